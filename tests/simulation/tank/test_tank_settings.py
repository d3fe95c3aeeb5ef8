"""What the tank's settings refuse, each with the field, what was found and what is allowed."""

import math

import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.operation.scenario import check_scenario
from wakewise.simulation.tank import TankSettings
from wakewise.simulation.tank.settings import JetSettings
from wakewise.simulation.water.currents import wave_number_per_m


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"waves": {"amplitude_m": 0.5, "period_s": 1.01}}, r"waves\.amplitude_m: 0\.5 m, .* breaks above 0\.113 m"),
        ({"sensors": {"pose_outages_s": [[5.0, 3.0]]}}, r"pose_outages_s: from 5 to 3 s"),
        ({"sensors": {"pose_outages_s": [[-5.0, 3.0]]}}, r"pose_outages_s: from -5 to 3 s"),
        (
            {"pump": {"speed_m_s": 1.0, "at_m": [0.0, 2.5, 0.8], "towards": [0.0, 1.0, 0.0]}},
            r"pump\.towards: .* wall at y = 2\.5 m",
        ),
        ({"tether": {"diameter_m": 0.01, "from_m": [50.0, 0.0, 0.0]}}, r"tether\.from_m: \(50, 0, 0\) m is outside"),
        ({"tether": {"diameter_m": 0.01, "from_m": [0.0, 0.0, 2.0]}}, r"tether\.from_m: .* below the floor"),
        ({"silt": {"grain_m": 0.0}}, r"grain_m: found 0\.0, should be greater than or equal to 0\.000001"),
        ({"silt": {"grain_m": -1e-5}}, r"grain_m: found -1e-05"),
        ({"sensors": {"pose_dropout": 1.5}}, r"pose_dropout: found 1\.5, should be less than or equal to 1"),
        ({"sensors": {"pose_dropout": -0.1}}, r"pose_dropout: found -0\.1"),
        ({"failures": [{"thruster": 0}]}, r"failures\.0\.thruster: found 0"),
        (
            {"current": {"velocity_m_s": [5.0, 0.0, 0.0]}},
            r"velocity_m_s\.0: found 5\.0, should be less than or equal to 3",
        ),
        (
            {"current": {"velocity_m_s": 0.1}},
            r"current\.velocity_m_s: found 0\.1, should be a list in sq",
        ),
        ({"current": {"file": ""}}, r"tank\.current\.file: found ''"),
    ],
)
def test_bad_fields_are_named(fields, words):
    """One line each."""
    with pytest.raises(InputError, match=words) as fault:
        check_scenario({"tank": fields}, "scenario")
    assert "\n" not in str(fault.value)


def test_waves_may_be_as_steep_as_they_stand():
    """Just below Miche's steepness H / L = 0.142 tanh(k h), in deep water as in shallow, a wave is accepted."""
    for period_s, depth_m in ((1.1, 1.5), (20.0, 0.4)):
        k = wave_number_per_m(period_s, depth_m)
        most_m = 0.071 * 2 * math.pi / k * math.tanh(k * depth_m)
        size = (6.0, 5.0, depth_m)
        kept = TankSettings(size_m=size, waves={"period_s": period_s, "amplitude_m": 0.999 * most_m})
        assert kept.waves.amplitude_m < most_m
        with pytest.raises(ValueError, match="breaks above"):
            TankSettings(size_m=size, waves={"period_s": period_s, "amplitude_m": 1.001 * most_m})


def test_jets_have_one_width():
    """A growth and swirl together are refused; what a resolved scenario writes, both at their defaults, is read."""
    with pytest.raises(ValidationError, match="give one of them"):
        JetSettings(half_width_growth=0.13, swirl=True)
    assert JetSettings(**JetSettings(swirl=True).model_dump()).swirl
    for bad in ({"half_width_growth": 0.08}, {"half_width_growth": 0.2}, {"wake_life": 0.9}, {"wake_life": 2.0}):
        with pytest.raises(ValidationError):
            JetSettings(**bad)

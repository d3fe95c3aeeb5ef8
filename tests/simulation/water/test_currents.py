"""The water's own motion: textbook waves, a jet by the jet's law, turbulence without divergence, sums."""

import math

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.tank import TankSettings, build_ambient
from wakewise.simulation.water import AiryWave, BackgroundTurbulence, PumpJet
from wakewise.simulation.water.currents import wave_number_per_m

STILL = {"current": {"velocity_m_s": (0.0, 0.0, 0.0)}}


def _built(**settings):
    return build_ambient(TankSettings(**STILL | settings), np.random.default_rng(0))


def _divergence(velocity, points, h=1e-4):
    total = np.zeros(len(points))
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = h
        total += (velocity(points + step) - velocity(points - step))[:, axis] / (2 * h)
    return total


@pytest.mark.parametrize(("period_s", "depth_m"), [(1.1, 1.5), (3.0, 1.5), (10.0, 1.5), (2.0, 20.0)])
def test_wave_numbers_solve_the_dispersion_relation(period_s, depth_m):
    """omega^2 = g k tanh(k h) to rounding, with deep and shallow water as its limits."""
    k, omega = wave_number_per_m(period_s, depth_m), 2 * math.pi / period_s
    assert 9.80665 * k * math.tanh(k * depth_m) == pytest.approx(omega**2, rel=1e-12)
    if depth_m == 20.0:
        assert k == pytest.approx(omega**2 / 9.80665, rel=1e-6)
    if period_s == 10.0:
        assert omega / k == pytest.approx(math.sqrt(9.80665 * depth_m), rel=0.03)


def test_a_wave_moves_the_surface_and_not_the_bed():
    """At z = 0 the water rises at a omega, nothing crosses the bed, and there the flow is a omega / sinh(k h)."""
    wave = AiryWave(amplitude_m=0.03, period_s=2.0, heading_rad=0.7, depth_m=1.5)
    omega, k = math.pi, wave.number_per_m
    times = np.linspace(0.0, 2.0, 201)
    top = np.array([wave.velocity(np.array([[0.3, 0.1, 0.0]]), t)[0] for t in times])
    bed = np.array([wave.velocity(np.array([[0.3, 0.1, 1.5]]), t)[0] for t in times])
    assert np.abs(top[:, 2]).max() == pytest.approx(0.03 * omega, rel=1e-3)
    assert np.abs(bed[:, 2]).max() < 1e-12
    assert np.linalg.norm(bed, axis=1).max() == pytest.approx(0.03 * omega / math.sinh(1.5 * k), rel=1e-3)
    assert top[:, 1] == pytest.approx(math.tan(0.7) * top[:, 0])


def test_waves_pump_and_turbulence_are_free_of_divergence():
    """At random points of the water each is so to 1e-4 of its own rate of shear."""
    rng = np.random.default_rng(3)
    points = rng.uniform([-2, -2, 0.1], [2, 2, 1.4], (200, 3))
    for settings in (
        {"waves": {"amplitude_m": 0.05}},
        {"current": {"velocity_m_s": (0.0, 0.0, 0.0), "turbulence_m_s": 0.05}},
        {"pump": {"speed_m_s": 1.0}},
    ):
        ambient = _built(**settings)
        # The pump is summed in single precision: wide steps keep its rounding out.
        error = _divergence(lambda x, a=ambient: a.velocity(x, 0.4), points, h=5e-3 if "pump" in settings else 1e-4)
        fastest = np.linalg.norm(ambient.velocity(points, 0.4), axis=1).max()
        assert np.abs(error).max() < (2e-2 if "pump" in settings else 1e-5) * fastest / 0.1


def test_a_pump_jet_follows_the_round_jet():
    """Exit speed in the core, 6.27 U0 D / x beyond it, half width 0.094 x, and it keeps its momentum."""
    jet = PumpJet(
        outlet_W_m=np.array([-2.9, 0.0, 20.0]),
        towards_W=np.array([2.0, 0.0, 0.0]),
        speed_m_s=1.0,
        diameter_m=0.05,
        bed_z_m=40.0,
        reach_m=8.0,
    )
    x = np.array([0.15, 0.5, 1.0, 2.0])
    axis = np.column_stack([x - 2.9, np.zeros(4), np.full(4, 20.0)])
    expected = np.minimum(1.0, 6.27 * 0.05 / x)
    assert jet.velocity(axis, 0.0)[:, 0] == pytest.approx(expected, rel=0.04)
    half = axis + np.column_stack([np.zeros(4), 0.094 * x, np.zeros(4)])
    assert jet.velocity(half, 0.0)[2:, 0] / jet.velocity(axis, 0.0)[2:, 0] == pytest.approx(np.full(2, 0.5), abs=0.05)
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 61), np.linspace(-0.5, 0.5, 61))
    plane = np.column_stack([np.full(y.size, -1.9), y.ravel(), 20.0 + z.ravel()])
    flux = float(np.sum(np.maximum(jet.velocity(plane, 0.0)[:, 0], 0.0) ** 2)) / 60**2
    assert flux == pytest.approx(math.pi / 4 * 0.05**2, rel=0.08)


def test_turbulence_has_the_rms_that_was_asked_for():
    """Over draws, 5 cm/s per axis; the same seed gives the same water, and time changes it."""
    points = np.random.default_rng(1).uniform(-3, 3, (300, 3))
    draws = [BackgroundTurbulence.drawn(0.05, 0.2, np.random.default_rng(k)) for k in range(20)]
    u = np.concatenate([draw.velocity(points, 0.0) for draw in draws])
    assert u.std(axis=0) == pytest.approx(np.full(3, 0.05), rel=0.1)
    again = BackgroundTurbulence.drawn(0.05, 0.2, np.random.default_rng(0))
    assert np.array_equal(again.velocity(points, 0.0), draws[0].velocity(points, 0.0))
    assert not np.allclose(again.velocity(points, 5.0), again.velocity(points, 0.0))


def test_motions_add_up():
    """A current and a wave together are the sum of both; none is still water."""
    points = np.array([[0.2, 0.1, 0.5]])
    both = _built(current={"velocity_m_s": (0.1, 0.0, 0.0)}, waves={"amplitude_m": 0.02})
    wave = _built(waves={"amplitude_m": 0.02})
    assert both.velocity(points, 1.0) == pytest.approx(wave.velocity(points, 1.0) + np.array([0.1, 0.0, 0.0]))
    assert not both.steady
    still = _built()
    assert still.velocity(points, 9.0).tolist() == [[0.0, 0.0, 0.0]]
    assert still.steady
    assert still.uniform
    assert still.end_s == math.inf


def test_a_series_takes_the_place_of_the_steady_current(tmp_path):
    """With a file the steady current of the settings is left out."""
    path = tmp_path / "c.csv"
    path.write_text("time_s,u,v\n0,0.1,0\n60,0.1,0\n")
    ambient = build_ambient(TankSettings(current={"file": str(path)}), np.random.default_rng(0))
    assert ambient.velocity(np.zeros((1, 3)), 3.0).tolist() == [[0.1, 0.0, 0.0]]
    assert ambient.end_s == 60.0


def test_a_pump_outside_the_water_is_refused():
    """Its outlet must be in the tank, and blow somewhere."""
    with pytest.raises(InputError, match=r"pump\.at_m"):
        _built(pump={"speed_m_s": 1.0, "at_m": (0.0, 0.0, 2.0)})
    with pytest.raises(InputError, match=r"pump\.towards"):
        _built(pump={"speed_m_s": 1.0, "towards": (0.0, 0.0, 0.0)})


def test_a_wide_pump_sends_the_papers_current_over_the_target():
    """0.5 m/s from an outlet of 0.3 m at 1.2 m depth is 0.3 m/s at a target 2.9 m away, and a jet."""
    jet = PumpJet(
        outlet_W_m=np.array([-2.9, 0.0, 1.2]), towards_W=np.array([1.0, 0.0, 0.0]), speed_m_s=0.5, diameter_m=0.3,
        bed_z_m=1.5, reach_m=8.0,
    )  # fmt: skip
    at_target = np.array([[0.0, y, z] for y in (-0.07, 0.0, 0.07) for z in (1.25, 1.35, 1.45)])
    assert jet.velocity(at_target, 0.0)[:, 0] == pytest.approx(np.full(9, 0.3), rel=0.15)
    beside = jet.velocity(np.array([[0.0, 1.5, 1.2], [0.0, 0.0, 0.3]]), 0.0)
    assert np.abs(beside[:, 0]).max() < 0.03

"""Momentum flux is thrust: for models that are built so, for their data, and never after a mix-up of units."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake.calibration import family, flux_over_thrust, momentum_law
from wakewise.wake.jets import GaussianJet, RoundJet
from wakewise.wake.samples import JetSamples

AREA = 0.25 * math.pi * 0.06**2


def _samples(jet, widest=0.5):
    rng = np.random.default_rng(0)
    distance, angle = rng.uniform(0.1, 0.6, 400), rng.uniform(0.0, widest, 400)
    x, r, thrust = distance * np.cos(angle), distance * np.sin(angle), np.repeat([1.0, 2.0, 4.0, 8.0], 100)
    return JetSamples(
        x_m=x,
        r_m=r,
        thrust_N=thrust,
        speed_m_s=jet.speed(x, r, thrust, AREA),
        across_m_s=np.zeros(400),
        disk_diameter_m=0.06,
    )


def test_the_round_jet_carries_its_thrust_through_every_plane():
    """From the disk to ten metres, by the integral."""
    along = np.array([0.01, 0.1, 0.3, 1.0, 10.0])
    for slope in (0.08, 0.13, 0.3):
        np.testing.assert_allclose(flux_over_thrust(RoundJet(half_width_slope=slope), along, AREA), 1.0, rtol=2e-3)


def test_the_integral_meets_the_closed_form():
    """Of a Gaussian jet, whose flux is known in closed form."""
    jet = GaussianJet(decay=5.0, virtual_origin_diameters=2.0, start_width_diameters=0.4, half_width_slope=0.11)
    along = np.array([0.06, 0.3, 1.2])
    np.testing.assert_allclose(flux_over_thrust(jet, along, AREA), jet.momentum_ratio(along / 0.06), rtol=1e-5)


@pytest.mark.parametrize("factor", [9.80665, 1.0 / 9.80665, 4.448, 1.0 / 4.448])
def test_thrusts_in_another_unit_are_refused(factor):
    """By the points alone: the model that was fitted to them does not matter."""
    jet = RoundJet.of_propeller()
    good = _samples(jet)
    assert momentum_law(good, jet).measured == pytest.approx(1.0, abs=0.1)
    with pytest.raises(InputError, match=r"units\? the points' momentum flux"):
        momentum_law(dataclasses.replace(good, thrust_N=good.thrust_N * factor), jet)


def test_points_on_the_axis_tell_no_flux():
    """Then only the model's is known, and the words say so."""
    jet = RoundJet.of_propeller()
    law = momentum_law(_samples(jet, widest=0.01), jet)
    assert law.measured is None
    assert "not told by points on the axis" in law.words
    assert "units?" not in law.words


def test_a_model_that_breaks_the_law_is_marked():
    """Though the points keep it."""
    law = momentum_law(_samples(RoundJet.of_propeller()), family("paper-calibrated").model(np.array([0.5])))
    assert law.fitted > 1.3
    assert "units?" in law.words

"""The readout: flown thrusts against direct ones, both by the controller's own wake model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wakewise.allocation import min_norm_allocation
from wakewise.operation import Parts, Scenario
from wakewise.simulation.tank.water_truth import STILL_M_S
from wakewise.ui.cockpit.state import StateEncoder, WakeReadout


@pytest.fixture(scope="module")
def parts() -> Parts:
    return Scenario.preset("quick", world="paper").replace(**{"target.points": 60}).parts()


@pytest.fixture(scope="module")
def readout(parts: Parts) -> WakeReadout:
    return WakeReadout.of(parts)


def test_direct_thrusts_save_nothing(parts: Parts, readout: WakeReadout) -> None:
    """Held against themselves the least thrusts of a wrench differ by nothing."""
    layout = readout.watch.layout
    thrusts = min_norm_allocation(layout, np.array([5.0, 2.0, -3.0, 0.0, 0.1, 0.2])).thrusts_N
    flown, direct = readout.disturbances(parts.start, thrusts)
    assert flown == pytest.approx(direct, rel=1e-6)


def test_thrusts_of_the_null_space_are_held_against_none(parts: Parts, readout: WakeReadout) -> None:
    """They make no wrench, so direct allocation would push nowhere."""
    idle = 3.0 * parts.vehicle.null_space[:, 0]
    flown, direct = readout.disturbances(parts.start, idle)
    assert direct == pytest.approx(0.0, abs=1e-12)
    assert flown > 0.0


def test_the_rms_speed_is_that_of_the_whole_region(parts: Parts, readout: WakeReadout) -> None:
    """D over the sum of the region's weights, under the root."""
    weight = float(np.sum(parts.region.weights))
    assert readout.rms_m_s(4e-6 * weight) == pytest.approx(2e-3, rel=1e-12)
    assert readout.rms_m_s(0.0) == 0.0
    assert np.isnan(readout.rms_m_s(float("nan")))


@pytest.mark.parametrize(("direct_m_s", "saved"), [(2e-3, 75.0), (0.9 * STILL_M_S, None), (0.0, None)])
def test_of_still_water_nothing_is_saved(readout: WakeReadout, direct_m_s: float, saved: float | None) -> None:
    """Where direct thrusts leave the water as good as still there is no share to tell, not one of 0 %."""
    no_recorder: Any = None
    encoder = StateEncoder(readout, no_recorder)
    direct = readout.view.total_weight * direct_m_s**2
    encoder._both.append((0.25 * direct, direct))
    assert encoder.saved_pct == (None if saved is None else pytest.approx(saved))


def test_predicted_speeds_grow_with_the_root_of_thrust(parts: Parts, readout: WakeReadout) -> None:
    """Nothing pushes, nothing moves; four times the thrust, twice the speed."""
    n = len(parts.vehicle.thrusters)
    assert not readout.predicted_m_s(parts.start, np.zeros(n)).any()
    one, four = (readout.predicted_m_s(parts.start, np.full(n, size)) for size in (1.0, 4.0))
    assert one.max() > 0.0
    np.testing.assert_allclose(four, 2.0 * one, rtol=1e-9)


def test_the_shown_places_lie_where_the_target_is_taken_to_be(parts: Parts, readout: WakeReadout) -> None:
    """As far from the true ones as the survey is wrong."""
    off_m = readout.points_W_m - readout.true_points_W_m
    np.testing.assert_allclose(off_m, off_m[0] * np.ones((len(off_m), 1)), atol=1e-12)
    np.testing.assert_allclose(off_m[0], parts.surveyed_target.centre_W_m - parts.target.centre_W_m, atol=1e-12)

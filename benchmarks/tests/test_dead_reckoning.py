"""Dead reckoning against closed forms and against a real vehicle's log."""

import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_rotvec
from wakewise_benchmarks.estimator import dead_reckoned, dead_reckoning_drifts, local_north_east_down

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data")) / "auv_dvl"


def test_a_steady_turn_is_a_circle():
    """Constant speed and yaw rate lead once round and back to the start, at the radius v / r."""
    time_s = np.linspace(0.0, 2 * np.pi / 0.1, 2001)
    q = quat_from_rotvec(np.column_stack([np.zeros((2001, 2)), 0.1 * time_s]))
    path = dead_reckoned(time_s, q, np.tile([1.0, 0.0, 0.0], (2001, 1)))
    np.testing.assert_allclose(path[-1], 0.0, atol=1e-3)
    assert path[:, 1].max() == pytest.approx(20.0, abs=1e-2)


def test_degrees_become_metres():
    """A minute of latitude is a nautical mile, within the half percent by which it changes over the ellipsoid."""
    minute = np.radians(1.0 / 60.0)
    place = local_north_east_down(np.array([0.8, 0.8 + minute]), np.array([0.1, 0.1]), np.array([-5.0, -7.0]))
    assert place[1, 0] == pytest.approx(1852.0, rel=5e-3)
    assert place[1, 1] == 0.0
    assert place[1, 2] == 2.0


def test_times_that_do_not_ascend_are_refused():
    """A repeated instant has no velocity."""
    with pytest.raises(InputError, match="ascend"):
        dead_reckoned(np.array([0.0, 0.0]), np.tile([1.0, 0, 0, 0], (2, 1)), np.zeros((2, 3)))


@pytest.mark.skipif(not DATA.is_dir(), reason="reference data not present")
def test_a_real_doppler_log_drifts_by_less_than_two_percent():
    """Seven runs of 400 s of an AUV at sea: the end is within 2 % of the distance run of where it was, median 1 %."""
    drifts = dead_reckoning_drifts(DATA.parent)
    assert len(drifts) >= 5
    assert max(drifts) < 2.0
    assert np.median(drifts) < 1.0

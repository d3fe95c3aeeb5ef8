"""Trajectories in TUM's format."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.exports import Trajectory, write_tum


def test_eight_numbers_a_line_with_w_last(track: Trajectory, tmp_path: Path) -> None:
    """NumPy reads back times, positions and quaternions (x, y, z, w) exactly."""
    write_tum(tmp_path / "true.txt", track, "true pose")
    rows = np.loadtxt(tmp_path / "true.txt")
    np.testing.assert_array_equal(rows[:, 0], track.times_s)
    np.testing.assert_array_equal(rows[:, 1:4], track.p_W_m)
    np.testing.assert_array_equal(rows[:, 4:], track.q[:, [1, 2, 3, 0]])


def test_a_pose_that_is_no_number_is_refused() -> None:
    """NaN never gets into a file: one line says so."""
    with pytest.raises(InputError, match="quaternion"):
        Trajectory(times_s=np.zeros(1), p_W_m=np.zeros((1, 3)), q=np.full((1, 4), np.nan))

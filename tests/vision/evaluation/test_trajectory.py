"""Laws of the trajectory error, and a real path judged as evo judges it."""

import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise_benchmarks.trajectory_error import paired_instants, read_tum, trajectory_error

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "trajectories"
PATH = np.random.default_rng(0).normal(size=(50, 3)).cumsum(axis=0)
R = matrix_from_quat(quat_from_rotvec(np.array([0.2, 0.4, -0.3])))


def test_alignment_forgives_exactly_what_it_may():
    """A rigid motion is free with rigid alignment, a scale only with a similarity, and none of it with none."""
    moved, grown = PATH @ R.T + [1, 2, 3], 2 * PATH @ R.T + [1, 2, 3]
    assert trajectory_error(moved, PATH).rmse_mm < 1e-6
    assert trajectory_error(grown, PATH, "similarity").rmse_mm < 1e-6
    assert trajectory_error(grown, PATH, "similarity").scale == pytest.approx(0.5)
    assert trajectory_error(grown, PATH).rmse_mm > 100
    assert trajectory_error(PATH + np.array([0.003, 0, 0.004]), PATH, "none").rmse_mm == pytest.approx(5.0)


def test_different_lengths_are_refused():
    """Instants must pair up."""
    with pytest.raises(InputError, match="shapes"):
        trajectory_error(PATH, PATH[1:])


@pytest.mark.skipif(not DATA.is_dir(), reason="reference data not present")
@pytest.mark.parametrize(
    ("align", "rmse_m", "median_m"),
    [
        ("rigid", 0.008118977562045396, 0.0074146298293173854),
        ("similarity", 0.006123163030157291, 0.005305225075852879),
    ],
)
def test_a_real_path_has_the_error_that_evo_finds(align, rmse_m, median_m):
    """ORB-SLAM on fr2/desk, 2174 pairs: figures printed by evo (github.com/MichaelGrupp/evo), equal to 1e-9."""
    truth_s, truth_m = read_tum(DATA / "fr2_desk_groundtruth.txt")
    found_s, found_m = read_tum(DATA / "fr2_desk_ORB.txt")
    mine, true = paired_instants(found_s, truth_s)
    error = trajectory_error(found_m[mine], truth_m[true], align)
    assert error.pairs == 2174
    assert error.rmse_mm / 1e3 == pytest.approx(rmse_m, abs=1e-9)
    assert error.median_mm / 1e3 == pytest.approx(median_m, abs=1e-9)


def test_a_broken_line_is_named(tmp_path):
    """A line with too few numbers is refused with its number."""
    path = tmp_path / "path.txt"
    path.write_text("# t x y z qx qy qz qw\n0 0 0 0 0 0 0 1\n1 0 0\n")
    with pytest.raises(InputError, match="line 3"):
        read_tum(path)

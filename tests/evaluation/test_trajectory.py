"""Laws of the trajectory error."""

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.evaluation import trajectory_error
from wakewise.geometry import matrix_from_quat, quat_from_rotvec

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

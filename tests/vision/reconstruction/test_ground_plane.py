"""The plane of a flat subject, and heights over it."""

import numpy as np
import pytest

from wakewise.core.errors import StageError
from wakewise.vision.reconstruction.quality.split_half_check import fit_ground_plane, heights


def test_the_plane_is_the_beds_and_up_is_towards_the_cameras():
    """A slanted bed with a coral on it: the coral does not tilt it; both ways are each other's inverse."""
    rng = np.random.default_rng(0)
    up = np.array([0.2, -0.3, 0.93])
    up /= np.linalg.norm(up)
    across = np.cross(up, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    flat = rng.uniform(-1.0, 1.0, (4000, 2)) * [1.5, 1.0]
    points = flat @ np.stack([across, np.cross(up, across)]) + rng.normal(0, 0.003, (4000, 1)) * up
    coral = rng.uniform(0.3, 0.5, (600, 3)) @ np.stack([across, np.cross(up, across), up])
    level = fit_ground_plane(np.concatenate([points, coral]), np.array([2.0 * up]))
    assert level.axes[2] @ up > np.cos(np.radians(0.3))
    assert np.abs(level.to_plane(points)[:, 2]).max() < 0.03
    assert level.to_plane(coral)[:, 2].min() > 0.25
    assert np.allclose(level.to_model(level.to_plane(coral)), coral)
    assert np.linalg.det(level.axes) == pytest.approx(1.0)
    assert fit_ground_plane(points, np.array([-2.0 * up])).axes[2] @ up < -0.99
    with pytest.raises(StageError, match="on a line"):
        fit_ground_plane(np.outer(np.arange(9.0), up), np.array([2.0 * up]))


def test_heights_are_means_of_cells():
    """Rows run along, columns across; a cell without points is unknown."""
    told = np.array([[0.1, 0.1, 1.0], [0.2, 0.3, 3.0], [2.5, 0.5, 7.0], [0.5, 1.5, -1.0]])
    grid, low = heights(told, 1.0)
    assert low.tolist() == [0.0, 0.0]
    assert grid.shape == (2, 3)
    assert grid[0].tolist() == pytest.approx([2.0, np.nan, 7.0], nan_ok=True)
    assert grid[1, 0] == -1.0

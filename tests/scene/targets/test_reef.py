"""A patch of reef from a height map."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.scene.targets import find_target, is_mesh_file, procedural_kinds
from wakewise.scene.targets.reef import CELL_M, REEF, SIDE_M, height_map_mesh, reef_patch


def test_a_patch_stands_on_the_bed_two_metres_wide() -> None:
    """It is found by its name, not as a file; it has relief, faces up, and goes below the bed at its edge."""
    assert REEF in procedural_kinds()
    assert not is_mesh_file(REEF)
    target = find_target(REEF, 2.2, seed=1)
    low, high = target.mesh.vertices_m.min(axis=0), target.mesh.vertices_m.max(axis=0)
    np.testing.assert_allclose(high[:2] - low[:2], SIDE_M)
    assert 0.2 < target.bed_z_m - low[2] < 0.6
    assert high[2] > target.bed_z_m
    assert (target.mesh.area_vectors_m2[:, 2] < 0.0).all()
    rim = np.abs(target.mesh.vertices_m[:, :2]).max(axis=1) > 0.5 * SIDE_M - 0.5 * CELL_M
    assert (target.mesh.vertices_m[rim, 2] > target.bed_z_m).all()


def test_a_seed_makes_one_patch() -> None:
    """The same seed gives the same patch, another one another."""
    one, again, other = reef_patch(1), reef_patch.__wrapped__(1), reef_patch(2)
    np.testing.assert_array_equal(one.vertices_m, again.vertices_m)
    assert np.abs(one.vertices_m - other.vertices_m).max() > 0.05


def test_a_height_map_keeps_its_heights_away_from_its_edge() -> None:
    """Vertices inside the edge are as high as the map says."""
    height = np.random.default_rng(0).uniform(0.1, 0.3, (60, 50))
    mesh = height_map_mesh(height, 0.01, 0.05)
    inside = mesh.vertices_m[:, 2].reshape(60, 50)[6:-6, 6:-6]
    np.testing.assert_allclose(inside, height[6:-6, 6:-6], atol=1e-12)


@pytest.mark.parametrize("height", [np.zeros(5), np.zeros((1, 5)), np.full((3, 3), np.nan)])
def test_what_is_no_height_map_is_refused(height: np.ndarray) -> None:
    """A line, a single row and numbers that are none make no surface."""
    with pytest.raises(InputError, match="height map: shape"):
        height_map_mesh(height, 0.01)

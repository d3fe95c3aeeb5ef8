"""Patches: a surface cut into pieces of about one size, with what counts of it and what hides."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from wakewise.core.errors import InputError
from wakewise.scene.missions import patches_of
from wakewise.scene.missions.visibility import CLEARANCE_M, REACH_M, SHIELD_CELLS
from wakewise.scene.targets import Mesh, coral, place_on_bed
from wakewise.vision.evaluation import Crop

CORAL = place_on_bed("branching", coral("branching"), 1.5)
PATCHES = patches_of(CORAL.mesh, CORAL.bed_z_m)


def test_patches_are_many_and_of_about_one_size() -> None:
    """A coral has some eight hundred patches; nine in ten have between a third and three times the mean area."""
    share = PATCHES.samples / PATCHES.samples.mean()
    assert 700 <= PATCHES.count <= 800
    assert ((share > 1 / 3) & (share < 3)).mean() > 0.9
    assert (PATCHES.samples > 0).all()


def test_a_patch_is_a_small_piece_that_faces_one_way() -> None:
    """Samples of a patch lie within a centimetre or so of its middle, and nearly all face the way that it does."""
    off = np.linalg.norm(PATCHES.points_W_m - PATCHES.mean(PATCHES.points_W_m)[PATCHES.patch], axis=1)
    mean = PATCHES.mean(PATCHES.normals)
    along = np.einsum("ij,ij->i", PATCHES.normals, mean[PATCHES.patch]) / np.linalg.norm(mean, axis=1)[PATCHES.patch]
    assert np.percentile(off, 95) < 0.012
    assert (along > 0.0).mean() > 0.97


def test_area_and_samples_are_the_meshs() -> None:
    """The area is that of the faces that count, and samples lie on them."""
    middles = CORAL.mesh.triangles_m.mean(axis=1)
    counts = middles[:, 2] < CORAL.bed_z_m - CLEARANCE_M
    assert PATCHES.area_m2 == pytest.approx(CORAL.mesh.face_areas_m2[counts].sum(), rel=1e-9)
    assert np.linalg.norm(PATCHES.normals, axis=1) == pytest.approx(1.0, abs=1e-9)
    assert (PATCHES.points_W_m[:, 2] < CORAL.bed_z_m - 0.5 * CLEARANCE_M).all()


def test_what_counts_is_what_evaluations_count() -> None:
    """The clearance above the bed and the reach of a model are those of the evaluation."""
    assert Crop().clearance_m == CLEARANCE_M
    one = patches_of(Mesh(np.array([[0, 0, 0], [0.001, 0, 0], [0, 0.001, 0]]), np.array([[0, 1, 2]])), None, 1, 2)
    assert one.spread(np.array([True, False])).all()
    assert REACH_M == 0.003


def test_spread_reaches_neighbours_and_no_farther() -> None:
    """What was found spreads to samples within 3 mm, and to all of them."""
    found = np.zeros(len(PATCHES.points_W_m), dtype=np.bool_)
    found[::97] = True
    away = np.asarray(KDTree(PATCHES.points_W_m[::97]).query(PATCHES.points_W_m)[0])
    assert (PATCHES.spread(found) == (away <= REACH_M)).all()


def test_the_shield_lies_by_the_surface() -> None:
    """The coarser surface that hides is off by no more than it says, which is about one of its cells."""
    cell = float(CORAL.mesh.extent_m.max()) / SHIELD_CELLS
    assert PATCHES.shield_off_m < 1.8 * cell
    assert len(PATCHES.shield_W_m) < 0.4 * len(CORAL.mesh.faces)
    some = PATCHES.shield_W_m[::500].reshape(-1, 3)
    away = np.asarray(KDTree(CORAL.mesh.vertices_m).query(some)[0])
    assert away.max() <= PATCHES.shield_off_m + 1e-9


def test_a_coarse_mesh_hides_as_it_is() -> None:
    """Of a mesh of few large faces every face is kept."""
    box = trimesh.creation.box(extents=(0.2, 0.1, 0.3))
    assert len(patches_of(Mesh(box.vertices, box.faces)).shield_W_m) == 12


def test_the_same_surface_gives_the_same_patches() -> None:
    """Nothing is left to chance."""
    again = patches_of(CORAL.mesh, CORAL.bed_z_m)
    assert (again.points_W_m == PATCHES.points_W_m).all()
    assert (again.patch == PATCHES.patch).all()


def test_nothing_to_photograph_is_refused() -> None:
    """A target that is all at the bed, and patches of no number, are refused in one line."""
    flat = Mesh(np.array([[0.0, 0, 1.5], [0.1, 0, 1.5], [0, 0.1, 1.5]]), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="nothing of the target is"):
        patches_of(flat, 1.5)
    with pytest.raises(InputError, match="0 patches of 10"):
        patches_of(flat, None, 0)

"""Thickness and curvature of shapes that have known ones; scores follow from them."""

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh, coral, find_fragility
from wakewise.scene.targets.fragility import SHARP_PER_M, THIN_M, curvature_per_m, thickness_m


def ball(radius_m, subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m)
    return Mesh(mesh.vertices, mesh.faces)


def spun(radius_of, length_m, around=48, along=60):
    """Surface of revolution about z, open at both ends, in triangles of even size."""
    z = np.linspace(0.0, length_m, along)
    turn = 2 * np.pi * np.arange(around) / around
    r = radius_of(z)
    vertices = np.stack(
        [np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn)), np.outer(z, np.ones(around))], axis=2
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, b, a + around], -1), np.stack([b, b + around, a + around], -1)])
    return Mesh(vertices, faces.reshape(-1, 3)), z.repeat(around)


@pytest.mark.parametrize("radius_m", [0.004, 0.02, 0.08])
def test_a_ball_is_as_thick_as_its_diameter_and_curved_as_one_over_its_radius(radius_m):
    """Everywhere alike; the twelve vertices with five neighbours, whose share of area is crude, within 15 %."""
    mesh = ball(radius_m)
    np.testing.assert_allclose(thickness_m(mesh), 2 * radius_m, rtol=0.02)
    curvature = np.sort(curvature_per_m(mesh) * radius_m)
    np.testing.assert_allclose(curvature[12:-12], 1.0, rtol=0.03)
    np.testing.assert_allclose(curvature, 1.0, rtol=0.15)


def test_a_rod_is_as_thick_as_its_diameter_and_half_as_curved_as_a_ball():
    """Away from its ends."""
    mesh, z = spun(lambda z: np.full_like(z, 0.005), 0.06)
    inner = (z > 0.015) & (z < 0.045)
    np.testing.assert_allclose(thickness_m(mesh)[inner], 0.01, rtol=0.02)
    np.testing.assert_allclose(curvature_per_m(mesh)[inner], 100.0, rtol=0.03)


def test_a_cone_gets_thinner_and_more_curved_towards_its_tip():
    """The ball that touches at radius r of a cone of half angle a is 2 r / cos(a) thick; curvature is cos(a) / 2 r."""
    slope = 0.2
    mesh, z = spun(lambda z: slope * (0.07 - z), 0.06, along=80)
    inner = (z > 0.02) & (z < 0.045)
    r, cosine = slope * (0.07 - z[inner]), 1 / np.sqrt(1 + slope**2)
    np.testing.assert_allclose(thickness_m(mesh)[inner], 2 * r / cosine, rtol=0.03)
    np.testing.assert_allclose(curvature_per_m(mesh)[inner], cosine / (2 * r), rtol=0.05)


def test_a_plate_is_as_thick_as_it_is_at_its_rim_too():
    """A box 60 x 60 x 6 mm: 6 mm on the faces, no more at the rim, and flat faces have no curvature."""
    mesh = trimesh.creation.box((0.06, 0.06, 0.006)).subdivide_to_size(0.0025)
    plate = Mesh(mesh.vertices, mesh.faces)
    thickness, curvature = thickness_m(plate), curvature_per_m(plate)
    middle = np.max(np.abs(plate.vertices_m[:, :2]), axis=1) < 0.02
    np.testing.assert_allclose(thickness[middle], 0.006, rtol=0.02)
    np.testing.assert_allclose(curvature[middle], 0.0, atol=2.0)
    assert thickness.max() < 0.0075


def test_scores_follow_thickness_and_curvature():
    """A thick ball is robust, a tiny one delicate, and the bounds of the module say where between."""
    assert np.all(find_fragility(ball(0.05)).score == 0.0)
    assert np.all(find_fragility(ball(0.001)).score == 1.0)
    found = find_fragility(ball(0.0055))
    thin = (THIN_M[1] - 0.011) / (THIN_M[1] - THIN_M[0])
    sharp = (1 / 0.0055 - SHARP_PER_M[0]) / (SHARP_PER_M[1] - SHARP_PER_M[0])
    np.testing.assert_allclose(found.score, 1 - (1 - thin) * (1 - sharp), atol=0.03)


def test_scores_do_not_depend_on_where_and_how_the_target_stands():
    """A turned and moved rod has the same scores."""
    mesh, _ = spun(lambda z: 0.003 + 0.1 * z, 0.05)
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.5, 0.8]))[:3, :3]
    moved = Mesh(mesh.vertices_m @ turn.T + [3.0, -2.0, 1.5], mesh.faces)
    np.testing.assert_allclose(find_fragility(moved).score, find_fragility(mesh).score, atol=0.02)


def test_marks_count_where_they_are_higher():
    """The higher of found and marked."""
    mesh = ball(0.05)
    marked = np.where(mesh.vertices_m[:, 2] > 0.03, 0.7, 0.0)
    np.testing.assert_array_equal(find_fragility(mesh, marked).score, marked)


def test_tips_of_a_branching_coral_are_more_delicate_than_its_trunk():
    """What stands out high and far is; the foot is not; all scores are finite and within 0 and 1."""
    mesh = coral("branching")
    found = find_fragility(mesh)
    z = mesh.vertices_m[:, 2]
    trunk = (z > 0.005) & (z < 0.03)
    assert np.median(found.score[trunk]) < 0.05
    assert np.median(found.score[z > np.quantile(z, 0.95)]) > 0.3
    assert 0.05 < found.share(mesh) < 0.6


@pytest.mark.parametrize("marked", [np.zeros(3), np.full(2562, 1.5), np.full(2562, np.nan), np.full(2562, -0.1)])
def test_marks_of_another_mesh_or_out_of_range_are_refused(marked):
    """One finite score from 0 to 1 per vertex."""
    with pytest.raises(InputError, match="from 0 to 1"):
        find_fragility(ball(0.05), marked)


def test_a_mesh_without_area_is_refused():
    """Every corner at one place."""
    with pytest.raises(InputError, match="zero area"):
        find_fragility(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])))

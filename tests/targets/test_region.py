"""The sample points of the region lie where water or surface is, evenly, with the paper's weights."""

import numpy as np
import pytest
import trimesh

from wakewise.errors import InputError
from wakewise.targets import Mesh, MeshDistance, coral, place_on_bed, sample_region
from wakewise.targets.region import DECAY_M, SHELL_M

BED_Z_M = 1.5


def ball(radius_m=0.07, height_m=0.1, subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m)
    return place_on_bed("ball", Mesh(mesh.vertices + np.array([0, 0, height_m]), mesh.faces), BED_Z_M)


@pytest.mark.parametrize("kind", ["branching", "brain", "plate"])
def test_half_of_the_points_lie_on_the_surface_and_half_in_the_water(kind):
    """Above the bed, outside the flesh, within the shell; weights are exp(-d / 5 cm), in (0, 1]."""
    target = place_on_bed(kind, coral(kind), BED_Z_M)
    region = sample_region(target, 151, np.random.default_rng(0))
    assert region.points_W_m.shape == (151, 3)
    assert np.all(region.points_W_m[:, 2] <= BED_Z_M)
    assert np.all((region.weights > 0) & (region.weights <= 1))
    np.testing.assert_array_equal(region.weights, np.exp(-region.distance_m / DECAY_M))
    assert np.all(region.distance_m[:75] == 0)
    assert np.all((region.distance_m[75:] > 0) & (region.distance_m[75:] < SHELL_M * 1.02))
    np.testing.assert_allclose(
        MeshDistance(target.mesh.vertices_m, target.mesh.faces)(region.points_W_m[:75]), 0.0, atol=1e-9
    )
    np.testing.assert_allclose(
        MeshDistance(target.mesh.vertices_m, target.mesh.faces)(region.points_W_m[75:]),
        region.distance_m[75:],
        atol=1e-12,
    )


def test_no_water_point_is_inside_the_flesh():
    """For a ball the water points are farther from its centre than its radius, all round."""
    region = sample_region(ball(), 400, np.random.default_rng(1))
    centre = np.array([0.0, 0.0, BED_Z_M - 0.1])
    out = region.points_W_m[200:] - centre
    assert np.linalg.norm(out, axis=1).min() > 0.0695
    assert np.linalg.norm(out.mean(axis=0)[:2]) < 0.01


def test_an_open_scan_is_not_filled_with_water():
    """A dome without a floor: the hollow under it is not taken for water."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.08)
    dome = Mesh(mesh.vertices, mesh.faces[mesh.triangles_center[:, 2] > 0])
    region = sample_region(place_on_bed("dome", dome, BED_Z_M), 200, np.random.default_rng(0))
    radius = np.linalg.norm(region.points_W_m[100:] - [0, 0, BED_Z_M], axis=1)
    # The lowest ring of faces is cut in steps, so a point just above the bed may have none over it.
    assert np.mean(radius > 0.079) >= 0.99


def test_the_points_integrate_smooth_functions():
    """Means over the points of each half meet the integrals over a ball's surface and shell.

    A cell's middle stands for the cell, so a mean of r^2 misses the spread within a cell, h^2 / 4 for cells of volume
    h^3, as every midpoint rule does; with that added the integral is met within 1 %.
    """
    radius, height = 0.07, 0.2
    region = sample_region(ball(radius, height), 300, np.random.default_rng(2))
    z = BED_Z_M - height - region.points_W_m[:, 2]
    assert np.mean((z[:150] / radius) ** 2) == pytest.approx(1 / 3, rel=0.02)
    assert abs(np.mean(z[:150])) < 0.02 * radius
    outer = radius + SHELL_M
    mean_r2 = 3 / 5 * (outer**5 - radius**5) / (outer**3 - radius**3)
    r2 = np.sum((region.points_W_m[150:] - [0, 0, BED_Z_M - height]) ** 2, axis=1)
    cell_m = (4 / 3 * np.pi * (outer**3 - radius**3) / 150) ** (1 / 3)
    assert np.mean(r2) + cell_m**2 / 4 == pytest.approx(mean_r2, rel=0.01)


def test_the_same_generator_gives_the_same_points():
    """The region is a function of target, number and generator."""
    target = ball(subdivisions=3)
    one, two, other = (sample_region(target, 60, np.random.default_rng(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.points_W_m, two.points_W_m)
    assert not np.array_equal(one.points_W_m, other.points_W_m)


@pytest.mark.parametrize("n", [0, 1, 20_000])
def test_a_silly_number_of_points_is_refused(n):
    """The message says what is allowed."""
    with pytest.raises(InputError, match="allowed 2 to 10000"):
        sample_region(ball(subdivisions=2), n, np.random.default_rng(0))

"""The sample points of the region lie where water or surface is, and stand for the paper's integral."""

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.scene.targets import Fragility, Mesh, MeshDistance, coral, place_on_bed, region_measure, sample_region
from wakewise.scene.targets.region import DECAY_M, SHELL_M, InsideTest

BED_Z_M = 1.5


def ball(radius_m=0.07, height_m=0.1, subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m)
    return place_on_bed("ball", Mesh(mesh.vertices + np.array([0, 0, height_m]), mesh.faces), BED_Z_M)


@pytest.fixture(scope="module", params=["branching", pytest.param("brain", marks=pytest.mark.slow), "plate"])
def sampled(request):
    """A coral, its region of 151 points and the measure it stands for."""
    target = place_on_bed(request.param, coral(request.param), BED_Z_M)
    region = sample_region(target, 151, np.random.default_rng(0))
    return target, region, region_measure(target, 10_000, 10_000, np.random.default_rng(1))


@pytest.mark.slow
def test_a_third_of_the_points_lies_on_the_surface_and_the_others_in_the_water(sampled):
    """Above the bed, outside the flesh, within the shell, at the distance that is stated."""
    target, region, _ = sampled
    assert region.points_W_m.shape == (151, 3)
    assert np.all(region.points_W_m[:, 2] <= BED_Z_M)
    assert np.all(region.weights > 0)
    assert np.all(region.distance_m[:50] == 0)
    assert np.all((region.distance_m[50:] > 0) & (region.distance_m[50:] <= SHELL_M))
    exact = MeshDistance(target.mesh.vertices_m, target.mesh.faces)(region.points_W_m)
    np.testing.assert_allclose(exact[:50], 0.0, atol=1e-9)
    np.testing.assert_allclose(exact[50:], region.distance_m[50:], atol=1e-12)
    assert not np.any(InsideTest(target.mesh).holds(region.points_W_m[50:]))


def test_total_weight_is_that_of_the_papers_points(sampled):
    """n/2 for the surface and n/2 times the mean of exp(-d / 5 cm) over the water, drawn here anew."""
    target, region, measure = sampled
    water = measure.points_W_m[measure.on_surface :]
    distance = MeshDistance(target.mesh.vertices_m, target.mesh.faces)(water)
    wanted = 151 / 2 * (1 + np.mean(np.exp(-distance / DECAY_M)))
    assert region.weights.sum() == pytest.approx(wanted, rel=0.005)


def test_linear_and_smooth_functions_are_summed_well(sampled):
    """Means of x, y, z to 0.5 mm; of a broad Gaussian anywhere to 1 % of its largest mean."""
    target, region, measure = sampled
    few, many = region.weights / region.weights.sum(), measure.weights / measure.weights.sum()
    np.testing.assert_allclose(few @ region.points_W_m, many @ measure.points_W_m, atol=5e-4)
    centres = target.centre_W_m + np.random.default_rng(3).uniform(-0.1, 0.1, (50, 3))

    def means(points, weights):
        return np.exp(-np.sum((points - centres[:, None]) ** 2, axis=2) / (2 * 0.06**2)) @ weights

    truth = means(measure.points_W_m, many)
    np.testing.assert_allclose(means(region.points_W_m, few), truth, atol=0.01 * truth.max())


def test_no_water_point_is_inside_the_flesh():
    """For a ball the water points are farther from its centre than its radius, all round."""
    region = sample_region(ball(), 400, np.random.default_rng(1))
    centre = np.array([0.0, 0.0, BED_Z_M - 0.1])
    out = region.points_W_m[133:] - centre
    assert np.linalg.norm(out, axis=1).min() > 0.0695
    assert np.linalg.norm(out.mean(axis=0)[:2]) < 0.01


def test_an_open_scan_is_not_filled_with_water():
    """A dome without a floor: the hollow under it is not taken for water."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.08)
    dome = Mesh(mesh.vertices, mesh.faces[mesh.triangles_center[:, 2] > 0])
    region = sample_region(place_on_bed("dome", dome, BED_Z_M), 200, np.random.default_rng(0))
    radius = np.linalg.norm(region.points_W_m[67:] - [0, 0, BED_Z_M], axis=1)
    # The lowest ring of faces is cut in steps, so a point just above the bed may have none over it.
    assert np.mean(radius > 0.079) >= 0.99


def test_the_points_integrate_the_paper_s_weights_over_a_ball():
    """Sums meet the integrals over a ball's surface and shell, which are known in closed form.

    With R the radius and c = 5 cm, the mean over the shell of exp(-(r - R) / c) r^(2 k) is an integral of one variable.
    """
    radius, height = 0.07, 0.2
    region = sample_region(ball(radius, height), 300, np.random.default_rng(2))
    centre = np.array([0, 0, BED_Z_M - height])
    r = np.linspace(radius, radius + SHELL_M, 4001)
    fade, share = np.exp(-(r - radius) / DECAY_M), r**2 / np.trapezoid(r**2, r)
    squared = np.sum((region.points_W_m - centre) ** 2, axis=1)
    for power in (0, 1):
        wanted = 150 * (radius ** (2 * power) + np.trapezoid(fade * share * r ** (2 * power), r))
        assert region.weights @ squared**power == pytest.approx(wanted, rel=0.01)
    assert np.linalg.norm(region.weights @ (region.points_W_m - centre)) < 0.002 * region.weights.sum()


def test_delicate_places_count_more():
    """With gain 3 the weight of a ball's marked upper half grows fourfold and that of the lower half stays."""
    target = ball(0.07, 0.2)
    up = BED_Z_M - 0.2 - target.mesh.vertices_m[:, 2]
    marked = Fragility(thickness_m=np.ones(len(up)), curvature_per_m=np.ones(len(up)), score=(up > 0).astype(float))
    plain, more = (sample_region(target, 150, np.random.default_rng(4), marked, gain) for gain in (0.0, 3.0))

    def halves(region):
        top = region.points_W_m[:, 2] < BED_Z_M - 0.2
        return region.weights[top].sum(), region.weights[~top].sum()

    assert halves(more)[0] == pytest.approx(4 * halves(plain)[0], rel=0.08)
    assert halves(more)[1] == pytest.approx(halves(plain)[1], rel=0.25)
    assert more.weights.sum() == pytest.approx(2.5 * plain.weights.sum(), rel=0.02)


def test_no_gain_is_the_papers_weights():
    """Delicate features that are given without a gain change nothing."""
    target = ball(subdivisions=3)
    n = len(target.mesh.vertices_m)
    marked = Fragility(thickness_m=np.ones(n), curvature_per_m=np.ones(n), score=np.ones(n))
    with_marks = sample_region(target, 40, np.random.default_rng(5), marked)
    np.testing.assert_array_equal(with_marks.weights, sample_region(target, 40, np.random.default_rng(5)).weights)


def test_a_gain_without_features_or_of_another_mesh_is_refused():
    """So is a gain out of range, NaN included."""
    target, rng = ball(subdivisions=2), np.random.default_rng(0)
    other = Fragility(thickness_m=np.ones(3), curvature_per_m=np.ones(3), score=np.ones(3))
    with pytest.raises(InputError, match="no delicate features"):
        sample_region(target, 30, rng, gain=1.0)
    with pytest.raises(InputError, match="one per vertex"):
        sample_region(target, 30, rng, other, 1.0)
    for gain in (-1.0, np.nan, 1e6):
        with pytest.raises(InputError, match="allowed 0 to 100"):
            sample_region(target, 30, rng, other, gain)


def test_a_target_with_no_surface_above_the_bed_is_refused():
    """Its faces are all under, though a vertex looks out."""
    mesh = Mesh(np.array([[0.0, 0, 0.001], [0.1, 0, -0.1], [0, 0.1, -0.1]]), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="no surface above the bed"):
        sample_region(place_on_bed("sunk", mesh, BED_Z_M), 30, np.random.default_rng(0))


def test_more_points_than_are_relaxed_are_sampled_too():
    """Clusters alone keep the total, and few points as well as two work."""
    target = ball(subdivisions=3)
    many, two = (sample_region(target, n, np.random.default_rng(0)) for n in (700, 2))
    assert many.weights.sum() / 700 == pytest.approx(two.weights.sum() / 2, rel=0.005)
    assert np.all(many.weights > 0)


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

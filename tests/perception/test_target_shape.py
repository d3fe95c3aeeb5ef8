"""Shape of a target seen from some sides: its centre, the side not seen, the region to protect, bodies on the bed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from perception_cases import LEVEL
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, IntArray
from wakewise.perception.bed_plane import BedPlane
from wakewise.perception.target_shape import (
    LEAST_POINTS,
    VOXEL_M,
    TargetShape,
    averaged,
    ball,
    bodies,
    completed,
    in_company,
    middle_depth,
    protected_region,
    seen_round_rad,
    shape_of,
    thinned,
    view_sectors,
)
from wakewise.scene.targets import Mesh, find_target, region_measure, sample_region
from wakewise.scene.targets.region import DECAY_M, SHELL_M

BED = LEVEL
RADIUS_M = 0.1
CENTRE = np.array([0.3, -0.2, 1.5 - RADIUS_M])


def directions(n: int, rng: np.random.Generator) -> Array:
    """Unit vectors all round."""
    way = rng.normal(size=(n, 3))
    return np.asarray(way / np.linalg.norm(way, axis=1, keepdims=True))


def above(points_W_m: Array) -> Array:
    """Points that are far enough above the bed to be mapped as standing on it."""
    return np.asarray(points_W_m[points_W_m[:, 2] < 1.48])


def sphere(n: int, rng: np.random.Generator) -> Array:
    """Surface of a sphere that stands on the bed."""
    return above(CENTRE + RADIUS_M * directions(n, rng))


def near_side(n: int, rng: np.random.Generator, azimuth_rad: float) -> Array:
    """The half of the sphere that is seen along a level direction."""
    points = sphere(2 * n, rng)
    return np.asarray(points[(points - CENTRE)[:, :2] @ [math.cos(azimuth_rad), math.sin(azimuth_rad)] < 0.0])


def bush(n: int, rng: np.random.Generator) -> Array:
    """Points all through a sphere on the bed."""
    return above(CENTRE + RADIUS_M * directions(n, rng) * np.cbrt(rng.random((n, 1))))


def cameras_at(azimuths_rad: Array, distance_m: float = 10.0) -> Array:
    """Cameras that look level at the sphere along azimuths."""
    along = np.column_stack([np.cos(azimuths_rad), np.sin(azimuths_rad), np.zeros(len(azimuths_rad))])
    return np.asarray(CENTRE - distance_m * along)


def off(found: TargetShape) -> float:
    """Distance of a centre from the true one, in radii."""
    return float(np.linalg.norm(found.centre_W_m - CENTRE)) / RADIUS_M


def turned(points_W_m: Array, quarters: int) -> Array:
    """Points turned about the upright axis through the sphere by quarters of a turn."""
    c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters]
    return np.asarray(CENTRE + (points_W_m - CENTRE) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))


@pytest.mark.parametrize("seed", range(4))
def test_half_a_sphere_has_its_centre_behind_what_is_seen(seed: int) -> None:
    """Seen along one direction, its centre is right to 15 % of the radius, its middle across the view to 3 %."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-3.0, 3.0)
    found = shape_of(near_side(600, rng, azimuth), BED, cameras_at(np.array([azimuth])))
    assert off(found) < 0.15
    across = np.array([-math.sin(azimuth), math.cos(azimuth)])
    assert abs((found.centre_W_m - CENTRE)[:2] @ across) < 0.03 * RADIUS_M


@pytest.mark.parametrize("seed", range(4))
def test_a_bush_has_its_centre_amid_its_points(seed: int) -> None:
    """Seen through along one direction, its centre is right to 15 % of the radius."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-3.0, 3.0)
    assert off(shape_of(bush(1500, rng), BED, cameras_at(np.array([azimuth])))) < 0.15


def test_two_directions_give_the_middle_in_plan() -> None:
    """Seen along two directions at right angles, the middle in plan is right to 5 % of the radius, and surer."""
    rng = np.random.default_rng(1)
    points = np.concatenate([near_side(500, rng, 0.4), near_side(500, rng, 0.4 + math.pi / 2.0)])
    two = shape_of(points, BED, cameras_at(np.array([0.4, 0.4 + math.pi / 2.0])))
    one = shape_of(near_side(500, rng, 0.4), BED, cameras_at(np.array([0.4])))
    assert np.linalg.norm((two.centre_W_m - CENTRE)[:2]) < 0.05 * RADIUS_M
    assert two.centre_std_m < 0.85 * one.centre_std_m


@pytest.mark.parametrize("seed", range(4))
def test_from_all_round_the_centre_is_that_of_the_box(seed: int) -> None:
    """Seen from all round, the centre is right to 3 % of the radius, and hardly a point is mirrored."""
    rng = np.random.default_rng(seed)
    points = sphere(1500, rng)
    found = shape_of(points, BED, cameras_at(np.linspace(-3.0, 3.0, 40), 0.8))
    assert off(found) < 0.03
    assert len(found.surface_W_m) <= 1.01 * found.seen
    assert 0.9 * RADIUS_M < found.radius_m < 1.5 * RADIUS_M


def test_what_was_guessed_from_one_side_tells_nothing_of_what_was_seen_all_round() -> None:
    """The first centre from all round is taken as it is, and further ones are averaged with it."""
    rng = np.random.default_rng(5)
    cameras = CENTRE + np.array([[math.cos(a), math.sin(a), -0.3] for a in np.linspace(0.0, 6.0, 40)])
    one_side = shape_of(near_side(300, rng, 0.0), BED, cameras[:1])
    whole = shape_of(sphere(1000, rng), BED, cameras)
    assert (one_side.all_round, whole.all_round) == (False, True)
    first = averaged(one_side, whole)
    assert np.array_equal(first.centre_W_m, whole.centre_W_m)
    moved = shape_of(sphere(1000, rng) + np.array([0.02, 0.0, 0.0]), BED, cameras)
    share = (averaged(first, moved).centre_W_m - first.centre_W_m)[0] / (moved.centre_W_m - first.centre_W_m)[0]
    assert 0.02 < share < 0.5


@pytest.mark.parametrize("apart_deg", [0.0, 20.0, 90.0, 180.0])
def test_how_far_round_a_place_was_seen_is_the_widest_angle_between_cameras(apart_deg: float) -> None:
    """Height and distance of the cameras do not count, nor those between."""
    ends = np.radians([-90.0, -90.0 + 0.4 * apart_deg, -90.0 + apart_deg])
    far = np.array([0.4, 1.3, 0.8])
    cameras = CENTRE + np.stack([far * np.cos(ends), far * np.sin(ends), -far], axis=1)
    assert seen_round_rad(cameras, CENTRE) == pytest.approx(math.radians(apart_deg), abs=1e-6)
    assert seen_round_rad(cameras[:1], CENTRE) == pytest.approx(0.0, abs=1e-6)


def test_the_uncertainty_is_along_the_view() -> None:
    """Along the one view the centre is less certain than across it; `centre_std_m` is the root of the trace."""
    rng = np.random.default_rng(2)
    found = shape_of(near_side(300, rng, 0.0), BED, cameras_at(np.array([0.0])))
    assert found.covariance[0, 0] > 2.0 * found.covariance[1, 1] > 0.0
    assert found.centre_std_m == pytest.approx(math.sqrt(np.trace(found.covariance)))
    np.testing.assert_allclose(found.covariance, found.covariance.T)
    looser = shape_of(near_side(300, np.random.default_rng(2), 0.0), BED, cameras_at(np.array([0.0])), 0.02)
    assert looser.centre_std_m > found.centre_std_m


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_the_shape_turns_with_the_scene(quarters: int) -> None:
    """Points and cameras turned by a quarter about the upright axis give the turned centre, equally certain."""
    points, cameras = near_side(300, np.random.default_rng(3), 0.5), cameras_at(np.array([0.4, 0.5, 0.9]), 0.8)
    one = shape_of(points, BED, cameras)
    other = shape_of(turned(points, quarters), BED, turned(cameras, quarters))
    np.testing.assert_allclose(other.centre_W_m, turned(one.centre_W_m, quarters), atol=1e-9)
    assert other.centre_std_m == pytest.approx(one.centre_std_m)


def test_stray_points_do_not_move_the_shape() -> None:
    """Single points far off move the centre by less than 3 % of the radius, and the radius by less than 5 %."""
    rng = np.random.default_rng(4)
    points, cameras = near_side(500, rng, 1.0), cameras_at(np.array([1.0]))
    stray = CENTRE + np.array([[0.4, 0.0, -0.1], [-0.3, 0.3, -0.2], [0.0, -0.5, 0.0], [0.1, 0.2, -0.5]])
    one, other = shape_of(points, BED, cameras), shape_of(np.concatenate([stray, points]), BED, cameras)
    assert np.linalg.norm(one.centre_W_m - other.centre_W_m) < 0.03 * RADIUS_M
    assert other.radius_m == pytest.approx(one.radius_m, rel=0.05)
    assert not in_company(np.concatenate([stray, points]))[:4].any()
    assert in_company(points).mean() > 0.98


def test_few_points_are_all_in_company() -> None:
    """Below twice the least number none is judged."""
    few = np.random.default_rng(5).uniform(size=(2 * LEAST_POINTS - 1, 3)) ** 8
    assert in_company(few).all()


def test_the_height_is_that_above_the_bed() -> None:
    """On a sloping bed the centre lies midway between the top and the bed straight below it."""
    slope = BedPlane(up_W=np.array([0.2, 0.0, -math.sqrt(0.96)]), at_W_m=np.array([0.3, -0.2, 1.5]))
    column = np.random.default_rng(6).uniform([0.27, -0.23, 1.3], [0.33, -0.17, 1.48], (400, 3))
    found = shape_of(column, slope, cameras_at(np.linspace(-3.0, 3.0, 40), 0.8))
    foot = slope.below(found.centre_W_m)[2]
    assert found.centre_W_m[2] == pytest.approx(0.5 * (1.3 + foot), abs=0.004)


@pytest.mark.parametrize(("depth_share", "true_m"), [(0.0, 0.9), (0.5, 0.9), (0.9, 0.9)])
def test_the_middle_s_depth_is_fitted_with_the_share(depth_share: float, true_m: float) -> None:
    """Depths that lie nearer than the middle by a share of the half chord give the middle to 2 % of the half width."""
    aside = np.linspace(-RADIUS_M, RADIUS_M, 400)
    depth = true_m - depth_share * np.sqrt(RADIUS_M**2 - aside**2)
    found, std = middle_depth(depth, aside, RADIUS_M)
    assert abs(found - true_m) < 0.02 * RADIUS_M
    assert 0.0 < std < 0.3 * RADIUS_M


def test_views_of_one_sector_count_once() -> None:
    """Cameras close together are one level unit direction, their mean; those farther apart are several."""
    close = view_sectors(cameras_at(np.array([0.50, 0.52, 0.54])), CENTRE)
    np.testing.assert_allclose(close, [[math.cos(0.52), math.sin(0.52)]], atol=1e-9)
    apart = view_sectors(cameras_at(np.array([-2.0, -2.0, 0.0, 1.0])), CENTRE)
    np.testing.assert_allclose(np.sort(np.arctan2(apart[:, 1], apart[:, 0])), [-2.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(apart, axis=1), 1.0)
    assert view_sectors(np.zeros((0, 3)), CENTRE).shape == (0, 2)


def test_only_the_side_that_was_not_seen_is_mirrored() -> None:
    """Half a sphere is completed through its upright axis; what was seen comes first and is not doubled."""
    points = near_side(3000, np.random.default_rng(7), 0.0)
    surface, seen = completed(points, CENTRE)
    np.testing.assert_array_equal(surface[:seen], points[thinned(points)])
    added = surface[seen:]
    assert 0.7 * seen < len(added) < seen
    np.testing.assert_allclose(np.linalg.norm(added - CENTRE, axis=1), RADIUS_M, atol=1e-9)
    assert (added[:, 0] > CENTRE[0]).all()
    assert np.asarray(KDTree(points).query(added)[0]).min() > 1.5 * VOXEL_M
    whole = sphere(6000, np.random.default_rng(8))
    assert len(completed(whole, CENTRE)[0]) == completed(whole, CENTRE)[1]


def test_thinned_points_are_one_in_each_voxel() -> None:
    """Each voxel that holds points keeps its first, in their order."""
    points = np.random.default_rng(9).uniform(-0.05, 0.05, (800, 3))
    kept = thinned(points, 0.02)
    cells = [tuple(cell) for cell in np.floor(points / 0.02).astype(int)]
    assert kept.tolist() == [i for i, cell in enumerate(cells) if cell not in cells[:i]]


@pytest.mark.parametrize("n", [20, 150, 300])
def test_the_region_is_water_near_the_surface_above_the_bed(n: int) -> None:
    """It has n points, a third of them on the surface and the others above the bed within `SHELL_M`, as stated."""
    surface = sphere(3000, np.random.default_rng(10))
    region = protected_region(surface, BED, n)
    few = round(n / 3)
    assert len(region.points_W_m) == n
    assert (region.weights > 0.0).all()
    assert (region.distance_m[:few] == 0.0).all() and (region.distance_m[few:] > 0.0).all()
    assert (BED.height_m(region.points_W_m) > 0.0).all()
    water = region.points_W_m[few:]
    distance = np.asarray(KDTree(surface).query(water)[0])
    np.testing.assert_allclose(region.distance_m[few:], np.maximum(distance, 1e-6))
    assert distance.max() < SHELL_M


def test_without_a_bed_the_water_is_all_round() -> None:
    """Where no bed is known, points lie below the target too."""
    region = protected_region(sphere(3000, np.random.default_rng(10)), None, 150)
    assert (BED.height_m(region.points_W_m) < -0.03).any()


def test_weights_add_up_as_in_the_quadrature() -> None:
    """n/2 on the surface, and n/2 times the mean of exp(-d / `DECAY_M`) in the water, drawn here anew, to 2 %."""
    rng, n = np.random.default_rng(11), 300
    surface = sphere(3000, rng)
    region = protected_region(surface, BED, n)
    assert region.weights[:100].sum() == pytest.approx(0.5 * n)
    water = rng.uniform(surface.min(axis=0) - SHELL_M, surface.max(axis=0) + SHELL_M, (20_000, 3))
    distance = np.asarray(KDTree(surface).query(water[BED.height_m(water) > 0.0])[0])
    mean = np.exp(-distance[distance < SHELL_M] / DECAY_M).mean()
    assert region.weights[100:].sum() == pytest.approx(0.5 * n * mean, rel=0.02)


def test_the_region_of_few_points_is_whole() -> None:
    """A surface of fewer points than a third of n gives n points nonetheless, with the same total on the surface."""
    surface = sphere(12, np.random.default_rng(12))
    region = protected_region(surface, BED, 60)
    assert len(region.points_W_m) == 60
    assert (region.distance_m == 0.0).sum() == len(surface)
    assert region.weights[: len(surface)].sum() == pytest.approx(30.0)


def surface_of(mesh: Mesh, n: int, rng: np.random.Generator) -> Array:
    """Points spread by area over what of a mesh stands above the bed."""
    face = rng.choice(len(mesh.faces), n, p=mesh.face_areas_m2 / mesh.face_areas_m2.sum())
    a, b, c = np.moveaxis(mesh.triangles_m[face], 1, 0)
    u, v = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
    points = (1.0 - u) * a + u * (1.0 - v) * b + u * v * c
    return np.asarray(points[points[:, 2] < 1.5])


@pytest.mark.parametrize("reference", ["measure", pytest.param("sample", marks=pytest.mark.slow)])
def test_the_disturbance_is_that_of_the_region_of_the_mesh(reference: str) -> None:
    """Of jets through random places D agrees with that of the mesh's own region to 15 % in the median.

    That region is `sample_region`, or `region_measure`, whose sum it stands for to 0.3 %.
    """
    rng, n = np.random.default_rng(13), 300
    target = find_target("branching", 1.5)
    surface = surface_of(target.mesh, 20_000, rng)
    ours = protected_region(surface[thinned(surface)], BED, n)
    if reference == "sample":
        sampled = sample_region(target, n, rng)
        places, weights = sampled.points_W_m, sampled.weights
    else:
        measure = region_measure(target, 2000, 4000, rng)
        places, weights = measure.points_W_m, n * measure.weights
    assert ours.weights.sum() == pytest.approx(weights.sum(), rel=0.02)
    ratio = np.empty(40)
    for k in range(40):
        at, way = target.centre_W_m + rng.uniform(-0.12, 0.12, 3), directions(1, rng)[0]
        D = []
        for points, share in ((ours.points_W_m, ours.weights), (places, weights)):
            aside2 = np.sum((points - at) ** 2, axis=1) - ((points - at) @ way) ** 2
            D.append(share @ np.exp(-aside2 / (2.0 * 0.04**2)) ** 2)
        ratio[k] = D[0] / D[1]
    assert np.median(np.abs(ratio - 1.0)) < 0.15
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    assert np.quantile(np.abs(ratio - 1.0), 0.9) < 0.25


def test_a_ball_stands_for_what_is_not_known() -> None:
    """Its points lie on the sphere, evenly all round, none of them seen; its uncertainty is per axis."""
    shape = ball(CENTRE, RADIUS_M, 0.05, points=300)
    way = (shape.surface_W_m - CENTRE) / RADIUS_M
    assert (shape.seen, shape.radius_m, len(way)) == (0, RADIUS_M, 300)
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1.0)
    np.testing.assert_allclose(way.mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(way.T @ way / 300, np.eye(3) / 3.0, atol=0.01)
    np.testing.assert_allclose(shape.covariance, 0.05**2 * np.eye(3))


def sure_bodies(points_W_m: Array) -> list[IntArray]:
    """Bodies of points whose places are known."""
    return bodies(points_W_m, BED, np.zeros(len(points_W_m)))


def test_bodies_on_the_bed_are_told_apart() -> None:
    """Two spheres apart are two bodies, the larger first; the bed, strays and what floats high are none."""
    rng = np.random.default_rng(14)
    small = sphere(300, rng) + np.array([0.5, 0.0, 0.0])
    large = sphere(500, rng)
    sand = rng.uniform([-0.5, -1.0, 1.49], [1.2, 0.6, 1.51], (600, 3))
    stray, high = np.array([[1.5, 1.5, 1.2]]), CENTRE - [0.0, 0.0, 3.0] + 0.01 * rng.normal(size=(50, 3))
    found = sure_bodies(np.concatenate([sand, small, stray, large, high]))
    assert len(found) == 2
    start = len(sand) + len(small) + 1
    np.testing.assert_array_equal(found[0], np.arange(start, start + len(large)))
    np.testing.assert_array_equal(found[1], np.arange(len(sand), len(sand) + len(small)))
    assert sure_bodies(sand) == []
    assert sure_bodies(large[: LEAST_POINTS - 1]) == []
    assert sure_bodies(np.zeros((0, 3))) == []


def test_points_too_far_apart_are_no_body() -> None:
    """Points of which no two are near each other make none, unless they are not known better than to a decimetre."""
    scattered = np.stack(np.meshgrid([0.0, 0.1, 0.2], [0.0, 0.1, 0.2], [1.2, 1.3, 1.4]), axis=-1).reshape(-1, 3)
    assert sure_bodies(scattered) == []
    unsure = np.full(len(scattered), 0.07)
    assert [len(body) for body in bodies(scattered, BED, unsure)] == [len(scattered)]
    unsure[1:] = 0.04  # half of both is less than the gap
    assert bodies(scattered, BED, unsure) == []

"""The plane of the bed: found under what stands on it and among clutter, never a wall; its geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_cases import LEVEL

from wakewise.core.arrays import Array
from wakewise.perception.bed_plane import (
    LEAST_POINTS,
    STEEPEST_RAD,
    WITHIN_M,
    BedPlane,
    fit_bed,
    near_bed,
)

places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)
slants = st.tuples(st.floats(0.0, 0.5), st.floats(-math.pi, math.pi))


def plane(slope_rad: float, azimuth_rad: float, at_W_m: Array) -> BedPlane:
    """A plane through a place, sloping down towards an azimuth."""
    level = math.sin(slope_rad) * np.array([math.cos(azimuth_rad), math.sin(azimuth_rad)])
    return BedPlane(up_W=np.append(level, -math.cos(slope_rad)), at_W_m=at_W_m)


def on_plane(bed: BedPlane, n: int, rng: np.random.Generator, noise_m: float = 0.003) -> Array:
    """Points of a plane, 1.6 m wide, with errors."""
    level = np.column_stack([bed.at_W_m[:2] + rng.uniform(-0.8, 0.8, (n, 2)), np.zeros(n)])
    return np.array([bed.below(point) for point in level]) + noise_m * rng.normal(size=(n, 3))


def angle_rad(one: BedPlane, other: BedPlane) -> float:
    """Angle between two planes."""
    return math.acos(min(1.0, float(one.up_W @ other.up_W)))


@given(slants, places, places)
@settings(max_examples=40, deadline=None)
def test_the_point_below_is_on_the_plane_straight_below(slant: tuple[float, float], at: Array, point: Array) -> None:
    """It has the same x and y and no height; the height of a place is its distance from the plane, above positive."""
    bed = plane(*slant, at)
    foot = bed.below(point)
    np.testing.assert_array_equal(foot[:2], point[:2])
    assert abs(bed.height_m(foot[None])[0]) < 1e-12
    lifted = np.stack([point + bed.up_W, point - 2.0 * bed.up_W, point - np.array([0.0, 0.0, 1.0])])
    rise = bed.height_m(lifted) - bed.height_m(point[None])
    np.testing.assert_allclose(rise, [1.0, -2.0, math.cos(slant[0])], atol=1e-12)


@given(slants, places, places, places)
@settings(max_examples=60, deadline=None)
def test_a_ray_hits_the_plane_before_it_or_not_at_all(
    slant: tuple[float, float], at: Array, start: Array, way: Array
) -> None:
    """A hit lies on the plane and ahead; there is none where the ray leads away, or starts from below."""
    length = float(np.linalg.norm(way))
    if length < 0.1:
        return
    bed, direction = plane(*slant, at), way / length
    hit = bed.hit(start, direction)
    height, towards = float(bed.height_m(start[None])[0]), float(-direction @ bed.up_W)
    if hit is not None:
        assert abs(bed.height_m(hit[None])[0]) < 1e-6
        ahead = hit - start
        assert ahead @ direction == pytest.approx(np.linalg.norm(ahead), abs=1e-9)
        assert height > 0.0 and towards > 0.0
    elif abs(height) > 1e-9:
        assert height < 0.0 or towards < 2e-6


def test_a_level_bed_lies_at_its_depth() -> None:
    """Heights are counted up from it, though z points down."""
    bed = LEVEL
    np.testing.assert_array_equal(bed.height_m(np.array([[3.0, 1.0, 1.2], [0.0, 0.0, 1.6]])), [1.5 - 1.2, 1.5 - 1.6])
    hit = bed.hit(np.array([0.0, 0.0, 0.5]), np.array([0.6, 0.0, 0.8]))
    assert hit is not None
    np.testing.assert_allclose(hit, [0.75, 0.0, 1.5])
    assert bed.hit(np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0])) is None


@pytest.mark.parametrize("seed", range(6))
def test_the_bed_is_found_under_boulders_and_clutter(seed: int) -> None:
    """With a quarter of the points on boulders and 30 % in the water the plane is right to 6 mm and 1 degree."""
    rng = np.random.default_rng(seed)
    bed = plane(rng.uniform(0.0, 0.35), rng.uniform(-3.0, 3.0), np.array([1.0, -2.0, 1.5]))
    sand = on_plane(bed, 135, rng)
    unit = rng.normal(size=(75, 3))
    unit *= -np.sign(unit @ bed.up_W)[:, None] / np.linalg.norm(unit, axis=1, keepdims=True)
    boulders = on_plane(bed, 3, rng).repeat(25, axis=0) - 0.12 * unit
    clutter = on_plane(bed, 90, rng) + rng.uniform(0.02, 0.8, (90, 1)) * bed.up_W
    found = fit_bed(np.concatenate([clutter, sand, boulders]), rng)
    assert found is not None
    assert angle_rad(found, bed) < math.radians(1.0)
    assert np.abs(found.height_m(sand)).mean() < 0.006
    assert found.up_W[2] < 0.0
    assert np.linalg.norm(found.up_W) == pytest.approx(1.0)


def test_exact_points_give_the_exact_plane() -> None:
    """Without errors the plane is that of the points to rounding."""
    rng = np.random.default_rng(7)
    bed = plane(0.3, 1.0, np.array([0.5, 0.5, 2.0]))
    points = on_plane(bed, 60, rng, noise_m=0.0)
    found = fit_bed(points, rng)
    assert found is not None
    np.testing.assert_allclose(found.up_W, bed.up_W, atol=1e-9)
    np.testing.assert_allclose(found.height_m(points), 0.0, atol=1e-12)


def test_a_few_points_below_do_not_matter() -> None:
    """With 5 % of the points in the ground, where mapping failed, the bed is found."""
    rng = np.random.default_rng(8)
    bed = LEVEL
    wrong = on_plane(bed, 10, rng) + rng.uniform(0.05, 0.5, (10, 1)) * [0.0, 0.0, 1.0]
    found = fit_bed(np.concatenate([on_plane(bed, 190, rng), wrong]), rng)
    assert found is not None
    assert angle_rad(found, bed) < math.radians(0.5)


@pytest.mark.parametrize("steeper_rad", [math.radians(3.0), math.radians(30.0), math.radians(60.0)])
def test_a_wall_is_no_bed(steeper_rad: float) -> None:
    """Points of one plane that is steeper than allowed give None."""
    rng = np.random.default_rng(9)
    slope = STEEPEST_RAD + steeper_rad
    wide = np.array([-math.sin(slope), 0.0, math.cos(slope)])
    across = rng.uniform(-0.8, 0.8, (200, 1)) * [0.0, 1.0, 0.0]
    along = np.array([-wide[2], 0.0, wide[0]])
    wall = [1.0, 0.0, 1.0] + across + rng.uniform(-0.8, 0.8, (200, 1)) * along + 0.001 * rng.normal(size=(200, 3))
    assert fit_bed(wall, rng) is None


def test_a_bed_is_found_beside_a_wall_of_more_points() -> None:
    """The wall has more points, and is passed over."""
    rng = np.random.default_rng(10)
    wall = rng.uniform([0.79, -0.8, 0.5], [0.81, 0.8, 1.5], (150, 3))
    found = fit_bed(np.concatenate([wall, on_plane(LEVEL, 100, rng)]), rng)
    assert found is not None
    assert angle_rad(found, LEVEL) < math.radians(1.0)


def test_too_few_points_are_no_bed() -> None:
    """Fewer than `LEAST_POINTS`, none, all at one place or all on one line give None."""
    rng = np.random.default_rng(11)
    points = on_plane(LEVEL, LEAST_POINTS, rng, noise_m=0.0)
    assert fit_bed(points, rng) is not None
    assert fit_bed(points[1:], rng) is None
    assert fit_bed(points[:0], rng) is None
    assert fit_bed(np.ones((50, 3)), rng) is None
    assert fit_bed(np.linspace(0.0, 1.0, 50)[:, None] * [0.5, 0.25, 0.125], rng) is None


def test_points_all_over_the_water_are_no_bed() -> None:
    """Where no plane holds many of the points, there is none."""
    rng = np.random.default_rng(12)
    assert fit_bed(rng.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 1.5], (300, 3)), rng) is None


@pytest.mark.parametrize("seed", range(4))
def test_the_lowest_of_two_planes_is_the_bed(seed: int) -> None:
    """A ledge 10 cm higher with as many points is not taken for the bed."""
    rng = np.random.default_rng(seed)
    low, high = LEVEL, BedPlane(up_W=LEVEL.up_W, at_W_m=np.array([0.0, 0.0, 1.4]))
    found = fit_bed(np.concatenate([on_plane(high, 120, rng), on_plane(low, 120, rng)]), rng)
    assert found is not None
    assert abs(found.at_W_m[2] - 1.5) < 0.5 * WITHIN_M


def test_the_fit_is_a_function_of_points_and_seed() -> None:
    """Equal seeds give equal planes."""
    points = on_plane(LEVEL, 80, np.random.default_rng(13))
    one, other = (fit_bed(points, np.random.default_rng(5)) for _ in range(2))
    assert one is not None and other is not None
    np.testing.assert_array_equal(one.up_W, other.up_W)
    np.testing.assert_array_equal(one.at_W_m, other.at_W_m)


def test_the_bed_under_a_place_is_that_of_the_points_about_it() -> None:
    """A plane is moved to the points within reach, by less than its own thickness; few points leave it as it is."""
    rng, bed = np.random.default_rng(5), LEVEL
    near = np.column_stack([rng.uniform(-0.3, 0.3, (60, 2)), np.full(60, 1.506)])
    far = np.column_stack([rng.uniform(1.0, 2.0, (60, 2)), np.full(60, 1.494)])
    moved = near_bed(bed, np.concatenate([near, far]), np.zeros(3), 0.35)
    assert moved.at_W_m[2] == pytest.approx(1.506, abs=1e-9)
    assert near_bed(bed, near[:5], np.zeros(3), 0.35) is bed
    high = near + np.array([0.0, 0.0, -0.1])
    assert near_bed(bed, high, np.zeros(3), 0.35) is bed

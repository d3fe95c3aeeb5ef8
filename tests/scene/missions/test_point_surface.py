"""A surface known by points: its normals, its patches beside those of a mesh, and what hides what."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions import Coverage, SurfacePatches, VisibilityCriteria, patches_of
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.point_surface import LEAST_POINTS, MAPPED_CRITERIA, normals_of, patches_of_points
from wakewise.scene.missions.visibility import CLEARANCE_M, well_visible
from wakewise.scene.targets import Mesh
from wakewise.vision.imaging import PinholeCamera

CAMERA = PinholeCamera(1280, 960, math.radians(80.0))
CENTRE = np.array([0.0, 0.0, 1.0])
RADIUS, SPACING = 0.1, 0.005


def ball_directions() -> Array:
    """Directions spread evenly (a Fibonacci spiral), as many as a ball has points at the spacing; shape (n, 3)."""
    n = round(4.0 * math.pi * RADIUS**2 / SPACING**2)
    k = np.arange(n) + 0.5
    down, turn = np.arccos(1.0 - 2.0 * k / n), math.pi * (1.0 + math.sqrt(5.0)) * k
    return np.stack([np.cos(turn) * np.sin(down), np.sin(turn) * np.sin(down), np.cos(down)], axis=1)


OUT = ball_directions()
POINTS = CENTRE + RADIUS * OUT
BALL = patches_of_points(POINTS, OUT, SPACING)


def plate(x_m: float, half_m: float = 0.1) -> Array:
    """Points of an upright square plate at this place north of the centre, shape (n, 3)."""
    steps = np.arange(-half_m, half_m + 0.5 * SPACING, SPACING)
    east, down = (grid.ravel() for grid in np.meshgrid(steps, steps))
    return np.asarray(CENTRE + np.stack([np.full(len(east), x_m), east, down], axis=1))


def at(azimuth_deg: float, elevation_deg: float = 20.0, range_m: float = 0.5) -> Pose:
    return camera_pose(CENTRE, math.radians(azimuth_deg), math.radians(elevation_deg), range_m)


def shown(patches: SurfacePatches, X_WC: Pose) -> BoolArray:
    return well_visible(patches, X_WC, CAMERA, MAPPED_CRITERIA)


def degrees_apart(one: Array, other: Array) -> Array:
    """Angles between unit vectors, shape (n,)."""
    return np.asarray(np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", one, other), -1.0, 1.0))))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_normals_of_a_ball_point_outward(seed: int) -> None:
    """Points that are off by half a millimetre, seen from anywhere outside, give the radius to seven degrees."""
    rng = np.random.default_rng(seed)
    towards = OUT + rng.normal(0.0, 0.3, OUT.shape)
    towards[np.einsum("ni,ni->n", towards, OUT) < 0.3] = OUT[np.einsum("ni,ni->n", towards, OUT) < 0.3]
    normals = normals_of(POINTS + rng.normal(0.0, 0.0005, POINTS.shape), towards)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-9)
    off = degrees_apart(normals, OUT)
    assert off.max() < 7.0
    assert np.median(off) < 2.0


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_normals_do_not_depend_on_order_or_place(seed: int) -> None:
    """Points in another order, turned and moved, have the same normals in that order, turned."""
    rng = np.random.default_rng(seed)
    points = POINTS + rng.normal(0.0, 0.0005, POINTS.shape)
    order, R = rng.permutation(len(points)), Rotation.random(random_state=rng).as_matrix()
    again = normals_of(points[order] @ R.T + rng.normal(0.0, 2.0, 3), OUT[order] @ R.T)
    assert degrees_apart(again, normals_of(points, OUT)[order] @ R.T).max() < 0.1


def test_normals_turn_with_where_they_were_seen_from() -> None:
    """A surface that was seen from inside has the opposite normals."""
    assert np.allclose(normals_of(POINTS, -OUT), -normals_of(POINTS, OUT))


def test_few_points_have_normals_too() -> None:
    """Of fewer points than a neighbourhood has all are taken: four in a plane have its normal."""
    square = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.01, 0.01, 0.0]])
    assert np.allclose(normals_of(square, np.tile([0.3, 0.3, -1.0], (4, 1))), [0.0, 0.0, -1.0])


def test_area_is_that_of_the_ball() -> None:
    """Points at the spacing stand for the area of the ball, and each belongs to a patch of about ten."""
    assert BALL.area_m2 == pytest.approx(4.0 * math.pi * RADIUS**2, rel=0.003)
    assert BALL.count == pytest.approx(len(POINTS) / 10, rel=0.05)
    assert (BALL.points_W_m == POINTS).all()
    assert np.linalg.norm(BALL.mean(BALL.points_W_m) - CENTRE, axis=1).min() > 0.97 * RADIUS


@pytest.mark.parametrize(
    "taken_from",
    [
        [(azimuth, 20.0) for azimuth in (0.0, 10.0, 20.0)],
        [(azimuth, 20.0) for azimuth in range(0, 75, 15)],
        [(azimuth, 40.0) for azimuth in range(0, 360, 15)],
        [(azimuth, elevation) for elevation in (-30.0, 70.0) for azimuth in range(0, 360, 30)],
    ],
)
@pytest.mark.parametrize("need", [VisibilityCriteria(), MAPPED_CRITERIA])
def test_points_of_a_ball_are_covered_as_its_mesh_is(
    taken_from: list[tuple[float, float]], need: VisibilityCriteria
) -> None:
    """The same photographs cover the same share of the points and of the mesh, to two percent of the ball."""
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    mesh = patches_of(Mesh(sphere.vertices + CENTRE, sphere.faces))
    shares = []
    for patches in (BALL, mesh):
        coverage = Coverage.begin(patches, need=need)
        for azimuth, elevation in taken_from:
            coverage = coverage.seen(at(azimuth, elevation), CAMERA)
        shares.append((coverage.share, float((coverage.level > 0).mean())))
    assert shares[0][0] > 0.15
    assert shares[0] == pytest.approx(shares[1], abs=0.02)


@given(st.floats(0.0, 360.0), st.floats(-80.0, 80.0), st.floats(0.25, 1.5))
@settings(max_examples=20, deadline=None)
def test_the_far_side_of_a_ball_is_hidden(azimuth: float, elevation: float, range_m: float) -> None:
    """Of a ball no point beyond its horizon is shown, and every point that faces the camera is."""
    X_WC = at(azimuth, elevation, range_m)
    facing = OUT @ ((X_WC.p_m - CENTRE) / range_m)
    seen = shown(BALL, X_WC)
    assert not seen[facing < RADIUS / range_m].any()
    assert seen[facing > RADIUS / range_m + 0.35].all()


@pytest.mark.parametrize("thick_m", [0.004, 0.02, 0.03])
@pytest.mark.parametrize("azimuth", [0.0, 40.0, 180.0, 215.0])
def test_the_far_side_of_a_thin_plate_is_hidden(thick_m: float, azimuth: float) -> None:
    """From either side of a plate its near side is shown and its far side is not, but for its rim."""
    north, south = plate(0.5 * thick_m), plate(-0.5 * thick_m)
    towards = np.repeat([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], len(north), axis=0)
    seen = shown(patches_of_points(np.concatenate([north, south]), towards, SPACING), at(azimuth))
    near, far = np.split(seen, 2) if math.cos(math.radians(azimuth)) > 0.0 else np.split(seen, 2)[::-1]
    assert near.mean() > 0.98
    assert far.mean() < 0.01


@pytest.mark.parametrize("gap_m", [0.03, 0.1])
def test_what_stands_in_front_hides(gap_m: float) -> None:
    """A plate that faces the camera is hidden by another before it, and shown where that is not or is gone."""
    behind, before = plate(-0.5 * gap_m), plate(0.5 * gap_m, half_m=0.05)
    points = np.concatenate([behind, before])
    patches = patches_of_points(points, np.tile([1.0, 0.0, 0.0], (len(points), 1)), SPACING)
    seen = shown(patches, at(0.0, 0.0))
    aside = np.abs(behind[:, 1:] - CENTRE[1:]).max(axis=1)
    assert seen[len(behind) :].all()
    assert seen[: len(behind)][aside < 0.04].mean() < 0.01
    assert seen[: len(behind)][aside > 0.075].all()
    alone = patches_of_points(behind, np.tile([1.0, 0.0, 0.0], (len(behind), 1)), SPACING)
    assert shown(alone, at(0.0, 0.0)).all()


def test_what_is_at_the_bed_does_not_count_but_hides() -> None:
    """Points less than a centimetre above the bed are no samples; they and the others are what hides."""
    bed_z_m = float(CENTRE[2])
    upper = patches_of_points(POINTS, OUT, SPACING, bed_z_m)
    counts = POINTS[:, 2] < bed_z_m - CLEARANCE_M
    assert (upper.points_W_m == POINTS[counts]).all()
    assert upper.area_m2 == pytest.approx(BALL.area_m2 * counts.mean(), rel=0.02)
    assert (upper.shield_W_m == BALL.shield_W_m).all()
    assert (upper.normals == BALL.normals[counts]).all()


def test_each_point_hides_the_square_it_stands_for() -> None:
    """The triangle about a point has it in its middle, lies square to its normal, and holds a circle about it."""
    corners = BALL.shield_W_m
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.allclose(corners.mean(axis=1), POINTS)
    inner = np.linalg.norm(corners.mean(axis=1) - 0.5 * (corners[:, 0] + corners[:, 1]), axis=1)
    assert inner == pytest.approx(SPACING / math.sqrt(2.0))
    along = np.einsum("ni,ni->n", cross, BALL.normals) / np.linalg.norm(cross, axis=1)
    assert np.abs(along) == pytest.approx(1.0)


def test_too_few_points_are_refused() -> None:
    """One line says how many points count and how many are needed; that many are enough."""
    some = slice(0, LEAST_POINTS - 1)
    with pytest.raises(InputError, match=rf"\b{LEAST_POINTS - 1} points .* at least {LEAST_POINTS}\b"):
        patches_of_points(POINTS[some], OUT[some], SPACING)
    with pytest.raises(InputError, match=rf"\b0 points .* at least {LEAST_POINTS}\b"):
        patches_of_points(POINTS, OUT, SPACING, bed_z_m=float(CENTRE[2]) - 2.0 * RADIUS)
    with pytest.raises(InputError, match=rf"\b0 points .* at least {LEAST_POINTS}\b"):
        patches_of_points(np.empty((0, 3)), np.empty((0, 3)), SPACING)
    enough = patches_of_points(POINTS[:LEAST_POINTS], OUT[:LEAST_POINTS], SPACING)
    assert len(enough.points_W_m) == LEAST_POINTS


def test_the_same_points_give_the_same_patches() -> None:
    """Nothing is left to chance."""
    again = patches_of_points(POINTS, OUT, SPACING)
    assert (again.patch == BALL.patch).all()
    assert (again.normals == BALL.normals).all()

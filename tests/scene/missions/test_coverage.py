"""Coverage: laws of what photographs have seen, on a ball, and where to go next."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions import (
    CameraAim,
    CandidateViews,
    Coverage,
    SurfacePatches,
    TankBounds,
    VisibilityCriteria,
    patches_of,
    reachable_views,
)
from wakewise.scene.missions.coverage import WELL
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.visibility import BEST, view_quality
from wakewise.scene.targets import Mesh
from wakewise.vision.imaging import PinholeCamera

CAMERA = PinholeCamera(1280, 960, math.radians(80.0))
CENTRE = np.array([0.0, 0.0, 1.0])
RADIUS = 0.1
BOUNDS = TankBounds(low_W_m=np.array([-3.0, -2.5, 0.0]), high_W_m=np.array([3.0, 2.5, 2.5]))
SIZE = np.array([0.3, 0.3, 0.3])


def ball(centre: np.ndarray = CENTRE, radius: float = RADIUS) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Mesh(sphere.vertices + centre, sphere.faces)


PATCHES = patches_of(ball(), count=200, per_patch=5)


@pytest.fixture(scope="module")
def views() -> CandidateViews:
    return reachable_views(
        PATCHES,
        CAMERA,
        centre_W_m=CENTRE,
        ranges_m=(0.5,),
        aim=CameraAim(X_BC=camera_pose(np.zeros(3), math.pi, 0.0, 0.2)),
        size_m=SIZE,
        bounds=BOUNDS,
        target_W_m=ball().vertices_m,
        clearance_m=0.05,
    )


def at(azimuth_deg: float, elevation_deg: float = 20.0, range_m: float = 0.5) -> Pose:
    return camera_pose(CENTRE, math.radians(azimuth_deg), math.radians(elevation_deg), range_m)


def taken(*poses: Pose, patches: SurfacePatches = PATCHES) -> Coverage:
    coverage = Coverage.begin(patches)
    for X_WC in poses:
        coverage = coverage.seen(X_WC, CAMERA)
    return coverage


poses = st.builds(at, st.floats(0.0, 360.0), st.floats(-80.0, 80.0), st.floats(0.15, 3.0))


@given(st.lists(poses, min_size=1, max_size=6))
@settings(max_examples=20, deadline=None)
def test_a_photograph_more_never_covers_less(taken_from: list[Pose]) -> None:
    """Neither share nor the score of any patch falls with another photograph, wherever it is taken from."""
    coverage = Coverage.begin(PATCHES)
    for X_WC in taken_from:
        after = coverage.seen(X_WC, CAMERA)
        assert after.share >= coverage.share
        assert after.share >= after.sure >= coverage.sure
        assert (after.score >= coverage.score).all()
        assert (coverage.well <= after.well).all()
        coverage = after
    assert 0.0 <= coverage.share <= 1.0
    assert coverage.photos == len(taken_from)


@given(st.permutations([at(0), at(10), at(20), at(30, 40), at(200), at(210)]))
@settings(max_examples=20, deadline=None)
def test_the_order_of_photographs_does_not_matter(taken_from: list[Pose]) -> None:
    """The same photographs in another order cover the same."""
    assert (taken(*taken_from).level == taken(*sorted(taken_from, key=lambda X: tuple(X.p_m))).level).all()


def test_what_faces_away_is_never_seen() -> None:
    """However many photographs are taken from the north, nothing that faces south is shown by any."""
    coverage = taken(*(at(azimuth, elevation) for azimuth in (-20, -10, 0, 10, 20) for elevation in (10, 25)))
    assert not coverage.level[PATCHES.normals[:, 0] < -0.2].any()
    assert (coverage.level[PATCHES.normals[:, 0] > 0.9] == WELL).all()


def test_three_photographs_with_a_base_are_needed() -> None:
    """One photograph, two, or three from one place cover nothing; three ten degrees apart cover what faces them."""
    assert taken(at(0)).share == 0.0
    assert taken(at(0), at(10)).share == 0.0
    assert taken(at(0), at(0), at(0)).share == 0.0
    assert taken(at(0), at(60), at(120)).share == 0.0
    assert taken(at(0), at(10), at(20)).share > 0.15


def test_levels_are_those_of_a_slow_twin() -> None:
    """A photograph pairs with another at 3 to 35 deg where both show a place well enough for that angle."""
    shots = [at(azimuth, elevation) for azimuth, elevation in ((0, 20), (14, 20), (31, 35), (45, 20), (60, 50))]
    need, points = VisibilityCriteria(), PATCHES.points_W_m
    quality = np.array([view_quality(PATCHES, X_WC, CAMERA, need) for X_WC in shots]) / BEST
    rays = np.array([X_WC.p_m - points for X_WC in shots])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    cosines = np.einsum("kni,lni->kln", rays, rays)
    low, high = np.cos(need.apart_rad)
    pairs = (cosines <= low) & (cosines >= high) & (quality[:, None] > 0.0) & (quality[None] > 0.0)
    pairs &= np.minimum(quality[:, None], quality[None]) >= need.support * (1.0 - cosines)
    most = pairs.sum(axis=1).max(axis=0)
    slow = np.where((quality > 0.0).any(axis=0), np.minimum(most, 2) + 1, 0)
    assert np.array_equal(taken(*shots).level, slow)
    assert {0, 1, 2, WELL} <= set(slow.tolist())
    strict = pairs.sum() / ((cosines <= low) & (cosines >= high) & (quality[:, None] * quality[None] > 0.0)).sum()
    assert 0.3 < strict < 0.95


def test_coverage_knows_no_place_and_no_direction() -> None:
    """Target and cameras moved and turned about the vertical together leave every level as it was."""
    shift, turn = np.array([1.0, -2.0, 0.5]), math.radians(70.0)
    R = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    moved = SurfacePatches(
        points_W_m=PATCHES.points_W_m @ R.T + shift,
        normals=PATCHES.normals @ R.T,
        patch=PATCHES.patch,
        area_m2=PATCHES.area_m2,
        shield_W_m=PATCHES.shield_W_m @ R.T + shift,
        shield_off_m=PATCHES.shield_off_m,
    )
    places = [(0, 20, 0.5), (12, 20, 0.5), (24, 30, 0.5), (40, 10, 0.6)]
    here = taken(*(at(*place) for place in places))
    centre = R @ CENTRE + shift
    there = taken(
        *(camera_pose(centre, math.radians(a) + turn, math.radians(e), r) for a, e, r in places), patches=moved
    )
    assert (here.level != there.level).mean() < 0.002


def test_a_blurred_photograph_covers_nothing_but_is_counted() -> None:
    """A photograph far less sharp than the sharpest before it leaves all as it was and is told of."""
    sharp = taken(at(0)).seen(at(10), CAMERA, 40.0)
    blurred = sharp.seen(at(20), CAMERA, 10.0)
    assert blurred.share == 0.0
    assert (blurred.photos, blurred.blurred) == (3, 1)
    assert sharp.seen(at(20), CAMERA, 30.0).share > 0.15


@pytest.mark.parametrize("sharpness", [-1.0, math.nan, math.inf])
def test_a_sharpness_that_is_none_is_refused(sharpness: float) -> None:
    """Negative and unreal numbers are no sharpness."""
    with pytest.raises(InputError, match="sharpness"):
        Coverage.begin(PATCHES).seen(at(0), CAMERA, sharpness)


def test_photographs_from_too_far_cover_nothing() -> None:
    """Where a pixel is larger than what the model needs, nothing is seen well: 764 px of focus, 2 mm, 1.5 m."""
    assert taken(at(0, 20, 1.4), at(10, 20, 1.4), at(20, 20, 1.4)).share > 0.1
    assert taken(at(0, 20, 1.8), at(10, 20, 1.8), at(20, 20, 1.8)).share == 0.0


def test_without_views_there_is_nowhere_to_go() -> None:
    """A coverage that knows no views counts, and says nothing of where to go."""
    assert taken(at(0)).next_view(at(0)) is None


def test_going_where_it_says_covers_the_ball(views: CandidateViews) -> None:
    """Each view that is named adds to the score, and following them until none is left covers what can be reached."""
    coverage, X_WC = Coverage.begin(PATCHES, views), at(0)
    for _ in range(120):
        view = coverage.next_view(X_WC)
        if view is None:
            break
        after = coverage.seen(view, CAMERA)
        assert after.score.mean() > coverage.score.mean()
        coverage, X_WC = after, view
    assert view is None
    assert "nothing within reach" in coverage.words(X_WC)
    everywhere = Coverage.begin(PATCHES)
    for k in range(len(views.places)):
        everywhere = everywhere.seen(views.pose(k), CAMERA)
    assert coverage.share > 0.97 * everywhere.share
    assert coverage.photos < 0.75 * everywhere.photos


def test_gains_are_what_a_photograph_brings(views: CandidateViews) -> None:
    """What a view is said to add to the levels is what a photograph from it adds, to a few percent of samples."""
    coverage = Coverage.begin(PATCHES, views)
    for number in (5, 6, 30, 50, 51, 52):
        coverage = coverage.seen(views.pose(number), CAMERA)
    for number in (7, 31, 53, 60):
        after = coverage.seen(views.pose(number), CAMERA)
        brought = (after.level / WELL - coverage.level / WELL).mean()
        assert coverage.gains[number] == pytest.approx(brought, abs=0.01)

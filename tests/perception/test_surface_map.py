"""The surface gathered from sweeps: cells that two sweeps saw, their means, what denies them, and the next sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_cases import LEVEL, looking, pixels_of

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.perception import surface_map
from wakewise.perception.bundle_adjustment import Keyframe
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.feature_tracks import Grey
from wakewise.perception.plane_sweep import PlaneSweep, SweptDepth, compared, swept_depth
from wakewise.perception.surface_map import (
    ABOVE_BED_M,
    BEHIND,
    CELL_M,
    LEAST_DEPTH_M,
    LEAST_RADIUS_M,
    VIEW_PX,
    SurfaceMap,
    empty_surface,
    sweep_in_view,
    sweep_target,
    turned_about,
    view_camera,
    with_sweep,
)

CAMERA = CalibratedCamera(width=240, height=180, fx=200.0, fy=200.0, cx=120.0, cy=90.0)
AHEAD = looking(np.zeros(3), np.array([1.0, 0.0, 0.0]))
MIDDLE = (120, 90)
NEAR_M, FAR_M = 0.6025, 0.8025
CENTRE = np.array([0.7, 0.0, 0.0])
places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)


def seen(
    depth_m: float | Sequence[Sequence[float]],
    std_m: float = 0.001,
    X_WC: Pose = AHEAD,
    corner: tuple[int, int] = MIDDLE,
) -> SweptDepth:
    """Depths of a few pixels, of one on the optical axis if nothing else is said."""
    depth = np.atleast_2d(np.array(depth_m))
    (left, top), (high, wide) = corner, depth.shape
    return SweptDepth(
        X_WC=X_WC,
        window=(left, top, left + wide, top + high),
        depth_m=depth,
        std_m=np.where(np.isfinite(depth), std_m, np.nan),
    )


def surface_of(*sweeps: SweptDepth, start: SurfaceMap | None = None) -> SurfaceMap:
    """The surface after some sweeps."""
    surface = empty_surface() if start is None else start
    for swept in sweeps:
        surface = with_sweep(surface, swept, CAMERA)
    return surface


def wall(seed: int, depth_m: float = 0.6, side: int = 24, apart_m: float = 0.001) -> SweptDepth:
    """A wall seen with errors by a camera somewhere before it, and not everywhere."""
    rng = np.random.default_rng(seed)
    eye = np.append(rng.uniform(-0.002, 0.002), rng.uniform(-0.02, 0.02, 2))
    depth = depth_m + rng.uniform(-apart_m, apart_m, (side, side))
    depth[rng.random(depth.shape) < 0.3] = np.nan
    return seen(depth.tolist(), rng.uniform(0.001, 0.004), looking(eye, eye + np.array([1.0, 0.0, 0.0])), (100, 80))


def keyframe(angle_deg: float, grey: int | None = 0, away_m: float = 0.7, at_W_m: Array = CENTRE) -> Keyframe:
    """A keyframe on a level circle about the centre, with a picture of one grey, that looks at a place."""
    angle = math.radians(angle_deg)
    eye = CENTRE - away_m * np.array([math.cos(angle), math.sin(angle), 0.0])
    X_WC = looking(eye, at_W_m)
    picture = None if grey is None else np.full((180, 240), grey, np.uint8)
    return Keyframe(
        time_s=0.0,
        X_WC=X_WC,
        prior=X_WC,
        std=(0.001, 0.001),
        ids=np.zeros(0, np.int64),
        pixels=np.zeros((0, 2)),
        picture=picture,
    )


def greys_of(sweep: PlaneSweep) -> list[int]:
    """Which pictures a sweep compares: their greys, the reference first."""
    return [round(float(view.levels[90, 120])) for view in (sweep.reference, *sweep.others)]


ARC = [keyframe(angle, grey) for angle, grey in ((15.0, 15), (10.0, 10), (5.0, 5), (0.0, 200))]


def test_nothing_was_seen_at_first() -> None:
    """The empty surface has no cells, and a sweep without a depth adds none."""
    assert len(empty_surface()) == 0
    assert len(empty_surface().confirmed) == 0
    assert len(surface_of(seen(math.nan))) == 0
    assert len(empty_surface().chosen(np.zeros(0, np.bool_))) == 0


def test_a_cell_is_confirmed_by_its_second_sweep() -> None:
    """One sweep is not enough, however many of its points are in the cell."""
    many = seen([[NEAR_M, NEAR_M], [NEAR_M, NEAR_M]])
    once = surface_of(many)
    assert once.views.tolist() == [1] * len(once)
    assert len(once.confirmed) == 0
    twice = surface_of(many, many)
    assert len(twice) == len(once)
    assert twice.confirmed.tolist() == list(range(len(once)))


def test_sweeps_that_see_different_places_confirm_nothing() -> None:
    """Cells side by side are two cells."""
    surface = surface_of(seen(NEAR_M), seen(NEAR_M, corner=(124, 90)))
    assert surface.views.tolist() == [1, 1]
    assert len(surface.confirmed) == 0


def test_a_cell_has_the_weighted_mean_of_its_points() -> None:
    """Weights are one over the variances and add up; the best standard deviation is kept."""
    surface = surface_of(seen(0.601, 0.001), seen(0.604, 0.002))
    assert len(surface) == 1
    np.testing.assert_allclose(surface.points_W_m, [[(4.0 * 0.601 + 0.604) / 5.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(surface.weight, 1.25e6)
    np.testing.assert_allclose(surface.std_m, 0.001)


def test_points_of_one_sweep_count_once() -> None:
    """Their errors are shared: a cell's weight is that of one of them, and its direction has length 1 at most."""
    eye = AHEAD.p_m
    surface = surface_of(seen([[0.601, 0.603]], 0.002))
    assert len(surface) == 1
    np.testing.assert_allclose(surface.weight, 2.5e5)
    x = [0.601, 0.603]
    np.testing.assert_allclose(surface.points_W_m, [[0.602, x[1] / 400.0, 0.0]], atol=1e-12)
    to_eye = eye - surface.points_W_m[0]
    np.testing.assert_allclose(surface.towards_W[0], to_eye / np.linalg.norm(to_eye), atol=1e-4)


def test_directions_to_the_cameras_add_up() -> None:
    """Two cameras on either side give the sum of two unit directions."""
    place = np.array([NEAR_M, 0.0, 0.0])
    eyes = [np.array([0.1, 0.2, 0.0]), np.array([0.1, -0.2, 0.1])]
    away = [float(np.linalg.norm(place - eye)) for eye in eyes]
    surface = surface_of(*(seen(far, X_WC=looking(eye, place)) for eye, far in zip(eyes, away, strict=True)))
    wanted = sum((eye - place) / far for eye, far in zip(eyes, away, strict=True))
    around = surface.towards_W.sum(axis=0)
    np.testing.assert_allclose(around, wanted, atol=1e-9)


def test_a_cell_before_what_is_seen_is_denied_and_dropped() -> None:
    """Once denied it is no longer confirmed; denied more often than seen it is gone. What lies behind stays."""
    surface = surface_of(seen(NEAR_M), seen(NEAR_M))
    assert len(surface.confirmed) == 1
    surface = surface_of(seen(FAR_M), start=surface)
    assert surface.denials.tolist() == [1, 0]
    assert len(surface.confirmed) == 0
    surface = surface_of(seen(FAR_M), seen(FAR_M), start=surface)
    np.testing.assert_allclose(surface.points_W_m, [[FAR_M, 0.0, 0.0]], atol=1e-12)
    assert surface.views.tolist() == [3]
    assert surface.confirmed.tolist() == [0]


@pytest.mark.parametrize("views", [1, 2])
def test_a_cell_denied_as_often_as_it_was_seen_is_dropped(views: int) -> None:
    """As the module says."""
    surface = surface_of(*[seen(NEAR_M)] * views, *[seen(FAR_M)] * views)
    np.testing.assert_allclose(surface.points_W_m, [[FAR_M, 0.0, 0.0]], atol=1e-12)


def test_a_cell_seen_often_outlasts_a_denial() -> None:
    """Three sweeps against one leave it confirmed."""
    surface = surface_of(*[seen(NEAR_M)] * 3, seen(FAR_M))
    assert surface.views[surface.confirmed].tolist() == [3]


def test_only_what_is_clearly_seen_through_is_denied() -> None:
    """By more than `BEHIND` standard deviations and a cell; not by what is nearer, unknown or beside the window."""
    start = surface_of(seen(NEAR_M), seen(NEAR_M))
    slack = BEHIND * 0.01 + CELL_M

    def denials(swept: SweptDepth) -> int:
        return int(surface_of(swept, start=start).denials.sum())

    assert denials(seen(NEAR_M + slack + 0.001, 0.01)) == 1
    assert denials(seen(NEAR_M + slack - 0.001, 0.01)) == 0
    assert denials(seen(0.4, 0.01)) == 0
    assert denials(seen(math.nan)) == 0
    assert denials(seen(FAR_M, corner=(121, 90))) == 0
    assert denials(seen(FAR_M, corner=(120, 91))) == 0
    beyond = looking(np.array([1.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
    assert denials(seen(FAR_M, X_WC=beyond)) == 0


def test_points_of_the_bed_are_left_out() -> None:
    """Those less than `ABOVE_BED_M` above it or below it are no surface; without a bed they are."""
    down = looking(np.array([0.0, 0.001, 0.8]), np.array([0.0, 0.0, 1.5]))
    bed = LEVEL
    above, on, under = (0.7 - up for up in (3.0 * ABOVE_BED_M, 0.5 * ABOVE_BED_M, -ABOVE_BED_M))
    swept = seen([[above, math.nan, math.nan, on, math.nan, math.nan, under]], X_WC=down)
    assert len(with_sweep(empty_surface(), swept, CAMERA)) == 3
    surface = with_sweep(empty_surface(), swept, CAMERA, bed)
    assert len(surface) == 1
    assert bed.height_m(surface.points_W_m)[0] == pytest.approx(3.0 * ABOVE_BED_M, abs=1e-4)


def test_the_bed_denies_what_was_seen_before_it() -> None:
    """Though its own points are left out."""
    down = looking(np.array([0.0, 0.001, 0.8]), np.array([0.0, 0.0, 1.5]))
    surface = surface_of(*[seen(0.5, X_WC=down)] * 2)
    after = with_sweep(surface, seen(0.7, X_WC=down), CAMERA, LEVEL)
    assert after.denials.tolist() == [1]


@given(st.permutations(range(5)), st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_the_order_of_sweeps_that_agree_does_not_matter(order: list[int], seed: int) -> None:
    """Sweeps of one wall give the same cells in every order."""
    sweeps = [wall(10 * seed + k) for k in range(5)]
    one, other = surface_of(*sweeps), surface_of(*(sweeps[k] for k in order))
    assert len(one) > 20
    np.testing.assert_array_equal(one.views, other.views)
    np.testing.assert_array_equal(one.denials, 0)
    for name in ("points_W_m", "weight", "towards_W", "std_m"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-12)


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_cells_stay_apart(seed: int) -> None:
    """No two rows are of one cell, each row's mean lies in its cell, and no view is lost."""
    surface = surface_of(*(wall(10 * seed + k, apart_m=0.03) for k in range(4)))
    cells = np.floor(surface.points_W_m / CELL_M)
    assert len(np.unique(cells, axis=0)) == len(surface)
    assert (surface.views >= 1).all() and (surface.views <= 4).all()
    assert (np.linalg.norm(surface.towards_W, axis=1) <= surface.views + 1e-9).all()
    assert (surface.weight * surface.std_m**2 <= surface.views + 1e-9).all()
    assert (surface.denials <= surface.views).all()


def test_some_of_the_cells_can_be_chosen() -> None:
    """By rows or by a mask; every field follows."""
    surface = surface_of(wall(1), wall(2))
    rows = surface.confirmed
    mask = np.zeros(len(surface), np.bool_)
    mask[rows] = True
    by_rows, by_mask = surface.chosen(rows), surface.chosen(mask)
    assert 0 < len(rows) < len(surface)
    for name in SurfaceMap.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(by_rows, name), getattr(surface, name)[rows])
        np.testing.assert_array_equal(getattr(by_mask, name), getattr(by_rows, name))
    assert by_rows.confirmed.tolist() == list(range(len(rows)))


def test_a_sweep_leaves_the_surface_before_it_as_it_was() -> None:
    """Surfaces are records."""
    surface = surface_of(wall(1))
    before = {name: getattr(surface, name).copy() for name in SurfaceMap.__dataclass_fields__}
    surface_of(wall(2), wall(3, depth_m=0.9), start=surface)
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(surface, name), values)


def test_old_cells_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many sweeps see ever new places, there are no more than the bound and those of the last sweep."""
    monkeypatch.setattr(surface_map, "MOST_CELLS", 50)
    surface = empty_surface()
    for k in range(8):
        swept = wall(k, depth_m=0.5 + 0.03 * k)
        surface = surface_of(swept, start=surface)
        assert len(surface) <= 50 + len(surface_of(swept))


def test_there_are_never_more_cells_than_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not after a sweep of many new places either."""
    monkeypatch.setattr(surface_map, "MOST_CELLS", 50)
    assert len(surface_of(wall(1), wall(2, depth_m=0.65))) <= 50


def test_the_bound_does_not_drop_confirmed_cells_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are too many, those that one sweep saw go first."""
    beside = seen(np.full((8, 60), FAR_M).tolist(), corner=(160, 20))
    surface = surface_of(wall(1), wall(1), beside)
    confirmed = len(surface.confirmed)
    assert 20 < confirmed < len(surface) - 20
    monkeypatch.setattr(surface_map, "MOST_CELLS", confirmed)
    assert len(surface_of(seen(math.nan), start=surface).confirmed) == confirmed


@given(places, places, st.floats(0.2, 3.0), st.floats(0.2, 3.0), st.floats(0.001, 3.14))
@settings(max_examples=60, deadline=None)
def test_places_turned_about_a_centre_have_that_angle(
    centre: Array, axis: Array, one_m: float, other_m: float, angle_rad: float
) -> None:
    """It does not depend on their distances nor on which comes first."""
    if np.linalg.norm(axis[:2]) < 0.1:
        return
    a = np.array([axis[1], -axis[0], 0.0]) / np.linalg.norm(axis[:2])
    b = np.array([0.0, 0.0, 1.0])
    one = centre + one_m * a
    other = centre + other_m * (math.cos(angle_rad) * a + math.sin(angle_rad) * b)
    assert turned_about(centre, one, other) == pytest.approx(angle_rad, abs=1e-5)
    assert turned_about(centre, other, one) == pytest.approx(angle_rad, abs=1e-5)
    assert turned_about(centre, one, one) == pytest.approx(0.0, abs=1e-6)


def test_a_place_at_the_centre_has_some_angle() -> None:
    """It is a finite number."""
    assert math.isfinite(turned_about(CENTRE, CENTRE, np.zeros(3)))
    assert math.isfinite(turned_about(CENTRE, CENTRE, CENTRE))


def test_a_sweep_takes_pictures_five_ten_and_fifteen_degrees_off() -> None:
    """The last keyframe is its reference, nothing is compared yet, and pictures at other angles are not taken."""
    crowd = [keyframe(40.0, 40), keyframe(1.0, 1), keyframe(7.5, 7), keyframe(12.5, 12), keyframe(20.0, 20)]
    sweep = sweep_target([*crowd, *ARC], CENTRE, 0.1, CAMERA)
    assert sweep is not None
    assert not sweep.done and not sweep.scores
    assert greys_of(sweep) == [200, 5, 10, 15]
    np.testing.assert_array_equal(sweep.reference.X_WC.p_m, ARC[-1].X_WC.p_m)


def test_of_pictures_at_an_angle_the_latest_is_taken() -> None:
    """On either side."""
    sweep = sweep_target([*ARC[:3], keyframe(-5.0, 50), keyframe(10.5, 105), ARC[3]], CENTRE, 0.1, CAMERA)
    assert sweep is not None
    assert greys_of(sweep) == [200, 50, 105, 15]


def test_two_other_pictures_suffice_and_one_does_not() -> None:
    """Keyframes at one angle count once."""
    assert sweep_target(ARC[1:], CENTRE, 0.1, CAMERA) is not None
    assert sweep_target(ARC[2:], CENTRE, 0.1, CAMERA) is None
    assert sweep_target([keyframe(5.0), keyframe(5.5), keyframe(-5.0), ARC[3]], CENTRE, 0.1, CAMERA) is None
    assert sweep_target(ARC[3:], CENTRE, 0.1, CAMERA) is None


def test_keyframes_without_pictures_are_not_compared() -> None:
    """With two others left there is a sweep, with one there is none."""
    blind = {angle: keyframe(angle, None) for angle in (5.0, 10.0, 15.0)}
    sweep = sweep_target([ARC[0], blind[10.0], ARC[2], ARC[3]], CENTRE, 0.1, CAMERA)
    assert sweep is not None
    assert greys_of(sweep) == [200, 5, 15]
    assert sweep_target([blind[15.0], blind[10.0], ARC[2], ARC[3]], CENTRE, 0.1, CAMERA) is None


def test_a_sweep_straightens_what_a_rolling_shutter_sheared() -> None:
    """By each keyframe's own speed: its rows move against what they were late by."""
    slow = replace(CAMERA, readout_s=0.1)
    ramp = np.tile(np.arange(240, dtype=np.uint8), (180, 1))
    frames = [replace(frame, picture=ramp, speed_px_s=np.array([40.0 * k, 0.0])) for k, frame in enumerate(ARC)]
    sweep = sweep_target(frames, CENTRE, 0.1, slow)
    assert sweep is not None
    for view, speed in zip((sweep.reference, *sweep.others), (120.0, 80.0, 40.0, 0.0), strict=True):
        top, bottom = view.levels[[10, 169], 120]
        assert bottom - top == pytest.approx(speed * 0.1 * 159.0 / 180.0, abs=1.1)


def test_a_target_behind_the_camera_has_no_sweep() -> None:
    """Nor has one at it."""
    back = keyframe(0.0, 200, at_W_m=np.array([-1.0, 0.0, 0.0]))
    assert sweep_target([*ARC[:3], back], CENTRE, 0.1, CAMERA) is None
    close = keyframe(0.0, 200, away_m=0.5 * LEAST_DEPTH_M)
    assert sweep_target([*ARC[:3], close], CENTRE, 0.1, CAMERA) is None


def test_a_target_outside_the_picture_has_no_sweep() -> None:
    """Whichever way it lies; half in the picture it has one, of the window's part that is."""
    for aside in ([0.7, 1.5, 0.0], [0.7, -1.5, 0.0], [0.7, 0.0, 1.5], [0.7, 0.0, -1.5]):
        assert sweep_target([*ARC[:3], keyframe(0.0, 200, at_W_m=np.array(aside))], CENTRE, 0.1, CAMERA) is None
    half = sweep_target([*ARC[:3], keyframe(0.0, 200, at_W_m=np.array([0.7, 0.42, 0.0]))], CENTRE, 0.1, CAMERA)
    assert half is not None
    left, _, right, _ = half.window
    assert left == 0 and 24 <= right < 60


def test_a_target_that_looks_small_has_no_sweep() -> None:
    """Its window would show too little."""
    far = [keyframe(angle, 0, away_m=3.0) for angle in (15.0, 10.0, 5.0, 0.0)]
    assert sweep_target(far, CENTRE, 0.06, CAMERA) is None
    assert sweep_target(far, CENTRE, 0.3, CAMERA) is not None


def test_a_tiny_target_is_swept_as_one_of_the_least_radius() -> None:
    """Window and depths are those of `LEAST_RADIUS_M`."""
    tiny, least = (sweep_target(ARC, CENTRE, radius, CAMERA) for radius in (0.001, LEAST_RADIUS_M))
    assert tiny is not None and least is not None
    assert tiny.window == least.window
    np.testing.assert_array_equal(tiny.inverse_m, least.inverse_m)


@given(st.floats(0.06, 0.6), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
@settings(max_examples=25, deadline=None)
def test_a_ball_lies_in_its_window_and_depths(radius_m: float, aside_m: float, down_m: float) -> None:
    """All of its surface that is in the picture, from its front to its back; what is swept lies before the camera."""
    at = CENTRE + np.array([0.0, aside_m, down_m])
    frames = [*ARC[:3], keyframe(0.0, 200, at_W_m=at)]
    sweep = sweep_target(frames, CENTRE, radius_m, CAMERA)
    assert sweep is not None
    unit = np.random.default_rng(0).normal(size=(200, 3))
    ball = CENTRE + radius_m * unit / np.linalg.norm(unit, axis=1, keepdims=True)
    pixels = pixels_of(ball, frames[-1].X_WC, CAMERA)
    left, top, right, bottom = sweep.window
    assert 0 <= left < right <= 240 and 0 <= top < bottom <= 180
    shown = pixels[CAMERA.inside(pixels)]
    assert ((shown > [left - 1, top - 1]) & (shown < [right, bottom])).all()
    depth = (ball - frames[-1].X_WC.p_m) @ frames[-1].X_WC.R[:, 2]
    assert LEAST_DEPTH_M <= 1.0 / sweep.inverse_m[0] < depth.min()
    assert depth.max() < 1.0 / sweep.inverse_m[-1]


def pictured(texture: Grey, X_WC: Pose) -> Grey:
    """A texture of 2 mm squares on the board through the centre that faces -x, as a camera shows it."""
    K = np.array([[200.0, 0.0, 120.0], [0.0, 200.0, 90.0], [0.0, 0.0, 1.0]])
    corner = CENTRE - 0.001 * np.array([0.0, *texture.shape])
    board_C = X_WC.R.T @ np.column_stack([[0.0, 0.002, 0.0], [0.0, 0.0, 0.002], corner - X_WC.p_m])
    return np.asarray(cv2.warpPerspective(texture, K @ board_C, (240, 180), flags=cv2.INTER_LINEAR), dtype=np.uint8)


def test_a_board_is_mapped_where_it_is() -> None:
    """Sweeps along an arc confirm cells all over the window, on the board to 4 mm, seen from its front."""
    noise = cv2.GaussianBlur(np.random.default_rng(3).normal(size=(700, 700)), (0, 0), 1.5)
    texture = np.asarray(np.clip(128.0 + 35.0 * noise / noise.std(), 0, 255), dtype=np.uint8)
    frames: list[Keyframe] = []
    surface = empty_surface()
    for angle in range(-15, 16, 5):
        frame = keyframe(float(angle), None)
        frames.append(replace(frame, picture=pictured(texture, frame.X_WC)))
        sweep = sweep_target(frames, CENTRE, 0.1, CAMERA)
        if sweep is None:
            continue
        while not sweep.done:
            sweep = compared(sweep, CAMERA)
        surface = with_sweep(surface, swept_depth(sweep, CAMERA), CAMERA)
    found = surface.chosen(surface.confirmed)
    assert len(found) > 1000
    off = found.points_W_m[:, 0] - 0.7
    assert abs(np.average(off, weights=found.weight)) < 0.001
    assert np.percentile(abs(off), 90.0) < 0.004
    assert np.ptp(found.points_W_m[:, 1]) > 0.2 and np.ptp(found.points_W_m[:, 2]) > 0.2
    assert (found.towards_W[:, 0] < 0.0).all()


def test_all_orders_of_seeing_and_missing_a_place_leave_it_the_same_views() -> None:
    """Sweeps that see nothing there or only what is nearer change nothing of a cell."""
    sweeps = [seen(NEAR_M), seen(math.nan), seen(0.4), seen(NEAR_M)]
    for order in permutations(sweeps):
        surface = surface_of(*order)
        near = abs(surface.points_W_m[:, 0] - NEAR_M) < 1e-9
        assert surface.views[near].tolist() == [2]


def test_all_in_view_is_swept_in_smaller_pictures() -> None:
    """The whole picture is the window, depths go beyond the mapped ones; without pictures from aside there is none."""
    camera = CalibratedCamera(width=640, height=480, fx=400.0, fy=400.0, cx=320.0, cy=240.0)
    small = view_camera(camera)
    frames = [replace(frame, picture=np.full((480, 640), 7, np.uint8)) for frame in reversed(ARC)]
    mapped = CENTRE + np.array([[0.0, 0.1, 0.1], [0.1, -0.1, 0.0], [-0.1, 0.0, -0.1]])
    sweep = sweep_in_view(frames, mapped, small, 1.5)
    assert sweep is not None
    assert sweep.window == (0, 0, VIEW_PX, 240)
    assert len(sweep.others) == 3
    depths = (mapped - frames[-1].X_WC.p_m) @ frames[-1].X_WC.R[:, 2]
    assert 1.0 / sweep.inverse_m.max() < depths.min()
    assert 1.0 / sweep.inverse_m.min() > depths.max()
    assert sweep_in_view(frames[-2:], mapped, small, 1.5) is None
    assert sweep_in_view(frames, mapped, small, 0.3) is None
    assert sweep_in_view(frames, mapped - [0.8, 0.0, 0.0], small, 1.5) is None  # what is mapped lies behind the camera


def test_larger_cells_hold_each_second_pixel() -> None:
    """Points of a wall that fall into one cell become one, and those between rows and columns are left out."""
    once = with_sweep(empty_surface(), wall(1), CAMERA, None, 0.02, 2)
    whole = with_sweep(empty_surface(), wall(1), CAMERA, None, 0.02)
    fine = with_sweep(empty_surface(), wall(1), CAMERA)
    assert 0 < len(once) <= len(whole) < len(fine)
    assert len(np.unique(np.floor(whole.points_W_m / 0.02), axis=0)) == len(whole)

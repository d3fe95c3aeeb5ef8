"""Keyframes and the map made from them: places within noise of the truth, later keyframes moved along, again later."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from perception_cases import CAMERA, adjusted_whole, disturbed, looking, pixels_of, slopes_of, turn_between

from wakewise.core.arrays import Array, IntArray
from wakewise.core.geometry import Pose
from wakewise.perception.bundle_adjustment import LENS, BundleAdjustment, Keyframe, begin_adjustment, with_lens
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.map_initialization import (
    KEYFRAME_M,
    MOST_KEYFRAMES,
    PARALLAX_RAD,
    adjusted_map,
    moved_since,
    shift_of,
    well_crossed,
    with_keyframe,
)
from wakewise.perception.point_map import PointMap, add_rays, empty_map, ray_directions

MIDDLE = np.array([0.8, 0.0, 1.5])
PLACES = MIDDLE + np.random.default_rng(0).uniform([-0.3, -0.3, -0.15], [0.3, 0.3, 0.15], (120, 3))
IDS = 10 + 2 * np.arange(len(PLACES))
STD, CERTAIN, LATER_STD = (0.004, 0.004), (1e-5, 1e-5), (0.02, 0.02)
PERIOD_S = 0.5
NOISE_PX = 0.2
UNBENT = np.zeros(LENS)


def on_arc(k: float) -> Pose:
    """The k-th of 16 cameras on half an arc of a metre about the middle, a little up and down."""
    t = -0.8 + 0.1 * k
    return looking(MIDDLE + np.array([-0.8 * np.cos(t), 0.8 * np.sin(t), -0.45 - 0.05 * np.sin(3.0 * t)]), MIDDLE)


def keyframe(k: int, std: tuple[float, float] = STD, camera: CalibratedCamera = CAMERA) -> Keyframe:
    """Keyframe of the k-th camera with noise in pose and pixels, features in an order of its own."""
    rng, true = np.random.default_rng(k), on_arc(k)
    pixels = pixels_of(PLACES, true, camera) + NOISE_PX * rng.normal(size=(len(PLACES), 2))
    estimate = disturbed(true, std[0] * rng.normal(size=3), std[1] * rng.normal(size=3))
    order = rng.permutation(len(PLACES))
    return Keyframe(time_s=PERIOD_S * k, X_WC=estimate, prior=estimate, std=std, ids=IDS[order], pixels=pixels[order])


def mapped(frames: list[Keyframe], known: PointMap | None = None) -> PointMap:
    """The map of the keyframes' rays from their estimated poses."""
    known = empty_map() if known is None else known
    for frame in frames:
        slopes = CAMERA.slopes(frame.pixels)
        known = add_rays(
            known, frame.ids, slopes, frame.X_WC, frame.time_s, CAMERA.focal_px, 0.8, 2.0 * STD[0], 2.0 * STD[1]
        )
    return known


def adjusted(frames: list[Keyframe], points: PointMap, lens: Array = UNBENT) -> BundleAdjustment:
    """The whole adjustment of keyframes and points."""
    start = begin_adjustment(frames, *points.known_places(), CAMERA, lens)
    assert start is not None
    return adjusted_whole(start)


def errors(points: PointMap) -> Array:
    """Distances of the map's features from their true places, shape (n,)."""
    rows = points.rows(IDS)
    return np.asarray(np.linalg.norm(points.points_W_m[rows] - PLACES, axis=1))


def first_frames(camera: CalibratedCamera = CAMERA) -> list[Keyframe]:
    """Keyframes of 16 cameras; the first and the last are known for certain and hold frame and scale."""
    return [keyframe(k, std=CERTAIN if k in {0, 15} else STD, camera=camera) for k in range(16)]


FRAMES = first_frames()
# Features that no keyframe shows, with numbers between those of the others.
OTHER = 11 + 2 * np.arange(30)
OTHER_PLACES = MIDDLE + np.random.default_rng(1).uniform(-0.2, 0.2, (30, 3))


def with_others(points: PointMap) -> PointMap:
    """The map with features that no keyframe shows, but the first three cannot be computed."""
    for k in range(0, 16, 3):
        X_WC, some = on_arc(k), slice(0 if k == 0 else 3, None)
        slopes = slopes_of(OTHER_PLACES[some], X_WC)
        points = add_rays(points, OTHER[some], slopes, X_WC, 8.0, CAMERA.focal_px, 0.8)
    return points


BEFORE = with_others(mapped(FRAMES))
ADJUSTMENT = adjusted(FRAMES, BEFORE)
AFTER = adjusted_map(ADJUSTMENT, BEFORE)


def test_keyframes_are_some_way_apart() -> None:
    """The first is taken, then what is `KEYFRAME_M` from the last; the picture in hand is left where it is nearer."""
    first = keyframe(0)
    frames = with_keyframe((), first)
    assert frames == (first,)
    near = replace(first, X_WC=disturbed(first.X_WC, np.array([0.9 * KEYFRAME_M, 0.0, 0.0]), np.zeros(3)))
    far = replace(first, X_WC=disturbed(first.X_WC, np.array([0.0, 1.1 * KEYFRAME_M, 0.0]), np.zeros(3)))
    assert with_keyframe(frames, near) is frames
    assert with_keyframe(frames, far) == (first, far)
    assert with_keyframe((first, far), first) == (first, far, first)


def test_the_last_keyframes_are_kept() -> None:
    """Beyond `MOST_KEYFRAMES` the oldest go."""
    frames: tuple[Keyframe, ...] = ()
    for k in range(MOST_KEYFRAMES + 7):
        place = np.array([2.0 * KEYFRAME_M * k, 0.0, 0.0])
        frames = with_keyframe(frames, replace(FRAMES[0], time_s=float(k), X_WC=Pose(place, FRAMES[0].X_WC.q)))
    np.testing.assert_array_equal([frame.time_s for frame in frames], 7.0 + np.arange(MOST_KEYFRAMES))


def test_a_map_is_well_crossed_by_its_parallax_and_number() -> None:
    """The median parallax of mature features in the picture decides, and they must be so many."""
    count = int(BEFORE.mature[BEFORE.rows(IDS)].sum())
    assert count > 60
    assert well_crossed(BEFORE, IDS, count)
    assert not well_crossed(BEFORE, IDS, count + 1)
    assert not well_crossed(BEFORE, IDS + 5000, 1)
    mature = BEFORE.chosen(BEFORE.mature)
    for share, crossed in ((0.99, False), (1.01, True)):
        parallax = np.full(len(mature), share * PARALLAX_RAD)
        parallax[: len(mature) // 3] = 0.1
        assert well_crossed(replace(mature, parallax_rad=parallax), mature.ids, 10) is crossed


def test_places_come_within_noise_of_the_truth() -> None:
    """All features are mature, their errors a quarter of those before and within two standard deviations."""
    rows = AFTER.rows(IDS)
    assert AFTER.mature[rows].all()
    assert np.median(errors(AFTER)) < np.median(errors(BEFORE)) / 4.0
    assert (errors(AFTER) < 2.0 * AFTER.std_m[rows]).all()
    np.testing.assert_allclose(AFTER.points_W_m[rows], ADJUSTMENT.points_W_m, atol=1e-9)


def test_rows_stay_sorted_and_other_points_move_as_the_last_keyframe() -> None:
    """Numbers ascend, each is there once, and points that no keyframe shows are moved as the last keyframe is."""
    moved = BEFORE.moved(shift_of(ADJUSTMENT))
    assert (np.diff(AFTER.ids) > 0).all()
    np.testing.assert_array_equal(AFTER.ids, BEFORE.ids)
    assert np.isnan(AFTER.points_W_m[AFTER.rows(OTHER[:3])]).all()
    for name in PointMap.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(AFTER, name)[AFTER.rows(OTHER)], getattr(moved, name)[moved.rows(OTHER)])


def without(frame: Keyframe, ids: IntArray) -> Keyframe:
    """The keyframe without some of its features."""
    stays = ~np.isin(frame.ids, ids)
    return replace(frame, ids=frame.ids[stays], pixels=frame.pixels[stays])


def test_adjusted_points_know_how_they_were_seen() -> None:
    """Views, first ray, largest angle with it, and last time are those of the keyframes that show a point."""
    frames = [without(frame, IDS[[7]]) if k < 2 else frame for k, frame in enumerate(FRAMES[:12])]
    frames += [without(frame, IDS) for frame in FRAMES[12:]]
    adjustment = adjusted(frames, BEFORE)
    points = adjusted_map(adjustment, BEFORE)
    np.testing.assert_array_equal(points.views[points.rows(IDS)], np.where(np.isin(IDS, IDS[7]), 10, 12))
    np.testing.assert_array_equal(points.weight[points.rows(IDS)], points.views[points.rows(IDS)])
    np.testing.assert_array_equal(points.seen_s[points.rows(IDS)], PERIOD_S * 11)
    assert not points.outliers[points.rows(IDS)].any()
    for j, first in ((0, 0), (7, 2)):
        row = points.rows(IDS[[j]])[0]
        place = points.points_W_m[row]
        rays = [ray_directions(slopes_of(place[None], X_WC), X_WC)[0] for X_WC in adjustment.poses[first:12]]
        np.testing.assert_allclose(points.first_W[row], rays[0], atol=1e-9)
        assert points.parallax_rad[row] == pytest.approx(np.arccos(np.min(rays @ rays[0])), abs=1e-9)


def test_a_feature_that_slides_does_not_become_mature() -> None:
    """Where pixels miss its place by far, a first map holds it as not mature, and a later one leaves what it had."""
    rng, slides = np.random.default_rng(3), IDS[::10]
    frames = []
    for frame in FRAMES:
        off = 6.0 * rng.normal(size=frame.pixels.shape) * np.isin(frame.ids, slides)[:, None]
        frames.append(replace(frame, pixels=frame.pixels + off))
    adjustment = adjusted(frames, BEFORE)
    fresh, later = adjusted_map(adjustment, empty_map()), adjusted_map(adjustment, BEFORE)
    np.testing.assert_array_equal(fresh.ids, IDS)
    np.testing.assert_array_equal(fresh.mature, ~np.isin(IDS, slides))
    moved = BEFORE.moved(shift_of(adjustment))
    for name in PointMap.__dataclass_fields__:
        np.testing.assert_array_equal(
            getattr(later, name)[later.rows(slides)], getattr(moved, name)[moved.rows(slides)]
        )
    np.testing.assert_array_equal(later.ids, BEFORE.ids)


def test_further_rays_go_on_from_the_adjusted_places() -> None:
    """True rays leave them within a millimetre of where they are and count as views; none is an outlier."""
    points = add_rays(AFTER, IDS, slopes_of(PLACES, on_arc(8.5)), on_arc(8.5), 8.0, CAMERA.focal_px, 0.8)
    rows = points.rows(IDS)
    np.testing.assert_array_equal(points.views[rows], 17)
    assert not points.outliers[rows].any()
    assert points.mature[rows].all()
    assert np.linalg.norm(points.points_W_m[rows] - AFTER.points_W_m[rows], axis=1).max() < 1e-3


def test_later_keyframes_move_as_the_last_adjusted_one() -> None:
    """Adjusted ones have their new poses and are more certain; the others keep their pose relative to the last."""
    later = [keyframe(k, std=LATER_STD) for k in (16, 17)]
    gone = 3
    frames = moved_since((*FRAMES[gone:], *later), ADJUSTMENT)
    assert len(frames) == len(FRAMES) - gone + 2
    for frame, pose, given in zip(frames[:-2], ADJUSTMENT.poses[gone:], FRAMES[gone:], strict=True):
        assert frame.X_WC is pose
        assert frame.std == given.std
        assert (frame.time_s, frame.ids is given.ids, frame.pixels is given.pixels) == (given.time_s, True, True)
    for frame, given in zip(frames[-2:], later, strict=True):
        assert (frame.std, frame.time_s) == (LATER_STD, given.time_s)
        found, wanted = ADJUSTMENT.poses[-1].inverse() @ frame.X_WC, FRAMES[-1].X_WC.inverse() @ given.X_WC
        np.testing.assert_allclose(found.p_m, wanted.p_m, atol=1e-12)
        np.testing.assert_allclose(turn_between(found, wanted), 0.0, atol=1e-9)


def test_a_second_adjustment_holds_the_frame_and_takes_the_new_keyframes_in() -> None:
    """Places stay within millimetres, and poses that were off by 2 cm come to the map's frame."""
    later = [keyframe(k, std=LATER_STD) for k in range(16, 24)]
    frames = list(moved_since((*FRAMES, *later), ADJUSTMENT))
    again = adjusted(frames, AFTER, ADJUSTMENT.lens)
    points = adjusted_map(again, AFTER)
    rows = points.rows(IDS)
    assert points.mature[rows].all()
    assert (points.views[rows] == 24).all()
    assert np.linalg.norm(points.points_W_m[rows] - AFTER.points_W_m[AFTER.rows(IDS)], axis=1).max() < 0.004
    assert np.median(errors(points)) < 0.004
    for k, pose in enumerate(again.poses):
        assert np.linalg.norm(pose.p_m - on_arc(k).p_m) < 0.006
        assert np.linalg.norm(turn_between(pose, on_arc(k))) < 0.008


def test_a_wrong_lens_bends_the_adjusted_map_little() -> None:
    """With a calibration off by its stated errors the places are within twice the errors of those with the true one."""
    true = with_lens(CAMERA, np.array([0.002, -0.0015, 0.0015, -0.003, 0.006, 0.00075, -0.00075]))
    frames = first_frames(true)
    adjustment = adjusted(frames, mapped(frames))
    points = adjusted_map(adjustment, empty_map())
    assert points.mature.mean() > 0.95
    assert np.median(errors(points)) < 2.0 * np.median(errors(AFTER))

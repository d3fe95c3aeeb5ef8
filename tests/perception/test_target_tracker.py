"""The tracker of the target: what it finds in pictures, and what it says where pictures show nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.perception.conftest import Pictures

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.perception import PerceptionSettings, TargetTracker, TrackerState
from wakewise.perception.common_shift import common_shift
from wakewise.perception.target_tracker import PATIENT

SETTINGS = PerceptionSettings(width_px=480, accept_s=0.3, assumed_distance_m=0.7)
STD = (0.002, 0.002)
PERIOD_S = 0.2


def tracker_of(arc: Pictures, settings: PerceptionSettings = SETTINGS) -> TargetTracker:
    """The tracker of the pictures' camera."""
    return TargetTracker(camera=arc.camera, settings=settings)


def followed(
    tracker: TargetTracker, arc: Pictures, state: TrackerState | None = None, noise_m: float = 0.0
) -> tuple[TrackerState, list[Array | None]]:
    """The state after all pictures, and the poses' errors where the map gave one, shape (3,) each."""
    rng, state = np.random.default_rng(0), tracker.init() if state is None else state
    errors: list[Array | None] = []
    for k, (picture, X_WC) in enumerate(zip(arc.pictures, arc.poses, strict=True)):
        turn = quat_from_rotvec(noise_m * rng.normal(size=3))
        guess = Pose(X_WC.p_m + noise_m * rng.normal(size=3), quat_multiply(X_WC.q, turn))
        state, found = tracker.step(state, picture, PERIOD_S * k, guess, STD)
        errors.append(None if found is None else found.X_WC.p_m - X_WC.p_m)
    return state, errors


def back(tracker: TargetTracker, arc: Pictures, state: TrackerState) -> tuple[TrackerState, float]:
    """The state after the way back along the arc, in which no body was proposed, and the time of the next picture."""
    time_s = PERIOD_S * len(arc.poses)
    for picture, X_WC in zip(arc.pictures[-2::-1], arc.poses[-2::-1], strict=True):
        state, _ = tracker.step(state, picture, time_s, X_WC, STD)
        assert state.target is None or state.target.status == "assumed"
        time_s += PERIOD_S
    return state, time_s


@pytest.fixture(scope="module")
def after(arc: Pictures) -> TrackerState:
    """The state after the arc, with poses 2 mm and 2 mrad off."""
    return followed(tracker_of(arc), arc, noise_m=0.002)[0]


def test_what_stands_on_the_bed_is_found_and_accepted(arc: Pictures, after: TrackerState) -> None:
    """The coral is tracked after an arc of 30 deg, its centre known to 25 mm and its size to a third."""
    assert after.target is not None
    assert after.target.status == "tracked"
    assert np.linalg.norm(after.target.centre_W_m - arc.target.centre_W_m) < 0.025
    assert after.target.radius_m == pytest.approx(arc.target.radius_m, rel=0.35)
    assert after.bed is not None
    assert after.bed.at_W_m[2] == pytest.approx(arc.target.bed_z_m, abs=0.015)


@pytest.mark.parametrize("period_s", [0.1, PERIOD_S, 0.5, 1.0])
def test_map_and_region_take_turns(arc: Pictures, period_s: float) -> None:
    """No picture adjusts the map and computes the region; every keyframe is adjusted once, by the next picture."""
    tracker = tracker_of(arc)
    state, adjusted, shaped, fresh = tracker.init(), 0, 0, 0
    for k, (picture, X_WC) in enumerate(zip(arc.pictures, arc.poses, strict=True)):
        before = state
        state, _ = tracker.step(state, picture, period_s * k, X_WC, STD)
        adjusts, shapes = state.adjusted_s > before.adjusted_s, state.shaped_s > before.shaped_s
        assert not (adjusts and shapes)
        adjusted, shaped = adjusted + adjusts, shaped + shapes
        if state.initialized:
            fresh = 0 if state.adjusted_s == state.keyframes[-1].time_s else fresh + 1
            assert fresh <= 1
            assert state.adjusted_s > before.adjusted_s or state.camera is before.camera
    assert state.initialized
    assert adjusted >= 3
    assert shaped >= 3


def test_what_was_seen_from_one_side_is_accepted_late(arc: Pictures) -> None:
    """On an arc of 30 deg time alone accepts a proposed target only after `PATIENT` times as long."""
    tracker, first_s = tracker_of(arc), dict[str, float]()
    state = tracker.init()
    for k, (picture, X_WC) in enumerate(zip(arc.pictures, arc.poses, strict=True)):
        state, _ = tracker.step(state, picture, PERIOD_S * k, X_WC, STD)
        if state.target is not None:
            first_s.setdefault(state.target.status, PERIOD_S * k)
    assert first_s["tracked"] - first_s["proposed"] >= PATIENT * SETTINGS.accept_s - 1e-6


def test_the_protected_region_is_about_the_target_and_above_the_bed(arc: Pictures, after: TrackerState) -> None:
    """All points lie in the water within two radii and the shell, and weights are those of the number of points."""
    assert after.target is not None
    assert after.bed is not None
    away = np.linalg.norm(after.target.points_W_m - arc.target.centre_W_m, axis=1)
    assert away.max() < 2.0 * arc.target.radius_m + 0.12
    assert after.bed.height_m(after.target.points_W_m).min() > -0.02
    assert len(after.target.weights) == SETTINGS.points
    assert 0.5 * SETTINGS.points < after.target.weights.sum() < SETTINGS.points


def test_the_map_holds_the_camera_better_than_its_guess(arc: Pictures) -> None:
    """Poses by the map vary less than the guesses that it was made with."""
    _, errors = followed(tracker_of(arc), arc, noise_m=0.002)
    known = np.array([error for error in errors[-5:] if error is not None])
    assert len(known) == 5
    assert np.linalg.norm(known - known.mean(axis=0), axis=1).max() < 0.002
    assert np.linalg.norm(known.mean(axis=0)) < 0.012


def test_before_there_is_parallax_a_ball_at_the_stated_distance_is_protected(arc: Pictures) -> None:
    """After two pictures from one place the target is assumed, at the stated distance along the middle ray."""
    tracker = tracker_of(arc)
    state = tracker.init()
    for k in range(2):
        state, _ = tracker.step(state, arc.pictures[k], PERIOD_S * k, arc.poses[0], STD)
    assert state.target is not None
    assert state.target.status == "assumed"
    way = state.target.centre_W_m - arc.poses[0].p_m
    assert np.linalg.norm(way) == pytest.approx(SETTINGS.assumed_distance_m, rel=1e-6)
    assert way @ arc.poses[0].R[:, 2] == pytest.approx(SETTINGS.assumed_distance_m, rel=1e-3)


def test_a_box_chooses_its_body_and_needs_no_acceptance(arc: Pictures) -> None:
    """A designated box about the coral is tracked as the coral; one on bare sand stays assumed."""
    tracker = tracker_of(arc, SETTINGS.model_copy(update={"accept_s": 600.0}))
    u, v = arc.camera.pixels(((arc.target.centre_W_m - arc.poses[0].p_m) @ arc.poses[0].R)[None])[0]
    state = tracker.designate(tracker.init(), (u + 40, v + 45, u - 40, v - 45), arc.camera.width)
    state, _ = followed(tracker, arc, state)
    assert state.target is not None
    assert state.target.status == "tracked"
    assert np.linalg.norm(state.target.centre_W_m - arc.target.centre_W_m) < 0.025
    bare = tracker.designate(tracker.init(), (20, 300, 60, 340), arc.camera.width)
    bare, _ = followed(tracker, arc, bare)
    assert bare.target is not None
    assert bare.target.status == "assumed"


def test_without_acceptance_a_target_stays_proposed(arc: Pictures) -> None:
    """What nobody accepted is proposed until its time is over; accepted it is tracked."""
    tracker = tracker_of(arc, SETTINGS.model_copy(update={"accept_s": 600.0}))
    state, _ = followed(tracker, arc)
    assert state.target is not None
    assert state.target.status == "proposed"
    accepted = tracker.accept(state)
    accepted, _ = tracker.step(accepted, arc.pictures[-2], PERIOD_S * len(arc.poses), arc.poses[-2], STD)
    assert accepted.target is not None
    assert accepted.target.status == "tracked"


def test_a_refused_body_is_not_proposed_again_until_a_box_takes_it(arc: Pictures) -> None:
    """The refused coral is dropped and left out in all following pictures; a box on it ends the refusal."""
    tracker = tracker_of(arc, SETTINGS.model_copy(update={"accept_s": 600.0}))
    state, _ = followed(tracker, arc)
    assert state.target is not None
    assert state.target.status == "proposed"
    state = tracker.refuse(state)
    assert (state.shape, state.target, state.sweep, state.accepted) == (None, None, None, False)
    assert len(state.surface) == len(state.members) == 0
    state, time_s = back(tracker, arc, state)
    assert state.target is not None
    assert state.target.status == "assumed"
    u, v = arc.camera.pixels(((arc.target.centre_W_m - arc.poses[0].p_m) @ arc.poses[0].R)[None])[0]
    box = (u - 40, v - 45, u + 40, v + 45)
    assert len(tracker.designate(state, box, arc.camera.width, accepted=False).refused) == 1
    state = tracker.designate(state, box, arc.camera.width)
    assert state.refused == ()
    for k in range(8):
        state, _ = tracker.step(state, arc.pictures[k % 2 + 1], time_s + PERIOD_S * k, arc.poses[k % 2 + 1], STD)
    assert state.target is not None
    assert state.target.status == "tracked"
    assert np.linalg.norm(state.target.centre_W_m - arc.target.centre_W_m) < 0.025


def test_nothing_is_refused_before_a_body_is_proposed(arc: Pictures) -> None:
    """An assumed ball is no proposal."""
    tracker = tracker_of(arc)
    state, _ = tracker.step(tracker.init(), arc.pictures[0], 0.0, arc.poses[0], STD)
    assert tracker.refuse(state) is state


def test_a_target_out_of_the_picture_is_reported_lost_and_stays_protected(arc: Pictures, after: TrackerState) -> None:
    """With the camera turned away the status is lost within half a second, and the region is the last one."""
    assert after.target is not None
    tracker, state, time_s = tracker_of(arc), after, PERIOD_S * len(arc.poses)
    away = np.roll(arc.pictures[-1], 200, axis=1)[::-1, ::-1].copy()
    turned = Pose(arc.poses[-1].p_m, quat_multiply(arc.poses[-1].q, quat_from_rotvec(np.array([0.0, np.pi, 0.0]))))
    for k in range(3):
        picture = np.roll(away, k, axis=0)
        state, _ = tracker.step(state, picture, time_s + PERIOD_S * k, turned, STD)
    assert state.target is not None
    assert state.target.status == "lost"
    assert np.linalg.norm(state.target.centre_W_m - after.target.centre_W_m) < 0.005
    later, _ = tracker.step(state, np.roll(away, 7, axis=0), time_s + 1.0, turned, STD)
    assert later.target is not None
    assert np.array_equal(later.target.points_W_m, state.target.points_W_m)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda last: last, "frozen"),
        (lambda last: np.full_like(last, 90), "uniform"),
        (lambda last: last[:-10], "must be 480 x 360"),
    ],
)
def test_a_picture_that_shows_nothing_leaves_the_region(
    arc: Pictures, after: TrackerState, spoil: object, word: str
) -> None:
    """A frozen, uniform or wrongly sized picture is told as trouble; the region stays and no pose comes of it."""
    assert callable(spoil)
    picture = np.ascontiguousarray(spoil(arc.pictures[-1]))
    state, found = tracker_of(arc).step(after, picture, PERIOD_S * len(arc.poses), arc.poses[-1], STD)
    assert found is None
    assert word in state.trouble
    assert after.target is not None
    assert state.target is not None
    assert np.array_equal(state.target.points_W_m, after.target.points_W_m)


def test_after_a_picture_that_shows_nothing_speeds_are_of_the_whole_time(arc: Pictures) -> None:
    """Features that are found again move by their way since the last good picture over the time since then."""
    tracker = tracker_of(arc)
    before, _ = tracker.step(tracker.init(), arc.pictures[0], 0.0, arc.poses[0], STD)
    nothing, _ = tracker.step(before, np.full_like(arc.pictures[1], 90), PERIOD_S, arc.poses[1], STD)
    after, _ = tracker.step(nothing, arc.pictures[2], 2.0 * PERIOD_S, arc.poses[2], STD)
    kept = np.isin(after.tracks.ids, before.tracks.ids)
    assert kept.sum() > 100
    way = after.tracks.pixels[kept] - before.tracks.pixels[np.searchsorted(before.tracks.ids, after.tracks.ids[kept])]
    np.testing.assert_allclose(after.tracks.speeds[kept], way / (2.0 * PERIOD_S))


def test_a_late_picture_is_refused(arc: Pictures, after: TrackerState) -> None:
    """A picture older than the last one is told as late and changes nothing of the map."""
    state, found = tracker_of(arc).step(after, arc.pictures[3], 1.0, arc.poses[3], STD)
    assert found is None
    assert state.trouble.startswith("late picture")
    assert state.points is after.points


def test_in_mode_view_the_bed_is_protected_as_well(arc: Pictures) -> None:
    """Without a target everything mapped within the distance is protected, bed included."""
    settings = SETTINGS.model_copy(update={"protect": "view", "view_distance_m": 1.0})
    state, _ = followed(tracker_of(arc, settings), arc)
    assert state.target is not None
    assert state.target.status == "tracked"
    surface = state.target.points_W_m[state.target.distance_m <= 0.0]
    assert state.bed is not None
    assert np.mean(np.abs(state.bed.height_m(surface)) < 0.02) > 0.5
    assert np.linalg.norm(surface - arc.poses[-1].p_m, axis=1).max() < 1.1


def test_the_same_pictures_give_the_same_state(arc: Pictures, after: TrackerState) -> None:
    """The tracker is a function of its pictures and seed."""
    again, _ = followed(tracker_of(arc), arc, noise_m=0.002)
    assert again.target is not None
    assert after.target is not None
    assert np.array_equal(again.target.points_W_m, after.target.points_W_m)


def test_the_common_shift_of_points_is_found_across_the_view(arc: Pictures) -> None:
    """Points that move together by a centimetre across the view are found moved so, with a fifth of them wrong."""
    rng, X_WC = np.random.default_rng(1), arc.poses[0]
    points = arc.target.centre_W_m + 0.05 * rng.normal(size=(40, 3))
    way = X_WC.R @ np.array([0.01, -0.004, 0.0])
    pixels = arc.camera.pixels((points + way - X_WC.p_m) @ X_WC.R) + 0.2 * rng.normal(size=(40, 2))
    pixels[:8] += 30.0
    found = common_shift(points, pixels, arc.camera, X_WC, 0.02)
    assert np.linalg.norm(((found - way) @ X_WC.R)[:2]) < 0.0015


def test_what_is_not_mapped_stays_out_of_the_map_after_it_ends(arc: Pictures, after: TrackerState) -> None:
    """Features that ended before they were mature are dropped, and mature ones stay."""
    live = np.isin(after.points.ids, after.tracks.ids)
    assert (live | after.points.mature).all()
    assert int(after.points.mature.sum()) > 100
    assert replace(after, trouble="x").points is after.points


def test_features_are_sought_closely_about_what_stands_above_the_bed_before_a_target_is_known(
    arc: Pictures, after: TrackerState
) -> None:
    """Once there is a bed, a picture without a target gives half as many features again near the coral."""
    tracker = tracker_of(arc)
    blank = replace(
        after, shape=None, target=None, designation=None, tracks=after.tracks.kept(np.zeros(len(after.tracks), bool))
    )
    counts = []
    for before in (replace(blank, bed=None), blank):
        picture, X_WC = arc.pictures[-2], arc.poses[-2]
        state, _ = tracker.step(before, picture, after.last_s + PERIOD_S, X_WC, STD)
        p_C = X_WC.inverse().apply(arc.target.centre_W_m)
        middle = arc.camera.pixels(p_C[None])[0]
        near = np.linalg.norm(state.tracks.pixels - middle, axis=1) < arc.camera.focal_px * arc.target.radius_m / p_C[2]
        counts.append(int(near.sum()))
    assert counts[1] > 1.5 * counts[0] > 0, counts

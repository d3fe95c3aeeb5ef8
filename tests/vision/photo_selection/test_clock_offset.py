"""The offset of the camera's clock is found from motion, and refused where motion does not tell it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_dive import dive, write_photos

from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, quat_from_euler
from wakewise.vision.photo_selection.clock_offset import find_offset, predict_motion
from wakewise.vision.photo_selection.dive_track import DiveTrack, mounted_camera
from wakewise.vision.photo_selection.pick import PickRequest, pick_photos
from wakewise.vision.photo_selection.picture_statistics import photo_statistics

DOWN = mounted_camera(np.zeros(3), 90.0)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2)), 3])
def test_the_offset_of_a_clock_in_another_time_zone_is_found_within_a_tenth_of_a_second(
    tmp_path: Path, seed: int
) -> None:
    """Error at most 0.1 s and four standard deviations, for whole hours and odd seconds."""
    made, true_s = dive(seed, 80.0), 3600.0 * (3 * seed - 7) + 3.7 + 0.123 * seed
    write_photos(tmp_path / "photos", made, true_s, seed)
    offset = pick_photos(tmp_path / "photos", made.track, PickRequest()).figures["offset"]
    assert abs(offset["offset_s"] - true_s) <= min(0.1, 4.0 * offset["sigma_s"])
    assert offset["whole_hours"] == 3 * seed - 7


def test_photographs_of_another_dive_are_refused(tmp_path: Path) -> None:
    """The log of another dive at the same hour gives one line that names --offset."""
    write_photos(tmp_path / "photos", dive(1), 5.0)
    with pytest.raises(InputError, match=r"ambiguous: .*--offset"):
        pick_photos(tmp_path / "photos", dive(2).track, PickRequest())


def test_a_motion_that_repeats_is_ambiguous() -> None:
    """A path flown twice alike has two offsets that fit alike."""
    once = dive(3, 60.0).track
    count = len(once.time_s) - 1
    shift = once.position_W_m[-1] - once.position_W_m[0]
    twice = DiveTrack(
        name="twice",
        time_s=np.arange(2 * count + 1) / 10.0,
        position_W_m=np.vstack([once.position_W_m[:-1], once.position_W_m + shift]),
        q_WB=np.vstack([once.q_WB[:-1], once.q_WB]),
        altitude_m=np.full(2 * count + 1, np.nan),
        positions_from="the test",
    )
    predicted = predict_motion(twice, DOWN, 1.0)
    at = np.arange(3.0, 57.0)
    motion, _ = predicted.between(at[:-1], at[1:])
    found = find_offset(predicted, at, motion, None)
    assert found.ambiguous is not None and "another offset" in found.ambiguous
    assert found.second_offset_s is not None
    assert abs(abs(found.second_offset_s - found.offset_s) - 60.0) < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_a_log_with_z_up_is_refused_where_pitch_counts_as_much_as_climb(seed: int) -> None:
    """The correlation of its whole scale does not tell it; the true log, with depths 1 cm off, is not refused."""
    made = dive(seed, 100.0).track
    angles = euler_from_quat(made.q_WB) * [1.0, 6.0, 1.0]
    rng = np.random.default_rng(seed)
    true = replace(made, q_WB=quat_from_euler(*angles.T), altitude_m=1.0 + 0.0 * made.altitude_m)
    at = np.arange(3.0, 97.0)
    motion, _ = predict_motion(true, DOWN, 1.0).between(at[:-1], at[1:])
    motion = motion + rng.normal(scale=0.004, size=motion.shape)
    noise = np.column_stack([np.zeros((len(made.time_s), 2)), rng.normal(scale=0.01, size=len(made.time_s))])
    told = []
    for sign in (1.0, -1.0):
        log = replace(true, position_W_m=(true.position_W_m + noise) * [1.0, 1.0, sign])
        found = find_offset(predict_motion(log, DOWN, 1.0), at, motion, (-5.0, 5.0))
        told.append(found.ambiguous)
    assert found.correlation["scale"] > -0.4
    assert told[0] is None and told[1] is not None and "z_m must rise with depth" in told[1]


def test_clocks_that_do_not_overlap_are_told_in_one_line(tmp_path: Path) -> None:
    """Photographs of another month are refused, with --window as the way out."""
    write_photos(tmp_path / "photos", dive(1, 20.0), -30 * 86_400.0)
    with pytest.raises(InputError, match=r"do not overlap in time.*--window"):
        pick_photos(tmp_path / "photos", dive(1, 20.0).track, PickRequest())


@pytest.mark.slow
def test_a_clock_that_lost_its_date_is_found_in_a_wide_window(tmp_path: Path) -> None:
    """--window of years finds a camera that begins at 1970 again."""
    made = dive(4, 70.0)
    write_photos(tmp_path / "photos", made, 500 * 86_400.0 + 0.4)
    request = PickRequest(window_s=1e9)
    offset = pick_photos(tmp_path / "photos", made.track, request).figures["offset"]
    assert offset["offset_s"] == pytest.approx(500 * 86_400.0 + 0.4, abs=0.1)


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0, 90.0])
def test_the_predicted_motion_is_that_of_points_before_the_camera(tilt_deg: float) -> None:
    """Small steps of a camera move the picture of a plane before it as the integrals say."""
    X_BC = mounted_camera(np.array([0.2, 0.05, 0.1]), tilt_deg)
    n, rng = 21, np.random.default_rng(0)
    time_s = np.arange(n) * 0.05
    angles = np.array([0.02, -0.03, 0.7]) + np.cumsum(rng.normal(scale=2e-4, size=(n, 3)), axis=0)
    track = DiveTrack(
        name="small",
        time_s=time_s,
        position_W_m=np.cumsum(rng.normal(scale=5e-4, size=(n, 3)), axis=0),
        q_WB=quat_from_euler(*angles.T),
        altitude_m=np.full(n, np.nan),
        positions_from="the test",
    )
    predicted, known = predict_motion(track, X_BC, 1.2).between(np.array([0.0]), np.array([1.0]))
    assert known.all()
    from wakewise.vision.photo_selection.dive_track import camera_poses, poses_at

    centre, R_WC = camera_poses(poses_at(track, time_s[[0, -1]]), X_BC)
    grid = np.array([[x, y, 1.0] for x in (-0.01, 0.0, 0.01) for y in (-0.01, 0.0, 0.01)]) * 1.2
    points_W = centre[0] + grid @ R_WC[0].T
    after = (points_W - centre[1]) @ R_WC[1]
    before, seen = grid[:, :2] / 1.2, after[:, :2] / after[:, 2:]
    shift = (seen - before).mean(axis=0)
    z = (before[:, 0] + 1j * before[:, 1], seen[:, 0] + 1j * seen[:, 1])
    similar = np.vdot(z[0] - z[0].mean(), z[1] - z[1].mean()) / np.vdot(z[0] - z[0].mean(), z[0] - z[0].mean())
    assert predicted[0] == pytest.approx([*shift, np.angle(similar), np.log(abs(similar))], abs=2e-4)


def test_the_measured_motion_is_the_shift_turn_and_scale_of_the_pictures(tmp_path: Path) -> None:
    """A picture shifted by 32 of 320 px to the right and turned by 3 deg gives a tenth of a width and 3 deg."""
    import cv2

    picture = dive(0).picture(5.0)
    turn = cv2.getRotationMatrix2D((160, 120), -3.0, 1.05)
    turn[0, 2] += 32.0
    for k, image in enumerate((picture, cv2.warpAffine(picture, turn, (320, 240)))):
        cv2.imwrite(str(tmp_path / f"{k}.png"), image)
    motion = photo_statistics([tmp_path / "0.png", tmp_path / "1.png"])[0].motion[0]
    assert motion == pytest.approx([0.1, 0.0, np.radians(3.0), np.log(1.05)], abs=0.004)


def test_pictures_of_different_places_have_no_motion(tmp_path: Path) -> None:
    """A mirrored picture is no shifted one, and neither is noise."""
    import cv2

    picture = dive(0).picture(5.0)
    noise = np.random.default_rng(0).integers(0, 255, picture.shape, dtype=np.uint8)
    for k, image in enumerate((picture, picture[:, ::-1], noise)):
        cv2.imwrite(str(tmp_path / f"{k}.png"), image)
    statistics, _ = photo_statistics([tmp_path / f"{k}.png" for k in range(3)])
    assert np.isnan(statistics.motion).all()


@pytest.mark.slow
def test_a_camera_that_looks_ahead_and_down_tells_the_offset_too(tmp_path: Path) -> None:
    """A camera tilted by 50 deg, stated as 30 deg: error at most 0.1 s."""
    made = replace(dive(301, 80.0), tilt_deg=50.0)
    write_photos(tmp_path / "photos", made, 3.7)
    request = PickRequest(X_BC=mounted_camera(np.zeros(3), 30.0))
    offset = pick_photos(tmp_path / "photos", made.track, request).figures["offset"]
    assert offset["offset_s"] == pytest.approx(3.7, abs=0.1)


@pytest.mark.slow
def test_a_photograph_every_three_seconds_by_a_clock_of_whole_seconds_is_enough(tmp_path: Path) -> None:
    """Half of the photographs overlap; error at most 0.1 s over five minutes."""
    made = dive(101, 300.0)
    true_s = write_photos(tmp_path / "photos", made, 60.0, every_s=3.0, parts=False)
    found = pick_photos(tmp_path / "photos", made.track, PickRequest())
    assert found.figures["offset"]["pairs"] < len(true_s) * 0.7
    assert found.figures["offset"]["offset_s"] == pytest.approx(60.0, abs=0.1)


@pytest.mark.slow
def test_a_log_at_few_hertz_without_altitude_still_tells_the_offset(tmp_path: Path) -> None:
    """Poses at 4 Hz, no rangefinder, a camera turned a quarter about its axis: error at most 0.15 s."""
    made, true_s = dive(6, 80.0), 40.0
    write_photos(tmp_path / "photos", made, true_s)
    track = made.track
    poor = replace(
        track,
        time_s=track.time_s[::3],
        position_W_m=track.position_W_m[::3],
        q_WB=track.q_WB[::3],
        altitude_m=np.full(len(track.time_s[::3]), np.nan),
    )
    turned = type(DOWN).from_matrix(DOWN.R @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.zeros(3))
    offset = pick_photos(tmp_path / "photos", poor, PickRequest(X_BC=turned)).figures["offset"]
    assert abs(offset["offset_s"] - true_s) <= 0.15

"""Tracked features: moved as the picture moves, ended where it changes, found anew apart; brought to one instant."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import cdist, pdist

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.feature_tracks import (
    LEAST_CONTRAST,
    NO_TRACKS,
    SHORTEST_S,
    FeatureTracks,
    Grey,
    grey_picture,
    replenish,
    track,
)

HEIGHT, WIDTH = 150, 200
APART_PX = 7.0
AFTER_S = 0.2


def texture(seed: int, height: int = HEIGHT, width: int = WIDTH) -> Grey:
    """Smoothed noise with a standard deviation of 40 grey levels."""
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(height, width)), (0, 0), 1.8)
    return np.asarray(np.clip(128.0 + 40.0 * noise / noise.std(), 0, 255), dtype=np.uint8)


def shifted(picture: Grey, right_px: float, down_px: float) -> Grey:
    """The picture moved by a part of a pixel."""
    move = np.array([[1.0, 0.0, right_px], [0.0, 1.0, down_px]])
    size = picture.shape[::-1]
    moved = cv2.warpAffine(picture, move, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return np.asarray(moved, dtype=np.uint8)


def first(picture: Grey, most: int = 150) -> FeatureTracks:
    """Features of a first picture."""
    return replenish(track(NO_TRACKS, picture, AFTER_S), picture, most, APART_PX)


def middle(tracks: FeatureTracks, margin_px: float = 20.0) -> BoolArray:
    """Features a margin from the edge, where the moved picture shows what the first one did."""
    u, v = tracks.pixels.T
    return np.asarray((u > margin_px) & (u < WIDTH - margin_px) & (v > margin_px) & (v < HEIGHT - margin_px))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.7), (-5.25, 0.5), (8.4, 6.6)])
def test_features_move_as_the_picture_moves(shift: tuple[float, float]) -> None:
    """A shift by parts of a pixel is found to 0.1 px by every feature away from the edge, and few of them end."""
    picture = texture(0)
    before = first(picture)
    after = track(before, shifted(picture, *shift), AFTER_S)
    inner = before.ids[middle(before)]
    there = np.isin(after.ids, inner)
    assert there.sum() > max(0.9 * len(inner), 40)
    moved = after.pixels[there] - before.pixels[np.searchsorted(before.ids, after.ids[there])]
    np.testing.assert_allclose(moved, np.broadcast_to(shift, moved.shape), atol=0.1)


def test_a_guess_finds_what_has_moved_far() -> None:
    """A jump of 60 px is followed where it is expected, and not where the guess is NaN."""
    picture = texture(1)
    before = first(picture)
    before = before.kept(middle(before) & (before.pixels[:, 0] < WIDTH - 85))
    guess = before.pixels + np.array([59.0, 1.0])
    guess[::2] = np.nan
    after = track(before, shifted(picture, 60.0, 0.0), AFTER_S, guess)
    right = np.zeros(len(before), np.bool_)
    at = np.searchsorted(before.ids, after.ids)
    right[at] = np.linalg.norm(after.pixels - before.pixels[at] - [60.0, 0.0], axis=1) < 0.1
    assert right[1::2].mean() > 0.9
    assert right[::2].mean() < 0.3


def test_a_feature_that_is_covered_ends() -> None:
    """Under a new patch features end; away from it all go on."""
    picture = texture(2)
    before = first(picture)
    covered = picture.copy()
    covered[40:110, 60:140] = texture(3)[40:110, 60:140]
    after = track(before, covered, AFTER_S)
    u, v = before.pixels.T
    under = (u > 68) & (u < 132) & (v > 48) & (v < 102)
    away = (u < 45) | (u > 155) | (v < 25) | (v > 125)
    kept = np.isin(before.ids, after.ids)
    assert under.sum() >= 15 and away.sum() >= 40
    assert kept[under].mean() <= 0.05
    assert kept[away].all()


@pytest.mark.parametrize("after_s", [0.1, 0.4])
def test_speeds_are_those_of_the_last_step(after_s: float) -> None:
    """A feature's speed is its way since the last picture over the time; new features have none at first."""
    picture = texture(11)
    before = first(picture)
    assert not before.speeds.any()
    after = track(before, shifted(picture, 3.0, -1.5), after_s)
    after = after.kept(middle(after))
    assert len(after) > 40
    np.testing.assert_allclose(
        after.speeds, np.tile([3.0 / after_s, -1.5 / after_s], (len(after), 1)), atol=0.1 / after_s
    )
    way = after.pixels - before.pixels[np.searchsorted(before.ids, after.ids)]
    np.testing.assert_allclose(after.speeds, way / after_s)


def test_two_pictures_of_one_time_give_finite_speeds() -> None:
    """No time between them counts as `SHORTEST_S`."""
    picture = texture(12)
    after = track(first(picture), shifted(picture, 1.0, 0.0), 0.0)
    assert np.abs(after.speeds).max() < 2.0 / SHORTEST_S


def test_new_features_move_as_the_others_do() -> None:
    """Their speed is the median of those that are there, which keep theirs."""
    picture = texture(13)
    few = replenish(track(NO_TRACKS, picture, AFTER_S), picture, 40, 14.0)
    moved = shifted(picture, 2.0, 1.0)
    tracks = track(few, moved, AFTER_S)
    more = replenish(tracks, moved, 120, APART_PX)
    assert len(more) > len(tracks) + 20
    np.testing.assert_array_equal(more.speeds[: len(tracks)], tracks.speeds)
    np.testing.assert_array_equal(
        more.speeds[len(tracks) :], np.tile(np.median(tracks.speeds, axis=0), (len(more) - len(tracks), 1))
    )


ROLLING = CalibratedCamera(width=WIDTH, height=HEIGHT, fx=150.0, fy=150.0, cx=99.5, cy=74.5, readout_s=0.03)


def read_by_rows(places: Array, speeds: Array, camera: CalibratedCamera) -> Array:
    """Pixels where rows are read one after the other, top row first, of what moves in the picture at such speeds.

    `places`: where it is at the middle of the readout. The row that shows it is read while it is there.
    """
    pixels = places
    for _ in range(60):
        read_s = camera.readout_s * ((pixels[:, 1] + 0.5) / camera.height - 0.5)
        pixels = places + read_s[:, None] * speeds
    return pixels


@pytest.mark.parametrize("speed", [(0.0, 0.0), (150.0, 0.0), (0.0, 200.0), (-90.0, -140.0)])
def test_rows_that_were_read_at_different_times_are_brought_to_one_instant(speed: tuple[float, float]) -> None:
    """With constant image speeds the pixels are those at the middle of the readout, to rounding."""
    places = np.random.default_rng(0).uniform([0.0, 0.0], [WIDTH - 1.0, HEIGHT - 1.0], (50, 2))
    speeds = np.array(speed) * np.random.default_rng(1).uniform(0.5, 1.0, (50, 1))
    tracks = FeatureTracks(ids=np.arange(50), pixels=read_by_rows(places, speeds, ROLLING), speeds=speeds)
    np.testing.assert_allclose(tracks.at_middle(ROLLING), places, atol=1e-9)
    np.testing.assert_array_equal(tracks.at_middle(replace(ROLLING, readout_s=0.0)), tracks.pixels)


def test_the_top_row_is_early_and_the_bottom_row_late() -> None:
    """What moves right is seen too far left at the top and too far right at the bottom, and at its place midway."""
    pixels = np.array([[50.0, -0.5], [50.0, 0.5 * HEIGHT - 0.5], [50.0, HEIGHT - 0.5]])
    tracks = FeatureTracks(ids=np.arange(3), pixels=pixels, speeds=np.tile([100.0, 0.0], (3, 1)))
    np.testing.assert_allclose(tracks.at_middle(ROLLING) - pixels, [[1.5, 0.0], [0.0, 0.0], [-1.5, 0.0]], atol=1e-12)
    assert NO_TRACKS.at_middle(ROLLING).shape == (0, 2)


@pytest.mark.parametrize("way", [(8.0, 0.0), (0.0, 6.0), (-5.0, 4.0)])
def test_tracked_features_of_a_rolling_shutter_are_brought_to_one_instant(way: tuple[float, float]) -> None:
    """Pictures that were sheared by the readout give the pixels of the whole ones, which moved evenly, to 0.15 px."""
    scene, speed = texture(14), np.array(way) / AFTER_S

    def taken(at_s: float) -> Grey:
        u, v = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
        time_s = at_s + ROLLING.readout_s * ((v + 0.5) / HEIGHT - 0.5)
        x, y = (u - speed[0] * time_s).astype(np.float32), (v - speed[1] * time_s).astype(np.float32)
        return np.asarray(cv2.remap(scene, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT), dtype=np.uint8)

    before = first(taken(0.0))
    before = replace(before, speeds=np.tile(speed, (len(before), 1)))
    after = track(before, taken(AFTER_S), AFTER_S)
    after = after.kept(middle(after))
    assert len(after) > 40
    start = before.at_middle(ROLLING)[np.searchsorted(before.ids, after.ids)]
    np.testing.assert_allclose(after.at_middle(ROLLING) - start, np.tile(way, (len(after), 1)), atol=0.15)


@pytest.mark.parametrize("noise", [0.0, 0.5 * LEAST_CONTRAST])
def test_a_uniform_picture_has_no_features(noise: float) -> None:
    """Grey levels that vary by less than the sensor's noise give no corners."""
    grey = 90.0 + noise * np.random.default_rng(0).normal(size=(HEIGHT, WIDTH))
    assert len(first(np.round(grey).astype(np.uint8))) == 0


def test_new_features_keep_their_distance_and_their_number() -> None:
    """Apart from each other by the distance, from earlier ones by it but for rounding to pixels; never too many."""
    picture = texture(4)
    wide = replenish(track(NO_TRACKS, picture, AFTER_S), picture, 40, 14.0)
    assert 20 < len(wide) <= 40
    assert pdist(wide.pixels).min() >= 14.0
    more = replenish(wide, picture, 120, APART_PX)
    new = more.pixels[len(wide) :]
    np.testing.assert_array_equal(more.pixels[: len(wide)], wide.pixels)
    assert len(wide) + 20 < len(more) <= 120
    assert pdist(new).min() >= APART_PX
    assert cdist(new, wide.pixels).min() >= APART_PX - 1.0
    assert replenish(more, picture, len(more), APART_PX) is more


def test_new_features_lie_where_they_are_wanted() -> None:
    """A mask keeps them out of where it is 0, and is not changed."""
    picture = texture(5)
    where = np.zeros((HEIGHT, WIDTH), np.uint8)
    where[30:90, 50:170] = 255
    given = where.copy()
    found = replenish(track(NO_TRACKS, picture, AFTER_S), picture, 100, APART_PX, where)
    u, v = found.pixels.astype(int).T
    assert len(found) > 20
    assert where[v, u].all()
    np.testing.assert_array_equal(where, given)


def test_stronger_corners_are_fewer() -> None:
    """The least cornerness rises with the share of the best that is asked for."""
    picture = texture(6)
    count = [len(replenish(track(NO_TRACKS, picture, AFTER_S), picture, 500, 4.0, quality=q)) for q in (0.01, 0.3, 0.8)]
    assert count[0] > count[1] > count[2] > 0


def test_a_number_is_given_once() -> None:
    """Over pictures in which features end and others are found, no number comes back and each is held once."""
    tracks, gone, alive = NO_TRACKS, set[int](), set[int]()
    for k in range(6):
        picture = texture(7 + k // 2)
        tracks = track(tracks, picture, AFTER_S)
        ended = alive - set(tracks.ids.tolist())
        gone |= ended
        tracks = replenish(tracks, picture, 60, APART_PX)
        alive = set(tracks.ids.tolist())
        assert len(alive) == len(tracks) > 20
        assert not alive & gone
        assert max(alive) < tracks.next_id
    assert len(gone) > 60


def test_chosen_features_keep_their_numbers_and_places() -> None:
    """`kept` leaves picture and next number as they are."""
    tracks = first(texture(8))
    tracks = replace(tracks, speeds=np.random.default_rng(0).normal(size=(len(tracks), 2)))
    which = tracks.ids % 3 == 0
    some = tracks.kept(which)
    np.testing.assert_array_equal(some.ids, tracks.ids[which])
    np.testing.assert_array_equal(some.pixels, tracks.pixels[which])
    np.testing.assert_array_equal(some.speeds, tracks.speeds[which])
    assert (some.next_id, some.picture) == (tracks.next_id, tracks.picture)


def test_a_picture_of_another_size_ends_all_tracks() -> None:
    """None is kept, the picture is the new one, and numbers go on from where they were."""
    tracks = first(texture(9))
    other = texture(9, HEIGHT + 10, WIDTH)
    after = track(tracks, other, AFTER_S)
    assert len(after) == 0
    assert after.picture is other
    again = replenish(after, other, 30, APART_PX)
    assert again.ids.min() == tracks.next_id > 0


def test_grey_pictures_stay_and_colours_are_mixed() -> None:
    """Grey is kept as it is; equal colours are that grey; green is brighter than red, and red than blue."""
    grey = texture(10)
    np.testing.assert_array_equal(grey_picture(grey), grey)
    np.testing.assert_array_equal(grey_picture(np.repeat(grey[:, :, None], 3, axis=2)), grey)
    red, green, blue = (grey_picture(np.full((16, 16, 3), 200 * np.eye(3)[k], np.uint8))[0, 0] for k in range(3))
    assert green > red > blue > 0
    assert grey_picture(grey[:, ::-1]).flags.c_contiguous


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((20, 24)),
        np.zeros((20, 24), np.uint16),
        np.zeros((20, 24), np.bool_),
        np.zeros(400, np.uint8),
        np.zeros((2, 20, 24, 3), np.uint8),
        np.zeros((15, 24), np.uint8),
        np.zeros((20, 15, 3), np.uint8),
        np.zeros((20, 24, 1), np.uint8),
        np.zeros((20, 24, 4), np.uint8),
    ],
)
def test_other_arrays_are_no_pictures(wrong: NDArray[Any]) -> None:
    """Only uint8 of (h, w) or (h, w, 3) from 16 px on is taken; the message says so."""
    with pytest.raises(InputError, match=r"picture: .*needs"):
        grey_picture(wrong)

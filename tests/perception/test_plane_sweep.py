"""Sweeps of planes: depths are right to what they say, and there are none where the pictures do not tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from perception_cases import disturbed, looking, pixels_of

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.geometry import Pose
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.feature_tracks import Grey
from wakewise.perception.plane_sweep import (
    DEPTH_PX,
    DEPTHS,
    PlaneSweep,
    SweptDepth,
    Window,
    begin_sweep,
    compared,
    places_of,
    sweep_view,
    swept_depth,
)

CAMERA = CalibratedCamera(width=240, height=180, fx=200.0, fy=200.0, cx=119.5, cy=89.5)
LENS = replace(CAMERA, distortion=(-0.25, 0.06, 0.002, -0.001))
SHUTTER = replace(CAMERA, readout_s=0.03)
WINDOW: Window = (60, 40, 180, 140)
NEAR_M, FAR_M = 0.45, 1.0
AHEAD = np.array([1.0, 0.0, 0.0])
EYES = np.array([[0.0, 0.0, 0.0], [0.0, 0.07, 0.0], [0.0, -0.06, 0.03], [0.0, 0.02, -0.08]])
ACROSS, DOWN = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
TEXEL_M, TEXELS = 0.002, 1024


def texture(seed: int, blur_px: float = 1.5) -> Grey:
    """Smooth grey noise."""
    noise = np.random.default_rng(seed).normal(size=(TEXELS, TEXELS))
    smooth = np.asarray(cv2.GaussianBlur(noise, (0, 0), blur_px))
    return np.asarray(np.clip(128.0 + 35.0 * smooth / smooth.std(), 0, 255), dtype=np.uint8)


SAND, STONE = texture(1), texture(2)


class Board:
    """A textured plane through a place, with its sides along two directions; of endless or of some half width."""

    def __init__(self, at_W_m: Array, across_W: Array, down_W: Array, grey: Grey, half_m: float = np.inf) -> None:
        self.at_W_m, self.grey, self.half_m = at_W_m, grey, half_m
        self.across_W, self.down_W = (way / np.linalg.norm(way) for way in (across_W, down_W))
        self.normal_W = np.cross(self.across_W, self.down_W)

    def hit(self, start_W_m: Array, ray_W: Array) -> tuple[Array, Array]:
        """How far along rays the board is, infinite where they miss it, and its greys there."""
        far = (self.at_W_m - start_W_m) @ self.normal_W / (ray_W @ self.normal_W)
        place = start_W_m + far[..., None] * ray_W - self.at_W_m
        u, v = place @ self.across_W, place @ self.down_W
        on = (far > 0.0) & (np.maximum(abs(u), abs(v)) < self.half_m)
        at = [(way / TEXEL_M + 0.5 * TEXELS).astype(np.float32) for way in (u, v)]
        grey = cv2.remap(self.grey, at[0], at[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        return np.where(on, far, np.inf), np.asarray(grey, dtype=np.float64)


FACING = Board(0.65 * AHEAD, ACROSS, DOWN, SAND)
SLANTED = Board(0.65 * AHEAD, np.array([0.4, 1.0, 0.0]), np.array([-0.25, 0.0, 1.0]), SAND)
RAISED = [Board(0.85 * AHEAD, ACROSS, DOWN, SAND), Board(0.6 * AHEAD, ACROSS, DOWN, STONE, half_m=0.06)]


def shown(
    boards: Sequence[Board],
    X_WC: Pose,
    camera: CalibratedCamera = CAMERA,
    noise: float = 1.5,
    way_m_s: Array | None = None,
) -> tuple[Grey, Array]:
    """Picture of boards, and their depths; while a rolling shutter reads it the camera moves."""
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).astype(np.float64)
    slopes = camera.slopes(grid.reshape(-1, 2)).reshape(grid.shape)
    ray_W = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=2) @ X_WC.R.T
    start = np.zeros_like(ray_W) + X_WC.p_m
    if way_m_s is not None:
        late_s = camera.readout_s * ((np.arange(camera.height) + 0.5) / camera.height - 0.5)
        start = start + late_s[:, None, None] * way_m_s
    depths, greys = zip(*(board.hit(start, ray_W) for board in boards), strict=True)
    first = np.argmin(depths, axis=0)[None]
    grey = np.take_along_axis(np.array(greys), first, axis=0)[0]
    grey += noise * np.random.default_rng(round(1e6 * abs(X_WC.p_m).sum())).normal(size=grey.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8), np.min(depths, axis=0)


def poses(eyes: Array = EYES, at_W_m: Array = 0.65 * AHEAD) -> list[Pose]:
    """Cameras at some places that look at one."""
    return [looking(eye, at_W_m) for eye in eyes]


def begun(
    pictures: Sequence[Grey], X_WC: Sequence[Pose], camera: CalibratedCamera = CAMERA, window: Window = WINDOW
) -> PlaneSweep:
    """A sweep of the first picture by the others."""
    views = [sweep_view(picture, pose, camera) for picture, pose in zip(pictures, X_WC, strict=True)]
    return begin_sweep(views[0], views[1:], window, NEAR_M, FAR_M)


def finished(sweep: PlaneSweep, camera: CalibratedCamera = CAMERA) -> SweptDepth:
    """The depths when all pictures were compared."""
    while not sweep.done:
        sweep = compared(sweep, camera)
    return swept_depth(sweep, camera)


def swept_over(boards: Sequence[Board], window: Window = WINDOW, eyes: Array = EYES) -> tuple[SweptDepth, Array]:
    """Depths of boards, and the true ones."""
    X_WC = poses(eyes)
    pictures, depths = zip(*(shown(boards, pose) for pose in X_WC), strict=True)
    return finished(begun(pictures, X_WC, window=window)), cut(depths[0], window)


def cut(values: Array, window: Window = WINDOW) -> Array:
    """What is in a window."""
    left, top, right, bottom = window
    return values[top:bottom, left:right]


def share(swept: SweptDepth) -> float:
    """Share of the pixels that have a depth."""
    return float(np.isfinite(swept.depth_m).mean())


def misses(swept: SweptDepth, true_m: Array) -> Array:
    """Errors over stated standard deviations of the pixels that have a depth."""
    known = np.isfinite(swept.depth_m)
    return np.asarray((swept.depth_m - true_m)[known] / swept.std_m[known])


def inner(depths: Array) -> BoolArray:
    """The pixels with no step of depth within 3 px: beside one a window sees both sides."""
    near, far = (np.asarray(change(depths.astype(np.float32), np.ones((7, 7)))) for change in (cv2.erode, cv2.dilate))
    return np.asarray(far - near < 0.05)


@pytest.mark.parametrize("others", [2, 3])
@pytest.mark.parametrize("boards", [[FACING], [SLANTED]], ids=["facing", "slanted"])
def test_depths_of_a_plane_are_right_to_their_standard_deviation(boards: list[Board], others: int) -> None:
    """Nine pixels of ten have one; their errors have no bias, and are no larger than stated, nor nothing."""
    swept, true_m = swept_over(boards, eyes=EYES[: others + 1])
    assert share(swept) > 0.85
    miss = misses(swept, true_m)
    assert abs(np.mean(miss)) < 0.15
    assert 0.03 < np.sqrt(np.mean(miss**2)) < 1.0
    assert np.mean(abs(miss) > 3.0) < 0.001


def test_the_standard_deviation_is_that_of_the_picture_farthest_off() -> None:
    """It grows with the square of the depth, and is `DEPTH_PX` of that picture; it is known where the depth is."""
    swept, _ = swept_over([SLANTED])
    farthest = np.linalg.norm(EYES[1:] - EYES[0], axis=1).max()
    np.testing.assert_allclose(swept.std_m, DEPTH_PX * swept.depth_m**2 / (200.0 * farthest))
    near_half, _ = swept_over([SLANTED], eyes=np.concatenate([EYES[:1], 0.5 * EYES[1:]]))
    both = np.isfinite(near_half.depth_m) & np.isfinite(swept.depth_m)
    assert np.median(near_half.std_m[both] / swept.std_m[both]) == pytest.approx(2.0, rel=0.03)


def test_a_small_raised_square_stands_out() -> None:
    """It and what lies behind have their own depths; off the step no depth is wrong."""
    swept, true_m = swept_over(RAISED)
    flat = inner(cv2.copyMakeBorder(true_m, 3, 3, 3, 3, cv2.BORDER_REPLICATE))[3:-3, 3:-3]
    for depth in (0.6, 0.85):
        there = swept.depth_m[flat & (abs(true_m - depth) < 0.02)]
        assert np.isfinite(there).mean() > 0.8
        assert np.nanmedian(there) == pytest.approx(depth, abs=0.004)
    off = np.where(flat, swept.depth_m, np.nan) - true_m
    assert np.nanmean(abs(off) > 4.0 * swept.std_m) < 0.002


def test_a_uniform_window_has_no_depth() -> None:
    """Neither one of equal greys nor one with the sensor's noise alone."""
    X_WC = poses()
    for noise in (0.0, 2.0):
        blank = Board(0.65 * AHEAD, ACROSS, DOWN, np.full_like(SAND, 120))
        swept = finished(begun([shown([blank], pose, noise=noise)[0] for pose in X_WC], X_WC))
        assert not np.isfinite(swept.depth_m).any()
        assert not np.isfinite(swept.std_m).any()
        points, std = places_of(swept, CAMERA)
        assert points.shape == (0, 3) and std.shape == (0,)


def test_a_faint_texture_has_no_depth() -> None:
    """Below `LEAST_TEXTURE` a patch shows nothing, though its pictures agree; above, it does."""
    X_WC = poses()
    for contrast, most, least in ((0.04, 0.05, 0.0), (0.6, 1.0, 0.85)):
        faint = np.round(128.0 + contrast * (SAND - 128.0)).astype(np.uint8)
        pictures = [shown([Board(0.65 * AHEAD, ACROSS, DOWN, faint)], pose, noise=0.0)[0] for pose in X_WC]
        assert least <= share(finished(begun(pictures, X_WC))) <= most


def wrong_beside(blank: Board, boards: Sequence[Board]) -> float:
    """Share of the depths, off the steps of depth, that are wrong where a blank is part of what is seen."""
    swept, true_m = swept_over([blank, *boards])
    known = np.isfinite(swept.depth_m) & inner(true_m)
    return float(np.mean(abs(swept.depth_m - true_m)[known] > 4.0 * swept.std_m[known]))


def test_correlations_are_no_more_than_one() -> None:
    """Also where a picture's edge or that of something textured before a blank runs through a window."""
    X_WC, water = poses(), Board(0.85 * AHEAD, ACROSS, DOWN, np.full_like(SAND, 30))
    sweep = begun([shown([water, RAISED[1]], pose)[0] for pose in X_WC], X_WC)
    assert compared(sweep, CAMERA).scores[0].max() < 1.05


def test_there_are_no_wrong_depths_about_something_before_dark_water() -> None:
    """At most one in a hundred is wrong off the silhouette."""
    assert wrong_beside(Board(0.85 * AHEAD, ACROSS, DOWN, np.full_like(SAND, 30)), [RAISED[1]]) < 0.01


@pytest.mark.parametrize("window", [(0, 0, 80, 180), (160, 0, 240, 180)], ids=["left", "right"])
def test_a_window_at_the_edge_of_the_picture_has_no_wrong_depths(window: Window) -> None:
    """What is outside the other pictures has no depth; at most one in 300 is wrong."""
    swept, true_m = swept_over([SLANTED], window)
    assert np.mean(abs(misses(swept, true_m)) > 4.0) < 1.0 / 300.0


@pytest.mark.parametrize("window", [(0, 0, 80, 180), (160, 0, 240, 180)], ids=["left", "right"])
def test_a_window_at_the_edge_of_the_picture_has_its_depths(window: Window) -> None:
    """Its shape is that of the window, most pixels have a depth, and nearly all of these are right."""
    swept, true_m = swept_over([SLANTED], window)
    assert swept.depth_m.shape == swept.std_m.shape == (180, 80)
    assert share(swept) > 0.6
    assert np.percentile(abs(misses(swept, true_m)), 95.0) < 2.0


def test_a_picture_that_shows_something_else_does_not_spoil_the_depth() -> None:
    """Of three others one is hidden; of two this is too many."""
    X_WC = poses()
    pictures, depths = zip(*(shown([SLANTED], pose) for pose in X_WC), strict=True)
    true_m = cut(depths[0])
    hidden = shown([Board(0.3 * AHEAD, ACROSS, DOWN, STONE)], X_WC[2])[0]
    for at in (1, 2, 3):
        mixed = [hidden if k == at else picture for k, picture in enumerate(pictures)]
        swept = finished(begun(mixed, X_WC))
        assert share(swept) > 0.7
        assert np.mean(abs(misses(swept, true_m)) > 3.0) < 0.005
    assert share(finished(begun([pictures[0], pictures[1], hidden], X_WC[:3]))) < 0.15


def test_lens_distortion_is_taken_out() -> None:
    """Depths by pictures with it are as good as without; taken for pictures without, they are wrong or none."""
    X_WC, window = poses(), (20, 15, 220, 165)
    pictures = [shown([SLANTED], pose, LENS)[0] for pose in X_WC]
    true_m = cut(shown([SLANTED], X_WC[0])[1], window)
    swept = finished(begun(pictures, X_WC, LENS, window), LENS)
    assert share(swept) > 0.8
    miss = misses(swept, true_m)
    assert abs(np.mean(miss)) < 0.15
    assert np.mean(abs(miss) > 3.0) < 0.01
    bent = finished(begun(pictures, X_WC, CAMERA, window))
    assert np.mean(abs(misses(bent, true_m)) > 1.0) > 3.0 * np.mean(abs(miss) > 1.0)


def test_a_rolling_shutters_shear_is_taken_out() -> None:
    """Given the speed of what moves over the picture depths are right, when each picture moves its own way."""
    X_WC, ways = poses(), 0.5 * np.array([[0.0, 1.0, 0.4], [0.0, -1.0, 0.0], [0.0, 0.3, -1.0], [0.0, -0.5, 1.0]])
    taken = [shown([FACING], pose, SHUTTER, way_m_s=way) for pose, way in zip(X_WC, ways, strict=True)]
    true_m = cut(shown([FACING], X_WC[0])[1])
    speeds = [
        (pixels_of((0.65 * AHEAD)[None] - 1e-3 * way, pose, SHUTTER)[0] - [119.5, 89.5]) / 1e-3
        for pose, way in zip(X_WC, ways, strict=True)
    ]
    straight, sheared = (
        [
            sweep_view(picture, pose, SHUTTER, speed if given else None)
            for (picture, _), pose, speed in zip(taken, X_WC, speeds, strict=True)
        ]
        for given in (True, False)
    )
    swept = finished(begin_sweep(straight[0], straight[1:], WINDOW, NEAR_M, FAR_M), SHUTTER)
    assert share(swept) > 0.85
    assert np.sqrt(np.mean(misses(swept, true_m) ** 2)) < 0.7
    bent = finished(begin_sweep(sheared[0], sheared[1:], WINDOW, NEAR_M, FAR_M), SHUTTER)
    assert np.sqrt(np.mean(misses(bent, true_m) ** 2)) > 1.5 or share(bent) < 0.5


def test_a_global_shutter_needs_no_speed() -> None:
    """The speed changes nothing of its pictures."""
    picture = shown([FACING], poses()[0])[0]
    still, moved = (sweep_view(picture, poses()[0], CAMERA, speed) for speed in (None, np.array([90.0, -40.0])))
    np.testing.assert_array_equal(still.levels, moved.levels)
    np.testing.assert_array_equal(still.levels, picture)


def test_wrong_poses_give_few_depths() -> None:
    """Cameras turned by two degrees, each its own way, leave at most a tenth of the pixels one."""
    X_WC = poses()
    pictures = [shown([SLANTED], pose)[0] for pose in X_WC]
    turns = 0.035 * np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, -1.0, 1.0]])
    turned = [disturbed(pose, np.zeros(3), turn) for pose, turn in zip(X_WC, turns, strict=True)]
    assert share(finished(begun(pictures, X_WC))) > 0.85
    assert share(finished(begun(pictures, turned))) < 0.1


@pytest.mark.parametrize("period", [8, 14])
def test_a_texture_that_repeats_gives_few_depths(period: int) -> None:
    """Stripes agree at more depths than one: where all cameras lie across them few pixels have one."""
    wave = 128.0 + 60.0 * np.sin(2.0 * np.pi * np.arange(TEXELS) / period)
    stripes = Board(0.65 * AHEAD, ACROSS, DOWN, np.tile(wave, (TEXELS, 1)).astype(np.uint8))
    row = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.2, 0.0], [0.0, -0.1, 0.0]])
    swept, _ = swept_over([stripes], eyes=row)
    assert share(swept) < 0.3
    plain, _ = swept_over([FACING], eyes=row)
    assert share(plain) > 0.8


@pytest.mark.parametrize(("far_m", "most"), [(0.35, 0.2), (1.01, 0.05), (1.2, 0.01), (2.5, 0.01)])
def test_depths_outside_the_sweep_give_few(far_m: float, most: float) -> None:
    """What lies farther than the farthest plane has none; what is near, and so looks smooth, agrees here and there."""
    swept, _ = swept_over([Board(far_m * AHEAD, ACROSS, DOWN, SAND)])
    assert share(swept) < most


def test_pictures_are_compared_one_by_one() -> None:
    """A sweep is done when all were; it is a new record each time, with scores of the window at each depth."""
    X_WC = poses()
    sweep = begun([shown([FACING], pose)[0] for pose in X_WC], X_WC)
    assert sweep.inverse_m[0] == pytest.approx(1.0 / NEAR_M) and sweep.inverse_m[-1] == pytest.approx(1.0 / FAR_M)
    np.testing.assert_allclose(np.diff(sweep.inverse_m, 2), 0.0, atol=1e-12)
    for count in range(3):
        assert len(sweep.scores) == count and not sweep.done
        after = compared(sweep, CAMERA)
        assert len(sweep.scores) == count
        assert after.scores[:count] == sweep.scores
        sweep = after
    assert sweep.done
    assert all(score.shape == (DEPTHS, 100, 120) for score in sweep.scores)


def test_the_order_of_the_other_pictures_does_not_matter() -> None:
    """Depths are the same to rounding."""
    X_WC = poses()
    pictures = [shown([SLANTED], pose)[0] for pose in X_WC]
    one, other = (
        finished(begun([pictures[k] for k in order], [X_WC[k] for k in order]))
        for order in ([0, 1, 2, 3], [0, 3, 1, 2])
    )
    both = np.isfinite(one.depth_m) & np.isfinite(other.depth_m)
    assert both.mean() > 0.999 * np.isfinite(one.depth_m).mean()
    np.testing.assert_allclose(one.depth_m[both], other.depth_m[both], rtol=1e-4)


def test_a_picture_brought_to_the_reference_at_its_depth_agrees_with_it() -> None:
    """A board that faces the reference has its best score at its depth, about 1, for each of the other pictures."""
    X_WC = poses()
    sweep = begun([shown([FACING], pose)[0] for pose in X_WC], X_WC)
    while not sweep.done:
        sweep = compared(sweep, CAMERA)
    at = int(np.argmin(abs(sweep.inverse_m - 1.0 / 0.65)))
    for score in sweep.scores:
        typical = np.median(score, axis=(1, 2))
        assert abs(int(typical.argmax()) - at) <= 1
        assert 0.8 < typical.max() < 1.05


def test_places_are_those_of_the_pixels_in_the_world() -> None:
    """They lie on the board, project to their pixels, and keep their standard deviations."""
    swept, _ = swept_over([SLANTED])
    points, std = places_of(swept, CAMERA)
    row, column = np.nonzero(np.isfinite(swept.depth_m))
    assert points.shape == (len(row), 3)
    np.testing.assert_array_equal(std, swept.std_m[row, column])
    np.testing.assert_allclose(
        pixels_of(points, swept.X_WC, CAMERA), np.stack([column + 60, row + 40], axis=1), atol=1e-6
    )
    off = (points - SLANTED.at_W_m) @ SLANTED.normal_W
    assert abs(np.median(off)) < 0.001
    assert np.percentile(abs(off), 95.0) < 0.01


def test_places_of_a_turned_camera_are_exact() -> None:
    """A few depths set by hand give the world places of those pixels' rays; pixels without a depth give none."""
    X_WC, window = looking(np.array([0.3, -0.2, -0.4]), np.array([1.0, 0.4, 0.5])), (10, 20, 13, 22)
    depth = np.array([[0.5, np.nan, 0.7], [np.nan, 0.9, np.nan]])
    points, std = places_of(SweptDepth(X_WC=X_WC, window=window, depth_m=depth, std_m=0.01 * depth), CAMERA)
    pixels = np.array([[10.0, 20.0], [12.0, 20.0], [11.0, 21.0]])
    z = np.array([0.5, 0.7, 0.9])
    p_C = np.column_stack([CAMERA.slopes(pixels) * z[:, None], z])
    np.testing.assert_allclose(points, [X_WC.apply(p) for p in p_C], atol=1e-12)
    np.testing.assert_allclose(std, 0.01 * z)


def test_straightening_says_where_straight_pixels_lie() -> None:
    """Each pixel of a picture without distortion shows the ray that the camera sees where the map says."""
    across, down = LENS.straightening
    assert across.shape == down.shape == (180, 240)
    assert across.dtype == down.dtype == np.float32
    grid = np.stack(np.meshgrid(np.arange(240.0), np.arange(180.0)), axis=-1).reshape(-1, 2)
    rays = np.column_stack([CAMERA.slopes(grid), np.ones(len(grid))])
    np.testing.assert_allclose(np.stack([across.ravel(), down.ravel()], axis=1), LENS.pixels(rays), atol=1e-3)


def test_straightening_without_distortion_leaves_pixels_where_they_are() -> None:
    """The map is the grid of the pixels."""
    across, down = CAMERA.straightening
    np.testing.assert_allclose(across, np.tile(np.arange(240.0), (180, 1)), atol=1e-4)
    np.testing.assert_allclose(down, np.tile(np.arange(180.0)[:, None], (1, 240)), atol=1e-4)

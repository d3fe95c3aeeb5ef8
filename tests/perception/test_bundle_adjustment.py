"""Bundle adjustment: relative poses and the lens from pixels, scale and frame from the priors, SciPy's least cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from perception_cases import CAMERA, adjusted_whole, disturbed, looking, pixels_of, turn_between
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, IntArray
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.perception.bundle_adjustment import (
    CAUCHY_PX,
    DAMPING,
    LEAST_VIEWS,
    LENS,
    LENS_STD,
    MOST_POINTS,
    PIXEL_STD,
    POSE,
    BundleAdjustment,
    Keyframe,
    after_round,
    begin_adjustment,
    lens_numbers,
    with_lens,
)
from wakewise.perception.bundle_kernels import LEAST_AHEAD_M, invert, normal_equations, observed
from wakewise.perception.calibrated_camera import CalibratedCamera

MIDDLE = np.array([0.8, 0.0, 1.5])
PLACES = MIDDLE + np.random.default_rng(0).uniform([-0.3, -0.3, -0.15], [0.3, 0.3, 0.15], (60, 3))
TRUE = [
    looking(np.array([0.1 * np.cos(2.0 * k), y, 1.0 + 0.1 * np.sin(1.3 * k)]), MIDDLE)
    for k, y in enumerate(np.linspace(-0.4, 0.4, 8))
]
STD = (0.01, 0.01)
UNBENT = np.zeros(LENS)
BENT = replace(CAMERA, fx=480.0, fy=510.0, distortion=(-0.21, 0.06, 0.002, -0.003))
FIRST_ID = 5


def noisy(seed: int, poses: list[Pose] = TRUE, std: tuple[float, float] = STD) -> list[Pose]:
    """Poses with the stated errors."""
    rng = np.random.default_rng(seed)
    return [disturbed(X_WC, std[0] * rng.normal(size=3), std[1] * rng.normal(size=3)) for X_WC in poses]


def keyframes(
    estimates: list[Pose],
    places: Array = PLACES,
    noise_px: float = 0.0,
    std: tuple[float, float] = STD,
    true: list[Pose] = TRUE,
    camera: CalibratedCamera = CAMERA,
) -> list[Keyframe]:
    """Keyframes of the true cameras, with estimates of their poses, features in another order in each."""
    rng, frames = np.random.default_rng(99), []
    for k, (X_WC, estimate) in enumerate(zip(true, estimates, strict=False)):
        order = rng.permutation(len(places))
        pixels = pixels_of(places, X_WC, camera) + noise_px * rng.normal(size=(len(places), 2))
        frames.append(
            Keyframe(time_s=0.5 * k, X_WC=estimate, prior=estimate, std=std, ids=order + FIRST_ID, pixels=pixels[order])
        )
    return frames


def first_places(places: Array = PLACES, std_m: float = 0.01) -> tuple[IntArray, Array]:
    """Numbers of the features and their places with errors."""
    off = std_m * np.random.default_rng(98).normal(size=places.shape)
    return FIRST_ID + np.arange(len(places)), places + off


def begun(
    frames: Sequence[Keyframe],
    known: tuple[IntArray, Array] | None = None,
    camera: CalibratedCamera = CAMERA,
    lens: Array = UNBENT,
) -> BundleAdjustment:
    """The adjustment before its first round, of `first_places` if no others are given."""
    found = begin_adjustment(frames, *(first_places() if known is None else known), camera, lens)
    assert found is not None
    return found


def adjusted(frames: Sequence[Keyframe], known: tuple[IntArray, Array] | None = None) -> list[Pose]:
    """Poses after the whole adjustment."""
    return [frame.X_WC for frame in adjusted_whole(begun(frames, known)).adjusted_frames()]


def relative_errors(found: list[Pose]) -> tuple[float, float]:
    """Largest errors of the poses relative to the first: of place up to one scale, m, and of attitude, rad."""
    ways = np.array([found[0].inverse().apply(X_WC.p_m) for X_WC in found])
    wanted = np.array([TRUE[0].inverse().apply(X_WC.p_m) for X_WC in TRUE])
    scale = float(np.sum(ways * wanted) / np.sum(ways * ways))
    turns = [
        turn_between(found[0].inverse() @ one, TRUE[0].inverse() @ other)
        for one, other in zip(found, TRUE, strict=True)
    ]
    return float(np.linalg.norm(scale * ways - wanted, axis=1).max()), float(np.linalg.norm(turns, axis=1).max())


@pytest.mark.parametrize("seed", range(4))
def test_exact_pixels_give_the_true_relative_poses(seed: int) -> None:
    """Errors of 1 cm and 0.6 degrees per axis shrink more than twentyfold, up to the scale, which is the priors'."""
    estimates = noisy(seed)
    before, after = relative_errors(estimates), relative_errors(adjusted(keyframes(estimates)))
    assert after[0] < before[0] / 20.0
    assert after[1] < before[1] / 20.0


def test_outlying_pixels_matter_little() -> None:
    """With one pixel in ten far off, and others off by 0.3 px, attitudes still come back five times better."""
    estimates, rng = noisy(5), np.random.default_rng(6)
    frames = []
    for frame in keyframes(estimates, noise_px=0.3):
        pixels = frame.pixels.copy()
        pixels[:6] += rng.uniform(30.0, 80.0, (6, 2))
        frames.append(replace(frame, pixels=pixels))
    before, after = relative_errors(estimates), relative_errors(adjusted(frames))
    assert after[0] < before[0] / 5.0
    assert after[1] < before[1] / 5.0


def test_keyframes_keep_all_but_their_poses() -> None:
    """Times, standard deviations, features and their order are those that were given."""
    frames = keyframes(noisy(0))
    for given, found in zip(frames, adjusted_whole(begun(frames)).adjusted_frames(), strict=True):
        assert (given.time_s, given.std) == (found.time_s, found.std)
        np.testing.assert_array_equal(given.ids, found.ids)
        np.testing.assert_array_equal(given.pixels, found.pixels)


@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_what_is_true_stays_where_it_is(camera: CalibratedCamera) -> None:
    """Poses, lens and points do not move where they and the pixels are exact."""
    found = adjusted_whole(begun(keyframes(TRUE, camera=camera), first_places(std_m=0.0), camera))
    for pose, X_WC in zip(TRUE, found.poses, strict=True):
        np.testing.assert_allclose(X_WC.p_m, pose.p_m, atol=1e-6)
        np.testing.assert_allclose(turn_between(X_WC, pose), 0.0, atol=1e-6)
    np.testing.assert_allclose(found.points_W_m, PLACES, atol=1e-6)
    np.testing.assert_allclose(found.lens, 0.0, atol=1e-6)


def test_the_priors_set_the_frame() -> None:
    """Priors and first places in a frame that is moved and turned give the same poses and lens in that frame."""
    X_VW = Pose(np.array([2.0, -1.0, 0.5]), quat_from_euler(0.1, -0.2, 2.0))
    estimates, (ids, places) = noisy(1), first_places()
    one = adjusted_whole(begun(keyframes(estimates)))
    other = adjusted_whole(begun(keyframes([X_VW @ X_WC for X_WC in estimates]), (ids, X_VW.apply(places))))
    for here, there in zip(one.poses, other.poses, strict=True):
        np.testing.assert_allclose(there.p_m, X_VW.apply(here.p_m), atol=1e-6)
        np.testing.assert_allclose(turn_between(there, X_VW @ here), 0.0, atol=1e-6)
    np.testing.assert_allclose(other.lens, one.lens, atol=1e-6)
    np.testing.assert_allclose(other.points_W_m, X_VW.apply(one.points_W_m), atol=1e-6)


def test_a_certain_pose_stays_and_others_follow_it() -> None:
    """Two cameras that are known to a micrometre fix frame and scale for all others."""
    last = len(TRUE) - 1
    frames = [
        replace(frame, std=(1e-6, 1e-6)) if k in {0, last} else frame
        for k, frame in enumerate(keyframes([TRUE[0], *noisy(2)[1:-1], TRUE[-1]]))
    ]
    for pose, X_WC in zip(TRUE, adjusted(frames), strict=True):
        np.testing.assert_allclose(X_WC.p_m, pose.p_m, atol=5e-4)
        np.testing.assert_allclose(turn_between(X_WC, pose), 0.0, atol=1e-3)


def test_features_that_were_seen_seldom_do_not_matter() -> None:
    """Wrong pixels of features in fewer than `LEAST_VIEWS` pictures, and of ones without a place, change nothing."""
    frames, (ids, places) = keyframes(noisy(3)), first_places()
    seldom, more = 400 + np.arange(6), []
    for k, frame in enumerate(frames):
        extra = np.concatenate([[900], seldom if k < LEAST_VIEWS - 1 else seldom[:0]])
        wrong = np.random.default_rng(k).uniform(0.0, 480.0, (len(extra), 2))
        more.append(
            replace(frame, ids=np.concatenate([extra, frame.ids]), pixels=np.concatenate([wrong, frame.pixels]))
        )
    known = np.concatenate([ids, seldom]), np.concatenate([places, np.tile(MIDDLE, (6, 1))])
    with_more, without = adjusted_whole(begun(more, known)), adjusted_whole(begun(frames))
    np.testing.assert_array_equal(with_more.ids, ids)
    for one, other in zip(without.poses, with_more.poses, strict=True):
        np.testing.assert_allclose(one.p_m, other.p_m, atol=1e-12)
        np.testing.assert_allclose(one.q, other.q, atol=1e-12)


def test_too_few_points_are_not_adjusted() -> None:
    """Without keyframes or places, or with too few points, there is no adjustment; with just enough points there is."""
    frames, (ids, places), least = keyframes(noisy(4)), first_places(), 2 * LEAST_VIEWS
    assert begin_adjustment(frames, ids[: least - 1], places[: least - 1], CAMERA, UNBENT) is None
    assert begin_adjustment(frames, ids[:0], places[:0], CAMERA, UNBENT) is None
    assert begin_adjustment([], ids, places, CAMERA, UNBENT) is None
    assert begin_adjustment(frames[: LEAST_VIEWS - 1], ids, places, CAMERA, UNBENT) is None
    assert len(begun(frames, (ids[:least], places[:least])).ids) == least


def test_an_adjustment_begins_with_what_was_given() -> None:
    """Observations lie sorted by point, each with its frame and pixel, and nothing has moved."""
    estimates, lens = noisy(4), np.array(LENS_STD)
    frames = [
        replace(frame, ids=frame.ids[k:], pixels=frame.pixels[k:]) for k, frame in enumerate(keyframes(estimates))
    ]
    start = begun(frames, lens=lens)
    ids, places = first_places()
    np.testing.assert_array_equal(start.ids, ids)
    np.testing.assert_array_equal(start.points_W_m, places)
    np.testing.assert_array_equal(start.lens, lens)
    assert start.adjusted_camera() == with_lens(CAMERA, lens)
    assert start.poses == tuple(estimates)
    assert start.starts[-1] == len(start.frame_of) == sum(len(frame.ids) for frame in frames)
    for j, number in enumerate(start.ids):
        here = slice(start.starts[j], start.starts[j + 1])
        seen = [(k, frame.pixels[frame.ids == number][0]) for k, frame in enumerate(frames) if number in frame.ids]
        np.testing.assert_array_equal(start.frame_of[here], [k for k, _ in seen])
        np.testing.assert_array_equal(start.pixels[here], [pixel for _, pixel in seen])


def seen_so_often(views: IntArray) -> BundleAdjustment:
    """The adjustment before its first round of features that are seen in so many keyframes each, shape (n,)."""
    ids = np.arange(len(views))
    frames = [
        Keyframe(
            time_s=float(k),
            X_WC=TRUE[0],
            prior=TRUE[0],
            std=STD,
            ids=ids[views > k],
            pixels=np.zeros((int(sum(views > k)), 2)),
        )
        for k in range(int(views.max()))
    ]
    return begun(frames, (ids, np.tile(MIDDLE, (len(ids), 1))))


def test_the_points_of_most_views_are_adjusted() -> None:
    """Of more than `MOST_POINTS` those that were seen less often are left out."""
    views = np.full(MOST_POINTS + 500, LEAST_VIEWS)
    often = np.sort(np.random.default_rng(0).choice(len(views), MOST_POINTS, replace=False))
    views[often] += 1 + often % 4
    np.testing.assert_array_equal(seen_so_often(views).ids, often)
    assert len(seen_so_often(views[: MOST_POINTS - 1]).ids) == MOST_POINTS - 1


@pytest.mark.parametrize("most", [LEAST_VIEWS, LEAST_VIEWS + 3])
def test_no_more_points_are_adjusted_where_many_have_as_many_views(most: int) -> None:
    """Of features that were seen equally often no more than `MOST_POINTS` are adjusted."""
    views = LEAST_VIEWS + np.arange(MOST_POINTS + 500) % (most - LEAST_VIEWS + 1)
    start = seen_so_often(views)
    assert len(start.ids) <= MOST_POINTS
    assert (start.starts[1:] > start.starts[:-1]).all()


def test_a_round_leaves_the_adjustment_before_it_and_later_ones_move_nothing() -> None:
    """The poses before a round stay as they are; after ten rounds one more moves no camera by .01 mm."""
    start = begun(keyframes(noisy(7), noise_px=0.3))
    first = after_round(start)
    assert start.poses == tuple(frame.X_WC for frame in start.frames)
    assert max(np.linalg.norm(b.p_m - a.p_m) for a, b in zip(start.poses, first.poses, strict=True)) > 1e-3
    whole = adjusted_whole(start)
    more = after_round(whole)
    assert max(np.linalg.norm(b.p_m - a.p_m) for a, b in zip(whole.poses, more.poses, strict=True)) < 1e-5


def ray_through(R: Array, origin: Array, pixel_slopes: Array, distance_m: float) -> Array:
    """A point that the camera sees at slopes and a distance ahead."""
    return np.asarray(origin + R @ (distance_m * np.array([*pixel_slopes, 1.0])))


@pytest.mark.parametrize("camera", [CAMERA, BENT])
@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_those_of_the_cameras_pixels(camera: CalibratedCamera, seed: int) -> None:
    """All 16 columns equal central differences of the pixel by pose, lens and point, and the pixel is the camera's."""
    rng, eps = np.random.default_rng(seed), 1e-5
    X_WC = Pose(rng.normal(size=3), quat_from_euler(*rng.uniform(-1.5, 1.5, 3)))
    point = ray_through(X_WC.R, X_WC.p_m, rng.uniform(-0.45, 0.45, 2), rng.uniform(0.4, 1.5))
    J = np.zeros((2, 6 + 7 + 3))
    pixel = observed(X_WC.R, X_WC.p_m, point, lens_numbers(camera), J)

    def pixel_after(change: Array) -> Array:
        moved = disturbed(X_WC, change[:3], change[3:6])
        return np.asarray(pixels_of((point + change[13:])[None], moved, with_lens(camera, change[6:13]))[0])

    np.testing.assert_allclose(pixel, pixel_after(np.zeros(16)), atol=1e-9)
    wanted = [(pixel_after(step) - pixel_after(-step)) / (2.0 * eps) for step in eps * np.eye(16)]
    np.testing.assert_allclose(J, np.array(wanted).T, rtol=1e-6, atol=1e-4)


def test_a_point_behind_the_camera_is_taken_to_be_just_ahead() -> None:
    """Its pixel is that of the point brought to `LEAST_AHEAD_M`, and all derivatives are finite."""
    J, behind = np.zeros((2, 16)), np.array([0.004, -0.003, -0.5])
    pixel = observed(np.eye(3), np.zeros(3), behind, lens_numbers(CAMERA), J)
    ahead = np.array([[0.004, -0.003, LEAST_AHEAD_M]])
    np.testing.assert_allclose(pixel, CAMERA.pixels(ahead)[0], atol=1e-9)
    assert np.isfinite(J).all()


def test_a_lens_is_changed_as_its_errors_are_stated() -> None:
    """Focal lengths by a share, principal point by shares of the width, distortion by its coefficients; no more."""
    found = with_lens(BENT, np.array([0.01, 0.002, -0.003, 0.1, -0.2, 0.001, 0.004]))
    assert found.fx == pytest.approx(480.0 * 1.01)
    assert found.fy == pytest.approx(510.0 * 1.01)
    assert (found.cx, found.cy) == pytest.approx((319.5 + 1.28, 239.5 - 1.92))
    assert found.distortion == pytest.approx((-0.11, -0.14, 0.003, 0.001))
    assert (found.width, found.height) == (BENT.width, BENT.height)
    assert with_lens(BENT, UNBENT) == BENT


@pytest.mark.parametrize("seed", range(3))
def test_symmetric_matrices_are_inverted(seed: int) -> None:
    """The inverse is that of NumPy."""
    half = np.random.default_rng(seed).normal(size=(3, 3))
    A, found = half @ half.T + 0.1 * np.eye(3), np.zeros((3, 3))
    invert(A, found)
    np.testing.assert_allclose(found, np.linalg.inv(A), rtol=1e-9, atol=1e-12)


def test_the_normal_equations_are_those_of_all_unknowns() -> None:
    """Schur complement, right side and all blocks equal those of the dense normal matrix, by NumPy."""
    n, m, rng = 4, 9, np.random.default_rng(11)
    frames = keyframes(noisy(8)[:n], PLACES[:m], noise_px=1.5, camera=BENT)
    # The last frame lacks some features, and one pixel is far off.
    frames[-1] = replace(frames[-1], ids=frames[-1].ids[4:], pixels=frames[-1].pixels[4:])
    frames[0].pixels[2] += 25.0
    a = begun(frames, first_places(PLACES[:m]), BENT, np.array(LENS_STD) * rng.normal(size=LENS))
    lens = lens_numbers(a.adjusted_camera())
    R, origins = np.stack([pose.R for pose in a.poses]), np.stack([pose.p_m for pose in a.poses])
    limits = np.array([PIXEL_STD, CAUCHY_PX, DAMPING])
    S, g, V, h, W, L, misfit = normal_equations(R, origins, a.points_W_m, a.starts, a.frame_of, a.pixels, lens, limits)

    shared = POSE * n + LENS  # unknowns of cameras and lens; those of the points come after them
    point_of = np.repeat(np.arange(m), np.diff(a.starts))
    J, r = np.zeros((2 * len(point_of), shared + 3 * m)), np.zeros(2 * len(point_of))
    weights, misses = np.zeros(len(r)), np.zeros(m)
    for i, (k, j) in enumerate(zip(a.frame_of.tolist(), point_of.tolist(), strict=True)):
        own, rows = np.zeros((2, 16)), slice(2 * i, 2 * i + 2)
        r[rows] = a.pixels[i] - observed(R[k], origins[k], a.points_W_m[j], lens, own)
        J[rows, POSE * k : POSE * (k + 1)] = own[:, :6]
        J[rows, POSE * n : shared] = own[:, 6:13]
        J[rows, shared + 3 * j : shared + 3 * j + 3] = own[:, 13:]
        weights[rows] = 1.0 / PIXEL_STD**2 / (1.0 + np.sum(r[rows] ** 2) / CAUCHY_PX**2)
        misses[j] += np.sum(weights[rows] * r[rows] ** 2)
    N, right = J.T @ (weights[:, None] * J), J.T @ (weights * r)
    for j in range(m):
        own_block = slice(shared + 3 * j, shared + 3 * j + 3)
        N[own_block, own_block] += DAMPING * np.trace(N[own_block, own_block]) * np.eye(3)
    cross, points = N[:shared, shared:], N[shared:, shared:]
    np.testing.assert_allclose(S, N[:shared, :shared] - cross @ np.linalg.solve(points, cross.T), rtol=1e-7, atol=1e-4)
    np.testing.assert_allclose(
        g, right[:shared] - cross @ np.linalg.solve(points, right[shared:]), rtol=1e-7, atol=1e-4
    )
    np.testing.assert_allclose(S, S.T, rtol=1e-9, atol=1e-4)
    np.testing.assert_allclose(h.ravel(), right[shared:], rtol=1e-9)
    np.testing.assert_allclose(misfit, misses, rtol=1e-9)
    for j in range(m):
        mine = slice(3 * j, 3 * j + 3)
        np.testing.assert_allclose(V[j], points[mine, mine], rtol=1e-9)
        np.testing.assert_allclose(L[j], cross[POSE * n :, mine], rtol=1e-9, atol=1e-9)
    for i, (k, j) in enumerate(zip(a.frame_of.tolist(), point_of.tolist(), strict=True)):
        np.testing.assert_allclose(W[i], cross[POSE * k : POSE * (k + 1), 3 * j : 3 * j + 3], rtol=1e-9, atol=1e-9)


def test_a_round_is_the_step_of_all_unknowns() -> None:
    """Poses, lens and points move as the dense equations with the priors say, the points with them."""
    frames, known = keyframes(noisy(9)[:3], PLACES[:8], noise_px=0.5), first_places(PLACES[:8])
    a = begun(frames, known, lens=0.5 * np.array(LENS_STD))
    shared, point_of = POSE * 3 + LENS, np.repeat(np.arange(8), np.diff(a.starts))
    N, right = np.zeros((shared + 24, shared + 24)), np.zeros(shared + 24)
    for i, (k, j) in enumerate(zip(a.frame_of.tolist(), point_of.tolist(), strict=True)):
        own, columns = (
            np.zeros((2, 16)),
            np.r_[POSE * k : POSE * k + 6, POSE * 3 : shared, shared + 3 * j + np.arange(3)],
        )
        pose, lens = a.poses[k], lens_numbers(a.adjusted_camera())
        miss = a.pixels[i] - observed(pose.R, pose.p_m, a.points_W_m[j], lens, own)
        weight = 1.0 / PIXEL_STD**2 / (1.0 + miss @ miss / CAUCHY_PX**2)
        N[np.ix_(columns, columns)] += weight * own.T @ own
        right[columns] += weight * own.T @ miss
    for first in range(shared, shared + 24, 3):
        block = slice(first, first + 3)
        N[block, block] += DAMPING * np.trace(N[block, block]) * np.eye(3)
    prior = np.concatenate([np.tile(np.repeat(np.array(STD) ** -2, 3), 3), np.array(LENS_STD) ** -2])
    N[:shared, :shared] += np.diag(prior)
    right[POSE * 3 : shared] -= prior[POSE * 3 :] * a.lens
    step, after = np.linalg.solve(N, right).astype(np.float64), after_round(a)
    turns = step[: POSE * 3].reshape(3, 2, 3)
    for k, (before, pose) in enumerate(zip(a.poses, after.poses, strict=True)):
        wanted = disturbed(before, *turns[k])
        np.testing.assert_allclose(pose.p_m, wanted.p_m, atol=1e-9)
        np.testing.assert_allclose(turn_between(pose, wanted), 0.0, atol=1e-9)
    np.testing.assert_allclose(after.lens, a.lens + step[POSE * 3 : shared], atol=1e-9)
    np.testing.assert_allclose(after.points_W_m, a.points_W_m + step[shared:].reshape(-1, 3), atol=1e-9)


def lens_error_px(camera: CalibratedCamera, true: CalibratedCamera) -> float:
    """Root mean square distance of two cameras' pixels of the same rays over the picture, up to a turn.

    A turn of the camera does almost what a shift of the principal point does: poses take it up, the map keeps it not.
    """
    grid = np.stack(np.meshgrid(np.linspace(0, 639, 17), np.linspace(0, 479, 13)), axis=-1).reshape(-1, 2)
    rays = np.column_stack([true.slopes(grid), np.ones(len(grid))])

    def off(turn_rad: Array) -> Array:
        turned = disturbed(Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), np.zeros(3), turn_rad)
        return np.asarray((pixels_of(rays, turned, camera) - grid).ravel())

    return float(np.sqrt(2.0 * np.mean(least_squares(off, np.zeros(3)).fun ** 2)))


@pytest.mark.parametrize("seed", range(6))
def test_a_wrong_calibration_is_set_right(seed: int) -> None:
    """Exact pixels from an arc bring a lens that is off by its stated errors several times nearer to the true one."""
    rng = np.random.default_rng(seed)
    true = with_lens(BENT, np.array(LENS_STD) * rng.choice([-1.0, 1.0], LENS) * rng.uniform(0.7, 1.3, LENS))
    cameras = [
        looking(MIDDLE + np.array([-0.7 * np.cos(t), 0.7 * np.sin(t), -0.45 - 0.1 * np.sin(3.0 * t)]), MIDDLE)
        for t in np.linspace(-1.3, 1.3, 24)
    ]
    places = MIDDLE + rng.uniform([-0.5, -0.5, -0.2], [0.5, 0.5, 0.2], (400, 3))
    std, frames = (0.003, 0.003), []
    for frame in keyframes(noisy(seed, cameras, std), places, std=std, true=cameras, camera=true):
        inside = true.inside(frame.pixels)
        frames.append(replace(frame, ids=frame.ids[inside], pixels=frame.pixels[inside]))
    found = adjusted_whole(begun(frames, first_places(places), BENT))
    before, after = lens_error_px(BENT, true), lens_error_px(found.adjusted_camera(), true)
    assert before > 0.4
    assert after < before / 3.0


@pytest.mark.parametrize("seed", [6, 7])
def test_the_cost_is_the_least_that_scipy_finds(seed: int) -> None:
    """With noise and a wrong lens the cost, least over the points, is no more than SciPy's; the lens is the same."""
    places, n, rng = PLACES[:25], 5, np.random.default_rng(seed)
    true = with_lens(BENT, np.array(LENS_STD) * rng.normal(size=LENS))
    frames, known = keyframes(noisy(seed)[:n], places, noise_px=0.4, camera=true), first_places(places)

    def misses(poses: Sequence[Pose], lens: Array, points: Array) -> Array:
        """Residuals whose squares add up to the cost: Cauchy's of each pixel, and those of the priors."""
        camera, parts = with_lens(BENT, lens), [lens / LENS_STD]
        for X_WC, frame in zip(poses, frames, strict=True):
            miss = frame.pixels - pixels_of(points[frame.ids - FIRST_ID], X_WC, camera)
            share = np.maximum(np.sum(miss**2, axis=1, keepdims=True), 1e-12) / CAUCHY_PX**2
            parts.append((miss / PIXEL_STD * np.sqrt(np.log1p(share) / share)).ravel())
            parts += [(X_WC.p_m - frame.X_WC.p_m) / STD[0], turn_between(X_WC, frame.X_WC) / STD[1]]
        return np.concatenate(parts)

    def all_free(x: Array) -> Array:
        steps, lens = x[: 6 * n].reshape(n, 6), np.array(LENS_STD) * x[6 * n : 6 * n + LENS]
        poses = [disturbed(frame.X_WC, d[:3], d[3:]) for frame, d in zip(frames, STD[0] * steps, strict=True)]
        return misses(poses, lens, known[1] + STD[0] * x[6 * n + LENS :].reshape(-1, 3))

    found = adjusted_whole(begun(frames, known, BENT))

    def points_free(x: Array) -> Array:
        return misses(found.poses, found.lens, x.reshape(-1, 3))

    ours = least_squares(points_free, found.points_W_m.ravel(), x_scale=0.01)
    twin = least_squares(all_free, np.zeros(6 * n + LENS + places.size))
    assert twin.success
    assert ours.cost <= twin.cost * (1.0 + 1e-3)
    np.testing.assert_allclose(found.lens / LENS_STD, twin.x[6 * n : 6 * n + LENS], atol=0.05)
    assert np.abs(found.lens / LENS_STD).max() > 0.1

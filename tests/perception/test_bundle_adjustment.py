"""Bundle adjustment: relative poses from rays, scale and frame from the priors, the least cost of SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from perception_cases import CAMERA, disturbed, looking, slopes_of, turn_between
from scipy.optimize import least_squares

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.perception.bundle_adjustment import CAUCHY_PX, LEAST_VIEWS, PIXEL_STD, Keyframe, adjusted

FOCAL = CAMERA.focal_px
MIDDLE = np.array([0.8, 0.0, 1.5])
PLACES = MIDDLE + np.random.default_rng(0).uniform([-0.3, -0.3, -0.15], [0.3, 0.3, 0.15], (60, 3))
TRUE = [
    looking(np.array([0.1 * np.cos(2.0 * k), y, 1.0 + 0.1 * np.sin(1.3 * k)]), MIDDLE)
    for k, y in enumerate(np.linspace(-0.4, 0.4, 8))
]
STD = (0.01, 0.01)


def noisy(seed: int, poses: list[Pose] = TRUE, std: tuple[float, float] = STD) -> list[Pose]:
    """Poses with the stated errors."""
    rng = np.random.default_rng(seed)
    return [disturbed(X_WC, std[0] * rng.normal(size=3), std[1] * rng.normal(size=3)) for X_WC in poses]


def keyframes(
    estimates: list[Pose], places: Array = PLACES, noise_px: float = 0.0, std: tuple[float, float] = STD
) -> list[Keyframe]:
    """Keyframes of the true cameras, with estimates of their poses, features in another order in each."""
    rng, frames = np.random.default_rng(99), []
    for k, (X_WC, estimate) in enumerate(zip(TRUE, estimates, strict=False)):
        order = rng.permutation(len(places))
        slopes = slopes_of(places, X_WC) + noise_px / FOCAL * rng.normal(size=(len(places), 2))
        frames.append(Keyframe(time_s=0.5 * k, X_WC=estimate, std=std, ids=order + 5, slopes=slopes[order]))
    return frames


def first_places(places: Array = PLACES, std_m: float = 0.01) -> dict[int, Array]:
    """Places of the features by number, with errors."""
    off = std_m * np.random.default_rng(98).normal(size=places.shape)
    return {i + 5: p for i, p in enumerate(places + off)}


def relative_errors(found: list[Pose]) -> tuple[float, float]:
    """Largest errors of the poses relative to the first: of place up to one scale, m, and of attitude, rad."""
    ways = np.array([found[0].inverse().apply(X_WC.p_m) for X_WC in found])
    wanted = np.array([TRUE[0].inverse().apply(X_WC.p_m) for X_WC in TRUE])
    scale = float(np.sum(ways * wanted) / np.sum(ways * ways))
    turns = [turn_between(a.inverse() @ b, c.inverse() @ d) for a, b, c, d in
             zip(found[:1] * len(TRUE), found, TRUE[:1] * len(TRUE), TRUE, strict=True)]  # fmt: skip
    return float(np.linalg.norm(scale * ways - wanted, axis=1).max()), float(np.linalg.norm(turns, axis=1).max())


@pytest.mark.parametrize("seed", range(4))
def test_exact_pixels_give_the_true_relative_poses(seed: int) -> None:
    """Errors of 1 cm and 0.6 degrees per axis shrink more than twentyfold, up to the scale, which is the priors'."""
    estimates = noisy(seed)
    found = [frame.X_WC for frame in adjusted(keyframes(estimates), first_places(), FOCAL)]
    before, after = relative_errors(estimates), relative_errors(found)
    assert after[0] < before[0] / 20.0
    assert after[1] < before[1] / 20.0


def test_outlying_pixels_matter_little() -> None:
    """With one ray in ten far off, and others off by 0.3 px, attitudes still come back five times better."""
    estimates, rng = noisy(5), np.random.default_rng(6)
    frames = []
    for frame in keyframes(estimates, noise_px=0.3):
        slopes = frame.slopes.copy()
        slopes[:6] += rng.uniform(30.0, 80.0, (6, 2)) / FOCAL
        frames.append(Keyframe(time_s=0.0, X_WC=frame.X_WC, std=frame.std, ids=frame.ids, slopes=slopes))
    found = [frame.X_WC for frame in adjusted(frames, first_places(), FOCAL)]
    before, after = relative_errors(estimates), relative_errors(found)
    assert after[0] < before[0] / 5.0
    assert after[1] < before[1] / 5.0


def test_keyframes_keep_all_but_their_poses() -> None:
    """Times, standard deviations, features and their order are those that were given."""
    frames = keyframes(noisy(0))
    for given, found in zip(frames, adjusted(frames, first_places(), FOCAL), strict=True):
        assert (given.time_s, given.std) == (found.time_s, found.std)
        np.testing.assert_array_equal(given.ids, found.ids)
        np.testing.assert_array_equal(given.slopes, found.slopes)


def test_true_poses_stay_where_they_are() -> None:
    """Nothing moves where the poses, the points and the pixels are exact."""
    for pose, found in zip(TRUE, adjusted(keyframes(TRUE), first_places(std_m=0.0), FOCAL), strict=True):
        np.testing.assert_allclose(found.X_WC.p_m, pose.p_m, atol=1e-6)
        np.testing.assert_allclose(turn_between(found.X_WC, pose), 0.0, atol=1e-6)


def test_the_priors_set_the_frame() -> None:
    """Priors and first places in a frame that is moved and turned give the same poses in that frame."""
    X_VW = Pose(np.array([2.0, -1.0, 0.5]), quat_from_euler(0.1, -0.2, 2.0))
    estimates, places = noisy(1), first_places()
    one = adjusted(keyframes(estimates), places, FOCAL)
    other = adjusted(
        keyframes([X_VW @ X_WC for X_WC in estimates]), {i: X_VW.apply(p) for i, p in places.items()}, FOCAL
    )
    for here, there in zip(one, other, strict=True):
        np.testing.assert_allclose(there.X_WC.p_m, X_VW.apply(here.X_WC.p_m), atol=1e-6)
        np.testing.assert_allclose(turn_between(there.X_WC, X_VW @ here.X_WC), 0.0, atol=1e-6)


def test_a_certain_pose_stays_and_others_follow_it() -> None:
    """Two cameras that are known to a micrometre fix frame and scale for all others."""
    frames = []
    for k, frame in enumerate(keyframes([TRUE[0], *noisy(2)[1:-1], TRUE[-1]])):
        std = (1e-6, 1e-6) if k in (0, len(TRUE) - 1) else STD
        frames.append(Keyframe(time_s=0.0, X_WC=frame.X_WC, std=std, ids=frame.ids, slopes=frame.slopes))
    for pose, found in zip(TRUE, adjusted(frames, first_places(), FOCAL), strict=True):
        np.testing.assert_allclose(found.X_WC.p_m, pose.p_m, atol=5e-4)
        np.testing.assert_allclose(turn_between(found.X_WC, pose), 0.0, atol=1e-3)


def test_features_that_were_seen_seldom_do_not_matter() -> None:
    """Wrong rays of features in fewer than `LEAST_VIEWS` pictures, and of features without a place, change nothing."""
    frames, places = keyframes(noisy(3)), first_places()
    more = []
    for k, frame in enumerate(frames):
        ids = np.array([900] + [400 + j for j in range(6)] * (k < LEAST_VIEWS - 1))
        wrong = np.random.default_rng(k).uniform(-0.5, 0.5, (len(ids), 2))
        more.append(
            Keyframe(
                time_s=frame.time_s,
                X_WC=frame.X_WC,
                std=frame.std,
                ids=np.concatenate([ids, frame.ids]),
                slopes=np.concatenate([wrong, frame.slopes]),
            )
        )
    with_more = adjusted(more, places | {400 + j: MIDDLE for j in range(6)}, FOCAL)
    for one, other in zip(adjusted(frames, places, FOCAL), with_more, strict=True):
        np.testing.assert_allclose(one.X_WC.p_m, other.X_WC.p_m, atol=1e-12)
        np.testing.assert_allclose(one.X_WC.q, other.X_WC.q, atol=1e-12)


def test_too_few_points_change_nothing() -> None:
    """With fewer points than are needed the keyframes are those that were given."""
    frames = keyframes(noisy(4))
    few = {i: p for i, p in first_places().items() if i < 5 + 2 * LEAST_VIEWS - 1}
    assert adjusted(frames, few, FOCAL) == tuple(frames)


def test_the_cost_is_the_least_that_scipy_finds() -> None:
    """On a small problem with noise the cost, least over the points, is no more than that of `least_squares`."""
    places, n = PLACES[:7], 3
    frames = keyframes(noisy(6)[:n], places, noise_px=0.4)

    def misses(poses: list[Pose], points: Array) -> Array:
        """Residuals whose squares add up to the cost: Cauchy's for each ray, and those of the priors."""
        parts = []
        for X_WC, frame in zip(poses, frames, strict=True):
            miss = FOCAL * (frame.slopes - slopes_of(points[frame.ids - 5], X_WC))
            share = np.maximum(np.sum(miss**2, axis=1, keepdims=True), 1e-12) / CAUCHY_PX**2
            parts.append((miss / PIXEL_STD * np.sqrt(np.log1p(share) / share)).ravel())
            parts += [(X_WC.p_m - frame.X_WC.p_m) / STD[0], turn_between(X_WC, frame.X_WC) / STD[1]]
        return np.concatenate(parts)

    def all_free(x: Array) -> Array:
        steps = x[: 6 * n].reshape(n, 6)
        poses = [disturbed(frame.X_WC, d[:3], d[3:]) for frame, d in zip(frames, steps, strict=True)]
        return misses(poses, x[6 * n :].reshape(-1, 3))

    found = [frame.X_WC for frame in adjusted(frames, first_places(places), FOCAL)]

    def points_free(x: Array) -> Array:
        return misses(found, x.reshape(-1, 3))

    ours = least_squares(points_free, places.ravel(), x_scale=0.01)
    start = np.concatenate([np.zeros(6 * n), np.array(list(first_places(places).values())).ravel()])
    twin = least_squares(all_free, start, x_scale=0.01)
    assert twin.success
    assert ours.cost <= twin.cost * (1.0 + 1e-3)

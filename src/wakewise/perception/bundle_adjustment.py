"""Bundle adjustment of keyframes: camera poses, the lens and mapped points by all their pixels, with priors.

Gauss-Newton with Cauchy's weights; points are eliminated by the Schur complement (B. Triggs et al. 2000, Bundle
adjustment, doi 10.1007/3-540-44480-7_21). Priors on the poses alone set the scale and the frame. The lens is the crew's
calibration, with a prior of its errors: left as it is, it bends the map by 10 to 20 mm over half an orbit, and adjusted
by 2 mm (docs/research-log/0088).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.perception.bundle_kernels import normal_equations
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.feature_tracks import Grey

PIXEL_STD, CAUCHY_PX = 0.3, 1.5
"""Standard deviation of a pixel, and the scale of the weights."""
LEAST_VIEWS = 3
MOST_POINTS = 2500
"""Points that are adjusted, those of most views: more of them add time and little else."""
DAMPING = 1e-6
LENS_STD = (0.002, 0.0015, 0.0015, 0.003, 0.006, 0.00075, 0.00075)
"""Errors of a calibration, one sigma: focal length (share), principal point (share of the width), k1, k2, p1, p2.

Sources as of `wakewise.operation.scenario.calibration_error`: two sport cameras of one make in housings of one make.
"""
POSE, LENS = 6, len(LENS_STD)


@dataclass(frozen=True, kw_only=True, eq=False)
class Keyframe:
    """A picture that was kept: time, camera pose X_WC, the pose by other sensors, and its features.

    `ids`, shape (m,), and `pixels`, shape (m, 2). `prior` is the pose that sensors other than the camera give, and
    `std` its standard deviations per axis, m and rad. `picture` and the speed of what it shows, px/s, shape (2,), are
    for sweeps.
    """

    time_s: float
    X_WC: Pose
    prior: Pose
    std: tuple[float, float]
    ids: IntArray
    pixels: Array
    picture: Grey | None = None
    speed_px_s: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class BundleAdjustment:
    """Keyframes and points under adjustment; `after_round` makes the next.

    `frames` and `camera` are the given ones. `poses` and `lens`, shape (7,) as `LENS_STD`, are where they have come to.
    Observations are sorted by point, then by frame: `starts`, shape (m + 1,), `frame_of` (n,), `pixels` (n, 2). Points
    have `ids` (m,), places `points_W_m` (m, 3), and the inverse of their covariances, `information` (m, 3, 3);
    `misfit`, shape (m,), is the weighted sum of their squared misses.
    """

    frames: tuple[Keyframe, ...]
    camera: CalibratedCamera
    poses: tuple[Pose, ...]
    lens: Array
    ids: IntArray
    points_W_m: Array
    starts: IntArray
    frame_of: IntArray
    pixels: Array
    information: Array
    misfit: Array

    def adjusted_camera(self) -> CalibratedCamera:
        """The camera with the lens as it is now."""
        return with_lens(self.camera, self.lens)

    def adjusted_frames(self) -> tuple[Keyframe, ...]:
        """Keyframes with the poses as they are now."""
        return tuple(replace(frame, X_WC=pose) for frame, pose in zip(self.frames, self.poses, strict=True))


def begin_adjustment(
    frames: Sequence[Keyframe], ids: IntArray, points_W_m: Array, camera: CalibratedCamera, lens: Array
) -> BundleAdjustment | None:
    """Adjustment before its first round; None if too few points are seen in `LEAST_VIEWS` keyframes.

    `ids`, ascending, and `points_W_m`, shapes (k,) and (k, 3): first places of features; those without one are left
    out. `lens`, shape (7,): what it is begun with.
    """
    if not frames or not len(ids):
        return None
    frame_of, point_of, pixels = [], [], []
    for k, frame in enumerate(frames):
        at = np.minimum(np.searchsorted(ids, frame.ids), len(ids) - 1)
        known = ids[at] == frame.ids
        frame_of.append(np.full(int(known.sum()), k))
        point_of.append(at[known])
        pixels.append(frame.pixels[known])
    cam, pt, seen = np.concatenate(frame_of), np.concatenate(point_of), np.concatenate(pixels)
    views = np.bincount(pt, minlength=len(ids))
    often = np.zeros(len(ids), np.bool_)
    often[np.argsort(-views, kind="stable")[:MOST_POINTS]] = True
    often &= views >= LEAST_VIEWS
    if int(often.sum()) < 2 * LEAST_VIEWS:
        return None
    order = np.argsort(pt, kind="stable")
    order = order[often[pt[order]]]
    m = int(often.sum())
    return BundleAdjustment(
        frames=tuple(frames),
        camera=camera,
        poses=tuple(frame.X_WC for frame in frames),
        lens=lens,
        ids=ids[often],
        points_W_m=points_W_m[often],
        starts=np.concatenate([[0], np.cumsum(views[often])]),
        frame_of=cam[order],
        pixels=seen[order],
        information=np.zeros((m, 3, 3)),
        misfit=np.zeros(m),
    )


def after_round(before: BundleAdjustment) -> BundleAdjustment:
    """The adjustment after one more round of Gauss-Newton."""
    n = len(before.frames)
    S, g, V, h, W, L, misfit = normal_equations(
        np.stack([pose.R for pose in before.poses]),
        np.stack([pose.p_m for pose in before.poses]),
        before.points_W_m,
        before.starts,
        before.frame_of,
        before.pixels,
        lens_numbers(before.adjusted_camera()),
        np.array([PIXEL_STD, CAUCHY_PX, DAMPING]),
    )
    prior = np.empty(POSE * n + LENS)
    off = np.empty(POSE * n + LENS)
    for k, (pose, frame) in enumerate(zip(before.poses, before.frames, strict=True)):
        prior[POSE * k : POSE * k + 3], prior[POSE * k + 3 : POSE * k + POSE] = frame.std[0] ** -2, frame.std[1] ** -2
        off[POSE * k : POSE * k + 3] = frame.prior.p_m - pose.p_m
        off[POSE * k + 3 : POSE * k + POSE] = rotvec_from_quat(quat_multiply(quat_conjugate(pose.q), frame.prior.q))
    prior[POSE * n :], off[POSE * n :] = np.array(LENS_STD) ** -2, -before.lens
    step = np.linalg.solve(S + np.diag(prior), g + prior * off)
    turned = step[: POSE * n].reshape(n, POSE)
    by_cameras = np.einsum("oab,oa->ob", W, turned[before.frame_of])
    rest = h - np.add.reduceat(by_cameras, before.starts[:-1], axis=0) - np.einsum("mab,a->mb", L, step[POSE * n :])
    return replace(
        before,
        poses=tuple(
            Pose(pose.p_m + d[:3], quat_multiply(pose.q, quat_from_rotvec(d[3:])))
            for pose, d in zip(before.poses, turned, strict=True)
        ),
        lens=before.lens + step[POSE * n :],
        points_W_m=before.points_W_m + np.linalg.solve(V, rest[:, :, None])[:, :, 0],
        information=V,
        misfit=misfit,
    )


def load_kernel() -> None:
    """Run the compiled part once: else the first adjustment of a flight waits .3 s until it is loaded."""
    one = np.zeros(1, np.int64)
    normal_equations(
        np.eye(3)[None], np.zeros((1, 3)), np.ones((1, 3)), np.arange(2), one, np.zeros((1, 2)), np.ones(9), np.ones(3)
    )


def with_lens(camera: CalibratedCamera, lens: Array) -> CalibratedCamera:
    """The camera with its lens changed by `lens`, shape (7,): as `LENS_STD`."""
    scale, right, down, *bent = lens.tolist()
    k1, k2, p1, p2 = (old + new for old, new in zip(camera.distortion, bent, strict=True))
    return replace(
        camera,
        fx=camera.fx * (1.0 + scale),
        fy=camera.fy * (1.0 + scale),
        cx=camera.cx + right * camera.width,
        cy=camera.cy + down * camera.width,
        distortion=(k1, k2, p1, p2),
    )


def lens_numbers(camera: CalibratedCamera) -> Array:
    """fx, fy, cx, cy, k1, k2, p1, p2 and the width, shape (9,)."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion, camera.width])

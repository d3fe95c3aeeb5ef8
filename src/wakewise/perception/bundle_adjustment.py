"""Bundle adjustment of keyframes: camera poses and mapped points by all their rays, with priors on the poses.

Gauss-Newton with Cauchy's weights; points are eliminated by the Schur complement (B. Triggs et al. 2000, Bundle
adjustment, doi 10.1007/3-540-44480-7_21). Priors alone set the scale and the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.perception.resection import pixel_jacobian

ROUNDS = 10
PIXEL_STD, CAUCHY_PX = 0.3, 1.5
"""Standard deviation of a pixel, and the scale of the weights."""
LEAST_VIEWS = 3
DAMPING = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Keyframe:
    """A picture that was kept: time, camera pose X_WC with its standard deviations, and its features' rays.

    `ids`, shape (m,), and `slopes`, shape (m, 2), in the camera frame; `std` per axis, m and rad.
    """

    time_s: float
    X_WC: Pose
    std: tuple[float, float]
    ids: IntArray
    slopes: Array


def adjusted(frames: Sequence[Keyframe], points: dict[int, Array], focal_px: float) -> tuple[Keyframe, ...]:
    """Keyframes with adjusted poses.

    - `points`: first places, shape (3,) each, of features by number; those without one are left out.
    """
    if not frames or not points:
        return tuple(frames)
    ids = np.array(sorted(points), dtype=np.int64)
    frame_of, point_of, slopes = [], [], []
    for k, frame in enumerate(frames):
        at = np.searchsorted(ids, frame.ids)
        known = (at < len(ids)) & (ids[np.minimum(at, len(ids) - 1)] == frame.ids)
        frame_of.append(np.full(int(known.sum()), k))
        point_of.append(at[known])
        slopes.append(frame.slopes[known])
    cam, pt, seen = np.concatenate(frame_of), np.concatenate(point_of), np.concatenate(slopes)
    often = np.bincount(pt, minlength=len(ids)) >= LEAST_VIEWS
    kept = often[pt]
    cam, seen = cam[kept], seen[kept]
    number = np.cumsum(often) - 1
    pt = number[pt[kept]]
    places = np.array([points[int(i)] for i in ids[often]]).reshape(-1, 3)
    poses = [frame.X_WC for frame in frames]
    if len(places) < 2 * LEAST_VIEWS:
        return tuple(frames)
    n, m = len(frames), len(places)
    prior = np.array([[1.0 / frame.std[0] ** 2] * 3 + [1.0 / frame.std[1] ** 2] * 3 for frame in frames])
    for _ in range(ROUNDS):
        R = np.stack([pose.R for pose in poses])
        origin = np.stack([pose.p_m for pose in poses])
        p_C = np.einsum("nji,nj->ni", R[cam], places[pt] - origin[cam])
        inverse = 1.0 / np.maximum(p_C[:, 2], 0.02)
        x, y = p_C[:, 0] * inverse, p_C[:, 1] * inverse
        miss = focal_px * (seen - np.stack([x, y], axis=1))
        weight = 1.0 / (1.0 + np.einsum("oi,oi->o", miss, miss) / CAUCHY_PX**2) / PIXEL_STD**2
        J_pose = pixel_jacobian(x, y, inverse, focal_px, R[cam])
        J_point = -J_pose[:, :, :3]
        wJ = weight[:, None, None] * J_pose
        H = np.zeros((n, 6, n, 6))
        diagonal, g = np.zeros((n, 6, 6)), np.zeros((n, 6))
        np.add.at(diagonal, cam, np.swapaxes(wJ, 1, 2) @ J_pose)
        np.add.at(g, cam, np.einsum("oia,oi->oa", wJ, miss))
        V, h = np.zeros((m, 3, 3)), np.zeros((m, 3))
        wP = weight[:, None, None] * J_point
        np.add.at(V, pt, np.swapaxes(wP, 1, 2) @ J_point)
        np.add.at(h, pt, np.einsum("oia,oi->oa", wP, miss))
        W = np.zeros((n, 6, m, 3))
        np.add.at(W.transpose(0, 2, 1, 3), (cam, pt), np.swapaxes(wJ, 1, 2) @ J_point)
        for k, (pose, frame) in enumerate(zip(poses, frames, strict=True)):
            off = np.concatenate(
                [
                    frame.X_WC.p_m - pose.p_m,
                    rotvec_from_quat(quat_multiply(quat_conjugate(pose.q), frame.X_WC.q)),
                ]
            )
            diagonal[k] += np.diag(prior[k])
            g[k] += prior[k] * off
            H[k, :, k] += diagonal[k]
        V += DAMPING * np.trace(V, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        V_inverse = np.linalg.inv(V)
        WV = np.einsum("kamb,mbc->kamc", W, V_inverse).reshape(6 * n, 3 * m)
        flat = W.reshape(6 * n, 3 * m)
        step = np.linalg.solve(H.reshape(6 * n, 6 * n) - WV @ flat.T, g.ravel() - WV @ h.ravel())
        move = np.einsum("mab,mb->ma", V_inverse, h - (flat.T @ step).reshape(m, 3))
        step = step.reshape(n, 6)
        poses = [
            Pose(pose.p_m + d[:3], quat_multiply(pose.q, quat_from_rotvec(d[3:])))
            for pose, d in zip(poses, step, strict=True)
        ]
        places = places + move
        if float(np.abs(step).max()) < 1e-6:
            break
    return tuple(replace(frame, X_WC=pose) for frame, pose in zip(frames, poses, strict=True))

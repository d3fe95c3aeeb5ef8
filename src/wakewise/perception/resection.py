"""Resection: the camera's pose from mapped points and their pixels (Gauss-Newton with Cauchy's weights)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.perception.calibrated_camera import CalibratedCamera

LEAST_POINTS = 12
"""Fewer points that fit make no pose."""
ROUNDS = 10
SCALE_PX, INLIER_PX = 1.0, 3.0
"""Scale of Cauchy's weights, and the distance up to which a point fits."""
LEAST_FITTING = 0.4
"""Least share of the points that must fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Resection:
    """Camera pose X_WC, its covariance, shape (6, 6), of position in W and rotation vector in C, and who fits, (n,).

    `residual_px` is the root mean square distance of those that fit.
    """

    X_WC: Pose
    covariance: Array
    fits: BoolArray
    residual_px: float


def resection(
    points_W_m: Array, point_std_m: Array, pixels: Array, camera: CalibratedCamera, guess: Pose
) -> Resection | None:
    """Pose from mapped points, shape (n, 3), at pixels, shape (n, 2), near a guess; None if too few fit.

    `point_std_m`, shape (n,): standard deviations of the points, which add to that of their pixels.
    """
    if len(points_W_m) < LEAST_POINTS:
        return None
    slopes = camera.slopes(pixels)
    focal, pose = camera.focal_px, guess
    for last in range(ROUNDS):
        p_C = (points_W_m - pose.p_m) @ pose.R
        z = p_C[:, 2]
        ahead = z > 0.02
        if int(ahead.sum()) < LEAST_POINTS:
            return None
        inverse = np.where(ahead, 1.0 / np.where(ahead, z, 1.0), 0.0)
        x, y = p_C[:, 0] * inverse, p_C[:, 1] * inverse
        miss = focal * (slopes - np.stack([x, y], axis=1))
        sigma2 = 1.0 + (focal * inverse * point_std_m) ** 2
        error2 = np.einsum("ni,ni->n", miss, miss) / sigma2
        weights = np.where(ahead, 1.0 / ((1.0 + error2 / SCALE_PX**2) * sigma2), 0.0)
        J = pixel_jacobian(x, y, inverse, focal, pose.R)
        H = np.einsum("n,nia,nib->ab", weights, J, J)
        try:
            step = np.linalg.solve(H, np.einsum("n,nia,ni->a", weights, J, miss))
        except np.linalg.LinAlgError:
            return None
        pose = Pose(pose.p_m + step[:3], quat_multiply(pose.q, quat_from_rotvec(step[3:])))
        if last and float(np.abs(step).max()) < 1e-7:
            break
    fits = ahead & (error2 < INLIER_PX**2)
    if int(fits.sum()) < max(LEAST_POINTS, LEAST_FITTING * len(fits)):
        return None
    residual = float(np.sqrt(np.mean(np.einsum("ni,ni->n", miss[fits], miss[fits]))))
    spread2 = max(0.5 * float(np.mean(error2[fits])), 0.025)
    return Resection(X_WC=pose, covariance=spread2 * np.linalg.inv(H), fits=fits, residual_px=residual)


def pixel_jacobian(x: Array, y: Array, inverse: Array, focal: float, R_WC: Array) -> Array:
    """Derivative of pixels by the camera's position in W and rotation vector in C, shape (n, 2, 6).

    That by the point's position in W is the first three columns with the other sign. `x`, `y`, `inverse`, shape (n,):
    slopes of the points and their inverse depths; `R_WC`, shape (3, 3), or (n, 3, 3) of points in several pictures.
    """
    n = len(x)
    by_point = np.zeros((n, 2, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = inverse
    by_point[:, 0, 2], by_point[:, 1, 2] = -x * inverse, -y * inverse
    J = np.empty((n, 2, 6))
    J[:, :, :3] = -by_point @ np.swapaxes(R_WC, -1, -2)
    # A turn w of the camera moves a point in its frame by p x w.
    J[:, 0, 3], J[:, 0, 4], J[:, 0, 5] = x * y, -(1.0 + x * x), y
    J[:, 1, 3], J[:, 1, 4], J[:, 1, 5] = 1.0 + y * y, -x * y, -x
    return focal * J

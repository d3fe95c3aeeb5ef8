"""What the tests of the perception share: a camera, poses that look at a place, slopes and pixels of points."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, look_at, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.perception.bed_plane import BedPlane
from wakewise.perception.bundle_adjustment import BundleAdjustment, after_round
from wakewise.perception.calibrated_camera import CalibratedCamera

LEVEL = BedPlane(up_W=np.array([0.0, 0.0, -1.0]), at_W_m=np.array([0.0, 0.0, 1.5]))
"""A level bed at 1.5 m."""
CAMERA = CalibratedCamera(width=640, height=480, fx=500.0, fy=500.0, cx=319.5, cy=239.5)


def looking(eye_W_m: Array, at_W_m: Array) -> Pose:
    """Camera pose X_WC: z forward, x to the right and level, y down."""
    return Pose.from_matrix(look_at(eye_W_m, at_W_m)[:, [1, 2, 0]], eye_W_m)


def slopes_of(points_W_m: Array, X_WC: Pose) -> Array:
    """Slopes of the rays to points before the camera, shape (n, 2)."""
    p_C = (points_W_m - X_WC.p_m) @ X_WC.R
    return p_C[:, :2] / p_C[:, 2:]


def pixels_of(points_W_m: Array, X_WC: Pose, camera: CalibratedCamera = CAMERA) -> Array:
    """Pixels of points, shape (n, 2)."""
    return camera.pixels((points_W_m - X_WC.p_m) @ X_WC.R)


def disturbed(X_WC: Pose, way_m: Array, turn_rad: Array) -> Pose:
    """A pose moved in W and turned in C."""
    return Pose(X_WC.p_m + way_m, quat_multiply(X_WC.q, quat_from_rotvec(turn_rad)))


def turn_between(X_WC: Pose, X_WD: Pose) -> Array:
    """Rotation vector, in the first frame, from the first pose to the second, shape (3,)."""
    return rotvec_from_quat(quat_multiply(quat_conjugate(X_WC.q), X_WD.q))


def adjusted_whole(adjustment: BundleAdjustment) -> BundleAdjustment:
    """The adjustment after as many rounds as any test's needs."""
    for _ in range(10):
        adjustment = after_round(adjustment)
    return adjustment

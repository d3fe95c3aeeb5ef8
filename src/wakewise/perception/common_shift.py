"""Shift that points of one body have in common in a picture: how a swaying target is followed.

A target that sways moves by centimetres about its place at rest, too fast for the map's points to follow. One picture
shows its shift across the view; along the view it shows next to nothing, and a normal prior holds it.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.resection import pixel_jacobian

ROUNDS = 4
CAUCHY_PX = 4.0
"""Scale of Cauchy's weights: parts of a body move differently."""
NEAREST_M = 0.02


def common_shift(points_W_m: Array, pixels: Array, camera: CalibratedCamera, X_WC: Pose, std_m: float) -> Array:
    """Shift of points, shape (n, 3), that explains their pixels, shape (n, 2), best, shape (3,); along the view none.

    Robust least squares with a normal prior of standard deviation `std_m`.
    """
    slopes, focal, shift = camera.slopes(pixels), camera.focal_px, np.zeros(3)
    for _ in range(ROUNDS):
        p_C = (points_W_m + shift - X_WC.p_m) @ X_WC.R
        z = np.maximum(p_C[:, 2], NEAREST_M)
        slope = p_C[:, :2] / z[:, None]
        miss = focal * (slopes - slope)
        J = -pixel_jacobian(slope[:, 0], slope[:, 1], 1.0 / z, focal, X_WC.R)[:, :, :3]
        weights = 1.0 / (1.0 + np.einsum("ni,ni->n", miss, miss) / CAUCHY_PX**2)
        H = np.einsum("n,nia,nib->ab", weights, J, J) + np.eye(3) / std_m**2
        shift = shift + np.linalg.solve(H, np.einsum("n,nia,ni->a", weights, J, miss) - shift / std_m**2)
    return np.asarray(shift)

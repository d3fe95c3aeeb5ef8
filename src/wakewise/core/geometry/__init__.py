"""Rotations and poses; NumPy only. World W is NED, body B is FRD, camera C has OpenCV axes.

`rotations.py` has `Pose` (X_WB), `rotations.py` quaternions (w, x, y, z), Euler angles and rotation vectors.
"""

from wakewise.core.geometry.rotations import (
    Pose,
    euler_from_quat,
    look_at,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_matrix,
    quat_from_rotvec,
    quat_integrate,
    quat_multiply,
    rotvec_from_quat,
    skew,
)

__all__ = [
    "Pose",
    "euler_from_quat",
    "look_at",
    "matrix_from_quat",
    "quat_conjugate",
    "quat_from_euler",
    "quat_from_matrix",
    "quat_from_rotvec",
    "quat_integrate",
    "quat_multiply",
    "rotvec_from_quat",
    "skew",
]

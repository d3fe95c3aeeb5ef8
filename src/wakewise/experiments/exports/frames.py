"""From our frames to those of other tools and back: NED/FRD, ENU/FLU, z up, OpenGL.

ROS has x east, y north, z up for the world and x forward, y left, z up for bodies (REP 103,
https://www.ros.org/reps/rep-0103.html); its optical frames have OpenCV's axes, as our cameras. Viewers and nerfstudio
have z up and cameras that look along -z with y up (OpenGL). All of it is turns by fixed matrices, each its own inverse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat, quat_multiply

R_ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Turns a vector given in NED into one given in ENU, and back."""
R_FLU_FRD = np.diag([1.0, -1.0, -1.0])
"""Turns FRD into FLU, NED into x north, y west, z up, OpenCV's camera axes into OpenGL's; and back."""
_Q_ENU_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
_Q_FLU_FRD = np.array([0.0, 1.0, 0.0, 0.0])


def enu_of(p_W_m: ArrayLike) -> Array:
    """Points or vectors, shape (..., 3), of NED in ENU; the same call leads back."""
    return np.asarray(p_W_m, dtype=np.float64) @ R_ENU_NED


def flu_of(v_B: ArrayLike) -> Array:
    """Vectors, shape (..., 3), of FRD in FLU, or of NED with z up; the same call leads back."""
    return np.asarray(v_B, dtype=np.float64) @ R_FLU_FRD


def ros_body(p_W_m: ArrayLike, q_WB: ArrayLike) -> tuple[Array, Array]:
    """Position, shape (..., 3), and quaternion (w, x, y, z), shape (..., 4), of the FLU body in ENU; w not negative.

    The same call leads back from ENU/FLU to NED/FRD.
    """
    return enu_of(p_W_m), _upright(quat_multiply(quat_multiply(_Q_ENU_NED, q_WB), _Q_FLU_FRD))


def ros_optical(p_W_m: ArrayLike, q_WC: ArrayLike) -> tuple[Array, Array]:
    """The same of a camera, whose axes are OpenCV's on both sides; the same call leads back."""
    return enu_of(p_W_m), _upright(quat_multiply(_Q_ENU_NED, q_WC))


def opengl_camera(p_W_m: ArrayLike, q_WC: ArrayLike) -> Array:
    """Camera-to-world matrices, shape (n, 4, 4): world x north, y west, z up; camera x right, y up, z backward."""
    R_WC = matrix_from_quat(q_WC)
    matrix = np.tile(np.eye(4), (len(R_WC), 1, 1))
    matrix[:, :3, :3] = R_FLU_FRD @ R_WC @ R_FLU_FRD
    matrix[:, :3, 3] = flu_of(p_W_m)
    return matrix


def _upright(q: Array) -> Array:
    """The one of the two quaternions of each turn whose w is not negative."""
    return np.where(q[..., :1] < 0.0, -q, q)

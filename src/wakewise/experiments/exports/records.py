"""What exports are made from: plain arrays in NED/FRD, on the clock of the flight.

From our frames to those of other tools and back: NED/FRD, ENU/FLU, z up, OpenGL.

ROS has x east, y north, z up for the world and x forward, y left, z up for bodies (REP 103,
https://www.ros.org/reps/rep-0103.html); its optical frames have OpenCV's axes, as our cameras. Viewers and nerfstudio
have z up and cameras that look along -z with y up (OpenGL). All of it is turns by fixed matrices, each its own inverse.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_multiply


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Where something was: times (n,), positions (n, 3) and unit quaternions (w, x, y, z), shape (n, 4), in NED."""

    times_s: Array
    p_W_m: Array
    q: Array

    def __post_init__(self) -> None:
        q = np.asarray(self.q, dtype=np.float64)
        norm = np.linalg.norm(q, axis=-1, keepdims=True)
        if not (norm > 1e-6).all():
            raise InputError("track: a quaternion of length 0, or one that is no number; each must be of length 1")
        object.__setattr__(self, "q", q / norm)
        n = len(self.times_s)
        freeze(self, times_s=(n,), p_W_m=(n, 3), q=(n, 4))


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustRecord:
    """Thrusts (n, m), of m thrusters, and wrenches (n, 6), force and moment in FRD, at times (n,)."""

    times_s: Array
    thrusts_N: Array
    wrenches_B: Array

    def __post_init__(self) -> None:
        n = len(self.times_s)
        freeze(self, times_s=(n,), thrusts_N=(n, None), wrenches_B=(n, 6))


@dataclass(frozen=True, kw_only=True, eq=False)
class Photographs:
    """Photographs, where they are, and the camera that took them.

    `files` are one per pose of `track`, of different names; `track` is of the camera C with OpenCV axes (`q` is q_WC).
    `params`, shape (8,), are fx, fy, cx, cy in pixels (centres at +0.5), k1, k2, p1, p2 of OpenCV's distortion.
    """

    files: tuple[Path, ...]
    track: Trajectory
    width: int
    height: int
    params: Array

    def __post_init__(self) -> None:
        freeze(self, params=(8,))
        if len(self.files) != len(self.track.times_s) or not self.files:
            raise InputError(f"photographs: {len(self.files)} files with {len(self.track.times_s)} poses, one each")
        if len({path.name for path in self.files}) != len(self.files):
            raise InputError("photographs: two of one name, all must differ")


@dataclass(frozen=True, kw_only=True, eq=False)
class SparsePoints:
    """Points (n, 3) in NED, their colours (n, 3) as RGB bytes, and mean reprojection errors in pixels, shape (n,).

    `seen` says, by a photograph's name, at which pixels, shape (k, 2), which points, shape (k,), were observed in it.
    """

    points_W_m: Array
    colours: NDArray[np.uint8]
    errors_px: Array
    seen: Mapping[str, tuple[Array, IntArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), errors_px=(n,))


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

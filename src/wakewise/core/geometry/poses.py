"""Rigid poses in monogram notation: X_AB holds the origin and the axes of B as seen from A."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry.rotations import matrix_from_quat, quat_conjugate, quat_from_matrix, quat_multiply


@dataclass(frozen=True, eq=False)
class Pose:
    """X_AB: position and orientation of frame B in frame A.

    Parameters
    ----------
    p_m : ndarray, shape (3,)
        Origin of B from the origin of A, expressed in A.
    q : ndarray, shape (4,)
        Unit quaternion q_AB, (w, x, y, z); normalised here.
    """

    p_m: Array
    q: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    def __post_init__(self) -> None:
        freeze(self, p_m=(3,), q=(4,))
        norm = math.sqrt(self.q @ self.q)
        if norm < 1e-6:
            raise InputError(f"quaternion {self.q.tolist()}: length {norm:g}, must not be zero")
        freeze_q = self.q / norm
        freeze_q.setflags(write=False)
        object.__setattr__(self, "q", freeze_q)

    @classmethod
    def from_matrix(cls, R_AB: ArrayLike, p_m: ArrayLike) -> Pose:
        """Pose from a rotation matrix, shape (3, 3), and a position, shape (3,)."""
        return cls(np.asarray(p_m, dtype=np.float64), quat_from_matrix(R_AB))

    @property
    def R(self) -> Array:
        """Rotation matrix R_AB, shape (3, 3)."""
        return matrix_from_quat(self.q)

    def __matmul__(self, other: Pose) -> Pose:
        """X_AC = X_AB @ X_BC."""
        return Pose(self.p_m + self.R @ other.p_m, quat_multiply(self.q, other.q))

    def inverse(self) -> Pose:
        """X_BA."""
        q_BA = quat_conjugate(self.q)
        return Pose(-(matrix_from_quat(q_BA) @ self.p_m), q_BA)

    def apply(self, points_B_m: ArrayLike) -> Array:
        """Express points given in B, shape (..., 3), in A."""
        return np.asarray(points_B_m, dtype=np.float64) @ self.R.T + self.p_m


def look_at(eye_W_m: ArrayLike, target_W_m: ArrayLike) -> Array:
    """Orientation of a body whose x axis points from `eye` at `target` and whose y axis is level (no roll).

    Returns
    -------
    R_WB : ndarray, shape (3, 3)
        World is NED, so the body's z axis points as far down as the view allows. Straight up or down, where no level
        axis is singled out, y points east.

    Raises
    ------
    InputError
        If the two points coincide.
    """
    view = np.asarray(target_W_m, dtype=np.float64) - np.asarray(eye_W_m, dtype=np.float64)
    distance = float(np.linalg.norm(view))
    if distance < 1e-9:
        raise InputError("look_at: eye and target coincide, they must be apart")
    x = view / distance
    y = np.cross(np.array([0.0, 0.0, 1.0]), x)
    level = float(np.linalg.norm(y))
    y = y / level if level > 1e-9 else np.array([0.0, 1.0, 0.0])
    return np.stack([x, y, np.cross(x, y)], axis=1)

"""Unit quaternions in the order (w, x, y, z), rotation matrices, Euler angles (ZYX, Fossen) and rotation vectors.

`q_AB` and `R_AB` both turn a vector expressed in B into the same vector expressed in A: v_A = R_AB v_B.
Equations: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021, section 2.2.

Rigid poses in monogram notation: X_AB holds the origin and the axes of B as seen from A.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError


def skew(v: ArrayLike) -> Array:
    """Cross-product matrix S(v) with S(v) w = v x w; v has shape (3,), the result (3, 3)."""
    x, y, z = np.asarray(v, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def quat_multiply(q_AB: ArrayLike, q_BC: ArrayLike) -> Array:
    """Hamilton product: q_AC = q_AB q_BC, shapes (..., 4)."""
    a, b = np.asarray(q_AB, dtype=np.float64), np.asarray(q_BC, dtype=np.float64)
    one = a.ndim == 1 and b.ndim == 1
    # Plain numbers are several times faster than arrays for a single product, of which control makes hundreds a second.
    aw, ax, ay, az = a.tolist() if one else np.moveaxis(a, -1, 0)
    bw, bx, by, bz = b.tolist() if one else np.moveaxis(b, -1, 0)
    product = [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
    return np.array(product) if one else np.stack(product, axis=-1)


def quat_conjugate(q_AB: ArrayLike) -> Array:
    """Inverse of a unit quaternion: q_BA, shape (..., 4)."""
    return np.asarray(q_AB, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def matrix_from_quat(q_AB: ArrayLike) -> Array:
    """Rotation matrix R_AB, shape (..., 3, 3), of a quaternion q_AB, shape (..., 4); normalises first."""
    q = np.asarray(q_AB, dtype=np.float64)
    if q.ndim == 1:
        w, x, y, z = q.tolist()
        per = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * per, x * per, y * per, z * per
    else:
        w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows) if q.ndim == 1 else np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quat_from_matrix(R_AB: ArrayLike) -> Array:
    """Quaternion q_AB with w >= 0, shape (4,), of a rotation matrix R_AB, shape (3, 3).

    Takes the largest of the four candidates (Shepperd 1978, doi 10.2514/3.55767b), so no division is near zero.
    """
    R = np.asarray(R_AB, dtype=np.float64)
    trace = np.trace(R)
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = R[m, j] - R[j, m]
        q[1 + i] = 1.0 + 2.0 * R[i, i] - trace
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + m] = R[m, i] + R[i, m]
    q /= np.linalg.norm(q)
    return q if q[0] >= 0 else -q


def quat_from_euler(roll_rad: float | Array, pitch_rad: float | Array, yaw_rad: float | Array) -> Array:
    """Quaternions q_WB, shape (..., 4), of Euler angles in ZYX order (yaw first, about z; Fossen eq. 2.32)."""
    if isinstance(roll_rad, float) and isinstance(pitch_rad, float) and isinstance(yaw_rad, float):
        halves = 0.5 * float(roll_rad), 0.5 * float(pitch_rad), 0.5 * float(yaw_rad)
        if math.isfinite(sum(halves)):
            return np.array(_quat(*((math.cos(half), math.sin(half)) for half in halves)))
    many = [0.5 * np.asarray(angle, dtype=np.float64) for angle in (roll_rad, pitch_rad, yaw_rad)]
    return np.stack(_quat(*((np.cos(half), np.sin(half)) for half in many)), axis=-1)


def _quat(roll: tuple[Any, Any], pitch: tuple[Any, Any], yaw: tuple[Any, Any]) -> list[Any]:
    """The four entries, of the cosine and the sine of half of each angle."""
    (cr, sr), (cp, sp), (cy, sy) = roll, pitch, yaw
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def euler_from_quat(q_WB: ArrayLike) -> Array:
    """Roll, pitch and yaw in radians, shape (..., 3), of quaternions q_WB, shape (..., 4); pitch in [-pi/2, pi/2]."""
    q = np.asarray(q_WB, dtype=np.float64)
    if q.ndim == 1:
        w, x, y, z = q.tolist()
        twice = 2.0 / (w * w + x * x + y * y + z * z)
        roll = math.atan2(twice * (w * x + y * z), 1.0 - twice * (x * x + y * y))
        pitch = math.asin(min(max(twice * (w * y - z * x), -1.0), 1.0))
        return np.array([roll, pitch, math.atan2(twice * (w * z + x * y), 1.0 - twice * (y * y + z * z))])
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def quat_from_rotvec(rotvec_rad: ArrayLike) -> Array:
    """Quaternion, shape (..., 4), of a rotation vector (axis times angle), shape (..., 3)."""
    v = np.asarray(rotvec_rad, dtype=np.float64)
    if v.ndim == 1:
        x, y, z = v.tolist()
        turn = math.hypot(x, y, z)
        share = math.sin(turn / 2) / turn if turn > 0.0 else 0.5
        return np.array([math.cos(turn / 2), share * x, share * y, share * z])
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    # np.sinc(x) = sin(pi x)/(pi x), smooth through zero.
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * v], axis=-1)


def rotvec_from_quat(q_AB: ArrayLike) -> Array:
    """Rotation vector, shape (..., 3), with angle in [0, pi], of unit quaternions, shape (..., 4)."""
    q = np.asarray(q_AB, dtype=np.float64)
    q = np.where(q[..., :1] < 0, -q, q)
    norm = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(norm, q[..., :1])
    scale = np.where(norm > 1e-12, angle / np.where(norm > 1e-12, norm, 1.0), 2.0)
    return scale * q[..., 1:]


def quat_integrate(q_WB: ArrayLike, omega_B_rad_s: ArrayLike, dt_s: float) -> Array:
    """Turn q_WB by the body rate omega_B, constant over dt_s (exact for a constant rate)."""
    step = quat_from_rotvec(np.asarray(omega_B_rad_s, dtype=np.float64) * dt_s)
    q = quat_multiply(q_WB, step)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Pose:
    """X_AB: position and orientation of frame B in frame A.

    `p_m`, shape (3,): origin of B from the origin of A, expressed in A. `q`, shape (4,): unit quaternion q_AB, (w, x,
    y, z); normalised here.
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

    Returns `R_WB`, shape (3, 3): world is NED, so the body's z axis points as far down as the view allows. Straight up
    or down, where no level axis is singled out, y points east. Raises InputError if the two points coincide.
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

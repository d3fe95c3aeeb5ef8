"""What a source of poses says, with how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Measurement

LARGEST_M = 1e5
"""A place further from the origin than this is no place of a dive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseSample:
    """A pose or a position in NED/FRD on our clock.

    `measurement` has `X_WB`, or `p_WB_m` where the source knows no attitude. `covariance`, shape (6, 6), is that of
    position in W (m) and of attitude (rad, roll, pitch, yaw as MAVLink has it, a rotation vector for small errors);
    None where the source does not say.
    """

    measurement: Measurement
    covariance: Array | None = None

    def __post_init__(self) -> None:
        if self.covariance is not None:
            freeze(self, covariance=(6, 6))

    @property
    def position_std_m(self) -> float | None:
        """One sigma of the position per axis, the root of the mean variance; None where nothing is known."""
        if self.covariance is None:
            return None
        return math.sqrt(float(np.trace(self.covariance[:3, :3])) / 3.0)


def checked_pose(p_m: Array, q: Array) -> Pose:
    """A pose, or what is wrong with it.

    Raises
    ------
    InputError
        If it is not finite, further away than a dive goes, or its quaternion is none.
    """
    return Pose(checked_place(p_m), checked_turn(q))


def checked_place(p_m: Array) -> Array:
    """A place in m, shape (3,), or what is wrong with it."""
    if p_m.shape != (3,) or not np.isfinite(p_m).all() or np.abs(p_m).max() > LARGEST_M:
        told = " ".join(f"{x:g}" for x in p_m.ravel())
        raise InputError(f"position {told}: must be three numbers of at most {LARGEST_M:g} m")
    return p_m


def checked_turn(q: Array) -> Array:
    """A unit quaternion (w, x, y, z), or what is wrong with it; 1 % of length is taken for rounding."""
    if q.shape != (4,) or not abs(float(np.linalg.norm(q)) - 1.0) <= 0.01:
        raise InputError(f"quaternion {' '.join(f'{x:g}' for x in q.ravel())}: its length must be 1")
    return np.asarray(q / np.linalg.norm(q))

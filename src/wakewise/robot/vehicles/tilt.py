"""The joint that tilts a camera in its housing: stops, rate, and where the camera is at an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import finite_number
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class TiltJoint:
    """A hinge about the camera's own right axis.

    A positive angle looks up, as a positive pitch of the body does; at zero the camera is as its mount states it.

    Parameters
    ----------
    low_rad, high_rad : float
        The stops.
    rate_rad_s : float
        How fast it turns.
    p_BJ_m : ndarray, shape (3,), or None
        A point of the hinge from the body origin; None: it goes through the camera's centre of projection.

    Raises
    ------
    InputError
        If the range does not hold zero, the rate is not positive, or a number is not finite.
    """

    low_rad: float
    high_rad: float
    rate_rad_s: float
    p_BJ_m: Array | None = None

    def __post_init__(self) -> None:
        for field in ("low_rad", "high_rad", "rate_rad_s"):
            finite_number(getattr(self, field), f"camera_tilt: {field}")
        low, high = math.degrees(self.low_rad), math.degrees(self.high_rad)
        if not -90.0 <= low <= 0.0 <= high <= 90.0 or not low < high:
            raise InputError(f"camera_tilt: range {low:g} to {high:g} deg, must hold 0 and lie within -90 to 90")
        if self.rate_rad_s <= 0.0:
            raise InputError(f"camera_tilt: rate {math.degrees(self.rate_rad_s):g} deg/s, must be finite and above 0")
        if self.p_BJ_m is not None:
            freeze(self, p_BJ_m=(3,))

    def within(self, tilt_rad: float) -> float:
        """The angle nearest to a wished one between the stops."""
        return min(max(tilt_rad, self.low_rad), self.high_rad)

    def towards(self, tilt_rad: float, wished_rad: float, dt_s: float) -> float:
        """The angle after a time at the joint's rate towards a wished angle or its stop."""
        way = self.within(wished_rad) - tilt_rad
        return tilt_rad + math.copysign(min(abs(way), self.rate_rad_s * dt_s), way)

    def mount(self, X_BC: Pose, tilt_rad: float) -> Pose:
        """Camera mount at an angle, from that at zero."""
        if tilt_rad == 0.0:
            return X_BC
        c, s = math.cos(tilt_rad), math.sin(tilt_rad)
        R_BC = X_BC.R @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        pivot = X_BC.p_m if self.p_BJ_m is None else self.p_BJ_m
        return Pose.from_matrix(R_BC, pivot + R_BC @ (X_BC.R.T @ (X_BC.p_m - pivot)))

    def slide_m(self, X_BC: Pose, tilt_rad: float) -> Array:
        """How the camera's place in the body changes per radian of tilt, shape (3,)."""
        if self.p_BJ_m is None:
            return np.zeros(3)
        return np.cross(X_BC.R[:, 0], self.mount(X_BC, tilt_rad).p_m - self.p_BJ_m)

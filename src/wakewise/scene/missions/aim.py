"""Camera aim of a mission: by the pitch of the vehicle, by the camera's tilt joint, or by both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles.vehicle import TiltJoint, Vehicle

AimBy = Literal["auto", "pitch", "tilt", "both"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraAim:
    """A camera on a body, and what it is aimed with."""

    X_BC: Pose  # camera mount at no tilt
    # What tilts the camera as far as its stops; the body pitches for the rest. None: the body pitches for all.
    joint: TiltJoint | None = None

    def tilt(self, pitch_rad: float, pitch_rate_rad_s: float = 0.0) -> tuple[float, float]:
        """Tilt, and its rate in rad/s, of a camera that is to look at a pitch above the horizon; zeros without a joint.

        On an upright body, within the stops.
        """
        if self.joint is None:
            return 0.0, 0.0
        reference = self.level_tilt(pitch_rad)
        tilt = self.joint.within(reference)
        return tilt, pitch_rate_rad_s if tilt == reference else 0.0

    def level_tilt(self, pitch_rad: float) -> float:
        """Tilt with which the camera of a level body looks at a pitch above the horizon, without stops."""
        return pitch_rad - self._mounted_at_rad

    @cached_property
    def _mounted_at_rad(self) -> float:
        """Pitch of the camera on a level body at no tilt."""
        return math.asin(min(max(-float(self.X_BC.R[2, 2]), -1.0), 1.0))

    def mount(self, tilt_rad: float) -> Pose:
        """Camera mount at a tilt."""
        return self.X_BC if self.joint is None else self.joint.mount(self.X_BC, tilt_rad)

    def camera_motion(self, tilt_rad: float, tilt_rate_rad_s: float) -> tuple[Array, Array]:
        """Velocity and angular velocity of the camera within the body, in the axes of B, shape (3,) each."""
        if self.joint is None:
            return np.zeros(3), np.zeros(3)
        return tilt_rate_rad_s * self.joint.slide_m(self.X_BC, tilt_rad), tilt_rate_rad_s * self.X_BC.R[:, 0]


def aim_of(vehicle: Vehicle, by: AimBy = "auto") -> CameraAim:
    """What a vehicle's camera is aimed with: `auto` takes the joint where there is one, and pitch beyond its stops.

    Raises InputError if the tilt is asked of a camera that has no joint.
    """
    if by in ("tilt", "both") and vehicle.tilt is None:
        raise InputError(f"mission.aim: {by}, the camera of {vehicle.name} has no tilt joint, allowed auto or pitch")
    return CameraAim(X_BC=vehicle.X_BC, joint=None if by == "pitch" else vehicle.tilt)

"""The joint that tilts the camera of a real vehicle: its angle as the autopilot reports it, and what is asked of it.

A mount that reports its angle is steered while the companion drives, and given back to the pilot afterwards. A camera
without one is fixed: the controller turns the body instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import MOUNT_BY_MAVLINK, MOUNT_BY_STICKS, mount_command

ASKS_S = 0.2
LEAST_RAD = math.radians(0.5)
"""A wished angle that differs by less from the last is not sent."""


@dataclass(kw_only=True, eq=False)
class MountControl:
    """The camera of one vehicle.

    Parameters
    ----------
    gate : OutputGate
    vehicle : Vehicle
        With its joint, if it has one.
    stated_rad : float
        Angle where the autopilot reports none, up positive.
    """

    gate: OutputGate
    vehicle: Vehicle
    stated_rad: float = 0.0
    _asked: tuple[float, float] | None = None
    """Angle and time of the last request; None while the mount is the pilot's."""

    @property
    def reported(self) -> bool:
        """Whether the vehicle has a joint whose angle the autopilot has reported."""
        return self.vehicle.tilt is not None and math.isfinite(self.gate.known.mount_pitch[0])

    @property
    def angle_rad(self) -> float:
        """Angle of the joint now, as reported or stated."""
        joint = self.vehicle.tilt
        if joint is None or not self.reported:
            return self.stated_rad
        return joint.within(self.gate.known.mount_pitch[0])

    def X_BC(self) -> Pose:
        """Where the camera is in the body now."""
        return _tilted(self.vehicle, self.angle_rad)

    def flown(self, vehicle: Vehicle) -> Vehicle:
        """A vehicle as its controller may know it: without a joint, at the stated angle, if none is reported."""
        if self.reported:
            return vehicle
        return replace(vehicle, X_BC=_tilted(vehicle, self.stated_rad), tilt=None)

    def ask(self, wished_rad: float, engaged: bool) -> None:
        """Steer the mount towards an angle while engaged; else give it back to the pilot."""
        if not self.reported:
            return
        now_s, system = self.gate.clock(), self.gate.known.system
        if not engaged:
            self.give_back()
            return
        if self._asked is not None:
            before_rad, asked_s = self._asked
            if abs(wished_rad - before_rad) < LEAST_RAD or now_s - asked_s < ASKS_S:
                return
        self._asked = (wished_rad, now_s)
        self.gate.send("command_long", mount_command(system, wished_rad, MOUNT_BY_MAVLINK))

    def give_back(self) -> None:
        """Let the pilot steer the mount again, if it was steered."""
        if self._asked is not None:
            self._asked = None
            self.gate.send("command_long", mount_command(self.gate.known.system, 0.0, MOUNT_BY_STICKS))

    @property
    def words(self) -> str:
        """The angle, for people."""
        whence = "" if self.reported else " (stated)"
        return f"camera {math.degrees(self.angle_rad):+.0f} deg{whence}"


def _tilted(vehicle: Vehicle, angle_rad: float) -> Pose:
    """The camera's place in the body; a camera without a joint of its own turns about itself."""
    if vehicle.tilt is not None or angle_rad == 0.0:
        return vehicle.X_BC_at(angle_rad)
    c, s = math.cos(0.5 * angle_rad), math.sin(0.5 * angle_rad)
    return vehicle.X_BC @ Pose(np.zeros(3), np.array([c, s, 0.0, 0.0]))

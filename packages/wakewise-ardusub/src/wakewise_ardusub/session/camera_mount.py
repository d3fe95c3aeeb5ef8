"""The joint that tilts the camera of a real vehicle: its angle as the autopilot reports it, and what is asked of it.

A mount that reports its angle before the flight is steered while the companion drives, and given back to the pilot
afterwards. A camera without one is fixed: the controller turns the body instead. ArduSub reports what it asks of the
mount's servo, not where the camera is; the joint's own rate stands between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import MOUNT_BY_MAVLINK, MOUNT_BY_STICKS, mount_command, parameter_request

WAITS_S = 1.5
"""How long the first report is waited for; it is asked for five times a second."""
SILENT_S = 2.0
ASKS_S, AGAIN_S = 0.2, 1.0
"""How soon another angle is asked for, and the same one again that did not come."""
LEAST_RAD, OFF_RAD = math.radians(0.5), math.radians(2.0)
"""A desired angle that differs by less from the last is not sent; a reported one by more has not come."""
GIVES = 3
"""How often the mount is given back: a message may be lost."""
TYPE_PARAMETER, STABILIZED = "MNT1_TYPE", 1.0
"""Parameter of the mount's kind, and the kind of which ArduSub takes the hull's pitch off what is asked (servos)."""


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
    _joint: bool | None = None
    """Whether the controller has the joint; None until that is decided."""
    _shown: tuple[float, float] | None = None
    """Angle that the camera has come to, and when."""
    _asked: tuple[float, float] | None = None
    """Angle and time of the last request; None while the mount is the pilot's."""
    _gives: int = 0

    @property
    def reported(self) -> bool:
        """Whether the vehicle has a joint whose angle the autopilot has reported, before the flight if it has begun."""
        if self._joint is not None:
            return self._joint
        return self.vehicle.tilt is not None and math.isfinite(self.gate.known.mount_pitch[0])

    @property
    def silent(self) -> bool:
        """Whether a mount that was reported is not any more."""
        return self.reported and self.gate.clock() - self.gate.known.mount_pitch[1] > SILENT_S

    def current_angle_rad(self) -> float:
        """Angle of the joint now, as reported, limited by the joint's rate since the last call, or stated."""
        joint = self.vehicle.tilt
        if joint is None or not self.reported:
            return self.stated_rad
        angle, now_s = self.gate.known.mount_pitch[0], self.gate.clock()
        if self._shown is not None:
            before_rad, before_s = self._shown
            most = joint.rate_rad_s * (now_s - before_s)
            angle = before_rad + min(max(angle - before_rad, -most), most)
        self._shown = (angle, now_s)
        return angle

    def X_BC(self) -> Pose:
        """Where the camera is in the body now."""
        return _tilted(self.vehicle, self.current_angle_rad())

    def ask_kind(self) -> None:
        """Ask the autopilot what kind of mount it has."""
        self.gate.send("param_request_read", parameter_request(self.gate.known.system, TYPE_PARAMETER))

    def flown(self, vehicle: Vehicle) -> Vehicle:
        """A vehicle as its controller may know it: without a joint, at the stated angle, if none is reported.

        That is decided here, once.
        """
        self._joint = self.reported
        if self._joint:
            return vehicle
        return replace(vehicle, X_BC=_tilted(vehicle, self.stated_rad), tilt=None)

    def ask(self, desired_rad: float, engaged: bool) -> None:
        """Steer the mount towards an angle while engaged; else give it back to the pilot."""
        if not engaged:
            self.give_back()
        elif self.reported and not self.silent:
            known, now_s = self.gate.known, self.gate.clock()
            stabilized = known.parameters.get(TYPE_PARAMETER, STABILIZED) == STABILIZED
            asked_rad = desired_rad + (known.attitude[1] if stabilized and math.isfinite(known.attitude[1]) else 0.0)
            if self._asked is not None:
                before_rad, before_s = self._asked
                other = abs(asked_rad - before_rad) >= LEAST_RAD and now_s - before_s >= ASKS_S
                again = abs(known.mount_pitch[0] - desired_rad) > OFF_RAD and now_s - before_s >= AGAIN_S
                if not other and not again:
                    return
            self._asked, self._gives = (asked_rad, now_s), GIVES
            self.gate.send("command_long", mount_command(known.system, asked_rad, MOUNT_BY_MAVLINK))

    def give_back(self) -> None:
        """Let the pilot steer the mount again, if it was steered; to be called `GIVES` times."""
        self._asked = None
        if self._gives:
            self._gives -= 1
            self.gate.send("command_long", mount_command(self.gate.known.system, 0.0, MOUNT_BY_STICKS))

    @property
    def words(self) -> str:
        """The angle, for people."""
        whence = "" if self.reported else " (stated)"
        silent = ", mount not heard" if self.silent else ""
        return f"camera {math.degrees(self.current_angle_rad()):+.0f} deg{whence}{silent}"


def _tilted(vehicle: Vehicle, angle_rad: float) -> Pose:
    """The camera's place in the body; a camera without a joint of its own turns about itself."""
    if vehicle.tilt is not None or angle_rad == 0.0:
        return vehicle.X_BC_at(angle_rad)
    c, s = math.cos(0.5 * angle_rad), math.sin(0.5 * angle_rad)
    return vehicle.X_BC @ Pose(np.zeros(3), np.array([c, s, 0.0, 0.0]))

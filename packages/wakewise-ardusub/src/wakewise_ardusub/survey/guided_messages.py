"""SET_POSITION_TARGET_LOCAL_NED of a survey: place, velocity, acceleration, heading and the bound of its turn.

ArduSub's GUIDED takes no feed-forward of a turn beside a heading. With both it turns by `yaw_rate` while the heading is
more than 5 deg off, in whole deg/s and on the side of the error, so that a negative rate turns away from the target.
Within 5 deg it follows the heading alone, with a lag of about 1 / ATC_ANG_YAW_P. So on an arc the heading leads by
`HEADING_LEAD_S` times the turn rate, and `yaw_rate` is the size of the turn with `TURN_ROOM`.

Source: ArduPilot, ArduSub/mode_guided.cpp and AC_AttitudeControl_Sub.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array

VELOCITY_GAIN, PLACE_GAIN_PER_S, MOST_CORRECTION_M_S = 3.0, 5.0, 0.25
"""Correction of the velocity target by what is measured. The firmware's default gains (PSC_VELXY_*) need 20 s to push
through the dead zone of the thrusters."""
TURN_CORRECTION_M, MOST_TURNING_M_S = 2.5, 0.5
"""More correction on an arc, m/s for each rad/s, and its bound (WPNAV_SPEED). There the firmware's integral
(PSC_VELXY_I) has to turn with the vehicle: a velocity error of the turn rate times the demand over that gain."""
HEADING_LEAD_S = 0.2
TURN_ROOM, LEAST_TURN_RAD_S = 2.0, math.radians(10.0)
_NAMES = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")
_NO_ACCELERATION, _NO_TURN = 0x1C0, 0x800


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyTarget:
    """Place, velocity and acceleration, shape (3,), in W; heading, rad, and its turn rate on an arc, rad/s.

    Numbers are checked when the message is made, because a target that is none ends a survey and is no error.
    """

    place_W_m: Array
    velocity_W_m_s: Array = field(default_factory=lambda: np.zeros(3))
    acceleration_W_m_s2: Array = field(default_factory=lambda: np.zeros(3))
    heading_rad: float = 0.0
    turn_rad_s: float = 0.0

    def message(self, measured: tuple[Array, Array] | None, *, takes_acceleration: bool) -> dict[str, Any] | None:
        """Fields of the message; None where one is not a number. `measured`: place and velocity, shape (3,) each."""
        numbers = [*self.place_W_m, *self._corrected(measured), *self.acceleration_W_m_s2]
        if not np.isfinite([*numbers, self.heading_rad, self.turn_rad_s]).all():
            return None
        turn = abs(self.turn_rad_s)
        mask = (0 if turn else _NO_TURN) | (0 if takes_acceleration else _NO_ACCELERATION)
        return {
            **dict(zip(_NAMES, map(float, numbers), strict=True)),
            "time_boot_ms": 0,
            "coordinate_frame": 1,
            "type_mask": mask,
            "yaw": float(self.heading_rad + HEADING_LEAD_S * self.turn_rad_s),
            "yaw_rate": max(TURN_ROOM * turn, LEAST_TURN_RAD_S) if turn else 0.0,
        }

    def _corrected(self, measured: tuple[Array, Array] | None) -> Array:
        """The velocity, shape (3,), with the bounded correction by errors of place and velocity."""
        if measured is None:
            return self.velocity_W_m_s
        place, velocity = measured
        more = VELOCITY_GAIN * (self.velocity_W_m_s - velocity) + PLACE_GAIN_PER_S * (self.place_W_m - place)
        most = min(MOST_CORRECTION_M_S + TURN_CORRECTION_M * abs(self.turn_rad_s), MOST_TURNING_M_S)
        return self.velocity_W_m_s + more * min(1.0, most / max(float(np.linalg.norm(more)), 1e-9))

"""GUIDED and POSHOLD of the simulated autopilot: targets from MAVLink, and the horizontal cascade that follows them.

A target is SET_POSITION_TARGET_LOCAL_NED. ArduSub takes a position, a velocity, or both; from 4.8 on also both with an
acceleration. Any other combination changes nothing. Position and velocity: the position moves on with the velocity, and
the velocity is set to zero 3 s after the last message, so the vehicle stops and holds (`LAPSE_S`).

Cascade (names and defaults of ArduPilot's AC_PosControl): the position's error times PSC_POSXY_P plus the target's
velocity is a velocity, its error in a PI (PSC_VELXY_*) plus the target's acceleration an acceleration. As a lean angle
over ANGLE_MAX it is the forward and the lateral demand. Not simulated: the jerk-limited shaping of targets, filters,
waypoint speed profiles.

Heading. A turn rate beside a heading is no feed-forward: it is the rate, in whole deg/s, at which ArduSub turns while
the heading is more than 5 deg off. Its side is that of the error, so that a negative one turns away (`turned_to`).

Source: ArduPilot, ArduSub/mode_guided.cpp, GCS_MAVLink_Sub.cpp and AC_AttitudeControl_Sub.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.geometry import euler_from_quat
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.sitl.own_parameters import ParameterTable

LAPSE_S = 3.0
"""Age of a target at which its velocity is set to zero (GUIDED_VEL_TIMEOUT_MS)."""
ACCELERATION_FROM = (4, 8, 0)
"""Oldest release that takes an acceleration."""
YAW_SLEW_RAD_S, FAR_RAD = math.radians(60.0), math.radians(5.0)
"""Fastest turn to a target's heading (AUTO_YAW_SLEW_RATE); the error up to which a turn rate is not used."""
_BODY = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)
_OFFSET = (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, *_BODY)
_FRAMES = (mavlink.MAV_FRAME_LOCAL_NED, *_OFFSET)
_POSITION, _VELOCITY, _ACCELERATION, _YAW, _YAW_RATE = 0x007, 0x038, 0x1C0, 0x400, 0x800


@dataclass(frozen=True, kw_only=True, eq=False)
class GuidedTarget:
    """What GUIDED follows: place (None: velocity alone), velocity, acceleration, shape (3,), in W; heading and turn.

    `came_s` is the time of the message; `lapses` is false of a position alone, which stays valid.
    """

    place_W_m: Array | None
    velocity_W_m_s: Array
    acceleration_W_m_s2: Array
    heading_rad: float | None = None
    turn_rad_s: float | None = None
    came_s: float = 0.0
    lapses: bool = True

    def __post_init__(self) -> None:
        freeze(self, velocity_W_m_s=(3,), acceleration_W_m_s2=(3,))

    def advanced(self, now_s: float, dt_s: float) -> GuidedTarget:
        """The target one loop later; velocity and acceleration are zero once it has lapsed."""
        if self.lapses and now_s - self.came_s > LAPSE_S:
            still = np.zeros(3)
            return replace(self, velocity_W_m_s=still, acceleration_W_m_s2=still, turn_rad_s=None)
        if self.place_W_m is None or not self.velocity_W_m_s.any():
            return self
        place = self.place_W_m + dt_s * self.velocity_W_m_s
        return replace(self, place_W_m=place, velocity_W_m_s=self.velocity_W_m_s + dt_s * self.acceleration_W_m_s2)


def hold_here(motion: PhysicsState, now_s: float) -> GuidedTarget:
    """The target of a vehicle that holds its place and heading, as at the entry into GUIDED or POSHOLD."""
    return GuidedTarget(
        place_W_m=np.array(motion.p_WB_m),
        velocity_W_m_s=np.zeros(3),
        acceleration_W_m_s2=np.zeros(3),
        heading_rad=euler_from_quat(motion.q_WB)[2],
        came_s=now_s,
        lapses=False,
    )


def read_target(
    message: Any, motion: PhysicsState, zero_depth_m: float, now_s: float, firmware: tuple[int, int, int]
) -> GuidedTarget | None:
    """The target of a SET_POSITION_TARGET_LOCAL_NED; None where ArduSub of this release takes none from it.

    `zero_depth_m` is the depth, in the frame of `motion`, that the autopilot calls 0.
    """
    frame, mask = message.coordinate_frame, message.type_mask
    position, velocity, acceleration, yaw, yaw_rate = (
        not mask & bits for bits in (_POSITION, _VELOCITY, _ACCELERATION, _YAW, _YAW_RATE)
    )
    numbers = np.array([getattr(message, name) for name in ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")])
    used = np.repeat([position, velocity, acceleration], 3)
    if frame not in _FRAMES or not (position or velocity) or not np.isfinite(numbers[used]).all():
        return None
    if acceleration and not (position and velocity and firmware >= ACCELERATION_FROM):
        return None
    heading = euler_from_quat(motion.q_WB)[2]
    turn = _about_down(heading) if frame in _BODY else np.eye(3)
    place: Array | None = None
    if position:
        origin = motion.p_WB_m if frame in _OFFSET else np.array([0.0, 0.0, zero_depth_m])
        place = origin + turn @ numbers[:3]
    asked: float | None = None
    if yaw and math.isfinite(message.yaw):
        asked = float(message.yaw) + (heading if frame == mavlink.MAV_FRAME_BODY_OFFSET_NED else 0.0)
    return GuidedTarget(
        place_W_m=place,
        velocity_W_m_s=turn @ numbers[3:6] if velocity else np.zeros(3),
        acceleration_W_m_s2=numbers[6:] if acceleration else np.zeros(3),
        heading_rad=asked,
        turn_rad_s=float(message.yaw_rate) if yaw_rate and math.isfinite(message.yaw_rate) else None,
        came_s=now_s,
        lapses=velocity,
    )


def turned_to(target: GuidedTarget, sought_rad: float, heading_rad: float, dt_s: float) -> float:
    """The heading that the attitude loop seeks one loop later, from the one it seeks now and the vehicle's own."""
    turn = 0.0 if target.turn_rad_s is None else target.turn_rad_s
    if target.heading_rad is None:
        return sought_rad + turn * dt_s
    off = _wrapped(target.heading_rad - heading_rad)
    if turn and abs(off) > FAR_RAD:
        whole = math.radians(math.trunc(min(math.degrees(turn), math.degrees(YAW_SLEW_RAD_S))))
        return sought_rad + math.copysign(1.0, off) * whole * dt_s
    most = YAW_SLEW_RAD_S * dt_s
    return sought_rad + max(-most, min(most, _wrapped(target.heading_rad - sought_rad)))


def horizontal_demands(
    target: GuidedTarget, total: Array, motion: PhysicsState, parameters: ParameterTable, dt_s: float
) -> tuple[Array, float, float]:
    """The velocity loop's integral, shape (2,), m/s2, and the forward and lateral demands, each in [-1, 1]."""
    desired = target.velocity_W_m_s[:2]
    if target.place_W_m is not None:
        catch_up = parameters.value("PSC_POSXY_P", otherwise=1.0) * (target.place_W_m - motion.p_WB_m)[:2]
        most = 1e-2 * parameters.value("WPNAV_SPEED", otherwise=50.0)
        desired = desired + catch_up * min(1.0, most / max(float(np.hypot(*catch_up)), 1e-9))
    error = desired - motion.v_W_m_s[:2]
    most = 1e-2 * parameters.value("PSC_VELXY_IMAX", otherwise=1000.0)
    total = np.clip(total + parameters.value("PSC_VELXY_I", otherwise=0.5) * error * dt_s, -most, most)
    asked = target.acceleration_W_m_s2[:2] + parameters.value("PSC_VELXY_P", otherwise=1.0) * error + total
    heading = euler_from_quat(motion.q_WB)[2]
    body = _about_down(heading)[:2, :2].T @ asked
    largest = math.radians(1e-2 * parameters.value("ANGLE_MAX", otherwise=4500.0))
    leans = np.clip(np.arctan(body / GRAVITY_M_S2) / largest, -1.0, 1.0)
    return total, float(leans[0]), float(leans[1])


def _wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def _about_down(angle_rad: float) -> Array:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

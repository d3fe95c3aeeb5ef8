"""Motion reference of teleoperation, which all modes share.

Roll, pitch and yaw with their rates, a position with its velocity, and the camera's tilt. Each mode continues from it,
so goals are continuous; commands are approached within the limits of this module.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.control.motion_profile import limit_slew, profile_step_moving, unwrap_near
from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.scene.missions import CameraAim

TURN_RAD_S, TURN_RAD_S2 = 0.6, 0.8
"""Fastest turn of an assist against what it follows, and the fastest change of a turn; estimates: at half a metre from
the target the one is 0.3 m/s to the side."""
TILT_RAD_S2 = 2.0
"""Fastest change of a tilt's rate: a joint of 45 deg/s is up to it in 0.4 s."""
STEEPEST_RAD = math.radians(75.0)
"""Steepest pitch that sticks and assists ask of a body."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionReference:
    """A goal and its motion: place and velocity in W, roll, pitch and yaw and their rates, shape (3,) each, tilt."""

    place_W_m: Array
    velocity_W_m_s: Array
    angles_rad: Array
    rates_rad_s: Array
    tilt_rad: float = 0.0
    tilt_rad_s: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, place_W_m=(3,), velocity_W_m_s=(3,), angles_rad=(3,), rates_rad_s=(3,))

    @classmethod
    def at(cls, body: BodyState, tilt_rad: float = 0.0) -> MotionReference:
        """At rest where a body is."""
        rest = np.zeros(3)
        angles = euler_from_quat(body.X_WB.q)
        return cls(place_W_m=body.X_WB.p_m, velocity_W_m_s=rest, angles_rad=angles, rates_rad_s=rest, tilt_rad=tilt_rad)

    @property
    def X_WB(self) -> Pose:
        """The body's pose."""
        return Pose(self.place_W_m, quat_from_euler(*self.angles_rad))

    @property
    def omega_B_rad_s(self) -> Array:
        """Angular velocity in B, shape (3,) (Fossen 2021, eq. 2.40)."""
        (roll, pitch, _), (p, q, r) = self.angles_rad, self.rates_rad_s
        sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
        return np.array([p - r * sp, q * cr + r * sr * cp, -q * sr + r * cr * cp])

    def goal(self, tracking_weight_scale: float = 1.0, max_tracking_deviation: float | None = None) -> Goal:
        """As the controllers take it."""
        X_WB = self.X_WB
        twist = np.concatenate([X_WB.R.T @ self.velocity_W_m_s, self.omega_B_rad_s])
        return Goal(
            X_WB=X_WB,
            nu_B=twist,
            tilt_rad=self.tilt_rad,
            tracking_weight_scale=tracking_weight_scale,
            max_tracking_deviation=max_tracking_deviation,
        )

    def camera(self, aim: CameraAim) -> tuple[Array, Array]:
        """Place of the camera in W, and its velocity against the body's place, shape (3,) each."""
        X_WB = self.X_WB
        lever_B = aim.mount(self.tilt_rad).p_m
        slide_B, _ = aim.camera_motion(self.tilt_rad, self.tilt_rad_s)
        return X_WB.apply(lever_B), X_WB.R @ (np.cross(self.omega_B_rad_s, lever_B) + slide_B)


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeReference:
    """Commanded roll, pitch and yaw, shape (3,), tilt of the camera, and their rates."""

    angles_rad: Array
    rates_rad_s: Array
    tilt_rad: float = 0.0
    tilt_rad_s: float = 0.0


def step_attitude(
    motion: MotionReference, reference: AttitudeReference, dt_s: float, aim: CameraAim
) -> MotionReference:
    """The motion with its attitude a step nearer to a reference one that moves; the tilt at its joint's rate."""
    for k in range(3):
        motion = step_angle(motion, k, reference, dt_s)
    return step_tilt(motion, reference, dt_s, aim)


def step_angle(motion: MotionReference, k: int, reference: AttitudeReference, dt_s: float) -> MotionReference:
    """The motion with angle number k a step nearer to a reference one that moves."""
    angle, rate = profile_step_moving(
        float(motion.angles_rad[k]),
        float(motion.rates_rad_s[k]),
        unwrap_near(float(reference.angles_rad[k]), float(motion.angles_rad[k])),
        float(reference.rates_rad_s[k]),
        dt_s,
        TURN_RAD_S,
        TURN_RAD_S2,
    )
    return _with_angle(motion, k, angle, rate)


def step_tilt(motion: MotionReference, reference: AttitudeReference, dt_s: float, aim: CameraAim) -> MotionReference:
    """The motion with its camera's joint a step nearer to a reference tilt that moves."""
    if aim.joint is None:
        return motion
    tilt, rate = profile_step_moving(
        motion.tilt_rad,
        motion.tilt_rad_s,
        reference.tilt_rad,
        reference.tilt_rad_s,
        dt_s,
        aim.joint.rate_rad_s,
        TILT_RAD_S2,
    )
    return replace(motion, tilt_rad=aim.joint.within(tilt), tilt_rad_s=rate)


def turn_tilt_joint(motion: MotionReference, desired_rad_s: float, dt_s: float, aim: CameraAim) -> MotionReference:
    """The motion with its camera's joint turned at a reference rate, as far as its stops."""
    if aim.joint is None:
        return motion
    most = aim.joint.rate_rad_s
    rate = limit_slew(motion.tilt_rad_s, min(max(desired_rad_s, -most), most), dt_s, TILT_RAD_S2)
    asked = motion.tilt_rad + 0.5 * (motion.tilt_rad_s + rate) * dt_s
    tilt = aim.joint.within(asked)
    return replace(motion, tilt_rad=tilt, tilt_rad_s=rate if tilt == asked else 0.0)


def step_rate(motion: MotionReference, k: int, desired_rad_s: float, dt_s: float) -> MotionReference:
    """The motion with angle number k turned at a reference rate, which is reached at `TURN_RAD_S2`."""
    before = float(motion.rates_rad_s[k])
    rate = limit_slew(before, desired_rad_s, dt_s, TURN_RAD_S2)
    return _with_angle(motion, k, float(motion.angles_rad[k]) + 0.5 * (before + rate) * dt_s, rate)


def _with_angle(motion: MotionReference, k: int, angle_rad: float, rate_rad_s: float) -> MotionReference:
    angles, rates = np.array(motion.angles_rad), np.array(motion.rates_rad_s)
    angles[k], rates[k] = angle_rad, rate_rad_s
    return replace(motion, angles_rad=angles, rates_rad_s=rates)


def rates_of(angles_rad: Array, omega_B_rad_s: Array) -> Array:
    """Rates of roll, pitch and yaw, shape (3,), of an angular velocity in B (Fossen 2021, eq. 2.41)."""
    roll, pitch, _ = angles_rad
    p, q, r = omega_B_rad_s
    sr, cr = math.sin(roll), math.cos(roll)
    cp = max(math.cos(pitch), 0.05)
    turn = (sr * q + cr * r) / cp
    return np.array([p + math.sin(pitch) * turn, cr * q - sr * r, turn])

"""A mission that can be left and taken up again at any moment: its own time, and the way back to where it stands.

A route is a function of time. Here it is the time of the mission, which stops while another mode flies. When the
mission is resumed, the vehicle comes to rest, flies at the mission's pace round the target (straight in azimuth,
elevation and range, so never through it) to where the mission was left, and there the clock begins to run again, faster
and faster until it keeps up with the world's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wakewise.control.motion_profile import unwrap_near
from wakewise.control.velocity_reference import limit_acceleration
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, euler_from_quat, quat_conjugate, quat_multiply
from wakewise.operation.teleop.motion import (
    AttitudeReference,
    MotionReference,
    rates_of,
    step_attitude,
    step_rate,
    turn_tilt_joint,
)
from wakewise.scene.missions import CameraAim, Leg, Route
from wakewise.scene.missions.orbit import camera_pose, camera_twist
from wakewise.scene.missions.route import rest_to_rest

PACE_S = 1.0
"""Time in which the mission's clock comes up to the world's: at its acceleration a mission of 0.1 m/s takes two."""
REST_M_S, REST_RAD_S = 1e-9, 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanState:
    """Where a mission stands.

    `mission_s` is its own time and `pace` how fast that runs, `back` the way back to it, of which `back_s` is done.
    """

    phase: Literal["stopping", "returning", "flying"] = "stopping"
    mission_s: float = 0.0
    pace: float = 0.0
    back: Leg | None = None
    back_s: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ResumableMission:
    """A route with what aims the camera, and how fast the way back to it is flown."""

    route: Route
    aim: CameraAim
    speed_m_s: float
    acceleration_m_s2: float
    braking_m_s2: float

    @property
    def flies(self) -> bool:
        """Whether there is anything to fly."""
        return len(self.route.exposures_s) > 0

    def begun(self) -> tuple[ScanState, MotionReference]:
        """At the mission's beginning, its clock running."""
        scan = ScanState(phase="flying", pace=1.0)
        return scan, self._on_route(
            scan, MotionReference.at(self.route.body(0.0, self.aim), self.route.tilt(0.0, self.aim)[0]), 0.0
        )

    def step(self, scan: ScanState, motion: MotionReference, dt_s: float) -> tuple[ScanState, MotionReference]:
        """A step on, from wherever the motion is."""
        if scan.phase == "stopping":
            motion = stopped(motion, dt_s, self.braking_m_s2, self.aim)
            still = np.abs(motion.velocity_W_m_s).max() < REST_M_S and np.abs(motion.rates_rad_s).max() < REST_RAD_S
            if not still:
                return scan, motion
            return replace(scan, phase="returning", back=self._way_back(scan, motion), back_s=0.0), motion
        leg = scan.back
        if scan.phase == "returning" and leg is not None:
            scan = replace(scan, back_s=scan.back_s + dt_s)
            fraction, per_s = leg.progress(scan.back_s)
            place, rate = (1.0 - fraction) * leg.start + fraction * leg.end, per_s * (leg.end - leg.start)
            motion, there = self._led(motion, place, rate, dt_s)
            if scan.back_s < leg.duration_s or not there:
                return scan, motion
            return replace(scan, phase="flying", pace=0.0, back=None), motion
        pace = min(scan.pace + dt_s / PACE_S, 1.0)
        scan = replace(scan, pace=pace, mission_s=scan.mission_s + 0.5 * (scan.pace + pace) * dt_s)
        return scan, self._on_route(scan, motion, dt_s)

    def _on_route(self, scan: ScanState, motion: MotionReference, dt_s: float) -> MotionReference:
        place, rate = self.route.on_sphere(scan.mission_s)
        return self._led(motion, place, scan.pace * rate, dt_s)[0]

    def _led(self, motion: MotionReference, place: Array, rate: Array, dt_s: float) -> tuple[MotionReference, bool]:
        """The motion with its camera at a place on the sphere, and whether it looks where it should.

        `place` and `rate` are azimuth, elevation and range and how fast they change, shape (3,).
        """
        X_WC, (v_W, omega_W) = camera_pose(self.route.centre_W_m, *place), camera_twist(*place, *rate)
        tilt, tilt_rate = self.aim.tilt(-float(place[1]), -float(rate[1]))
        q_WB = quat_multiply(X_WC.q, quat_conjugate(self.aim.mount(tilt).q))
        angles = euler_from_quat(q_WB)
        _, turned_B = self.aim.camera_motion(tilt, tilt_rate)
        omega_B = Pose(X_WC.p_m, q_WB).R.T @ omega_W - turned_B
        reference = AttitudeReference(
            angles_rad=angles, rates_rad_s=rates_of(angles, omega_B), tilt_rad=tilt, tilt_rad_s=tilt_rate
        )
        if dt_s > 0.0:
            motion = step_attitude(motion, reference, dt_s, self.aim)
        else:
            motion = replace(
                motion, angles_rad=angles, rates_rad_s=reference.rates_rad_s, tilt_rad=tilt, tilt_rad_s=tilt_rate
            )
        off = np.abs(np.remainder(motion.angles_rad - angles + math.pi, 2.0 * math.pi) - math.pi).max()
        eye, moves = motion.camera(self.aim)
        place_B = X_WC.p_m - (eye - motion.place_W_m)
        return replace(motion, place_W_m=place_B, velocity_W_m_s=v_W - moves), bool(off < 1e-9)

    def _way_back(self, scan: ScanState, motion: MotionReference) -> Leg:
        away = motion.camera(self.aim)[0] - self.route.centre_W_m
        distance = float(np.linalg.norm(away))
        end, _ = self.route.on_sphere(scan.mission_s)
        azimuth = math.atan2(away[1], away[0])
        elevation = math.asin(min(max(-float(away[2]) / max(distance, 1e-6), -1.0), 1.0))
        start = np.array([azimuth, elevation, distance])
        end = np.array([unwrap_near(float(end[0]), azimuth), end[1], end[2]])
        return rest_to_rest("back to the mission", start, end, self.speed_m_s, self.acceleration_m_s2)


def stopped(motion: MotionReference, dt_s: float, braking_m_s2: float, aim: CameraAim) -> MotionReference:
    """The motion a step nearer to rest, which it comes to ahead of where it is."""
    velocity = limit_acceleration(motion.velocity_W_m_s, np.zeros(3), dt_s, braking_m_s2)
    place = motion.place_W_m + 0.5 * dt_s * (motion.velocity_W_m_s + velocity)
    motion = turn_tilt_joint(replace(motion, place_W_m=place, velocity_W_m_s=velocity), 0.0, dt_s, aim)
    for k in range(3):
        motion = step_rate(motion, k, 0.0, dt_s)
    return motion

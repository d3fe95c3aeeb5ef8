"""Motion reference by sticks, settings and assists: one pure step for the attitude, one for the position.

Released sticks brake: the commanded velocity falls to zero, and the position where it becomes zero is held. The
velocity is kept in the frame of the sticks, which turns with the vehicle or along the sphere about the target.

Collision limits: towards each plane and sphere of the surroundings the velocity of approach is at most v = sqrt(2 a d),
from which the hull stops within d, the distance less the clearance and `STICK_MARGIN_M`. Tangential velocity is not
limited.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from wakewise.control.velocity_reference import (
    FULL_M_S,
    FULL_RAD_S,
    HIGHEST_RAD,
    advance_reference,
    limit_acceleration,
    limit_jerk,
)
from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import (
    Pose,
    euler_from_quat,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_matrix,
    quat_multiply,
)
from wakewise.core.interfaces import BodyState
from wakewise.operation.teleop.motion import (
    STEEPEST_RAD,
    AttitudeReference,
    MotionReference,
    step_angle,
    step_rate,
    step_tilt,
    turn_tilt_joint,
)
from wakewise.operation.teleop.operator_state import OperatorSettings
from wakewise.planning import Surroundings
from wakewise.planning.kernels import plane_gap, sphere_gap
from wakewise.planning.problem import CLEARANCE_M
from wakewise.scene.missions import CameraAim
from wakewise.scene.missions.orbit import R_FC

_Q_FC = quat_from_matrix(R_FC)
OVER_M = 0.15
"""Nearer to the vertical through the target than this, no heading is better than another: it stays as it is."""
_ROUNDS = 3


def camera_on_target(
    place_W_m: Array, velocity_W_m_s: Array, yaw_rad: float, target_W_m: Array, aim: CameraAim, dt_s: float
) -> AttitudeReference:
    """Attitude and tilt with which a body at a place keeps its camera on a target: tilt first, pitch beyond its stops.

    `place_W_m`, `velocity_W_m_s`, `target_W_m`: shape (3,) each. `yaw_rad`: heading now, which stays right over the
    target, where none is better. `dt_s`: over which the rates are taken.
    """
    angles, tilt = _watching(place_W_m, yaw_rad, target_W_m, aim)
    if not velocity_W_m_s.any():
        return AttitudeReference(angles_rad=angles, rates_rad_s=np.zeros(3), tilt_rad=tilt)
    before, tilt_before = _watching(place_W_m - dt_s * velocity_W_m_s, yaw_rad, target_W_m, aim)
    rates = (np.remainder(angles - before + math.pi, 2.0 * math.pi) - math.pi) / dt_s
    return AttitudeReference(
        angles_rad=angles, rates_rad_s=rates, tilt_rad=tilt, tilt_rad_s=(tilt - tilt_before) / dt_s
    )


def _watching(place_W_m: Array, yaw_rad: float, target_W_m: Array, aim: CameraAim) -> tuple[Array, float]:
    away = target_W_m - place_W_m
    over = math.hypot(away[0], away[1]) < OVER_M
    bearing = yaw_rad if over else math.atan2(away[1], away[0])
    angles, tilt = np.array([0.0, 0.0, bearing]), 0.0
    # The eye moves with the body that turns it: the lever is shorter than the sight, so a few rounds suffice.
    for _ in range(_ROUNDS):
        R_WB = matrix_from_quat(quat_from_euler(*angles))
        sight = away - R_WB @ aim.mount(tilt).p_m
        level = math.hypot(sight[0], sight[1])
        heading = bearing if over else math.atan2(sight[1], sight[0])
        pitch = min(max(math.atan2(-sight[2], level), -HIGHEST_RAD), HIGHEST_RAD)
        tilt, _ = aim.tilt(pitch)
        q_WC = quat_multiply(quat_from_euler(0.0, pitch, heading), _Q_FC)
        angles = euler_from_quat(quat_multiply(q_WC, quat_conjugate(aim.mount(tilt).q)))
        angles[1] = min(max(angles[1], -STEEPEST_RAD), STEEPEST_RAD)
    return angles, tilt


def level_frame(yaw_rad: float) -> Array:
    """Forward, right and down of the body's level frame in W, the columns of shape (3, 3)."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def sphere_frame(eye_W_m: Array, centre_W_m: Array) -> Array:
    """Towards the centre of a sphere, right and down along it, in W, the columns of shape (3, 3)."""
    away = centre_W_m - eye_W_m
    ahead = away / max(float(np.linalg.norm(away)), 1e-6)
    azimuth = math.atan2(ahead[1], ahead[0])
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    return np.stack([ahead, right, np.cross(ahead, right)], axis=1)


def elevation_rad(eye_W_m: Array, centre_W_m: Array) -> float:
    """Elevation of an eye above the horizon of a centre, shape (3,) each."""
    away = eye_W_m - centre_W_m
    return math.atan2(-float(away[2]), math.hypot(away[0], away[1]))


STICK_MARGIN_M = 0.025
"""What a commanded place keeps beyond the clearance: a hull that is stopped from full stick goes up to 33 mm farther
than its command (research log 86)."""
FELT_M_S = 0.02
"""Loss of speed from which it is worth saying what is in the way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CollisionLimiter:
    """What is solid, half the hull's size, shape (3,), and how hard the hull can brake."""

    around: Surroundings
    half_m: Array
    braking_m_s2: float

    def __post_init__(self) -> None:
        freeze(self, half_m=(3,))

    def allowed(self, X_WB: Pose, velocity_W_m_s: Array, omega_B_rad_s: Array) -> tuple[Array, str | None]:
        """The velocity with collision limits, shape (3,), and the name of the obstacle, None if there is none.

        The rotation of the hull, `omega_B_rad_s` of shape (3,), is included.
        """
        velocity, R, slope, blocks = np.array(velocity_W_m_s), X_WB.R, np.empty(6), None
        planes, spheres = self.around.planes, self.around.spheres
        for k in range(len(planes) + len(spheres)):
            if k < len(planes):
                gap = plane_gap(X_WB.p_m, R, self.half_m, planes[k], slope)
            else:
                gap = sphere_gap(X_WB.p_m, R, self.half_m, spheres[k - len(planes)], slope)
            closing = -float(slope[:3] @ velocity + slope[3:] @ omega_B_rad_s)
            most = math.sqrt(2.0 * self.braking_m_s2 * max(gap - CLEARANCE_M - STICK_MARGIN_M, 0.0))
            if closing > most:
                velocity += (closing - most) * slope[:3]
                blocks = self.around.name(k) if closing - most > FELT_M_S else blocks
        return velocity, blocks


FASTER_M_S2, BRAKING_M_S2 = 0.15, 0.2
"""How fast a commanded velocity grows and falls on average; from 0.3 m/s to rest it takes 1.5 s and 0.23 m."""
JERK_M_S3 = 0.8
"""Fastest change of its acceleration: 0 to 0.2 m/s2 in a quarter of a second. That is what a vehicle answers in (lag of
a thruster 0.1 s, age of a plan up to 0.1 s, delay of an estimate 0.08 s), and no more than a person's own delay."""
EVEN_M_S = 0.3
"""Speed at which a change that begins and ends gently takes as long as one of steady acceleration would."""
PULL_M_S = 0.5
"""Fastest that the leash pulls the commanded place towards a vehicle that is held up or far off."""


def _peak(mean_m_s2: float) -> float:
    """Largest acceleration of a change by `EVEN_M_S` that takes v / mean in all: v / a + a / jerk of time."""
    takes_s = EVEN_M_S / mean_m_s2
    return 0.5 * JERK_M_S3 * (takes_s - math.sqrt(takes_s**2 - 4.0 * EVEN_M_S / JERK_M_S3))


FASTER_PEAK_M_S2, BRAKING_PEAK_M_S2 = _peak(FASTER_M_S2), _peak(BRAKING_M_S2)
"""0.17 and 0.25 m/s2."""
RANGE_PER_S, RANGE_M_S = 1.0, 0.05
"""How an orbit keeps its range: speed per distance, and at most."""
SLOW_M_S = 0.01
"""Speed towards the centre below which a range is kept."""
HARDEST_M_S2 = 0.6
"""Largest change of a commanded velocity, whatever bends its way: 0.4 m/s on a circle of a quarter of a metre."""
TILT_RAD_S = math.radians(40.0)
"""Tilt rate of the full stick at gain 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StickFrame:
    """The frame of the sticks, shape (3, 3), as it was a step ago, and the orbit's radius where one is kept.

    `frame` is None before the first step; `orbits`: it is the frame of an orbit. `change_m_s2`, shape (3,), is the
    acceleration in that frame. `blocked_by` is the name of an obstacle, None if there is none.
    """

    frame: Array | None = None
    change_m_s2: Array = field(default_factory=lambda: np.zeros(3))
    orbits: bool = False
    range_m: float | None = None
    blocked_by: str | None = None


def steer_attitude(
    motion: MotionReference, state: OperatorSettings, axes: Array, target_W_m: Array, aim: CameraAim, dt_s: float
) -> MotionReference:
    """The motion with attitude and tilt a step on: by the sticks where they are held, else by the assist, else level.

    `axes`, shape (5,): see `wakewise.operation.teleop.input.CONTROL_AXES`. `target_W_m`: shape (3,).
    """
    turn, rise, place = float(axes[3]), float(axes[4]), motion.place_W_m
    yaw = float(motion.angles_rad[2])
    desired = AttitudeReference(angles_rad=np.array([0.0, 0.0, yaw]), rates_rad_s=np.zeros(3), tilt_rad=motion.tilt_rad)
    if state.watch_target:
        desired = camera_on_target(place, motion.velocity_W_m_s, yaw, target_W_m, aim, dt_s)
    new = step_angle(motion, 0, desired, dt_s)
    by_hand = turn != 0.0 or not state.watch_target
    new = step_rate(new, 2, turn * FULL_RAD_S * state.share, dt_s) if by_hand else step_angle(new, 2, desired, dt_s)
    if rise == 0.0 and state.watch_target:
        return step_tilt(step_angle(new, 1, desired, dt_s), desired, dt_s, aim)
    rate = rise * TILT_RAD_S * state.gain
    if aim.joint is not None:
        level = replace(desired, angles_rad=np.zeros(3), rates_rad_s=np.zeros(3))
        return turn_tilt_joint(step_angle(new, 1, level, dt_s), rate, dt_s, aim)
    pitch = float(motion.angles_rad[1])
    return step_rate(new, 1, 0.0 if abs(pitch) >= STEEPEST_RAD and rate * pitch > 0.0 else rate, dt_s)


def steer_position(
    motion: MotionReference,
    sphere: StickFrame,
    state: OperatorSettings,
    axes: Array,
    target_W_m: Array,
    aim: CameraAim,
    estimate: BodyState,
    dt_s: float,
    keep_off: CollisionLimiter | None = None,
) -> tuple[MotionReference, StickFrame]:
    """The motion with velocity and place a step on, and what the sticks go by at the next.

    On an orbit it is the camera that keeps to the sphere, and the place of the body follows from its turn.
    """
    eye, swing = motion.camera(aim)
    frame = sphere_frame(eye, target_W_m) if state.orbit else level_frame(float(motion.angles_rad[2]))
    if sphere.frame is None or state.orbit != sphere.orbits:
        sphere = StickFrame(frame=frame, orbits=state.orbit)
    swing = swing if state.orbit else np.zeros(3)
    command = FULL_M_S * state.share * np.asarray(axes[:3])
    if state.orbit and elevation_rad(eye, target_W_m) > HIGHEST_RAD:
        command[2] = max(command[2], 0.0)
    before = frame if sphere.frame is None else sphere.frame
    now = before.T @ (motion.velocity_W_m_s + swing)
    range_m = None
    if state.orbit:
        command[0], range_m = _at_range(command[0], now[0], sphere.range_m, float(np.linalg.norm(eye - target_W_m)))
    answer, change = filtered_velocity(now, sphere.change_m_s2, command, dt_s)
    velocity = frame @ answer - swing
    blocked_by = None
    if keep_off is not None:
        free = velocity
        velocity, _ = keep_off.allowed(motion.X_WB, velocity, motion.omega_B_rad_s)
        if not np.array_equal(velocity, free):
            change = np.zeros(3)  # the collision limit is no acceleration of the sticks, so it does not continue
        if command.any():  # the obstacle of the command, not of the velocity that is already reduced
            _, blocked_by = keep_off.allowed(motion.X_WB, frame @ command - swing, motion.omega_B_rad_s)
    # Near the zenith the frame turns faster than a velocity may.
    velocity = limit_acceleration(motion.velocity_W_m_s, velocity, dt_s, HARDEST_M_S2)
    place = limit_lead(motion.place_W_m, 0.5 * (motion.velocity_W_m_s + velocity), estimate, dt_s)
    moved = replace(motion, place_W_m=place, velocity_W_m_s=velocity)
    return moved, StickFrame(
        frame=frame, change_m_s2=change, orbits=state.orbit, range_m=range_m, blocked_by=blocked_by
    )


def filtered_velocity(now_m_s: Array, change_m_s2: Array, command_m_s: Array, dt_s: float) -> tuple[Array, Array]:
    """Commanded velocity and acceleration after one step, with limited jerk; shape (3,) each, in the sticks' frame.

    No vehicle follows a step of the command; without the limit it would compensate the lag with thrust.
    """
    slower = np.linalg.norm(command_m_s) < np.linalg.norm(now_m_s)
    return limit_jerk(
        now_m_s, change_m_s2, command_m_s, dt_s, BRAKING_PEAK_M_S2 if slower else FASTER_PEAK_M_S2, JERK_M_S3
    )


def _at_range(command: float, now: float, kept_m: float | None, range_m: float) -> tuple[float, float | None]:
    """Commanded speed towards the centre, and the radius that is held; None while the stick is deflected."""
    if command != 0.0 or (kept_m is None and abs(now) > SLOW_M_S):
        return command, None
    kept_m = range_m if kept_m is None else kept_m
    return min(max(RANGE_PER_S * (range_m - kept_m), -RANGE_M_S), RANGE_M_S), kept_m


def limit_lead(place_W_m: Array, velocity_W_m_s: Array, estimate: BodyState, dt_s: float) -> Array:
    """A place moved on, shape (3,), on its leash while it moves; at rest it is held wherever the vehicle is carried."""
    known = bool(np.isfinite(estimate.X_WB.p_m).all())
    if not velocity_W_m_s.any() or not known:
        return np.asarray(place_W_m + dt_s * velocity_W_m_s)
    new = advance_reference(place_W_m, velocity_W_m_s, estimate, dt_s)
    step = new - place_W_m
    size, most = float(np.linalg.norm(step)), (PULL_M_S + float(np.linalg.norm(velocity_W_m_s))) * dt_s
    return np.asarray(new if size <= most else place_W_m + step * (most / size))

"""From what an operator asks for (a velocity) to a goal, and how closely it must be followed.

The paper's command: p_target = p_now + v_des T. With p_now taken afresh from every estimate, the noise of the estimate
becomes command, and a planner that obeys more flies worse (velocity deviation 18 % at w_track = 1 and 27 % at 20 in the
paper's world). So p_now is a place that moves as commanded and is kept within `LEASH_M` of the vehicle, lest it run
away from one that is held up.

`w_track` on the paper's scale sets the trade between obedience and still water: above 10 for transit, 5 for work,
below 2 for delicate places. It has one meaning here: 5 stands for the planner's default weights of tracking (w_track
200 per m2, w_path 20 per m2 and s, w_twist 1 per (m/s)2 and s), x for all three times x / 5; attitude, effort and wash
keep their weights. The planner's own field of the same name is one of the three and not on that scale. docs/methods.md
has a grid of it, `wakewise bench operator` flies the whole one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at, quat_from_euler, quat_from_matrix
from wakewise.core.interfaces import BodyState, Goal
from wakewise.planning.problem import PlanSettings

LEASH_M = 0.10
"""Farthest that the commanded place may be from the vehicle: what 0.1 m/s makes in a second."""
FULL_M_S, FULL_RAD_S = 0.5, math.radians(90.0)
"""What full stick asks for at gain 1; estimate: five times the pace of a mission."""
HIGHEST_RAD = math.radians(80.0)
"""Elevation above which an orbit does not climb: past the zenith left and right change places."""
PAPER_W_TRACK = 5.0
"""The paper's default; the planner's default weights of tracking, all three, stand for it."""
PAPER_DEVIATION = 0.12
"""Largest share of the way asked for that a plan may leave undone at the paper's w_track: of the 15 % that it promises,
what is left beside the 8 % that estimator and PID miss of any velocity, whatever the method (in squares)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocityCommand:
    """What an operator wants now: a velocity in W, and a point to keep in view, shape (3,) each, or a heading."""

    velocity_W_m_s: Array
    watch_W_m: Array | None = None
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, velocity_W_m_s=(3,))
        if self.watch_W_m is not None:
            freeze(self, watch_W_m=(3,))


def advance_reference(place_W_m: Array, velocity_W_m_s: Array, estimate: BodyState, dt_s: float) -> Array:
    """Commanded place after dt_s, shape (3,), on its leash to the vehicle; arguments have shape (3,)."""
    place = place_W_m + dt_s * velocity_W_m_s
    away = place - estimate.X_WB.p_m
    distance = float(np.linalg.norm(away))
    return np.asarray(place if distance <= LEASH_M else estimate.X_WB.p_m + away * (LEASH_M / distance))


def goal_of(command: VelocityCommand, place_W_m: Array) -> Goal:
    """Goal at a commanded place, moving as the operator asks, its forward axis on the point to watch.

    `place_W_m`, shape (3,), is that of `advance_reference`. Without a point to watch the vehicle is level with its
    heading. The goal's twist, in its own body frame, is the commanded velocity and the turn that keeps the point in
    view.

    Raises
    ------
    InputError
        If the place is the very point it should look at.
    """
    p, velocity = place_W_m, command.velocity_W_m_s
    if command.watch_W_m is None:
        X_WB, omega_W = Pose(p, quat_from_euler(0.0, 0.0, command.heading_rad)), np.zeros(3)
    else:
        away = command.watch_W_m - p
        X_WB = Pose(p, quat_from_matrix(look_at(p, command.watch_W_m)))
        # The line of sight r to a point at rest turns with r x (dr/dt) / |r|^2, dr/dt = -v.
        omega_W = np.cross(away, -velocity) / float(away @ away)
    R_BW = X_WB.R.T
    return Goal(X_WB=X_WB, nu_B=np.concatenate([R_BW @ velocity, R_BW @ omega_W]))


def scaled_tracking(plan: PlanSettings, w_track: float) -> PlanSettings:
    """Planner settings for the paper's scale of `w_track`: all weights of tracking grow with it, 5 leaves them alone.

    Raises
    ------
    InputError
        If it is not finite or not more than 0.
    """
    if not (np.isfinite(w_track) and w_track > 0.0):
        raise InputError(f"w_track: {w_track:g}, must be finite and more than 0")
    share = w_track / PAPER_W_TRACK
    weights = ("w_track", "w_path", "w_twist")
    return plan.model_copy(update={name: share * getattr(plan, name) for name in weights})


def limit_acceleration(velocity_m_s: Array, desired_m_s: Array, dt_s: float, acceleration_m_s2: float = 0.1) -> Array:
    """Velocity after dt_s on the way to a desired one at no more than this acceleration, shape (3,) each."""
    step = np.asarray(desired_m_s) - velocity_m_s
    size = float(np.linalg.norm(step))
    most = acceleration_m_s2 * dt_s
    return np.asarray(desired_m_s if size <= most else velocity_m_s + step * (most / size), dtype=np.float64)


def limit_jerk(
    velocity_m_s: Array,
    acceleration_m_s2: Array,
    desired_m_s: Array,
    dt_s: float,
    hardest_m_s2: float,
    jerk_m_s3: float,
) -> tuple[Array, Array]:
    """Velocity and acceleration after dt_s on the way to a desired velocity, shape (3,) each, both bounds kept.

    The acceleration aimed at is the one that can just fade, at this jerk, until the desired velocity is there (the law
    of `motion_profile.profile_step`, for vectors). So that is reached in finite time and, from rest, overshot by no
    more than jerk dt^2 / 8, a matter of whole steps.
    """
    left = np.asarray(desired_m_s) - velocity_m_s
    size, most = float(np.linalg.norm(left)), jerk_m_s3 * dt_s
    if size <= most * dt_s and float(np.linalg.norm(acceleration_m_s2)) <= most * (1.0 + 1e-9):
        return np.array(desired_m_s, dtype=np.float64), np.zeros(3)
    fades = math.sqrt(0.25 * most**2 + 2.0 * jerk_m_s3 * size) - 0.5 * most
    aimed = left * (min(hardest_m_s2, fades, size / dt_s) / max(size, 1e-12))
    acceleration = limit_acceleration(acceleration_m_s2, aimed, dt_s, jerk_m_s3)
    return velocity_m_s + dt_s * acceleration, acceleration


def deviation_limit(w_track: float) -> float:
    """Share of the way asked for that may be left undone at a w_track of the paper's scale: less the more it asks."""
    return PAPER_DEVIATION * math.sqrt(PAPER_W_TRACK / w_track)

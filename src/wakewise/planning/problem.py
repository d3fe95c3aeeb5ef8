"""The MPC problem: settings, problem and plan as records, and the reference over the horizon.

The problem, over N stages of h seconds (the paper: T = 2 s in 20 stages of 0.1 s):

    min  sum_k h (w_D D(x_k, T_k) + w_u |u_k|^2 + w_path |p - p_ref|^2 + w_att |e_att|^2 + w_twist |nu - nu_ref|^2)
         + w_track |p(T) - p_target|^2 + w_att |e_att(T)|^2
         + rho sum_k |excess of u_k - u_k-1 over the rate limit|^2 + w_change sum_k |u_k - u_k-1|^2 + clearance barrier

with thrust limits on u_k hard. u_k are the commands and T_k the mean thrusts over a stage behind the thrusters' lag.
D is divided by the sum of the region's weights (a mean square speed, (m/s)^2), so that weights do not depend on how
many points sample it. p_target is the last pose of the reference: p_now + v_des T for an operator's command.

Reference. A goal is a pose and a twist of now. Constant speed is right on legs and orbits. Where a mission or an
operator speeds up, a plan from it would be late by its age and the thrusters' lag. So the goal's change of twist is
extrapolated, too, and fades with `RAMP_S`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import one_of
from wakewise.core.defaults import DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Goal
from wakewise.core.jit.njit import assign, njit
from wakewise.core.settings import Settings
from wakewise.wake.disturbance import SUPERPOSITIONS, Superposition

PLAN_EVERY_S = 0.1
"""Time between two plans, and the most that one may take: a thruster's lag, within which nothing can be undone."""
RATE_LIMIT_N_S, RATE_PENALTY = 100.0, 100.0
"""Soft limit of the change of commands (N/s), which a thruster of 0.1 s reaches from 0 to 10 N, and the penalty rho of
the squared excess (per N^2), large beside every other price of a newton."""
CLEARANCE_M, BARRIER_REACH_M = 0.05, 0.25
"""Clearance at which the barrier becomes steep, that of a mission, and clearance from which nothing is felt; less where
the goal itself is nearer."""
SMOOTH_N = 0.5
"""Thrust below which the root of thrust is rounded off, or its slope at 0 would be infinite."""
EDGE_DEG = 3.0
"""Width of the edge that a planner gives to a cone with a sharp one, whose slope is not to be had."""


@dataclass(frozen=True, kw_only=True)
class PlanTerms:
    """What a plan weighs besides tracking, and when it is good enough: not for a scenario to set, or set elsewhere."""

    w_disturbance: float = DISTURBANCE_WEIGHT  # of `ControlSettings`, shared with the allocators
    w_effort: float = EFFORT_WEIGHT
    superposition: Superposition = "coherent"  # how jets add up
    tolerance: float = 1e-3  # relative decrease that ends the iterations
    second_start_every: int = 10  # plans between tries of another sign pattern of the spare thrusts; 0: none

    def __post_init__(self) -> None:
        one_of(self.superposition, SUPERPOSITIONS, "superposition")


class PlanSettings(Settings):
    """Horizon, weights of tracking and effort of the planner.

    The weights of tracking are per square metre (or rad, or m/s) and second, `w_track` per square metre at the end.
    """

    stages: int = Field(default=20, description="stages of the horizon", ge=2, le=60)
    stage_s: float = Field(default=0.1, description="length of one stage (s)", gt=0.0, le=0.5)
    w_change: float = Field(default=0.0, description="weight of squared change of commands (per N^2)", ge=0.0)
    w_track: float = Field(default=200.0, description="weight of the squared distance at the end (per m^2)", ge=0.0)
    w_path: float = Field(default=20.0, description="weight of the squared distance on the way (per m^2 s)", ge=0.0)
    w_attitude: float = Field(default=20.0, description="weight of the squared attitude error (per rad^2 s)", ge=0.0)
    w_twist: float = Field(default=1.0, description="weight of the squared twist error (per (m/s)^2 s)", ge=0.0)
    attitude_tolerance_rad: float = Field(
        default=0.0, description="attitude error that costs nothing (rad); lets buoyancy carry load", ge=0.0, le=0.5
    )
    iterations: int = Field(default=5, description="most iterations per plan; 1 is the fast mode", ge=1, le=50)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanProblem:
    """One question to a planner."""

    state: Array  # shape (13,): position, quaternion (w, x, y, z) and twist now
    thrusts_N: Array  # shape (n,): what the thrusters give now
    command_N: Array  # shape (n,): what they were last told
    reference: Array  # shape (N + 1, 13): desired states at the ends of the stages, the first one for now
    # Wrench that the vehicle's model does not explain, shape (3,) each; its force keeps its direction in the world.
    force_W_N: Array = field(default_factory=lambda: np.zeros(3))
    moment_B_Nm: Array = field(default_factory=lambda: np.zeros(3))
    current_W_m_s: Array = field(default_factory=lambda: np.zeros(3))
    tracking_weight_scale: float = 1.0  # factor of `w_track`, `w_path` and `w_twist`, more than 0

    def __post_init__(self) -> None:
        n = len(self.thrusts_N)
        freeze(
            self,
            state=(13,),
            thrusts_N=(n,),
            command_N=(n,),
            reference=(None, 13),
            force_W_N=(3,),
            moment_B_Nm=(3,),
            current_W_m_s=(3,),
        )
        if not 0.0 < self.tracking_weight_scale < np.inf:
            raise InputError(f"tracking_weight_scale: {self.tracking_weight_scale:g}, must be finite and more than 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon:
    """A plan."""

    states: Array  # shape (N + 1, 13): predicted states, the first one being that of the problem
    commands_N: Array  # shape (N, n): what to tell the thrusters
    thrusts_N: Array  # shape (N, n): the mean thrust that they give in each stage
    cost: float  # the objective, with rounded roots and edges
    disturbance: float  # mean of D over the horizon, (m/s)^2, with rounded roots and edges
    iterations: int
    converged: bool  # the last step promised less than the tolerance (one iteration: QP solved and the cost fell)
    solver: str  # what solved the last QP
    curvature: Array  # shape (n, n): of the cost by the thrusts of the first stage, for corrections between plans


def state_of(body: BodyState) -> Array:
    """Position, quaternion and twist in one array, shape (13,)."""
    return np.concatenate([body.X_WB.p_m, body.X_WB.q, body.nu_B])


def shifted(plan: Horizon, stages: int) -> Array:
    """Commands of a plan, moved on by whole stages; the last one is held."""
    by = min(max(stages, 0), len(plan.commands_N))
    return np.vstack([plan.commands_N[by:], np.repeat(plan.commands_N[-1:], by, axis=0)])


RAMP_S = 0.5
"""How long a change of speed goes on, on average, once it is seen: half of the second that an operator (0.1 m/s at
0.1 m/s2) or a leg of a mission (0.06 m/s at 0.05 m/s2) needs to reach its speed. Nobody knows when it ends, so it fades
with this time constant, as a change does that may end at any moment."""


def reference_of(goal: Goal, stages: int, stage_s: float, change_B: Array | None = None) -> Array:
    """Desired states at the ends of the stages: position, quaternion and twist.

    The goal's twist is carried on in its own body frame over `stages` of `stage_s`. `change_B`, shape (6,), is how fast
    it changes, in the body frame; it fades with `RAMP_S` (None: no change). Gives shape (stages + 1, 13), the first row
    the goal itself.
    """
    reference = np.empty((stages + 1, 13))
    change = np.zeros(6) if change_B is None else np.asarray(change_B, dtype=np.float64)
    _carry_on(goal.X_WB.p_m, goal.X_WB.q, goal.nu_B, change, stage_s, reference)
    return reference


@njit
def _carry_on(p: Array, q: Array, nu: Array, change: Array, stage_s: float, out: Array) -> None:
    assign(out[0, :3], p)
    assign(out[0, 3:7], q)
    assign(out[0, 7:], nu)
    twist, half, middle = np.empty(6), np.empty(4), np.empty(4)
    for k in range(1, out.shape[0]):
        before, after = out[k - 1], out[k]
        # Over the stage it moves with the twist of its middle, on an arc.
        so_far = RAMP_S * (1.0 - np.exp(-(k - 0.5) * stage_s / RAMP_S))
        for r in range(6):
            twist[r] = nu[r] + so_far * change[r]
            after[7 + r] = nu[r] + RAMP_S * (1.0 - np.exp(-k * stage_s / RAMP_S)) * change[r]
        rate = np.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
        angle = 0.5 * rate * stage_s
        sine = np.sin(0.5 * angle) / rate if rate > 1e-12 else 0.25 * stage_s
        half[0] = np.cos(0.5 * angle)
        for r in range(3):
            half[1 + r] = sine * twist[3 + r]
        _times(before[3:7], half, middle)
        _times(middle, half, after[3:7])
        # The chord of a screw: along the velocity half way, shortened across the axis of the turn by sin(a)/a.
        shorter = np.sin(angle) / angle if angle > 1e-6 else 1.0
        along = 0.0
        if rate > 1e-12:
            along = (1.0 - shorter) * (twist[0] * twist[3] + twist[1] * twist[4] + twist[2] * twist[5]) / (rate * rate)
        w, x, y, z = middle[0], middle[1], middle[2], middle[3]
        for r in range(3):
            twist[r] = shorter * twist[r] + along * twist[3 + r]
        u, v, s = twist[0], twist[1], twist[2]
        a, b, c = 2.0 * (y * s - z * v), 2.0 * (z * u - x * s), 2.0 * (x * v - y * u)
        after[0] = before[0] + stage_s * (u + w * a + y * c - z * b)
        after[1] = before[1] + stage_s * (v + w * b + z * a - x * c)
        after[2] = before[2] + stage_s * (s + w * c + x * b - y * a)


@njit
def _times(a: Array, b: Array, out: Array) -> None:
    """Quaternion product."""
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@njit
def between(a: Array, b: Array, share: float) -> Array:
    """State, shape (13,), a share of the way from one to the next: the pose along the turn, the rest straight."""
    state = (1.0 - share) * a + share * b
    turn, half = np.empty(4), np.empty(4)
    back = np.array([a[3], -a[4], -a[5], -a[6]])
    _times(back, b[3:7], turn)
    if turn[0] < 0.0:
        assign(turn, -turn)
    sine = np.sqrt(turn[1] ** 2 + turn[2] ** 2 + turn[3] ** 2)
    angle = share * np.arctan2(sine, turn[0])
    scale = np.sin(angle) / sine if sine > 1e-12 else share
    half[0] = np.cos(angle)
    assign(half[1:], scale * turn[1:])
    _times(a[3:7], half, state[3:7])
    return state

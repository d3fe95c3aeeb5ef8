"""What a receding-horizon planner is asked, and what it answers: settings, problem and plan as records.

The problem, over N stages of h seconds (the paper: T = 2 s in 20 stages of 0.1 s):

    min  sum_k h (w_D D(x_k, T_k) + w_u |u_k|^2 + w_path |p - p_ref|^2 + w_att |e_att|^2 + w_twist |nu - nu_ref|^2)
         + w_track |p(T) - p_target|^2 + w_att |e_att(T)|^2
         + rho sum_k |excess of u_k - u_k-1 over the rate limit|^2 + w_change sum_k |u_k - u_k-1|^2 + clearance barrier

with thrust limits on u_k hard. u_k are the commands and T_k the mean thrusts over a stage behind the thrusters' lag.
D is divided by the sum of the region's weights (a mean square speed, (m/s)^2), so that weights do not depend on how
many points sample it. p_target is the last pose of the reference: p_now + v_des T for an operator's command.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import one_of
from wakewise.core.defaults import DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState
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
    """What a plan weighs besides tracking, and when it is good enough: not for a scenario to set, or set elsewhere.

    Parameters
    ----------
    w_disturbance, w_effort : float
        Of `ControlSettings`, which the allocators of one instant share.
    superposition : "coherent" or "incoherent"
        How jets add up.
    tolerance : float
        Relative decrease that ends the iterations.
    second_start_every : int
        Plans between tries of another sign pattern of the spare thrusts; 0 for none.
    """

    w_disturbance: float = DISTURBANCE_WEIGHT
    w_effort: float = EFFORT_WEIGHT
    superposition: Superposition = "coherent"
    tolerance: float = 1e-3
    second_start_every: int = 10

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

    @property
    def horizon_s(self) -> float:
        """T, in seconds."""
        return self.stages * self.stage_s


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanProblem:
    """One question to a planner.

    Parameters
    ----------
    state : ndarray, shape (13,)
        Position, quaternion (w, x, y, z) and twist now.
    thrusts_N, command_N : ndarray, shape (n,)
        What the thrusters give now, and what they were last told.
    force_W_N, moment_B_Nm : ndarray, shape (3,)
        Wrench that the vehicle's model does not explain; its force keeps its direction in the world.
    current_W_m_s : ndarray, shape (3,)
    reference : ndarray, shape (N + 1, 13)
        Wished states at the ends of the stages, the first one for now.
    tracking_weight_scale : float
        What the weights of tracking (`w_track`, `w_path`, `w_twist`) are multiplied with, more than 0.
    """

    state: Array
    thrusts_N: Array
    command_N: Array
    reference: Array
    force_W_N: Array = field(default_factory=lambda: np.zeros(3))
    moment_B_Nm: Array = field(default_factory=lambda: np.zeros(3))
    current_W_m_s: Array = field(default_factory=lambda: np.zeros(3))
    tracking_weight_scale: float = 1.0

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
    """A plan.

    Parameters
    ----------
    states : ndarray, shape (N + 1, 13)
        Predicted states, the first one being that of the problem.
    commands_N, thrusts_N : ndarray, shape (N, n)
        What to tell the thrusters, and the mean thrust that they give in each stage.
    cost, disturbance : float
        The objective, and the mean of D over the horizon ((m/s)^2), both with rounded roots and edges.
    iterations : int
    converged : bool
        The last step promised less than the tolerance (one iteration only: its QP was solved and the cost fell).
    solver : str
        What solved the last QP.
    curvature : ndarray, shape (n, n)
        Curvature of the cost by the thrusts of the first stage, for small corrections between plans.
    """

    states: Array
    commands_N: Array
    thrusts_N: Array
    cost: float
    disturbance: float
    iterations: int
    converged: bool
    solver: str
    curvature: Array


def state_of(body: BodyState) -> Array:
    """Position, quaternion and twist in one array, shape (13,)."""
    return np.concatenate([body.X_WB.p_m, body.X_WB.q, body.nu_B])


def shifted(plan: Horizon, stages: int) -> Array:
    """Commands of a plan, moved on by whole stages; the last one is held."""
    by = min(max(stages, 0), len(plan.commands_N))
    return np.vstack([plan.commands_N[by:], np.repeat(plan.commands_N[-1:], by, axis=0)])

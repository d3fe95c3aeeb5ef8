"""What a receding-horizon planner is asked, and what it answers: settings, problem and plan as records.

The problem, over N stages of h seconds (the paper: T = 2 s in 20 stages of 0.1 s):

    min  sum_k h (w_D,k D(x_k, T_k) + w_u |u_k|^2 + w_path |p - p_ref|^2 + w_att |e_att|^2 + w_twist |nu - nu_ref|^2)
         + w_time T + w_track |p(T) - p_target|^2 + w_att |e_att(T)|^2
         + rho sum_k |excess of u_k - u_k-1 over the rate limit|^2 + w_change sum_k |u_k - u_k-1|^2 + clearance barrier

with thrust limits on u_k hard. u_k are the commands and T_k the mean thrusts over a stage behind the thrusters' lag.
D is divided by the sum of the region's weights (a mean square speed, (m/s)^2), so that weights do not depend on how
many points sample it. With `persistence`, D is that of jets which follow the thrusts with the lag of the wash on its
way to the target, so that what lasts weighs more than what is over soon. p_target is the last pose of the reference:
p_now + v_des T for an operator's command.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pydantic import Field

from wakewise.arrays import Array, freeze
from wakewise.interfaces import BodyState
from wakewise.settings import Settings


class PlanSettings(Settings):
    """Horizon, weights, levers and effort of the planner.

    The weights of tracking are per square metre (or rad, or m/s) and second, `w_track` per square metre at the end.
    """

    stages: int = Field(default=20, description="stages of the horizon", ge=2, le=60)
    stage_s: float = Field(default=0.1, description="length of one stage (s)", gt=0.0, le=0.5)
    plan_hz: float = Field(default=10.0, description="plans per second (Hz)", gt=0.0, le=100.0)
    w_disturbance: float = Field(
        default=150.0, description="weight of the mean square water speed at the target (per (m/s)^2 s)", ge=0.0
    )
    w_effort: float = Field(default=1e-3, description="weight of squared commands (per N^2 s)", ge=0.0)
    w_change: float = Field(default=0.0, description="weight of squared change of commands (per N^2)", ge=0.0)
    w_track: float = Field(default=200.0, description="weight of the squared distance at the end (per m^2)", ge=0.0)
    w_path: float = Field(default=20.0, description="weight of the squared distance on the way (per m^2 s)", ge=0.0)
    w_attitude: float = Field(default=20.0, description="weight of the squared attitude error (per rad^2 s)", ge=0.0)
    w_twist: float = Field(default=1.0, description="weight of the squared twist error (per (m/s)^2 s)", ge=0.0)
    w_time: float = Field(default=1.0, description="weight of the horizon's length (per s)", ge=0.0)
    attitude_tolerance_rad: float = Field(
        default=0.0, description="attitude error that costs nothing (rad); lets buoyancy carry load", ge=0.0, le=0.5
    )
    rate_limit_N_s: float = Field(default=100.0, description="soft limit of the change of commands (N/s)", gt=0.0)
    rho: float = Field(default=100.0, description="penalty of the squared excess over the rate limit (per N^2)", ge=0.0)
    smooth_N: float = Field(
        default=0.5, description="thrust below which the root of thrust is rounded off (N)", gt=0.0, le=5.0
    )
    edge_width_deg: float = Field(
        default=3.0, description="width of the edge given to a cone that has a sharp one (deg)", gt=0.0, le=40.0
    )
    superposition: Literal["coherent", "incoherent"] = Field(
        default="coherent", description="how jets that meet add up: velocities, or squares of speed"
    )
    quiet_gain: float = Field(
        default=1.0, description="how many times more disturbance counts where it arrives during an exposure", ge=1.0
    )
    exposure_s: float = Field(default=0.1, description="how long the shutter stays open (s)", ge=0.0)
    travel: bool = Field(default=False, description="count wash when it arrives at the target, not when it leaves")
    persistence: float = Field(
        default=0.0,
        description="lag of the jets that the disturbance is made of, in travel times to the target; 0 for none",
        ge=0.0,
        le=3.0,
    )
    clearance_m: float = Field(default=0.05, description="clearance at which the barrier becomes steep (m)", gt=0.0)
    barrier_reach_m: float = Field(
        default=0.25,
        description="clearance from which nothing is felt (m); less where the goal itself is nearer",
        gt=0.0,
    )
    iterations: int = Field(default=5, description="most iterations per plan; 1 is the fast mode", ge=1, le=50)
    tolerance: float = Field(default=1e-3, description="relative decrease that ends the iterations", gt=0.0, le=0.1)
    second_start_every: int = Field(
        default=10, description="plans between tries of another sign pattern of the spare thrusts; 0 for none", ge=0
    )
    deadline_s: float = Field(default=0.1, description="most time from question to answer (s)", gt=0.0)

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
    quiet : ndarray, shape (N,)
        Factor of w_D per stage.
    jets_N, jet_lags_s : ndarray, shape (n,), optional
        Thrusts that the jets stand for now, and the lags with which they follow the thrusters; None for no lag.
    """

    state: Array
    thrusts_N: Array
    command_N: Array
    reference: Array
    quiet: Array
    force_W_N: Array = field(default_factory=lambda: np.zeros(3))
    moment_B_Nm: Array = field(default_factory=lambda: np.zeros(3))
    current_W_m_s: Array = field(default_factory=lambda: np.zeros(3))
    jets_N: Array | None = None
    jet_lags_s: Array | None = None

    def __post_init__(self) -> None:
        n, stages = len(self.thrusts_N), len(self.quiet)
        freeze(
            self,
            state=(13,),
            thrusts_N=(n,),
            command_N=(n,),
            reference=(stages + 1, 13),
            quiet=(stages,),
            force_W_N=(3,),
            moment_B_Nm=(3,),
            current_W_m_s=(3,),
        )
        if self.jets_N is not None and self.jet_lags_s is not None:
            freeze(self, jets_N=(n,), jet_lags_s=(n,))


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

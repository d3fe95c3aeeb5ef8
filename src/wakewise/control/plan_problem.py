"""What a receding-horizon planner is asked, and what it answers: settings, problem and plan as records.

The problem, over N stages of h seconds (the paper: T = 2 s in 20 stages of 0.1 s):

    min  sum_k h (w_D,k D(x_k, T_k) + w_u |u_k|^2 + w_path |p - p_ref|^2 + w_att |e_att|^2 + w_twist |nu - nu_ref|^2)
         + w_time T + w_track |p(T) - p_target|^2 + w_att |e_att(T)|^2
         + rho sum_k |excess of u_k - u_k-1 over the rate limit|^2 + w_change sum_k |u_k - u_k-1|^2 + clearance barrier

with thrust limits on u_k hard. u_k are the commands and T_k the mean thrusts over a stage behind the thrusters' lag.
D is divided by the sum of the region's weights (a mean square speed, (m/s)^2), so that weights do not depend on how
many points sample it. p_target is the last pose of the reference: p_now + v_des T for an operator's command.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pydantic import Field

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError
from wakewise.geometry import quat_from_rotvec, quat_multiply
from wakewise.interfaces import BodyState, Goal
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
    clearance_m: float = Field(default=0.05, description="clearance at which the barrier becomes steep (m)", gt=0.0)
    barrier_reach_m: float = Field(default=0.25, description="clearance from which nothing is felt (m)", gt=0.0)
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
class Surroundings:
    """What the hull must not touch.

    Parameters
    ----------
    planes : ndarray, shape (n, 4)
        Unit normal into the free water and offset: free where normal . p > offset.
    spheres : ndarray, shape (n, 4)
        Centre in W and radius: the target and other obstacles.
    """

    planes: Array = field(default_factory=lambda: np.zeros((0, 4)))
    spheres: Array = field(default_factory=lambda: np.zeros((0, 4)))

    def __post_init__(self) -> None:
        freeze(self, planes=(None, 4), spheres=(None, 4))
        if self.spheres.size and np.any(self.spheres[:, 3] < 0.0):
            raise InputError(f"obstacle: radius {self.spheres[:, 3].min():g} m, must not be negative")
        if self.planes.size and np.any(np.abs(np.linalg.norm(self.planes[:, :3], axis=1) - 1.0) > 1e-6):
            raise InputError("plane: its normal is not of unit length")

    @classmethod
    def tank(cls, low_W_m: Array, high_W_m: Array, spheres: Array | None = None) -> Surroundings:
        """Walls, surface and floor of a box from `low_W_m` to `high_W_m`, shape (3,) each."""
        eye = np.eye(3)
        planes = np.vstack([np.column_stack([eye, low_W_m]), np.column_stack([-eye, -np.asarray(high_W_m)])])
        return cls(planes=planes, spheres=np.zeros((0, 4)) if spheres is None else spheres)


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
    """

    state: Array
    thrusts_N: Array
    command_N: Array
    reference: Array
    quiet: Array
    force_W_N: Array = field(default_factory=lambda: np.zeros(3))
    moment_B_Nm: Array = field(default_factory=lambda: np.zeros(3))
    current_W_m_s: Array = field(default_factory=lambda: np.zeros(3))

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


def reference_of(goal: Goal, stages: int, stage_s: float) -> Array:
    """Wished states, shape (stages + 1, 13): the goal carried on with its own twist, constant in its body frame."""
    reference = np.empty((stages + 1, 13))
    p, q = np.array(goal.X_WB.p_m), np.array(goal.X_WB.q)
    nu = goal.nu_B
    turn = quat_from_rotvec(nu[3:] * stage_s)
    half = quat_from_rotvec(nu[3:] * (0.5 * stage_s))
    for k in range(stages + 1):
        reference[k, :3], reference[k, 3:7], reference[k, 7:] = p, q, nu
        # The chord of an arc: along the velocity half way, shortened by sin(a)/a.
        angle = 0.5 * stage_s * float(np.linalg.norm(nu[3:]))
        p = p + stage_s * float(np.sinc(angle / np.pi)) * _rotated(quat_multiply(q, half), nu[:3])
        q = quat_multiply(q, turn)
    return reference


def state_of(body: BodyState) -> Array:
    """Position, quaternion and twist in one array, shape (13,)."""
    return np.concatenate([body.X_WB.p_m, body.X_WB.q, body.nu_B])


def _rotated(q: Array, v: Array) -> Array:
    t = 2.0 * np.cross(q[1:], v)
    return np.asarray(v + q[0] * t + np.cross(q[1:], t))

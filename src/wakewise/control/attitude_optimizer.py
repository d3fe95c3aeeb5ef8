"""Attitude optimisation: the hull pitches about the camera's hinge to where its thrusters disturb least.

A camera on a joint gives back what a fixed one takes: the mission says where the camera is and where it looks, and the
body may pitch about the joint's hinge as far as the stops allow. That is a redundancy beside that of the thrusters. A
pitched vehicle's weight lies partly along its level thrusters, and the directions and origins of its jets change with
the angle; the price is the moment with which the vehicle rights itself.

The *pitch offset* is the angle by which the joint stands above the mission's. The hinge turns the body the other way:

    X_WB' = X_WB S(-offset),   S(a) the turn by a about the joint's axis through its hinge, in B,

whatever the tilt is, since turns about one axis add up: X_BC(tilt) = S(tilt) X_BC(0). The camera's pose
X_WB' X_BC(tilt + offset) = X_WB X_BC(tilt) is the mission's.

The choice is slow. The offsets between the camera's stops are evaluated one after the other (`EVALUATE_S`), for one
goal, load and current; then `select` takes one. The hull goes there along a bang-bang profile (`motion_profile.py`).
The goal moves with it, twist included, so that feed-forward and horizon are right. An offset takes seconds to be given
back while the mission goes on, so there must be room where the mission will be by then; where there is none, the
offset is given up at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from wakewise.allocation import Layout, PowerLaw, Weights, compile_layout, min_wash_allocation
from wakewise.control.motion_profile import profile_step
from wakewise.control.null_space_allocation import FULL, STANDING_W, AllocationContext, power_law
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_rotvec
from wakewise.core.interfaces import BodyState, Goal
from wakewise.planning import Surroundings
from wakewise.planning.kernels import least_gap
from wakewise.planning.problem import CLEARANCE_M, reference_of
from wakewise.robot.vehicles import RigidBody, TiltJoint, Vehicle, compile_body, restoring_wrench
from wakewise.robot.vehicles.dynamics import coriolis_wrench, damping_wrench

if TYPE_CHECKING:
    from wakewise.control.pipeline import PipelineState

STEP_RAD = float(np.radians(5.0))
"""Distance between the offsets that are compared: half a metre on, a jet moves by 4 cm, less than its own width
there.
"""
RESERVE = 0.8
"""Share of the thrusters' limits that holding an attitude may take; the rest is the tracker's."""
RATE_RAD_S, ACCELERATION_RAD_S2 = 0.08, 0.04
"""How fast an offset changes, and how fast that. The body's middle goes round a hinge at most a quarter of a metre
away: at 2 cm/s, a third of a mission's speed on its orbits, with 1 cm/s2, a fifth of the acceleration of a mission's
legs, so that a change of attitude asks for less than the mission itself does."""

EVALUATE_S, ROUND_S = 0.1, 2.0
"""Time between two evaluations: the planner's own; and what a round of them takes over a joint of 90 deg."""
LOAD_S = 2.0
"""Time constant over which the load is averaged: a round. An attitude is for what stays."""
AHEAD_S = 0.5
"""Time between two places where there must be room: at a mission's fastest, .3 m/s, half a hull."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hinge:
    """A camera's mount at no tilt and the joint that turns it, as a change of attitude needs them."""

    X_BC: Pose
    joint: TiltJoint

    def span(self, tilt_rad: float) -> tuple[float, float]:
        """Least and largest offset that the stops allow a camera that the mission tilts so; they hold zero."""
        return min(self.joint.low_rad - tilt_rad, 0.0), max(self.joint.high_rad - tilt_rad, 0.0)

    @property
    def axis(self) -> Array:
        """The joint's axis in B, shape (3,): the camera's own, to its right."""
        return self.X_BC.R[:, 0]

    @property
    def pivot_m(self) -> Array:
        """A point on the joint's axis, shape (3,), from B's origin."""
        return self.X_BC.p_m if self.joint.p_BJ_m is None else self.joint.p_BJ_m

    def with_offset(self, goal: Goal, offset_rad: float, rate_rad_s: float = 0.0) -> Goal:
        """The goal with another attitude and tilt, the camera's pose and motion as they were.

        `offset_rad` is by how much the joint stands above the goal's tilt, `rate_rad_s` how fast that grows. The new
        goal's twist is the derivative of its pose: the old one seen from the new frame, and the turn of the body about
        the hinge, against the joint's.
        """
        if offset_rad == 0.0 and rate_rad_s == 0.0:
            return goal
        axis, pivot = self.axis, self.pivot_m
        turn = Pose(np.zeros(3), quat_from_rotvec(-offset_rad * axis))
        R = turn.R
        shift = pivot - R @ pivot
        v, omega = goal.nu_B[:3], goal.nu_B[3:]
        # Of the new origin, still in the old frame; then in the new one, and the turn about the pivot.
        nu = np.concatenate([R.T @ (v + np.cross(omega, shift)), R.T @ omega])
        nu += rate_rad_s * np.concatenate([np.cross(axis, pivot), -axis])
        return replace(goal, X_WB=goal.X_WB @ Pose(shift, turn.q), nu_B=nu, tilt_rad=goal.tilt_rad + offset_rad)


def offset_step(offset_rad: float, rate_rad_s: float, target_rad: float, dt_s: float) -> tuple[float, float]:
    """Offset and its rate a step later on the way to a target at rest, within `RATE_RAD_S` and its own change."""
    return profile_step(offset_rad, rate_rad_s, target_rad, dt_s, RATE_RAD_S, ACCELERATION_RAD_S2)


@lru_cache(maxsize=512)
def return_profile(offset_rad: float, held_s: float = 0.0) -> tuple[float, ...]:
    """Offsets every `AHEAD_S` from now on, if one is held for a while and then given back."""
    offset, rate, offsets = offset_rad, 0.0, [offset_rad] * (1 + round(held_s / AHEAD_S))
    while offset != 0.0:
        for _ in range(round(AHEAD_S / EVALUATE_S)):
            offset, rate = offset_step(offset, rate, 0.0, EVALUATE_S)
        offsets.append(offset)
    return tuple(offsets)


Gram = Callable[[Pose, Array], Array]
"""`(X_WB, thrusts_N) -> G`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HoldingTask:
    """What is to be held: a goal, and the load on the vehicle there.

    `force_W_N`, shape (3,), keeps its direction in the world (trim, current, cable), `moment_B_Nm`, shape (3,), in the
    body. `gram` gives the matrix of D, shape (2 n, 2 n), of a body's pose and of thrusts about which it is to hold,
    shape (n,); `total_weight` is that of the water it counts.
    """

    goal: Goal
    force_W_N: Array
    moment_B_Nm: Array
    gram: Gram
    total_weight: float

    def __post_init__(self) -> None:
        freeze(self, force_W_N=(3,), moment_B_Nm=(3,))


@dataclass(frozen=True, kw_only=True)
class AttitudeCost:
    """What holding an attitude costs: the allocators' own cost, and the power that the thrusters take for it.

    Both are infinite where it is not to be had.
    """

    cost: float
    power_W: float


INFEASIBLE = AttitudeCost(cost=np.inf, power_W=np.inf)
NEAR = 4.0
"""Attitudes that cost at most this many times the least are as good as the least: no wake model of ours knows the
speeds of the water within a factor of two (docs/research-log/0014), and cost goes with their square."""
MOST_POWER = 2.0
"""An attitude may take this many times the power of the mission's own. Where wash is carried off by a current or has
nothing to disturb, wake models still find it, and a vehicle that hovers for nearly nothing would pitch for it."""
WORTH = 0.1
"""Share of the power, or of the bound on the cost, by which another attitude must be better than the present one.

Of the power it must save `STANDING_W`, too: what a vehicle rights itself with is known to a few tenths of a newton
metre, and in nearly perfect trim one pitched to and fro by 5 deg for half a watt that it never found there.
"""


def select(costs: Sequence[AttitudeCost], own: int, present: int) -> int:
    """Which of some attitudes to take: of those that cost about the least, the one of least power.

    Thrusts are known well, what they do to the water roughly: a factor of two in cost decides, below that the power.
    The present one stays while it is about as good by both.

    `own` and `present` are the numbers of the mission's own attitude and of the present one.
    """
    most = MOST_POWER * costs[own].power_W
    usable = [k for k, each in enumerate(costs) if each.power_W <= most and np.isfinite(each.cost)]
    if not usable:
        return own
    least = NEAR * min(costs[k].cost for k in usable)
    best = min((k for k in usable if costs[k].cost <= least), key=lambda k: costs[k].power_W)
    cost, power, enough = costs[present].cost, costs[present].power_W, costs[best].power_W + STANDING_W
    stays = cost <= (1.0 + WORTH) * least and (1.0 - WORTH) * power <= min(enough, most)
    return present if stays else best


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeEvaluator:
    """What an attitude is weighed by: the nominal vehicle, what it may not touch, and the allocators' own weights.

    `half_m`, shape (3,), is half the hull's size; `layout` has the thrusters' limits less the tracker's reserve.
    """

    hinge: Hinge
    body: RigidBody
    layout: Layout
    law: PowerLaw
    half_m: Array
    around: Surroundings
    w_disturbance: float
    w_effort: float

    @classmethod
    def of(
        cls, vehicle: Vehicle, joint: TiltJoint, around: Surroundings, weights: tuple[float, float]
    ) -> AttitudeEvaluator:
        """For a vehicle with this joint, and weights of disturbance (of its weighted mean) and effort."""
        lower, upper = RESERVE * vehicle.thrust_lower_N, RESERVE * vehicle.thrust_upper_N
        return cls(
            hinge=Hinge(X_BC=vehicle.X_BC, joint=joint),
            body=compile_body(vehicle),
            layout=compile_layout(vehicle.allocation_matrix, lower, upper),
            law=power_law(vehicle),
            half_m=0.5 * np.asarray(vehicle.size_m),
            around=around,
            w_disturbance=weights[0],
            w_effort=weights[1],
        )

    def offsets(self, goal: Goal) -> tuple[float, ...]:
        """Offsets to compare: whole steps between the stops, and the stops."""
        low, high = self.hinge.span(goal.tilt_rad)
        steps = STEP_RAD * np.arange(np.ceil(low / STEP_RAD), np.floor(high / STEP_RAD) + 1.0)
        return tuple(float(offset) for offset in np.unique(np.concatenate([[low], steps, [0.0], [high]]).round(9)))

    def cost(self, task: HoldingTask, offset_rad: float) -> AttitudeCost:
        """What the gentlest thrusts that hold an attitude cost; `INFEASIBLE` where there are none.

        That is: where there is no room (`has_room`), or the thrusters' limits do not suffice. The wrench is the
        tracker's feed-forward: against weight, buoyancy and the moment that rights the vehicle, against the drag of the
        goal's own motion and the load.
        """
        goal = self.hinge.with_offset(task.goal, offset_rad)
        if offset_rad != 0.0 and not self.has_room(task.goal, offset_rad, ROUND_S):
            return INFEASIBLE
        nu = np.array(goal.nu_B)
        wrench = -restoring_wrench(self.body, goal.X_WB.q) - damping_wrench(self.body, nu)
        wrench -= coriolis_wrench(self.body, nu)
        wrench[:3] -= goal.X_WB.R.T @ task.force_W_N
        wrench[3:] -= task.moment_B_Nm
        if not np.isfinite(wrench).all():
            return INFEASIBLE
        G = task.gram(goal.X_WB, self.layout.inverse @ wrench)
        if not np.isfinite(G).all():
            return INFEASIBLE
        weights = Weights(disturbance=self.w_disturbance / task.total_weight, effort=self.w_effort)
        found = min_wash_allocation(self.layout, wrench, G, weights)
        if found.scale < FULL or found.disturbance is None:
            return INFEASIBLE
        T = found.thrusts_N
        return AttitudeCost(
            cost=weights.disturbance * found.disturbance + weights.effort * float(T @ T),
            power_W=float(self.law.power_W(T)),
        )

    def has_room(self, goal: Goal, offset_rad: float, held_s: float = 0.0) -> bool:
        """Whether an offset that is held for a while keeps the hull clear until it is given back, the goal going on.

        Clear is: no nearer to anything than `CLEARANCE_M`, or than the mission's own attitude there.
        """
        offsets = np.array(return_profile(offset_rad, held_s))
        way = reference_of(goal, len(offsets) - 1, AHEAD_S)
        turns = matrix_from_quat(quat_from_rotvec(np.multiply.outer(-offsets, self.hinge.axis)))
        R_own = matrix_from_quat(way[:, 3:7])
        p_own, pivot = way[:, :3].copy(), self.hinge.pivot_m
        # As `Hinge.with_offset` has it, for all places at once.
        p_flown = p_own + np.squeeze(R_own @ (pivot - turns @ pivot)[..., None], -1)
        both = zip(p_own, R_own, p_flown, R_own @ turns, strict=True)
        return all(self.gap_m(p, R) >= min(CLEARANCE_M, self.gap_m(p0, R0)) for p0, R0, p, R in both)

    def gap_m(self, p_m: Array, R: Array) -> float:
        """Least distance of a hull from what it may not touch: its middle, shape (3,), and its attitude, (3, 3)."""
        return float(least_gap(p_m, R, self.half_m, self.around.planes, self.around.spheres))


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeSearch:
    """A round of evaluations: its task, the offsets to evaluate, the present target first, and the costs so far."""

    task: HoldingTask
    offsets: tuple[float, ...]
    costs: tuple[AttitudeCost, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeOptimizer:
    """Stage 1 of the pipeline: replaces the goal's attitude by one of its own choice, under the same camera pose.

    `context` is the water that counts. What the camera's joint must do for it is told in `Command.goal`.
    """

    evaluator: AttitudeEvaluator
    context: AllocationContext

    def step(
        self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Goal | None]:
        """The goal to fly for the next `dt_s` seconds; None where the mission's is not finite."""
        if not np.isfinite(goal.X_WB.p_m.sum() + goal.X_WB.q.sum() + goal.nu_B.sum() + goal.tilt_rad):
            return replace(state, pitch_rate_rad_s=0.0, attitude_search=None), None
        if np.isfinite(estimate.X_WB.p_m.sum() + estimate.X_WB.q.sum() + estimate.load_B.sum()):
            state = self._evaluate(self._averaged_load(state, dt_s, estimate), dt_s, estimate, goal)
        low, high = self.evaluator.hinge.span(goal.tilt_rad)
        target = min(max(state.pitch_target_rad, low), high)
        offset, rate = offset_step(state.pitch_offset_rad, state.pitch_rate_rad_s, target, dt_s)
        moves = rate
        if not low <= offset <= high:
            # The mission's own tilt goes on towards a stop, maybe faster than an offset may change: that gives way.
            offset, rate = min(max(offset, low), high), 0.0
            moves = (offset - state.pitch_offset_rad) / dt_s
        flown = self.evaluator.hinge.with_offset(goal, offset, moves)
        return replace(state, pitch_offset_rad=offset, pitch_rate_rad_s=rate), flown

    def _averaged_load(self, state: PipelineState, dt_s: float, estimate: BodyState) -> PipelineState:
        force_W, moment_B = estimate.X_WB.R @ estimate.load_B[:3], estimate.load_B[3:]
        if state.load_force_W_N is not None and state.load_moment_B_Nm is not None:
            share = min(dt_s / LOAD_S, 1.0)
            force_W = (1.0 - share) * state.load_force_W_N + share * force_W
            moment_B = (1.0 - share) * state.load_moment_B_Nm + share * moment_B
        return replace(state, load_force_W_N=force_W, load_moment_B_Nm=moment_B)

    def _evaluate(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> PipelineState:
        """Evaluate one offset if it is time; after the last, select. A target without room left is given up."""
        early = state.attitude_age_s + dt_s < EVALUATE_S - 1e-6
        if early or state.load_force_W_N is None or state.load_moment_B_Nm is None:
            return replace(state, attitude_age_s=state.attitude_age_s + dt_s)
        now, target = state.attitude_search, state.pitch_target_rad
        if not self.evaluator.has_room(goal, target):
            now, target = None, 0.0
        if now is None:
            context, now_is = self.context, estimate
            task = HoldingTask(
                goal=goal,
                force_W_N=state.load_force_W_N,
                moment_B_Nm=state.load_moment_B_Nm,
                gram=lambda X_WB, thrusts_N: context.influence(replace(now_is, X_WB=X_WB), thrusts_N).gram,
                total_weight=context.view.total_weight,
            )
            low, high = self.evaluator.hinge.span(goal.tilt_rad)
            present = min(max(target, low), high)
            offsets = (present, *(offset for offset in self.evaluator.offsets(goal) if offset != present))
            now = AttitudeSearch(task=task, offsets=offsets)
        now = replace(now, costs=(*now.costs, self.evaluator.cost(now.task, now.offsets[len(now.costs)])))
        state = replace(state, attitude_search=now, attitude_age_s=0.0, pitch_target_rad=target)
        if len(now.costs) < len(now.offsets):
            return state
        best = now.offsets[select(now.costs, now.offsets.index(0.0), 0)]
        return replace(state, attitude_search=None, pitch_target_rad=best)


def attitude_optimizer(
    context: AllocationContext, vehicle: Vehicle, settings: ControlSettings, around: Surroundings
) -> AttitudeOptimizer | None:
    """The attitude optimiser where the settings want it and the camera tilts; else None.

    Raises
    ------
    InputError
        If it is asked for by name and the vehicle's camera is fixed.
    """
    wanted, joint = settings.allocation.optimize_attitude, vehicle.tilt
    if wanted and joint is None:
        raise InputError(
            f"control.allocation.optimize_attitude: true, the camera of {vehicle.name} has no joint, so the "
            "body's attitude follows "
            "from the camera's: leave it null, or take a vehicle with camera_tilt"
        )
    if joint is None or wanted is False:
        return None
    weights = settings.w_disturbance, settings.w_effort
    return AttitudeOptimizer(evaluator=AttitudeEvaluator.of(vehicle, joint, around, weights), context=context)

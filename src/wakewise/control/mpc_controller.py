"""Motion stage of the MPC methods: a plan ten times a second, flown by a tracking loop at the controller's rate.

Tube MPC (D. Q. Mayne, M. M. Seron, S. V. Rakovic, Automatica 41 (2005) 219, doi 10.1016/j.automatica.2004.08.019). The
planner plans on from the nominal state, where its last plan expected the vehicle to be, with nominal thrusts. The PID
that all methods share leads the vehicle along the nominal path, and its wrench is added to the planned one. So the
noise of the estimate does not enter the plan, and a plan that comes late does not open the loop. Beyond `TubeLimits`
the plan begins anew at the estimate.

Corrections. The thrusts of a correcting wrench minimise its cost in the planner's majorised model of the first stage,
so thrusters whose jets hit the target are spared here, too. The load that the estimator found acts in the plan, whose
thrusts hold against it at the planned attitude. Where the vehicle is turned from that, the correction turns the force
back: 22 N of current at 6 deg push 2 N aside (docs/research-log/0080). The PID's integral makes up for what is left.

Load moment. The estimate of the load answers the plan's own thrusts within a tenth of a second, since the thrusters
differ a little from their model. A plan that takes it up as it stands opposes that answer, and the next plan opposes
this one: near the limits the roll grew to 75 deg (docs/research-log/0090). So the plan holds against its average over
`LOAD_MOMENT_S`.

Tracking weights. Weights alone do not bound how far a plan leaves its reference: that depends on how heavy the vehicle
is and how near. Above a target and 5 N heavy, a plan with the paper's w_track = 5 left four fifths of the way undone
and saved a tenth of the wash. So where a goal states a limit (`Goal.max_tracking_deviation`), the weights are scaled
from plan to plan until the deviation over the next `DEVIATION_S` keeps it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from wakewise.allocation import Allocation
from wakewise.control.failsafe import PlanFailsafe
from wakewise.control.null_space_allocation import FULL, Allocator, single_jet_allocator
from wakewise.control.pid import Pid, make_pid
from wakewise.control.pipeline import Demand, MotionStage, Pipeline, PipelineState, hold
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, matrix_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, Goal, WakeModel
from wakewise.planning.obstacles import Surroundings, around_target
from wakewise.planning.planner import PlanModel, Planner, compile_plan
from wakewise.planning.problem import PLAN_EVERY_S, Horizon, PlanProblem, PlanTerms, between, reference_of, state_of
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import ImpingingJet
from wakewise.wake.disturbance import Superposition

DEVIATION_S = 0.5
"""Part of a plan over which its deviation is measured; much of it is flown."""
LOAD_MOMENT_S = 0.5
"""Time constant of the average of the load's moment: five plans, and shorter than the vehicle's own motion in roll."""
SLOWEST_M_S = 0.02
"""Mean speed below which a reference counts as this fast: a plan that holds still may move by millimetres."""
LARGEST_SCALE = 100.0
"""Largest factor of the tracking weights; the plan then follows as closely as `mpc`."""
SCALE_POWER, LEAST_CHANGE, MOST_CHANGE = 0.7, 0.8, 3.0
"""How much the factor follows the deviation, and its least and largest change from a plan to the next (0.1 s): a
hundredfold within half a second, and gone in two."""


@dataclass(frozen=True, kw_only=True)
class TubeLimits:
    """How far the vehicle may be from the nominal state, and how unsure of its place, before something is done."""

    position_m: float = 0.15
    attitude_rad: float = 0.35
    lost_m: float = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class MpcStage(MotionStage):
    """Plans, and follows the plan; where there is none, `pid` and `backup` fly.

    `planner.incidents` counts how often that was, by kind.
    """

    planner: PlanFailsafe
    pid: Pid
    backup: Allocator
    tube: TubeLimits = field(default_factory=TubeLimits)

    @property
    def model(self) -> PlanModel:
        """What the planner believes."""
        return self.planner.planner.model

    def expected(self, state: PipelineState) -> Array | None:
        """State that the plan expects now, shape (13,); None where there is no plan."""
        return None if state.plan is None else _at(state.plan, state.plan_age_s, self.model.settings.stage_s)

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds."""
        change_B = self._change(state, dt_s, goal)
        state = replace(state, load_moment_mean_B_Nm=averaged(state.load_moment_mean_B_Nm, estimate.load_B[3:], dt_s))
        if state.plan is None or state.plan_age_s >= PLAN_EVERY_S - 1e-6:
            state = self._replan(state, estimate, goal, change_B)
        if state.plan is None or state.correction_gain is None:
            return self._without_plan(replace(state, goal_nu=goal.nu_B), dt_s, estimate, goal)
        return self._follow(state, state.plan, state.correction_gain, dt_s, estimate, goal.nu_B)

    def allocated(self, state: PipelineState, found: Allocation, dt_s: float) -> PipelineState:
        """Take in other thrusts than the planned ones, of the same wrench.

        The next plan begins at these thrusts, not at those that were planned and never sent: its rate limit, its lag
        and its first jets are theirs. What corrects the wrench stays out of the plan (see the top of the file).
        """
        if state.plan is None:
            return replace(state, plan_thrusts_N=found.thrusts_N, backup_saturated=found.scale < FULL)
        table, null = self.model.table, self.model.layout.null
        planned = state.plan.commands_N[_stage(state.plan, state.plan_age_s - dt_s, table.stage_s)]
        shift = null @ (null.T @ (found.thrusts_N - planned))
        keep = table.keep ** (dt_s / table.stage_s)
        before = np.zeros_like(shift) if state.null_shift_given_N is None else state.null_shift_given_N
        return replace(state, null_shift_N=shift, null_shift_given_N=keep * before + (1.0 - keep) * shift)

    def _change(self, state: PipelineState, dt_s: float, goal: Goal) -> Array:
        """How fast the goal's velocity changes, shape (6,), zero for its turn.

        A turn that keeps something in view trembles with the hand and its rate within a step; carried on for half a
        second that is a yaw moment four times the one needed (docs/research-log/0073). A goal that jumps has no
        acceleration worth following.
        """
        if state.goal_nu is None or not dt_s > 0.0:
            return np.zeros(6)
        change = (goal.nu_B - state.goal_nu) / dt_s
        push = self.pid.body.mass_matrix @ change
        jumps = (np.abs(push) > self.pid.integral_limit).any()
        return np.zeros(6) if jumps else np.concatenate([change[:3], np.zeros(3)])

    def _replan(self, state: PipelineState, estimate: BodyState, goal: Goal, change_B: Array) -> PipelineState:
        settings = self.model.settings
        nominal, thrusts = state_of(estimate), state.thrusts_N
        before = state.thrusts_N
        if state.plan is not None:
            expected = _at(state.plan, state.plan_age_s, settings.stage_s)
            away = float(np.linalg.norm(expected[:3] - nominal[:3]))
            turned = float(np.linalg.norm(rotvec_from_quat(quat_multiply(quat_conjugate(expected[3:7]), nominal[3:7]))))
            if away <= self.tube.position_m and turned <= self.tube.attitude_rad:
                nominal, thrusts = expected, self._nominal_thrusts(state, state.plan)
                before = state.plan.commands_N[_stage(state.plan, state.plan_age_s, settings.stage_s)]
                if state.null_shift_N is not None and state.null_shift_given_N is not None:
                    thrusts, before = thrusts + state.null_shift_given_N, before + state.null_shift_N
            else:
                self.planner.incidents.count(
                    "off the path", f"off the planned path by {away:.2f} m: planned anew from the estimate"
                )

        reference = reference_of(goal, settings.stages, settings.stage_s, change_B)
        force_W = estimate.X_WB.R @ estimate.load_B[:3]

        def make() -> PlanProblem:
            return PlanProblem(
                state=nominal,
                thrusts_N=thrusts,
                command_N=before,
                reference=reference,
                force_W_N=force_W,
                moment_B_Nm=estimate.load_B[3:] if state.load_moment_mean_B_Nm is None else state.load_moment_mean_B_Nm,
                tracking_weight_scale=goal.tracking_weight_scale * state.tracking_scale,
            )

        found = self.planner.ask(make, state.plan, state.plan_age_s)
        if found.plan is None:
            return replace(state, plan=None, correction_gain=None, plan_age_s=0.0, plan_trouble=found.trouble)
        if found.trouble is not None:
            # The old plan keeps its clock.
            return replace(state, plan_trouble=found.trouble)
        deviation = tracking_deviation(found.plan.states, reference, settings.stage_s)
        return replace(
            state,
            plan=found.plan,
            tracking_scale=scale_tracking(state.tracking_scale, deviation, goal.max_tracking_deviation),
            correction_gain=correction_gain(self.model, found.plan),
            plan_age_s=0.0,
            plan_thrusts_N=thrusts,
            plan_force_W_N=force_W,
            plan_trouble=None,
            # They are in the thrusts that the new plan began with.
            null_shift_given_N=None,
        )

    def _nominal_thrusts(self, state: PipelineState, plan: Horizon) -> Array:
        """What the planned commands alone would make the thrusters give now."""
        table = self.model.table
        thrusts = np.array(state.thrusts_N if state.plan_thrusts_N is None else state.plan_thrusts_N)
        whole = _stage(plan, state.plan_age_s, table.stage_s)
        for k in range(whole):
            thrusts = table.keep * thrusts + (1.0 - table.keep) * plan.commands_N[k]
        rest = (state.plan_age_s - whole * table.stage_s) / table.stage_s
        keep = table.keep**rest
        return np.asarray(keep * thrusts + (1.0 - keep) * plan.commands_N[whole])

    def _follow(
        self, state: PipelineState, plan: Horizon, gain: Array, dt_s: float, estimate: BodyState, goal_nu: Array
    ) -> tuple[PipelineState, Demand]:
        model = self.model
        stage_s = model.settings.stage_s
        nominal = _at(plan, state.plan_age_s, stage_s)
        # All feed-forward, acceleration and load included, is in the plan; given twice it would run ahead of it.
        pid, correction = self.pid.to_path(state.pid, dt_s, estimate, nominal, saturated=state.saturated)
        if state.plan_force_W_N is not None:
            correction[:3] += (matrix_from_quat(nominal[3:7]) - estimate.X_WB.R).T @ state.plan_force_W_N
        planned = plan.commands_N[_stage(plan, state.plan_age_s, stage_s)]
        desired = planned + gain @ correction
        thrusts = np.minimum(np.maximum(desired, model.table.lower), model.table.upper)
        if not np.isfinite(thrusts).all():
            words = self.planner.incidents.count("not finite", "correction not finite")
            path = Goal(X_WB=Pose(nominal[:3], nominal[3:7]), nu_B=nominal[7:])
            return self._without_plan(replace(state, plan=None, plan_trouble=words), dt_s, estimate, path)
        over = float(np.abs(desired - thrusts).max())
        trouble = state.plan_trouble
        if over > 1e-9 and trouble is None:
            trouble = self.planner.incidents.count("saturated", f"thrusters saturated: {over:.1f} N cut off")
        demand = Demand(
            wrench_B=model.table.allocation @ planned + correction,
            thrusts_N=thrusts,
            disturbance=plan.disturbance * model.total_weight,
            trouble=trouble,
        )
        state = replace(state, pid=pid, plan_age_s=state.plan_age_s + dt_s, saturated=over > 1e-9, goal_nu=goal_nu)
        return state, demand

    def _without_plan(
        self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Demand]:
        """The wrench of the PID with feed-forward, for the backup's allocator."""
        pid, wrench = self.pid.wrench(state.pid, dt_s, estimate, goal, saturated=state.backup_saturated)
        if not np.isfinite(wrench.sum()):
            held, demand = hold(state, dt_s, "wrench not finite")
            words = "; ".join(part for part in (state.plan_trouble, demand.trouble) if part)
            return replace(held, plan_trouble=state.plan_trouble), replace(demand, trouble=words)
        state = replace(state, pid=pid, plan=None)
        return state, Demand(wrench_B=wrench, trouble=state.plan_trouble, allocator=self.backup)


def averaged(mean: Array | None, value: Array, dt_s: float) -> Array:
    """First-order low-pass of time constant `LOAD_MOMENT_S`, any shape; begins at the value, and anew after a NaN."""
    if mean is None or not np.isfinite(mean).all():
        return value
    return np.asarray(value + np.exp(-dt_s / LOAD_MOMENT_S) * (mean - value))


def correction_gain(model: PlanModel, plan: Horizon) -> Array:
    """Thrusts per unit of correcting wrench, shape (n, 6), of least cost in the plan's model of its first stage."""
    table = model.table
    alive = table.upper > table.lower
    effort = 2.0 * table.stage_s * max(model.terms.w_effort, 1e-4)
    weight = plan.curvature[np.ix_(alive, alive)] + effort * np.eye(int(alive.sum()))
    B = table.allocation[:, alive]
    easy = np.linalg.solve(weight, B.T)
    # The pseudo-inverse: wrenches that nothing makes are left out.
    sizes, axes = np.linalg.eigh(B @ easy)
    made = sizes > 1e-9 * sizes[-1]
    gain = np.zeros((model.thrusters, 6))
    gain[alive] = easy @ (axes[:, made] / sizes[made]) @ axes[:, made].T
    return gain


def tracking_deviation(states: Array, reference: Array, stage_s: float) -> float:
    """Share of the reference's way that a plan leaves undone or adds over its first `DEVIATION_S`.

    `states` and `reference` have shape (N + 1, 13). Not over the whole horizon: a plan that is made anew ten times a
    second may put off for good what it plans to make up for at its end.
    """
    end = min(max(round(DEVIATION_S / stage_s), 1), len(states) - 1)
    asked = reference[end, :3] - reference[0, :3]
    off = states[end, :3] - states[0, :3] - asked
    return float(np.linalg.norm(off)) / max(float(np.linalg.norm(asked)), SLOWEST_M_S * end * stage_s)


def scale_tracking(scale: float, deviation: float, limit: float | None) -> float:
    """Factor of the next plan's tracking weights, 1 to `LARGEST_SCALE`; 1 where there is no limit of the deviation."""
    if limit is None:
        return 1.0
    change = min(max((deviation / limit) ** SCALE_POWER, LEAST_CHANGE), MOST_CHANGE)
    return min(max(scale * change, 1.0), LARGEST_SCALE)


def _stage(plan: Horizon, age_s: float, stage_s: float) -> int:
    return min(int((age_s + 1e-6) / stage_s), len(plan.commands_N) - 1)


def _at(plan: Horizon, age_s: float, stage_s: float) -> Array:
    """State that a plan expects at an age, shape (13,)."""
    k = _stage(plan, age_s, stage_s)
    share = min(max(age_s / stage_s - k, 0.0), 1.0)
    return np.asarray(between(plan.states[k], plan.states[k + 1], share))


def mpc_pipeline(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    *,
    name: str = "wake-aware",
    surroundings: Surroundings | None = None,
    lower_N: Array | None = None,
    upper_N: Array | None = None,
    clock: Callable[[], float] = time.thread_time,
    enforce: bool = False,
) -> Pipeline:
    """A pipeline of planner and tracking that flies the plan's own thrusts.

    Settings with `w_disturbance` 0 make it `mpc`; the same with `plan.w_change` makes it `mpc-smooth`. Arguments as for
    `compile_plan`; `clock` and `enforce` (the deadline, for a world that does not wait) as for `PlanFailsafe`. The
    first plan is made here, since it compiles.
    """
    terms = PlanTerms(
        w_disturbance=settings.w_disturbance,
        w_effort=settings.w_effort,
        superposition=plan_superposition(wake, settings),
    )
    around = surroundings or around_target(region)
    model = compile_plan(vehicle, region, wake, settings.plan, around, terms, lower_N=lower_N, upper_N=upper_N)
    backup = single_jet_allocator(vehicle, region, model.wake, settings)
    motion = MpcStage(
        planner=PlanFailsafe(planner=compiled(Planner(model)), deadline_s=PLAN_EVERY_S, clock=clock, enforce=enforce),
        pid=make_pid(vehicle, settings),
        backup=backup,
    )
    return Pipeline(name=name, layout=backup.layout, motion=motion, lost_m=motion.tube.lost_m)


def plan_superposition(wake: WakeModel, settings: ControlSettings) -> Superposition:
    """How a plan adds jets up: as `control.superposition` says, but always as squares if its wake model has a floor.

    Wall jets that cancel on paper give the coherent sum many minima within 3 % of one another, and plans jump between
    them (docs/research-log/0014); the sum of squares is convex, and plans stay. The exact allocators find the least of
    all minima, and need no such care.
    """
    return "incoherent" if isinstance(wake, ImpingingJet) else settings.superposition


def compiled(planner: Planner) -> Planner:
    """Make one plan and throw it away: what is compiled or allocated on first use is ready then."""
    model = planner.model
    n, N = model.thrusters, model.settings.stages
    away = model.region.points_W_m.mean(axis=0) - np.array([1.0, 0.0, 0.5])
    body = BodyState(X_WB=Pose(away))
    problem = PlanProblem(
        state=state_of(body),
        thrusts_N=np.zeros(n),
        command_N=np.zeros(n),
        reference=reference_of(Goal(X_WB=body.X_WB), N, model.settings.stage_s),
    )
    planner.plan(problem, np.zeros((N, n)))
    return planner

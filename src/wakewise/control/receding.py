"""The receding-horizon controller: a plan ten times a second, flown by a tracking loop at the rate of the controller.

How a plan is applied. The planner plans on from where its last plan expected the vehicle to be (the nominal state, with
nominal thrusts), not from the estimate. Between and across plans the vehicle is led along the nominal path by the PID
that every other method has, gains and margins included, and the wrench of that PID is laid on top of the planned
thrusts. This is a tube: the noise of the estimate does not enter the plan, and a plan that comes late or not at all
does not open the loop (D. Q. Mayne, M. M. Seron, S. V. Rakovic, Automatica 41 (2005) 219, doi
10.1016/j.automatica.2004.08.019). When the vehicle is farther from the nominal state than `Tube` allows, the
plan begins anew at the estimate.

How corrections are shared out. The thrusts of a correction minimise its cost in the planner's own majorised model of
the first stage, so thrusters whose jets hit the target are spared there, too. The load that the estimator found acts
in the plan, whose thrusts hold against it at the planned attitude; where the vehicle is turned from that, the
correction turns the force back, as 22 N of stream held 6 deg askew push 2 N aside (docs/research-log/0080). The PID's
integral makes up for what is left.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wakewise.control.carried import Carried
from wakewise.control.firmness import firmer, stray_of
from wakewise.control.instant import instant_allocator
from wakewise.control.loop import HOLD_S, ControllerState, TrackingController
from wakewise.control.settings import ControlSettings
from wakewise.control.tracker import Tracker, TrackerState, make_tracker
from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose, matrix_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, Command, Goal, WakeModel
from wakewise.planning.guard import Guard
from wakewise.planning.planner import PlanModel, Planner, compile_plan
from wakewise.planning.problem import PLAN_EVERY_S, Horizon, PlanProblem, PlanTerms, state_of
from wakewise.planning.reference import between, reference_of
from wakewise.planning.surroundings import Surroundings, around_target
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import ImpingingJet
from wakewise.wake.disturbance import Superposition


@dataclass(frozen=True, kw_only=True)
class Tube:
    """How far the vehicle may be from the nominal state, and how unsure of its place, before something is done."""

    position_m: float = 0.15
    attitude_rad: float = 0.35
    lost_m: float = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanState:
    """What the controller remembers: the tracker's integral, the plan and its age, what the thrusters were told.

    `thrusts_N`, shape (n,), are the last commands; `nominal_N`, shape (n,), what the planned commands alone would
    make the thrusters give at the plan's start; `share`, shape (n, 6), shares corrections out; `backup` is the state
    of PID and allocator; `goal_nu`, shape (6,), is the twist of the last goal. `moved_N` is what was flown beside the
    planned commands in the null space, where somebody else shared the wrench out, and `moved_given_N` what of it the
    thrusters give by now, both shape (n,). `firmness` multiplies the weights of tracking (see `firmness.py`).
    `force_W_N`, shape (3,), is the load's force that the plan reckons with.
    """

    tracker: TrackerState
    thrusts_N: Array
    nominal_N: Array
    backup: ControllerState
    plan: Horizon | None = None
    share: Array | None = None
    age_s: float = 0.0
    trouble: str | None = None
    saturated: bool = False
    goal_nu: Array | None = None
    moved_N: Array | None = None
    moved_given_N: Array | None = None
    firmness: float = 1.0
    force_W_N: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,), nominal_N=(None,), force_W_N=(3,))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningController:
    """Plans, flies the plan, and falls back; implements `wakewise.core.interfaces.Controller`.

    `guard.counts` tells how often it fell back, by kind.
    """

    name: str
    guard: Guard
    tracker: Tracker
    backup: TrackingController
    tube: Tube = field(default_factory=Tube)

    @property
    def model(self) -> PlanModel:
        """What the planner believes."""
        return self.guard.planner.model

    @cached_property
    def _total_weight(self) -> float:
        return float(np.sum(self.model.region.weights))

    def init(self) -> PlanState:
        """State before the first step."""
        n = self.model.thrusters
        return PlanState(
            tracker=self.tracker.init(),
            thrusts_N=np.zeros(n),
            nominal_N=np.zeros(n),
            backup=self.backup.init(),
        )

    def carried(self, state: PlanState) -> Carried:
        """What another method can go on with."""
        return Carried(tracker=replace(state.tracker, goal_nu=state.goal_nu), thrusts_N=state.thrusts_N)

    def resumed(self, carried: Carried) -> PlanState:
        """State before the first step after another method's: the first plan begins at its thrusts."""
        begun, thrusts = self.init(), carried.thrusts_N
        goal_nu = carried.tracker.goal_nu
        return replace(begun, tracker=carried.tracker, thrusts_N=thrusts, nominal_N=thrusts, goal_nu=goal_nu)

    def expected(self, state: PlanState) -> Array | None:
        """State that the plan expects now, shape (13,); None where there is no plan."""
        return None if state.plan is None else _at(state.plan, state.age_s, self.model.settings.stage_s)

    def step(self, state: PlanState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PlanState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        trouble = self._unusable(estimate, goal)
        if trouble is not None:
            thrusts = state.thrusts_N * np.exp(-dt_s / HOLD_S)
            state = replace(state, plan=None, thrusts_N=thrusts, nominal_N=thrusts, trouble=None)
            return state, Command(thrusts_N=thrusts, wrench_B=np.zeros(6), fallback=trouble)
        change_B = self._change(state, dt_s, goal)
        if state.plan is None or state.age_s >= PLAN_EVERY_S - 1e-6:
            state = self._replan(state, estimate, goal, change_B)
        if state.plan is None or state.share is None:
            return self._fall_back(replace(state, goal_nu=goal.nu_B), dt_s, estimate, goal)
        return self._follow(state, state.plan, state.share, dt_s, estimate, goal.nu_B)

    def told(self, state: PlanState, thrusts_N: Array, dt_s: float) -> PlanState:
        """The state after other thrusts, shape (n,), of the same wrench were flown in place of the last command.

        The next plan begins at these shares, not at those that were planned and never sent: its rate limit, its lag
        and its first jets are theirs. What corrects the wrench stays out of the plan (see the top of the file).
        """
        if state.plan is None:
            return replace(state, thrusts_N=thrusts_N)
        table, null = self.model.table, self.model.layout.null
        planned = state.plan.commands_N[_stage(state.plan, state.age_s - dt_s, table.stage_s)]
        moved = null @ (null.T @ (thrusts_N - planned))
        keep = table.keep ** (dt_s / table.stage_s)
        before = np.zeros_like(moved) if state.moved_given_N is None else state.moved_given_N
        return replace(state, thrusts_N=thrusts_N, moved_N=moved, moved_given_N=keep * before + (1.0 - keep) * moved)

    def _unusable(self, estimate: BodyState, goal: Goal) -> str | None:
        count = self.guard.count
        for what, X_WB, nu_B in (("estimate", estimate.X_WB, estimate.nu_B), ("goal", goal.X_WB, goal.nu_B)):
            if not math.isfinite(sum(X_WB.p_m.tolist()) + sum(X_WB.q.tolist()) + sum(nu_B.tolist())):
                return count(f"{what} not finite", f"{what} not finite: holding the last thrusts, fading")
        if estimate.covariance is not None:
            spread = float(np.sqrt(estimate.covariance.diagonal()[:3].max()))
            if not spread <= self.tube.lost_m:
                return count("lost", f"pose lost ({spread:.2f} m unsure): holding the last thrusts, fading")
        return None

    def _change(self, state: PlanState, dt_s: float, goal: Goal) -> Array:
        """How fast the goal's velocity changes, shape (6,), zero for its turn.

        A turn that keeps something in view trembles with the hand and its rate within a step; carried on for half a
        second that is a yaw moment four times the one needed (docs/research-log/0073). A goal that jumps has no
        acceleration worth following.
        """
        if state.goal_nu is None or not dt_s > 0.0:
            return np.zeros(6)
        change = (goal.nu_B - state.goal_nu) / dt_s
        push = self.tracker.body.mass_matrix @ change
        jumps = (np.abs(push) > self.tracker.integral_limit).any()
        return np.zeros(6) if jumps else np.concatenate([change[:3], np.zeros(3)])

    def _replan(self, state: PlanState, estimate: BodyState, goal: Goal, change_B: Array) -> PlanState:
        settings = self.model.settings
        nominal, thrusts = state_of(estimate), state.thrusts_N
        before = state.thrusts_N
        if state.plan is not None:
            expected = _at(state.plan, state.age_s, settings.stage_s)
            away = float(np.linalg.norm(expected[:3] - nominal[:3]))
            turned = float(np.linalg.norm(rotvec_from_quat(quat_multiply(quat_conjugate(expected[3:7]), nominal[3:7]))))
            if away <= self.tube.position_m and turned <= self.tube.attitude_rad:
                nominal, thrusts = expected, self._nominal_thrusts(state)
                before = state.plan.commands_N[_stage(state.plan, state.age_s, settings.stage_s)]
                if state.moved_N is not None and state.moved_given_N is not None:
                    thrusts, before = thrusts + state.moved_given_N, before + state.moved_N
            else:
                self.guard.count(
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
                moment_B_Nm=estimate.load_B[3:],
                obedience=goal.obedience * state.firmness,
            )

        found = self.guard.ask(make, state.plan, state.age_s)
        if found.plan is None:
            return replace(state, plan=None, share=None, age_s=0.0, trouble=found.trouble)
        if found.trouble is not None:
            # The old plan keeps its clock.
            return replace(state, trouble=found.trouble)
        stray = stray_of(found.plan.states, reference, settings.stage_s)
        return replace(
            state,
            plan=found.plan,
            firmness=firmer(state.firmness, stray, goal.stray),
            share=correction_share(self.model, found.plan),
            age_s=0.0,
            nominal_N=thrusts,
            force_W_N=force_W,
            trouble=None,
            # They are in the thrusts that the new plan began with.
            moved_given_N=None,
        )

    def _nominal_thrusts(self, state: PlanState) -> Array:
        """What the planned commands alone would make the thrusters give now."""
        table, thrusts = self.model.table, np.array(state.nominal_N)
        if state.plan is None:
            return thrusts
        whole = _stage(state.plan, state.age_s, table.stage_s)
        for k in range(whole):
            thrusts = table.keep * thrusts + (1.0 - table.keep) * state.plan.commands_N[k]
        rest = (state.age_s - whole * table.stage_s) / table.stage_s
        keep = table.keep**rest
        return np.asarray(keep * thrusts + (1.0 - keep) * state.plan.commands_N[whole])

    def _follow(
        self, state: PlanState, plan: Horizon, share: Array, dt_s: float, estimate: BodyState, goal_nu: Array
    ) -> tuple[PlanState, Command]:
        model = self.model
        stage_s = model.settings.stage_s
        nominal = _at(plan, state.age_s, stage_s)
        # All feed-forward, acceleration and load included, is in the plan; given twice it would run ahead of it.
        tracker, correction = self.tracker.to_path(state.tracker, dt_s, estimate, nominal, saturated=state.saturated)
        correction[:3] += (matrix_from_quat(nominal[3:7]) - estimate.X_WB.R).T @ state.force_W_N
        planned = plan.commands_N[_stage(plan, state.age_s, stage_s)]
        wished = planned + share @ correction
        thrusts = np.minimum(np.maximum(wished, model.table.lower), model.table.upper)
        if not np.isfinite(thrusts).all():
            state = replace(state, plan=None, trouble=self.guard.count("not finite", "correction not finite"))
            path = Goal(X_WB=Pose(nominal[:3], nominal[3:7]), nu_B=nominal[7:])
            return self._fall_back(state, dt_s, estimate, path)
        over = float(np.abs(wished - thrusts).max())
        trouble = state.trouble
        if over > 1e-9 and trouble is None:
            trouble = self.guard.count("saturated", f"thrusters saturated: {over:.1f} N cut off")
        command = Command(
            thrusts_N=thrusts,
            wrench_B=model.table.allocation @ planned + correction,
            disturbance=plan.disturbance * self._total_weight,
            fallback=trouble,
        )
        state = replace(
            state,
            tracker=tracker,
            thrusts_N=thrusts,
            age_s=state.age_s + dt_s,
            saturated=over > 1e-9,
            goal_nu=goal_nu,
        )
        return state, command

    def _fall_back(self, state: PlanState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PlanState, Command]:
        backup = replace(state.backup, tracker=state.tracker, thrusts_N=state.thrusts_N)
        backup, command = self.backup.step(backup, dt_s, estimate, goal)
        words = "; ".join(part for part in (state.trouble, command.fallback) if part)
        state = replace(
            state,
            backup=backup,
            tracker=backup.tracker,
            thrusts_N=command.thrusts_N,
            nominal_N=command.thrusts_N,
            plan=None,
        )
        return state, replace(command, fallback=words or None)


def correction_share(model: PlanModel, plan: Horizon) -> Array:
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
    share = np.zeros((model.thrusters, 6))
    share[alive] = easy @ (axes[:, made] / sizes[made]) @ axes[:, made].T
    return share


def _stage(plan: Horizon, age_s: float, stage_s: float) -> int:
    return min(int((age_s + 1e-6) / stage_s), len(plan.commands_N) - 1)


def _at(plan: Horizon, age_s: float, stage_s: float) -> Array:
    """State that a plan expects at an age, shape (13,)."""
    k = _stage(plan, age_s, stage_s)
    share = min(max(age_s / stage_s - k, 0.0), 1.0)
    return np.asarray(between(plan.states[k], plan.states[k + 1], share))


def planning_controller(
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
) -> PlanningController:
    """Receding-horizon planner, tracking loop, guard; no levers.

    Settings with `w_disturbance` 0 make it `unaware`; the same with `plan.w_change` makes it `smooth`. Arguments as for
    `compile_plan`; `clock` and `enforce` (the deadline, for a world that does not wait) as for `Guard`. The first plan
    is made here, since it compiles.
    """
    terms = PlanTerms(
        w_disturbance=settings.w_disturbance,
        w_effort=settings.w_effort,
        superposition=plan_superposition(wake, settings),
    )
    around = surroundings or around_target(region)
    model = compile_plan(vehicle, region, wake, settings.plan, around, terms, lower_N=lower_N, upper_N=upper_N)
    return PlanningController(
        name=name,
        guard=Guard(planner=warmed(Planner(model)), deadline_s=PLAN_EVERY_S, clock=clock, enforce=enforce),
        tracker=make_tracker(vehicle, settings),
        backup=instant_allocator(vehicle, region, model.wake, settings),
    )


def plan_superposition(wake: WakeModel, settings: ControlSettings) -> Superposition:
    """How a plan adds jets up: as `control.superposition` says, but always as squares if its wake model has a floor.

    Wall jets that cancel on paper give the coherent sum many minima within 3 % of one another, and plans jump between
    them (docs/research-log/0014); the sum of squares is convex, and plans stay. The exact allocators find the least of
    all minima, and need no such care.
    """
    return "incoherent" if isinstance(wake, ImpingingJet) else settings.superposition


def warmed(planner: Planner) -> Planner:
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

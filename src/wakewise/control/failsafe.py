"""What is flown where a part of the pipeline gives no answer, a wrong one, or a late one.

| part | trouble | flown instead |
|---|---|---|
| input (`input_trouble`) | estimate or goal not finite, pose lost | last thrusts, fading |
| plan (`PlanFailsafe`) | refused, late, not finite, beyond limits, spinning | half of the previous plan, then PID |
| step (`Failsafe`) | exception, thrusts beyond limits, late | PID and least thrusts, or last thrusts, fading |

The PID of the last row starts from the estimate alone. It needs neither wake model nor plan. Every trouble is counted
by its kind, logged, and said in `Command.fallback`.

Clocks. A simulated world waits for its controller. There a late answer is counted by the thread's own time and flown,
so that one seed gives one flight on a busy machine. Where the world does not wait, `enforce` is on: the method works in
a thread of its own, and after `BACKUP_SHARE` of the period the substitute's thrusts go out. The late answer itself is
not flown; the state it leaves is taken at the step after. A compiled kernel is not interrupted, so an answer may be
later by the longest kernel (1 to 2 ms).

A controller from outside (`foreign`) has three rules of its own. Thrusts beyond the limits are cut, since its author
may not know them. Lateness is said in `Command.fallback`. After `PATIENCE_S` of lateness it is not asked again.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as Unfinished
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from wakewise.allocation import min_norm_allocation
from wakewise.control.null_space_allocation import FULL, Allocator
from wakewise.control.pid import Pid
from wakewise.core.arrays import Array
from wakewise.core.errors import WakewiseError, is_strict
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.planning.planner import Planner
from wakewise.planning.problem import CLEARANCE_M, Horizon, PlanProblem, shifted

if TYPE_CHECKING:
    from wakewise.control.pipeline import Pipeline, PipelineState

log = logging.getLogger(__name__)

HOLD_S = 0.5
"""Time constant with which thrusts fade while there is no usable estimate: some filter updates may be missed, a
vehicle that is lost must not go on pushing."""
RESTART_S = 1.0
"""A method that fails for so long without a break begins anew: what it remembers may be what it fails on."""
BACKUP_SHARE = 0.75
"""Share of the period that a method has where the deadline is enforced; the rest is for the substitute (0.1 ms) and
for sending."""
PATIENCE_S = 60.0
"""Time over and above its periods that a controller from outside may take in all; then it is not asked any more."""
USABLE_SHARE = 0.5
"""Share of the horizon up to which an old plan may be flown on."""
SPIN_RAD_S = 2.0
"""Rate of turn above which a plan is refused. No mission asks for more than 1 rad/s, stages of 0.1 s do not follow it,
and a plan that has begun to spin is the start of the next one (docs/research-log/0078)."""
_ROUNDING_N = 1e-6

Trouble = tuple[str, str]
"""Kind of a trouble, under which it is counted, and its words."""


@dataclass(eq=False)
class Incidents:
    """Counts troubles by kind and logs them under the name of a part."""

    part: str = "control"
    counts: dict[str, int] = field(default_factory=dict)

    def count(self, kind: str, words: str, harmless: bool = False) -> str:
        """Count and log an incident; returns its words. Nobody is warned of what changes no thrust."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        # The first of a kind is news, the thousandth is not.
        level = logging.DEBUG if self.counts[kind] > 1 else logging.INFO if harmless else logging.WARNING
        log.log(level, "%s: %s", self.part, words)
        return words


def faded(thrusts_N: Array, dt_s: float) -> Array:
    """Thrusts a step later where nothing is known to control by, shape (n,)."""
    return np.asarray(thrusts_N * np.exp(-dt_s / HOLD_S))


def input_trouble(estimate: BodyState, goal: Goal, lost_m: float | None = None) -> Trouble | None:
    """What makes an estimate or a goal useless; None if nothing does.

    `lost_m` is the standard deviation of the position from which on a pose counts as lost; None: it does not.
    """
    for what, X_WB, nu_B in (("estimate", estimate.X_WB, estimate.nu_B), ("goal", goal.X_WB, goal.nu_B)):
        # A sum is finite only if each of its parts is.
        if not math.isfinite(sum(X_WB.p_m.tolist()) + sum(X_WB.q.tolist()) + sum(nu_B.tolist())):
            return f"{what} not finite", f"{what} not finite"
    if lost_m is not None and estimate.covariance is not None:
        spread = float(np.sqrt(estimate.covariance.diagonal()[:3].max()))
        if not spread <= lost_m:
            return "lost", f"pose lost ({spread:.2f} m unsure)"
    return None


@dataclass(frozen=True, eq=False)
class CheckedPlan:
    """A plan to fly (None: there is none), the time since it began in s, and what went wrong (None: nothing)."""

    plan: Horizon | None
    age_s: float
    trouble: str | None


@dataclass(eq=False)
class PlanFailsafe:
    """Asks a planner and checks its answer within `deadline_s`.

    `enforce` leaves a late plan out; where it is off a late plan is counted and flown. `clock` gives seconds: the wall
    clock where the world does not wait, the solving thread's own (`time.thread_time`) where it does. `strict` raises
    an exception that is no `WakewiseError`, a mistake of the program; by default as `is_strict` says, and never where
    `enforce` is on.

    Beside troubles `incidents` counts goals inside the clearance. A plan keeps the clearance even there, so the vehicle
    stays off its goal.
    """

    planner: Planner
    deadline_s: float
    clock: Callable[[], float] = time.perf_counter
    enforce: bool = True
    strict: bool | None = None
    incidents: Incidents = field(default_factory=lambda: Incidents("planner"))

    def __post_init__(self) -> None:
        if self.strict is None:
            self.strict = is_strict() and not self.enforce

    def ask(self, make: Callable[[], PlanProblem], previous: Horizon | None, age_s: float) -> CheckedPlan:
        """A plan for the problem that `make` states, or the previous one, of that age, or none."""
        stage_s = self.planner.model.settings.stage_s
        began = self.clock()
        try:
            problem = make()
            start = self._start(problem, previous, age_s)
            until = began + 0.5 * self.deadline_s if self.enforce else float("inf")
            plan = self.planner.plan(problem, start, deadline=until, clock=self.clock)
            trouble = self._judge(plan)
        except WakewiseError as error:
            plan, trouble = None, ("refused", f"plan refused: {error}")
        except Exception as error:  # a fault of the program must not leave the vehicle without thrusts
            if self.strict:
                raise
            plan, trouble = None, ("failed", f"planner failed: {type(error).__name__}: {error}")
        if trouble is None and self.clock() - began > self.deadline_s:
            words = f"plan late: {1e3 * (self.clock() - began):.0f} ms of {1e3 * self.deadline_s:.0f} allowed"
            if not self.enforce:
                self.incidents.count("late", words, harmless=True)
            else:
                trouble = ("late", words)
        if trouble is None:
            if self.planner.crowded:
                words = f"goal inside clearance: nearer than {1e3 * CLEARANCE_M:.0f} mm, plans stay off it"
                self.incidents.count("goal inside clearance", words, harmless=True)
            return CheckedPlan(plan, 0.0, None)
        words = self.incidents.count(*trouble)
        if previous is not None and age_s <= USABLE_SHARE * stage_s * len(previous.commands_N):
            return CheckedPlan(previous, age_s, f"{words}: previous plan goes on")
        return CheckedPlan(None, 0.0, f"{words}: PID and allocator")

    def _start(self, problem: PlanProblem, previous: Horizon | None, age_s: float) -> Array:
        if previous is not None:
            return shifted(previous, round(age_s / self.planner.model.settings.stage_s))
        return self.planner.holding(problem)

    def _judge(self, plan: Horizon) -> Trouble | None:
        table = self.planner.model.table
        if not (np.isfinite(plan.cost) and np.isfinite(plan.commands_N).all() and np.isfinite(plan.states).all()):
            return "not finite", "plan not finite"
        if np.any(plan.commands_N < table.lower - 1e-9) or np.any(plan.commands_N > table.upper + 1e-9):
            return "limits", "plan breaks thrust limits"
        if plan.solver == "not convex":
            return "infeasible", "plan's QP has no solution"
        fastest = float(np.abs(plan.states[:, 10:]).max())
        if fastest > SPIN_RAD_S:
            return "spin", f"plan turns at {fastest:.1f} rad/s, {SPIN_RAD_S:g} are allowed"
        return None


@dataclass(kw_only=True, eq=False)
class Failsafe:
    """Checks each step of a pipeline and flies PID and least thrusts where it fails.

    `incidents` counts "failed", "limits", "late", "held", "restarted" and "given up". `clock` gives
    seconds; None: the thread's own time where the world waits for one of our methods, else the wall clock. `strict`
    raises an exception that is no `WakewiseError`, a mistake of the program; by default as
    `wakewise.core.errors.is_strict` says, and never where `enforce` is on: a vehicle in the water keeps its thrusts.
    """

    pid: Pid
    allocator: Allocator
    enforce: bool = False
    foreign: bool = False
    patience_s: float = PATIENCE_S
    clock: Callable[[], float] | None = None
    strict: bool | None = None
    incidents: Incidents = field(default_factory=Incidents)
    _worker: ThreadPoolExecutor | None = None
    _pending: Future[tuple[PipelineState, Command]] | None = None

    def __post_init__(self) -> None:
        if self.strict is None:
            self.strict = is_strict() and not self.enforce

    def begin(self, pipeline: Pipeline) -> PipelineState:
        """State before the first step; a controller from outside that cannot begin is not asked at all."""
        self._pending = None
        try:
            state, gave_up = pipeline.begin(), None
        except Exception as fault:  # whatever a controller from outside raises must not end the flight
            if not self.foreign or (self.strict and not isinstance(fault, WakewiseError)):
                raise
            words = f"{pipeline.name}: init raised {_said(fault)}"
            state, gave_up = pipeline.blank(), self.incidents.count("given up", words)
        return replace(state, sent_N=state.thrusts_N, gave_up=gave_up)

    def step(
        self, pipeline: Pipeline, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        if state.gave_up is not None:
            return self._substitute(state, dt_s, estimate, goal, state.gave_up)
        now = self.clock or (time.perf_counter if self.enforce or self.foreign else time.thread_time)
        began = now()
        new, command, trouble = self._ask(pipeline, state, dt_s, estimate, goal)
        if command is not None:
            command, trouble = self._judge(pipeline.name, command)
        # What is compiled on the first step is not the method's pace.
        took_s = now() - began if state.begun else 0.0
        command = self._paced(pipeline.name, command, trouble, took_s, dt_s)
        state = replace(new, begun=True, late_s=state.late_s + max(took_s - dt_s, 0.0))
        if self.foreign and not self.enforce and state.late_s > self.patience_s:
            words = f"{pipeline.name}: given up, {state.late_s:.0f} s late in all, last {took_s:.2f} s for {dt_s:.2f} s"
            state = replace(state, gave_up=self.incidents.count("given up", words))
        if command is not None:
            return replace(state, sent_N=command.thrusts_N, failed_s=0.0), command
        kind, words = trouble or ("failed", f"{pipeline.name}: no command")
        self.incidents.count(kind, words)
        failed_s = state.failed_s + dt_s
        if failed_s >= RESTART_S and not self.foreign:
            self.incidents.count("restarted", f"{pipeline.name} begins anew after {failed_s:.1f} s of trouble")
            state, failed_s = with_outer_stages(pipeline.begin(), state), 0.0
        return self._substitute(replace(state, failed_s=failed_s), dt_s, estimate, goal, words)

    def _ask(
        self, pipeline: Pipeline, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Command | None, Trouble | None]:
        """The method's next state, its answer, and what went wrong."""
        try:
            if not self.enforce:
                new, command = pipeline.decide(state, dt_s, estimate, goal)
                return new, command, None
            return self._ask_in_time(pipeline, state, dt_s, estimate, goal)
        except Exception as fault:  # whatever is raised in a control step must not leave the vehicle without thrusts
            self._pending = None
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            return state, None, ("failed", f"{pipeline.name}: raised {_said(fault)}")

    def _ask_in_time(
        self, pipeline: Pipeline, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Command | None, Trouble | None]:
        if self._worker is None:
            self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="control")
        pending = self._pending
        if pending is not None:
            if not pending.done():
                return state, None, ("late", f"{pipeline.name} late: still at a step before this one")
            self._pending = None
            left, _ = pending.result()
            state = with_outer_stages(left, state)
        asked = self._worker.submit(pipeline.decide, state, dt_s, estimate, goal)
        try:
            new, command = asked.result(timeout=BACKUP_SHARE * dt_s)
        except Unfinished:
            if asked.done():
                raise  # one that the method itself raised
            self._pending = asked
            words = f"{pipeline.name} late: no answer within {BACKUP_SHARE * 1e3 * dt_s:.0f} ms"
            return state, None, ("late", words)
        return new, command, None

    def _judge(self, name: str, command: Command) -> tuple[Command | None, Trouble | None]:
        """The command that may be sent, or what is wrong with it."""
        thrusts, layout = command.thrusts_N, self.allocator.layout
        within = np.clip(thrusts, layout.lower_N, layout.upper_N)
        over_N = float(np.abs(thrusts - within).max())
        words = f"{name}: thrusts {over_N:.1f} N beyond their limits"
        if not self.foreign:
            return (command, None) if over_N <= _ROUNDING_N else (None, ("limits", words))
        said = [command.fallback] if command.fallback else []
        if over_N > 1e-9:
            said.append(f"{words}, cut")
        return replace(command, thrusts_N=within, fallback="; ".join(said) or None), None

    def _paced(
        self, name: str, command: Command | None, trouble: Trouble | None, took_s: float, dt_s: float
    ) -> Command | None:
        """Count a late answer; the command, which says so if it is one from outside."""
        if not took_s > dt_s or (trouble is not None and trouble[0] == "late"):
            return command
        words = f"{name}: late, {1e3 * took_s:.0f} ms of {1e3 * dt_s:.0f} allowed"
        self.incidents.count("late", words, harmless=not self.enforce)
        if command is None or not self.foreign:
            return command
        return replace(command, fallback="; ".join(part for part in (command.fallback, words) if part))

    def _substitute(
        self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal, why: str
    ) -> tuple[PipelineState, Command]:
        """PID and least thrusts; where these cannot be had, the last thrusts, fading."""
        try:
            pid = state.failsafe_pid or self.pid.init()
            pid, wrench = self.pid.wrench(pid, dt_s, estimate, goal, saturated=state.failsafe_saturated)
            _, found = self.allocator.allocate(state, wrench, estimate, dt_s)
            found = min_norm_allocation(self.allocator.layout, wrench) if found is None else found
            sent = Command(
                thrusts_N=found.thrusts_N,
                wrench_B=wrench,
                disturbance=found.disturbance,
                fallback=f"{why}; PID and least thrusts",
            )
            state = replace(state, failsafe_pid=pid, failsafe_saturated=found.scale < FULL, sent_N=found.thrusts_N)
            return state, sent
        except Exception as fault:  # as in `_ask`
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            words = f"{why}; holding the last thrusts, fading ({type(fault).__name__})"
            self.incidents.count("held", words)
        last = np.zeros_like(self.allocator.layout.lower_N) if state.sent_N is None else state.sent_N
        thrusts = faded(last, dt_s)
        return replace(state, sent_N=thrusts), Command(thrusts_N=thrusts, wrench_B=np.zeros(6), fallback=words)


def with_outer_stages(new: PipelineState, state: PipelineState) -> PipelineState:
    """A method's new state, with what stages 5 and 6 of `state` remember."""
    return replace(
        new,
        begun=state.begun,
        sent_N=state.sent_N,
        failsafe_pid=state.failsafe_pid,
        failsafe_saturated=state.failsafe_saturated,
        failed_s=state.failed_s,
        late_s=state.late_s,
        gave_up=state.gave_up,
        pwm_direction=state.pwm_direction,
        pwm_owed_N_s=state.pwm_owed_N_s,
    )


def _said(fault: Exception) -> str:
    """An exception in one line: kind, words, and the line of code that raised it."""
    last = fault.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    where = "" if last is None else f" ({last.tb_frame.f_code.co_filename.rsplit('/', 1)[-1]}:{last.tb_lineno})"
    text = " ".join(str(fault).split()) or "no words"
    return f"{type(fault).__name__}: {text}{where}"

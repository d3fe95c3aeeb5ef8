"""Between a planner that may fail and a loop that must not: deadlines, checks, and what to do instead.

Order of preference: the fresh plan; the previous plan moved on in time, as long as enough of it is left; none, upon
which the controller falls back on PID and allocator. Every refusal is counted by its kind, logged, and said in words.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, WakewiseError, is_strict
from wakewise.planning.planner import Planner
from wakewise.planning.problem import CLEARANCE_M, Horizon, PlanProblem, shifted
from wakewise.planning.surroundings import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region

log = logging.getLogger(__name__)

USABLE_SHARE = 0.5
"""Share of the horizon up to which an old plan may be flown on."""
SPIN_RAD_S = 2.0
"""A plan that turns the vehicle faster is none: no mission or hand asks for more than 1 rad/s, stages of a tenth of a
second do not follow it, and a plan that has begun to spin is the start of the next one (docs/research-log/0078)."""


@dataclass(frozen=True, eq=False)
class Guarded:
    """A plan to fly (None: there is none), the time since it began in s, and what went wrong (None: nothing)."""

    plan: Horizon | None
    age_s: float
    trouble: str | None


@dataclass(eq=False)
class Guard:
    """Asks a planner and judges the answer.

    Parameters
    ----------
    planner : Planner
    deadline_s : float
        From question to answer.
    clock : callable
        Seconds; `time.perf_counter` where the world does not wait. In a simulated world, which does, the time of the
        solving thread (`time.thread_time`) gives the same flight on a busy machine.
    counts : dict
        How often each kind of trouble was met, and how often a goal lay inside the clearance, which a plan keeps even
        where it is asked to come nearer: the vehicle then stays off its goal for good, which is no trouble but news.
    enforce : bool
        Whether a late plan is left out. A simulated world waits for its controller; there a late plan is counted and
        flown, so that the same seed gives the same flight whether or not the machine was busy or had to compile.
    strict : bool, optional
        Whether an exception that is no `WakewiseError`, a mistake of the program, is raised instead of counted. By
        default as `wakewise.core.errors.is_strict` says, and never where `enforce` is on.
    """

    planner: Planner
    deadline_s: float
    clock: Callable[[], float] = time.perf_counter
    counts: dict[str, int] = field(default_factory=dict)
    enforce: bool = True
    strict: bool | None = None

    def __post_init__(self) -> None:
        if self.strict is None:
            self.strict = is_strict() and not self.enforce

    def count(self, kind: str, words: str, harmless: bool = False) -> str:
        """Count and log an event; returns its words. Nobody is warned of what changes no thrust."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        # The first of a kind is news, the thousandth is not.
        level = logging.DEBUG if self.counts[kind] > 1 else logging.INFO if harmless else logging.WARNING
        log.log(level, "planner: %s", words)
        return words

    def ask(self, make: Callable[[], PlanProblem], previous: Horizon | None, age_s: float) -> Guarded:
        """A plan for the problem that `make` states, or the previous one, of that age, moved on, or none."""
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
        except Exception as error:
            if self.strict:
                raise
            plan, trouble = None, ("failed", f"planner failed: {type(error).__name__}: {error}")
        if trouble is None and self.clock() - began > self.deadline_s:
            words = f"plan late: {1e3 * (self.clock() - began):.0f} ms of {1e3 * self.deadline_s:.0f} allowed"
            if not self.enforce:
                self.count("late", words, harmless=True)
            else:
                trouble = ("late", words)
        if trouble is None:
            if self.planner.crowded:
                words = f"goal inside clearance: nearer than {1e3 * CLEARANCE_M:.0f} mm, plans stay off it"
                self.count("goal inside clearance", words, harmless=True)
            return Guarded(plan, 0.0, None)
        words = self.count(*trouble)
        if previous is not None and age_s <= USABLE_SHARE * stage_s * len(previous.commands_N):
            return Guarded(previous, age_s, f"{words}: previous plan goes on")
        return Guarded(None, 0.0, f"{words}: PID and allocator")

    def _start(self, problem: PlanProblem, previous: Horizon | None, age_s: float) -> Array:
        if previous is not None:
            return shifted(previous, round(age_s / self.planner.model.settings.stage_s))
        return self.planner.holding(problem)

    def _judge(self, plan: Horizon) -> tuple[str, str] | None:
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


def check_start(
    vehicle: Vehicle,
    region: Region,
    state: Array,
    surroundings: Surroundings,
    clearance_m: float = 0.0,
    what: str = "start",
) -> None:
    """Refuse a start from which no plan can be good, before the loop begins.

    `state` is position, quaternion, twist, shape (13,); `what` it is called in the message.

    Raises
    ------
    InputError
        An empty region or weights that are negative or NaN, points of the target inside the hull, a hull that touches
        something or is nearer to it than `clearance_m`, or a state that is not finite.
    """
    from wakewise.planning.barrier import plane_gap, sphere_gap
    from wakewise.planning.kernels import rotation

    x = np.array(state, dtype=np.float64)
    if x.shape != (13,) or not np.isfinite(x).all():
        raise InputError(f"{what}: must be 13 finite numbers (position, quaternion, twist)")
    if len(region.points_W_m) == 0:
        raise InputError("region: no points, the target is empty")
    if np.any(region.weights < 0.0) or not np.sum(region.weights) > 0.0:
        raise InputError("region: weights must not be negative, and at least one must be more than 0")
    R = np.empty((3, 3))
    rotation(x, R)
    half = 0.5 * np.array(vehicle.size_m)
    inside = np.all(np.abs((region.points_W_m - x[:3]) @ R) < half, axis=1) & (region.distance_m == 0.0)
    if np.any(inside):
        raise InputError(f"{what}: {int(inside.sum())} points of the target lie inside the vehicle, it must be outside")
    slope = np.empty(6)
    planes = len(surroundings.planes)
    for number, row in enumerate((*surroundings.planes, *surroundings.spheres)):
        gap = plane_gap if number < planes else sphere_gap
        clear = gap(x[:3], R, half, np.array(row), slope)
        if clear < clearance_m:
            raise InputError(
                f"{what}: the hull comes within {clear:.3f} m of {surroundings.name(number)}, "
                f"allowed is {clearance_m:g} m or more"
            )

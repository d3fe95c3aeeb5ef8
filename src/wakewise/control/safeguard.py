"""A guard round a whole control step: whatever a method does, thrusts that can be flown go out, and in time.

`wakewise.planning.guard` judges plans. What is sent is also made by the tracker, the wake model's Gram matrix and the
allocator; here all of it together is judged: an exception, an answer of the wrong kind, thrusts that are not finite or
beyond the thrusters' limits, an answer later than the control period. What is flown then, in this order: the least
thrusts of the backup's wrench (the tracker of `dp` from the same estimate), which need neither wake model nor plan; if
these fail, too, the thrusts last sent, fading. Every trouble is counted by its kind, logged, and said in
`Command.fallback`.

The clock. A simulated world waits for its controller; there an answer is counted as late by the solving thread's own
time and flown all the same, and `Command.fallback` says nothing of it, so that one seed gives one flight on one kind
of processor. Where the world does not wait, `enforce` is on: the method works in a thread of its own, and when the
period is over the backup's thrusts go out. What it then answers is too old to be flown; the state it leaves is taken,
and it is asked again at the step after. A compiled kernel is not interrupted, so that an answer may be as much later
as the longest of them takes (a millisecond or two).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as Unfinished
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wakewise.allocation import Layout, min_norm_allocation
from wakewise.control.loop import HOLD_S, vehicle_layout
from wakewise.control.settings import ControlSettings
from wakewise.control.tracker import Tracker, TrackerState, make_tracker
from wakewise.control.watch import FULL
from wakewise.core.arrays import Array
from wakewise.core.errors import WakewiseError, is_strict
from wakewise.core.interfaces import BodyState, Command, Controller, Goal
from wakewise.robot.vehicles import Vehicle

log = logging.getLogger(__name__)

AFRESH_S = 1.0
"""A method that fails for so long without a break begins anew: what it remembers may be what it fails on."""
BACKUP_SHARE = 0.75
"""Share of the period that a method has where the deadline is enforced; the rest is the backup's, which takes a tenth
of a millisecond, and the sending's."""
_ROUNDING_N = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class SafeState:
    """The method's own state, the backup's, the thrusts last sent, shape (n,), and for how long the method has failed.

    `share` is what the backup's last thrusts made of its wrench; `first` is whether nothing was asked yet.
    """

    inner: Any
    tracker: TrackerState
    thrusts_N: Array
    share: float = 1.0
    failed_s: float = 0.0
    first: bool = True


@dataclass(kw_only=True, eq=False)
class Safeguard:
    """A method with a guard round each step; implements `wakewise.core.interfaces.Controller`.

    Parameters
    ----------
    inner : Controller
    tracker : Tracker
    layout : Layout
        What flies where the method does not: `dp`, but that it does not ask a wake model what D it causes.
    enforce : bool
        Whether the world does not wait, so that a late answer is not flown.
    clock : callable
        Seconds; by default the solving thread's where the world waits, the wall's where it does not.
    counts : dict
        How often each kind of trouble was met: "failed", "not finite", "limits", "late", "held", "afresh".
    strict : bool, optional
        Whether an exception that is no `WakewiseError`, or an answer of the wrong kind, is raised instead of counted:
        both are mistakes of the program. By default as `wakewise.core.errors.is_strict` says, and never where `enforce`
        is on: a vehicle in the water keeps its thrusts.
    """

    inner: Controller[Any]
    tracker: Tracker
    layout: Layout
    enforce: bool = False
    clock: Callable[[], float] | None = None
    counts: dict[str, int] = field(default_factory=dict)
    strict: bool | None = None
    _worker: ThreadPoolExecutor | None = None
    _pending: Future[tuple[Any, Command]] | None = None

    def __post_init__(self) -> None:
        if self.strict is None:
            self.strict = is_strict() and not self.enforce

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.inner.name

    def init(self) -> SafeState:
        """State before the first step."""
        self._pending = None
        return SafeState(
            inner=self.inner.init(), tracker=self.tracker.init(), thrusts_N=np.zeros(self.layout.B.shape[1])
        )

    def step(self, state: SafeState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[SafeState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        now = self.clock or (time.perf_counter if self.enforce else time.thread_time)
        began = now()
        inner, command, trouble = self._ask(state, dt_s, estimate, goal)
        if trouble is None and command is not None:
            trouble = self._judge(command)
        took_s = now() - began
        # What is compiled on the first step is not the method's pace.
        if took_s > dt_s and not state.first and (trouble is None or trouble[0] != "late"):
            words = f"late: {1e3 * took_s:.0f} ms of {1e3 * dt_s:.0f} allowed"
            self._count("late", words, harmless=not self.enforce)
        if trouble is None and command is not None:
            return replace(state, inner=inner, thrusts_N=command.thrusts_N, failed_s=0.0, first=False), command
        kind, words = trouble or ("failed", "no command")
        self._count(kind, words)
        failed_s = state.failed_s + dt_s
        if failed_s >= AFRESH_S:
            self._count("afresh", f"{self.name} begins anew after {failed_s:.1f} s of trouble")
            inner, failed_s = self.inner.init(), 0.0
        return self._fall_back(replace(state, inner=inner, failed_s=failed_s, first=False), dt_s, estimate, goal, words)

    def _ask(
        self, state: SafeState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[Any, Command | None, tuple[str, str] | None]:
        """The method's next state, its answer, and what went wrong: kind and words."""
        try:
            if not self.enforce:
                inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
                return inner, command, None
            return self._ask_in_time(state, dt_s, estimate, goal)
        except Exception as fault:  # whatever is raised in a control step must not leave the vehicle without thrusts
            self._pending = None
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            return state.inner, None, ("failed", f"{self.name} failed: {type(fault).__name__}: {fault}")

    def _ask_in_time(
        self, state: SafeState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[Any, Command | None, tuple[str, str] | None]:
        if self._worker is None:
            self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="control")
        pending, inner = self._pending, state.inner
        if pending is not None:
            if not pending.done():
                return inner, None, ("late", f"{self.name} late: still at a step before this one")
            self._pending = None
            inner, _ = pending.result()
        asked = self._worker.submit(self.inner.step, inner, dt_s, estimate, goal)
        try:
            inner, command = asked.result(timeout=BACKUP_SHARE * dt_s)
        except Unfinished:
            if asked.done():
                raise  # one that the method itself raised
            self._pending = asked
            return inner, None, ("late", f"{self.name} late: no answer within {BACKUP_SHARE * 1e3 * dt_s:.0f} ms")
        return inner, command, None

    def _judge(self, command: object) -> tuple[str, str] | None:
        lower, upper = self.layout.lower_N, self.layout.upper_N
        if not isinstance(command, Command) or command.thrusts_N.shape != lower.shape:
            words = f"{self.name} failed: must answer a Command of {len(lower)} thrusts"
            if self.strict:
                raise TypeError(words)
            return "failed", words
        thrusts = command.thrusts_N
        if not np.isfinite(thrusts).all():
            return "not finite", f"{self.name}: thrusts not finite"
        over_N = float(np.maximum(thrusts - upper, lower - thrusts).max())
        if over_N > _ROUNDING_N:
            return "limits", f"{self.name}: thrusts {over_N:.1f} N beyond their limits"
        return None

    def _fall_back(
        self, state: SafeState, dt_s: float, estimate: BodyState, goal: Goal, why: str
    ) -> tuple[SafeState, Command]:
        """The least thrusts of the tracker's wrench; where these cannot be had, the last ones, fading."""
        try:
            tracker, wrench = self.tracker.wrench(state.tracker, dt_s, estimate, goal, saturated=state.share < FULL)
            found = min_norm_allocation(self.layout, wrench)
            sent = Command(thrusts_N=found.thrusts_N, wrench_B=wrench, fallback=f"{why}; least thrusts")
            return replace(state, tracker=tracker, thrusts_N=found.thrusts_N, share=found.scale), sent
        except Exception as fault:  # as in `_ask`
            if self.strict and not isinstance(fault, WakewiseError):
                raise
            words = self._count("held", f"{why}; holding the last thrusts, fading ({type(fault).__name__})")
        thrusts = state.thrusts_N * np.exp(-dt_s / HOLD_S)
        return replace(state, thrusts_N=thrusts), Command(thrusts_N=thrusts, wrench_B=np.zeros(6), fallback=words)

    def _count(self, kind: str, words: str, harmless: bool = False) -> str:
        """Count and log an event; returns its words. Nobody is warned of what changes no thrust."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        # The first of a kind is news, the thousandth is not.
        level = logging.DEBUG if self.counts[kind] > 1 else logging.INFO if harmless else logging.WARNING
        log.log(level, "control: %s", words)
        return words


def safeguarded(
    controller: Controller[Any],
    vehicle: Vehicle,
    settings: ControlSettings,
    *,
    enforce: bool = False,
    strict: bool | None = None,
) -> Safeguard:
    """A method with a guard round each step; `enforce` where the world does not wait for its controller.

    `strict` as in `Safeguard`.
    """
    return Safeguard(
        inner=controller,
        tracker=make_tracker(vehicle, settings),
        layout=vehicle_layout(vehicle),
        enforce=enforce,
        strict=strict,
    )

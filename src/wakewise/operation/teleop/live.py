"""A flight in real time without a fixed end, in its own thread.

Loop, parts and record are those of every flight. Photographs are taken and the flight ends on request. The result is a
trial folder, also after an interruption.
"""

from __future__ import annotations

import gc
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid, TruthProvider
from wakewise.core.jit.precompile import compile_kernels
from wakewise.core.optional_dependencies import has
from wakewise.core.run_lock import exclusive_run
from wakewise.operation.flight_log import (
    PARTS,
    ExposureRecord,
    FlightLog,
    controls_part,
    drop_parts,
    has_parts,
    parts_controls,
    parts_exposures,
    parts_table,
    steps_of,
)
from wakewise.operation.flying import FLIGHT_JOBS, WATER_EVERY_S, loop_of, name_external_parts, recorder_of
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.operation.recorder import write_record
from wakewise.operation.teleop.input.control_log import TRACE_FILE, ControlLogWriter
from wakewise.operation.trial_folder import flown_by_hand, write_or_check_scenario, write_truth, write_views

_SEEN = ("time_s", *(f"goal_{axis}_m" for axis in "xyz"), *(f"goal_q{axis}" for axis in "wxyz"), "goal_tilt_deg")


def collect_flight(parts: Parts, folder: Path) -> bool:
    """Make of a flight's parts what a trial's flight leaves; False where there are none, or the flight is whole.

    planned.csv holds the commanded camera pose at each photograph. Rows without their photograph, or photographs
    without their row, are dropped, so an interrupted flight ends slightly earlier.
    """
    if (folder / "steps.parquet").exists() or not has_parts(folder):
        drop_parts(folder)
        return False
    table = parts_table(folder)
    seen = table.filter("exposing").select(_SEEN).collect()
    exposures = list(parts_exposures(folder, seen.height))
    write_views(parts, folder, [(parts.route.photo(k), *_view(parts, seen, k)) for k in range(seen.height)])
    controls = parts_controls(folder)
    if controls is not None:
        with whole_file(folder / TRACE_FILE) as path:
            controls.write_parquet(path)
    if has("logs"):
        from wakewise.operation.telemetry import write_mcap

        write_mcap(steps_of(table), folder / "log.mcap")
    write_record(folder, table, exposures, parts.scenario.imaging.window_s)
    drop_parts(folder)
    return True


def _view(parts: Parts, seen: pl.DataFrame, k: int) -> tuple[float, Pose]:
    """Time of photograph k, and the commanded pose of the camera."""
    time_s, *place, tilt_deg = (float(value) for value in seen.row(k))
    joint, X_BC = parts.vehicle.tilt, parts.vehicle.X_BC
    mount = X_BC if joint is None else joint.mount(X_BC, math.radians(tilt_deg))
    return time_s, Pose(np.array(place[:3]), np.array(place[3:])) @ mount


BETWEEN_S = 0.2
"""Least time between two photographs; an earlier request is served then."""
BY_HAND = "by hand"
"""Name of a leg if the pilot gives none."""


class PhotoTrigger:
    """A `PhotoSchedule` on request, from any thread or by the pilot.

    A pilot may have a method `taken()`, which returns and clears the requests since the last call: "capture" for a
    photograph in the same step, "stop" for the end of the flight. So a replay has both at the same times. Its attribute
    `leg` names the current leg.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._asked = threading.Event()
        self._last_s = -math.inf
        self.time_s = 0.0
        self.over = False

    def ask(self) -> None:
        """Request a photograph at the next step."""
        self._asked.set()

    def leg_name(self, _time_s: float) -> str:
        """The leg that the pilot names."""
        return str(getattr(self._parts.pilot, "leg", BY_HAND))

    def heed(self) -> None:
        """Read the pilot's requests."""
        for what in getattr(self._parts.pilot, "taken", tuple)():
            if what == "capture":
                self._asked.set()
            self.over |= what == "stop"

    def shutter_s(self, _number: int, time_s: float, _dt_s: float) -> float | None:
        """Now, if a photograph was requested and the last one is long enough ago."""
        self.time_s = time_s
        self.heed()
        if not self._asked.is_set() or time_s < self._last_s + BETWEEN_S - 1e-9:
            return None
        self._asked.clear()
        self._last_s = time_s
        return time_s


MOST_CATCHING_UP_S = 0.25
"""Largest delay that is caught up by faster steps; a larger one is dropped, because fast motion disturbs an operator
more than a gap."""
KEPT = 3000
"""Steps that percentiles are taken over: the last minute at 50 Hz."""


class RealTimePacer:
    """Holds each step of `run_loop` back until its time has come; one thread steps, any may read.

    Parameters
    ----------
    wait : callable
        Waits so many seconds, or less where there is nothing to wait for any more.
    paced : bool
        Without it no step waits; the reaction is measured all the same.
    clock : callable
        The time in s, never set back.

    Attributes
    ----------
    behind_s : float
        How late the last step came.
    lost_s : float
        Time let go in all.
    """

    def __init__(
        self, wait: Callable[[float], object], paced: bool = True, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._wait, self._paced, self._clock = wait, paced, clock
        self._origin_s: float | None = None
        self._read_at_s = 0.0
        self._behind, self._reaction = np.zeros(KEPT), np.zeros(KEPT)
        self._steps = 0
        self.behind_s = self.lost_s = 0.0

    def pace(self, time_s: float) -> None:
        """Wait until this time of the flight; the first call says when the flight began."""
        now_s = self._clock()
        if self._origin_s is None:
            self._origin_s = now_s - time_s
        if self._paced:
            if (early_s := self._origin_s + time_s - now_s) > 0.0:
                self._wait(early_s)
                now_s = self._clock()
            late_s = max(now_s - self._origin_s - time_s, 0.0)
            if late_s > MOST_CATCHING_UP_S:
                self._origin_s += late_s
                self.lost_s += late_s
            self.behind_s = late_s
        self._read_at_s = now_s

    def due_s(self, time_s: float) -> float:
        """When this time of the flight has come, by the clock; before the first step the flight begins now."""
        return (self._clock() if self._origin_s is None else self._origin_s) + time_s

    def sent(self, _time_s: float) -> None:
        """Take note that the thrusts which answer what was read at `pace` go to the plant."""
        k = self._steps % KEPT
        self._reaction[k] = self._clock() - self._read_at_s
        self._behind[k] = self.behind_s
        self._steps += 1

    @property
    def reaction_s(self) -> float:
        """From reading the controls to the plant's thrusts, at the last step."""
        return float(self._reaction[(self._steps - 1) % KEPT]) if self._steps else 0.0

    def late_s(self, share: float = 0.99) -> float:
        """How late this share of the last steps came at most; 0 before the first."""
        return _quantile(self._behind, self._steps, share)


def _quantile(ring: Array, steps: int, share: float) -> float:
    return float(np.quantile(ring[: min(steps, KEPT)], share)) if steps else 0.0


SWITCH_S = 2e-4
"""How long another thread may keep the interpreter when the flying one wants it back."""
_NO_WATER = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((0, 0, 0)))


class LiveFlight:
    """Flies parts until `stop`; one thread flies, the methods can be called from any thread.

    Raises InputError if the folder holds another trial, or a flight already.

    Parameters
    ----------
    folder : Path or None
        Becomes a trial folder; None keeps nothing.
    paced : bool
        By the clock; without it as fast as it goes.
    watch : callable, optional
        Called as `(step, truth_provider)` at each step in the flying thread, after the record: it must not take long.
    water_every_s : float
        How often the water at the target is measured.
    shutter : Shutter, optional
        Times of the photographs and of the end; by default on request.
    checked : bool
        Hold the parts against their scenario's tank first (see `Parts.preflight`); who flies elsewhere has done so.
    """

    def __init__(
        self,
        parts: Parts,
        *,
        folder: Path | None,
        paced: bool = True,
        watch: Callable[[Step, TruthProvider | None], None] | None = None,
        water_every_s: float = WATER_EVERY_S,
        shutter: PhotoTrigger | None = None,
        checked: bool = True,
    ) -> None:
        if folder is not None and (folder / "steps.parquet").exists():
            raise InputError(f"{folder}: holds a flight already, give another folder")
        if folder is not None and has_parts(folder):
            raise InputError(f"{folder}: holds a flight that was cut off; wakewise scan --resume {folder} finishes it")
        self.parts, self.folder = parts, folder
        self._watch, self._water_every_s, self._checked = watch, water_every_s, checked
        self._told_to_stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="flight")
        self._shutter = PhotoTrigger(parts) if shutter is None else shutter
        self._exposures: list[ExposureRecord] = []
        self.pace = RealTimePacer(self._told_to_stop.wait, paced)
        self.preparing: str | None = "not begun"
        self.latest: Step | None = None
        self.fault: BaseException | None = None

    def start(self) -> None:
        """Begin in a thread of its own; what must be prepared first is said in `preparing`, None once it flies."""
        self.preparing = "begins"
        self._thread.start()

    def run(self) -> None:
        """Fly in this thread, from preparation to folder; raises what ended the flight."""
        self._run()
        if self.fault is not None:
            raise self.fault

    def capture(self) -> None:
        """Take a photograph at the next step."""
        self._shutter.ask()

    def stop(self) -> None:
        """End the flight at the next step; its folder is written then, so wait for it with `join`."""
        self._told_to_stop.set()

    def wait(self, seconds: float) -> None:
        """Wait in the flying thread, or until the flight is to end."""
        self._told_to_stop.wait(seconds)

    def join(self, timeout_s: float | None = None) -> None:
        """Wait until the flight is over and its folder written."""
        self._thread.join(timeout_s)

    @property
    def running(self) -> bool:
        """Whether the thread is at work: it prepares, flies or writes."""
        return self._thread.is_alive()

    @property
    def time_s(self) -> float:
        """Time of the flight."""
        return 0.0 if self.latest is None else self.latest.time_s

    @property
    def behind_s(self) -> float:
        """How late the loop is against the clock."""
        return self.pace.behind_s

    @property
    def exposures(self) -> tuple[ExposureRecord, ...]:
        """Photographs taken so far, without the water that was in them."""
        return tuple(self._exposures)

    def _run(self) -> None:
        try:
            with ExitStack() as stack:
                if self.folder is not None:
                    stack.enter_context(exclusive_run(self.folder))
                self._fly()
        except BaseException as fault:  # the reason of the end is in `fault`
            self.fault = fault

    def _fly(self) -> None:
        parts, folder = self.parts, self.folder
        compile_kernels(FLIGHT_JOBS, self._prepare)
        if self._checked:
            self._prepare(0, 1, "checking vehicle, route and water")
            _ = parts.preflight
        if folder is not None:
            write_or_check_scenario(folder, flown_by_hand(parts))
            write_truth(parts, folder)
        self._prepare(0, 1, "preparing the water")
        with name_external_parts(parts):
            plant, truth_provider = parts.world.begin()
        log = FlightLog(
            folder=None if folder is None else folder / PARTS, keep=folder is not None, beside=self._keep_controls
        )
        recorder = recorder_of(
            parts, truth_provider, self._shutter, water_every_s=self._water_every_s, exposed=self._exposed, log=log
        )

        def record(step: Step) -> None:
            recorder(step)
            self.latest = step
            if self._watch is not None:
                self._watch(step, truth_provider)

        def sent(time_s: float) -> None:
            self.pace.sent(time_s)
            log.timed(self.pace.behind_s, self.pace.reaction_s)

        self.preparing = None
        try:
            with name_external_parts(parts, recorder), _undisturbed():
                loop_of(parts, plant, truth_provider, record)(
                    duration_s=None, stop=self._is_over, pace=self.pace.pace, sent=sent
                )
        finally:  # a flight that a fault ended is kept too
            log.flush()
            if folder is not None:
                collect_flight(parts, folder)

    def _keep_controls(self, part: int) -> None:
        """Write the inputs until now, if the pilot has a record of them."""
        pilot: Any = self.parts.pilot
        if not isinstance(getattr(pilot, "trace", None), ControlLogWriter):
            return
        if self.folder is not None and pilot.trace.frame().height:
            pilot.trace.write(controls_part(self.folder, part))
        pilot.trace = ControlLogWriter()

    def _is_over(self) -> bool:
        """Whether the end was requested, or the main thread has ended."""
        return self._told_to_stop.is_set() or self._shutter.over or not threading.main_thread().is_alive()

    def _prepare(self, _done: float, _total: float, note: str = "") -> None:
        self.preparing = note or self.preparing

    def _exposed(self, _number: int, exposure: ExposureRecord) -> None:
        self._exposures.append(replace(exposure, silt=_NO_WATER, flakes=None))


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Let this thread have the interpreter back soon, and leave what was made before the flight out of garbage rounds.

    Kernels of water and planner release it, and each time a busy thread may keep it for the interval of before: at
    Python's own 5 ms a loop of 50 Hz beside a thread that never rests loses two fifths of its pace. A round through all
    that the program has imported stops every thread for a period of 10 Hz.
    """
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(min(SWITCH_S, before_s))
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before_s)

"""A flight without an end, on the clock, in a thread of its own: what a person flies.

The loop, the parts and the record are those of every flight; what differs is who says when a photograph is taken and
when it is over. What it leaves is a trial folder like any other.
"""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.interfaces import ScalarGrid, TruthProvider
from wakewise.core.jit.precompile import compile_kernels
from wakewise.core.run_lock import exclusive_run
from wakewise.operation.exposures import ExposureRecord
from wakewise.operation.flight_log import PARTS, FlightLog, hands_part, has_parts
from wakewise.operation.flying import FLIGHT_JOBS, WATER_EVERY_S, loop_of, name_external_parts, recorder_of
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.input.control_log import ControlLogWriter
from wakewise.operation.teleop.live_folder import collect_flight
from wakewise.operation.teleop.photo_trigger import PhotoTrigger
from wakewise.operation.teleop.realtime_pacer import RealTimePacer
from wakewise.operation.trial_folder import flown_by_hand, write_or_check_scenario, write_truth

SWITCH_S = 2e-4
"""How long another thread may keep the interpreter when the flying one wants it back."""
_NO_WATER = ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((0, 0, 0)))


class LiveFlight:
    """Flies parts until it is told to stop; one thread flies, any other may ask and tell.

    Parameters
    ----------
    parts : Parts
    folder : Path or None
        Becomes a trial folder; None keeps nothing.
    paced : bool
        By the clock; without it as fast as it goes.
    watch : callable, optional
        Called as `(step, witness)` at each step in the flying thread, after the record: it must not take long.

    water_every_s : float
        How often the water at the target is measured.
    shutter : Shutter, optional
        Says when photographs are taken and when the flight is over; by default when it is asked.
    checked : bool
        Hold the parts against their scenario's tank first (see `Parts.preflight`); who flies elsewhere has done so.

    Raises
    ------
    InputError
        If the folder holds another trial, or a flight already.
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
        except BaseException as fault:  # the thread's end is told of by `fault`, whatever it is
            self.fault = fault

    def _fly(self) -> None:
        parts, folder = self.parts, self.folder
        compile_kernels(FLIGHT_JOBS, self._prepare)
        if self._checked:
            self._prepare(0, 1, "holds parts and water against each other")
            _ = parts.preflight
        if folder is not None:
            write_or_check_scenario(folder, flown_by_hand(parts))
            write_truth(parts, folder)
        self._prepare(0, 1, "fills the water")
        plant, witness = parts.world.begin()
        log = FlightLog(
            folder=None if folder is None else folder / PARTS, keep=folder is not None, beside=self._keep_hands
        )
        recorder = recorder_of(
            parts, witness, self._shutter, water_every_s=self._water_every_s, exposed=self._exposed, log=log
        )

        def record(step: Step) -> None:
            recorder(step)
            self.latest = step
            if self._watch is not None:
                self._watch(step, witness)

        def sent(time_s: float) -> None:
            self.pace.sent(time_s)
            log.timed(self.pace.behind_s, self.pace.reaction_s)

        self.preparing = None
        try:
            with name_external_parts(parts, recorder), _undisturbed():
                loop_of(parts, plant, witness, record)(
                    duration_s=None, stop=self._is_over, pace=self.pace.pace, sent=sent
                )
        finally:  # a flight that a fault ended is kept too
            log.flush()
            if folder is not None:
                collect_flight(parts, folder)

    def _keep_hands(self, part: int) -> None:
        """Put away what the hands did until now, of a pilot who has any."""
        pilot: Any = self.parts.pilot
        if not isinstance(getattr(pilot, "trace", None), ControlLogWriter):
            return
        if self.folder is not None and pilot.trace.frame().height:
            pilot.trace.write(hands_part(self.folder, part))
        pilot.trace = ControlLogWriter()

    def _is_over(self) -> bool:
        """Whether somebody said stop, or the program has ended round its flight."""
        return self._told_to_stop.is_set() or self._shutter.over or not threading.main_thread().is_alive()

    def _prepare(self, done: float, total: float, note: str = "") -> None:  # noqa: ARG002
        self.preparing = note or self.preparing

    def _exposed(self, number: int, exposure: ExposureRecord) -> None:  # noqa: ARG002
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

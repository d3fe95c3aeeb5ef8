"""Replay of a teleoperated flight from its recorded inputs: in the same world the same flight, to the byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from wakewise.core.errors import InputError
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario, read_scenario
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.control_log import TRACE_FILE, ControlLog, read_trace
from wakewise.operation.teleop.input.script import ScriptedInput, read_input
from wakewise.operation.teleop.live import LiveFlight, PhotoTrigger
from wakewise.operation.teleop.operator_state import OperatorState

AFTER_S = 3.0
"""How long a flight goes on after the last entry of a script; estimate: from full stick to rest takes 1.5 s."""


class ReplayedPhotoTrigger(PhotoTrigger):
    """Photographs and end at the times of an earlier flight; requests are ignored.

    `steps`: the columns `time_s` and `exposing` of the flight's steps.parquet.
    """

    def __init__(self, parts: Parts, steps: pl.DataFrame) -> None:
        super().__init__(parts)
        self._opened_s = steps.filter("exposing")["time_s"].to_numpy()
        self._end_s = float(steps["time_s"][-1])

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """Now, if it was opened in this step of the flight before."""
        self.heed()
        self.over = time_s >= self._end_s - 0.5 * dt_s
        if number >= len(self._opened_s) or not np.isclose(self._opened_s[number], time_s, rtol=0.0, atol=0.5 * dt_s):
            return None
        return time_s


class TimedPhotoTrigger(PhotoTrigger):
    """Photographs on request; the flight ends at `end_s`, or earlier on request."""

    def __init__(self, parts: Parts, end_s: float) -> None:
        super().__init__(parts)
        self._end_s = end_s

    def heed(self) -> None:
        """Read the pilot's requests, and check the time."""
        super().heed()
        self.over |= self.time_s >= self._end_s - 1e-9


def replay_input(parts: Parts, folder: Path) -> None:
    """Fly the inputs that a scenario of the pilot `operator` names, faster than real time, into a trial's folder.

    A record ends with its flight, a script `AFTER_S` after its last entry, unless "stop" is pressed before.

    Raises InputError if it names none, or they cannot be read.
    """
    if parts.scenario.control_log is None:
        _ = parts.pilot  # which says so
        return
    source = read_input(Path(parts.scenario.control_log))
    end_s = source.end_s if isinstance(source, ControlLog) else 0.0
    if isinstance(source, ScriptedInput):
        end_s = source.moments[-1].at_s + AFTER_S
    flown = assisted(parts, source, OperatorState())
    LiveFlight(flown, folder=folder, paced=False, shutter=TimedPhotoTrigger(flown, end_s)).run()


def replay_of(folder: Path, out: Path | None, parts: Parts | Scenario | None = None) -> LiveFlight:
    """A replay of a folder's inputs, faster than real time; begin it with `start`.

    `folder`: of a flight by hand. `out`: what the flight leaves goes there. `parts`: where it is flown; by default
    where it was, which gives the same flight. The inputs do not react: elsewhere, or with another method, the vehicle
    takes another path.

    Raises InputError if the folder holds no flight by hand, or `out` holds another trial.
    """
    for name in ("scenario.yaml", TRACE_FILE, "steps.parquet"):
        if not (folder / name).exists():
            raise InputError(f"{folder}: has no {name}, the folder of a flight by hand is needed")
    parts = read_scenario(folder / "scenario.yaml") if parts is None else parts
    parts = parts if isinstance(parts, Parts) else parts.parts()
    flown = assisted(parts, read_trace(folder / TRACE_FILE), OperatorState())
    steps = pl.read_parquet(folder / "steps.parquet", columns=["time_s", "exposing"])
    return LiveFlight(flown, folder=out, paced=False, shutter=ReplayedPhotoTrigger(flown, steps))

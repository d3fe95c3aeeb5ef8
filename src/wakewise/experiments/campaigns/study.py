"""A study: a campaign whose trials a program lists, such as one whose seeds are stratified.

A study is three things: planned trials, each a task with its key; `run_study`, which makes what is missing of them in a
campaign's folder; and a table of its own from the rows that come back. The folder is one of `wakewise campaign`, whose
`status` and `table` read it. Flights are tasks of `fly_stage` with setup functions and probes (`flight_task`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.jit.precompile import compile_kernels
from wakewise.experiments.campaigns.definition import FLIGHT_SOURCES, PlannedTrial, keep_plan
from wakewise.experiments.campaigns.engines import ProcessExecutor, TrialExecutor
from wakewise.experiments.campaigns.flights import FLY
from wakewise.experiments.campaigns.run import run
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.task import Figures, Task
from wakewise.experiments.trials.timing import BenchOptions

Key = tuple[str, str, int]
"""World or scenario, method or other name, seed."""
Row = Mapping[str, float | None]
WATER_EVERY_S = 0.25
"""How often the water is measured in the flights of studies."""


def store_folder(study: str) -> Path:
    """Where a study's trials are kept unless told otherwise: the user's cache folder (XDG base directories)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "wakewise" / "campaigns" / study


def flight_task(
    name: str,
    scenario: Mapping[str, Any],
    *,
    preset: str | None = "quick",
    setup: Mapping[str, Mapping[str, Any]] | None = None,
    probes: Mapping[str, Mapping[str, Any]] | None = None,
    duration_s: float | None = None,
    sources: tuple[str, ...] = (),
) -> Task:
    """A flight of a study, of which only figures are kept; `sources` are those of the study itself."""
    settings = {
        "scenario": dict(scenario),
        "preset": preset,
        "setup": dict(setup or {}),
        "probes": dict(probes or {}),
        "duration_s": duration_s,
        "water_every_s": WATER_EVERY_S,
        "keep": "none",
    }
    return Task(name=name, work=FLY, settings=settings, sources=(*FLIGHT_SOURCES, *sources))


@dataclass(frozen=True)
class FlightFailure:
    """A trial that gave no figures, and why."""

    flow: str
    name: str
    seed: int
    reason: str


@dataclass(frozen=True)
class StudyResult:
    """Figures of the trials that are finished, those that failed, and how many were known before."""

    rows: dict[Key, Row] = field(default_factory=dict)
    failures: list[FlightFailure] = field(default_factory=list)
    known: int = 0


def planned(tasks: Mapping[Key, Task]) -> list[PlannedTrial]:
    """Tasks by key as trials of a campaign."""
    return [
        PlannedTrial(task=task, factors={"method": method, "world": world, "seed": seed})
        for (world, method, seed), task in tasks.items()
    ]


def missing(tasks: Mapping[Key, Task], folder: Path, options: BenchOptions) -> list[Key]:
    """Keys of the trials that are still to be made."""
    if options.fresh or not folder.exists():
        return list(tasks)
    store = open_store(folder)
    return [key for key, task in tasks.items() if store.figures(task.key) is None]


def run_study(
    name: str,
    tasks: Mapping[Key, Task],
    folder: Path,
    options: BenchOptions,
    engine: Callable[[int], TrialExecutor] = ProcessExecutor,
) -> StudyResult:
    """Make the trials that are missing, and those again that failed in an earlier run; `fresh` forgets all of them."""
    store = open_store(folder)
    if not tasks:
        return StudyResult()
    if options.fresh:
        for task in tasks.values():
            store.forget(task.key)
    trials = planned(tasks)
    keep_plan(folder, name, trials, {"name": name})
    if missing(tasks, folder, options):
        compile_kernels(progress=options.progress)  # else each of the processes would
    outcomes = run([one.task for one in trials], folder, engine(options.workers), progress=options.progress, again=True)
    rows: dict[Key, Row] = {}
    failures: list[FlightFailure] = []
    for key, outcome in zip(tasks, outcomes, strict=True):
        if outcome.figures is None:
            failures.append(FlightFailure(*key, reason=outcome.reason or "not flown"))
        else:
            rows[key] = numbers(outcome.figures)
    return StudyResult(rows, failures, sum(one.known and one.figures is not None for one in outcomes))


def numbers(figures: Figures) -> dict[str, float | None]:
    """Figures that are numbers."""
    return {name: value for name, value in figures.items() if not isinstance(value, str)}


def selected(what: str, wished: Sequence[str] | None, allowed: Sequence[str]) -> tuple[str, ...]:
    """The wished names in the order of `allowed`; all if None.

    Raises
    ------
    InputError
        If one is not allowed.
    """
    for name in wished or ():
        if name not in allowed:
            raise InputError(f"{what}: '{name}' is not known, allowed: {', '.join(allowed)}")
    return tuple(name for name in allowed if wished is None or name in wished)

"""A study: a campaign whose trials a program lists, such as one whose seeds are stratified.

A study is three things: planned trials, each a task with its key; `run_study`, which makes what is missing of them in a
campaign's folder; and a table of its own from the rows that come back. The folder is one of `wakewise campaign`, whose
`status` and `table` read it. Flights are tasks of `fly_stage` with setup functions and probes (`flight_trial`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from wakewise.core.errors import InputError
from wakewise.core.jit.precompile import compile_kernels
from wakewise.experiments.campaigns.definition import FLIGHT_SOURCES, PlannedTrial, keep_plan
from wakewise.experiments.campaigns.engines import ProcessExecutor, TrialExecutor
from wakewise.experiments.campaigns.flights import FLY
from wakewise.experiments.campaigns.run import run
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.task import Figures, Task
from wakewise.experiments.trials.timing import BenchOptions

K = TypeVar("K", bound=Hashable)
Key = tuple[str, str, int]
"""World or scenario, method or other name, seed: what identifies a trial of a study unless it needs more."""
Row = Mapping[str, float | None]
WATER_EVERY_S = 0.25
"""How often the water is measured in the flights of studies."""


def store_folder(study: str) -> Path:
    """Where a study's trials are kept by default: the user's cache folder (XDG base directories)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "wakewise" / "campaigns" / study


def study_trial(world: str, method: str, seed: int, task: Task, variation: str = "") -> PlannedTrial:
    """A trial of a study with its place in the campaign."""
    factors: dict[str, str | int] = {"method": method, "world": world, "variation": variation, "seed": seed}
    return PlannedTrial(task=task, factors=factors)


def flight_trial(
    world: str,
    method: str,
    seed: int,
    scenario: Mapping[str, Any],
    *,
    preset: str | None = "quick",
    setup: Mapping[str, Mapping[str, Any]] | None = None,
    probes: Mapping[str, Mapping[str, Any]] | None = None,
    duration_s: float | None = None,
    sources: tuple[str, ...] = (),
    variation: str = "",
) -> PlannedTrial:
    """A flight of a study, of which only figures are kept: its place in the campaign, and what `fly_stage` is given.

    `sources` are those of the study itself, beside all that can change a flight.
    """
    settings: dict[str, Any] = {"scenario": dict(scenario), "preset": preset, "duration_s": duration_s, "keep": "none"}
    settings |= {"setup": dict(setup or {}), "probes": dict(probes or {}), "water_every_s": WATER_EVERY_S}
    name = "/".join(str(part) for part in (variation, world, method, seed) if part)
    task = Task(name=name, work=FLY, settings=settings, sources=(*FLIGHT_SOURCES, *sources))
    return study_trial(world, method, seed, task, variation)


@dataclass(frozen=True)
class FlightFailure:
    """A trial that gave no figures, and why."""

    flow: str
    name: str
    seed: int
    reason: str


@dataclass(frozen=True)
class StudyResult(Generic[K]):
    """Figures of the trials that are finished, those that failed, and which were known before; by the study's keys."""

    rows: dict[K, Row]
    failures: dict[K, FlightFailure]
    known: frozenset[K]

    def part(self, keys: Collection[K]) -> StudyResult[K]:
        """Of some trials alone."""
        return StudyResult(
            {key: row for key, row in self.rows.items() if key in keys},
            {key: failure for key, failure in self.failures.items() if key in keys},
            self.known & frozenset(keys),
        )

    @property
    def counts(self) -> dict[str, Any]:
        """How many trials there are, were flown now and failed; and those that failed."""
        return {
            "flights": len(self.rows) + len(self.failures),
            "flown": len(self.rows) - len(self.known),
            "failed": len(self.failures),
            "failures": [vars(failure) for failure in self.failures.values()],
        }


def missing(trials: Mapping[K, PlannedTrial], folder: Path, options: BenchOptions) -> list[K]:
    """Keys of the trials that are still to be made."""
    if options.fresh or not folder.exists():
        return list(trials)
    store = open_store(folder)
    return [key for key, one in trials.items() if store.figures(one.task.key) is None]


def run_study(
    name: str,
    trials: Mapping[K, PlannedTrial],
    folder: Path,
    options: BenchOptions,
    engine: Callable[[int], TrialExecutor] = ProcessExecutor,
) -> StudyResult[K]:
    """Make the trials that are missing, and those again that failed in an earlier run; `fresh` forgets all of them."""
    store = open_store(folder)
    if not trials:
        return StudyResult({}, {}, frozenset())
    if options.fresh:
        for one in trials.values():
            store.forget(one.task.key)
    keep_plan(folder, name, list(trials.values()), {"name": name})
    if missing(trials, folder, options):
        compile_kernels(progress=options.progress)  # else each of the processes would
    tasks = [one.task for one in trials.values()]
    outcomes = run(tasks, folder, engine(options.workers), progress=options.progress, again=True)
    found = dict(zip(trials, outcomes, strict=True))
    return StudyResult(
        {key: numbers(one.figures) for key, one in found.items() if one.figures is not None},
        {
            key: FlightFailure(one.world, one.method, one.seed, found[key].reason or "not flown")
            for key, one in trials.items()
            if found[key].figures is None
        },
        frozenset(key for key, one in found.items() if one.known and one.figures is not None),
    )


def numbers(figures: Figures) -> dict[str, float | None]:
    """Figures that are numbers."""
    return {name: value for name, value in figures.items() if not isinstance(value, str)}


def selected(what: str, requested: Sequence[str] | None, allowed: Sequence[str]) -> tuple[str, ...]:
    """The chosen names in the order of `allowed`; all if None.

    Raises InputError if one is not allowed.
    """
    for name in requested or ():
        if name not in allowed:
            raise InputError(f"{what}: '{name}' is not known, allowed: {', '.join(allowed)}")
    return tuple(name for name in allowed if requested is None or name in requested)

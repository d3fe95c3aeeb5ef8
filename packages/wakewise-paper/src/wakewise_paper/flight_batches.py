"""Flies many flights of a bench side by side as a campaign, and goes on where a run was stopped.

Flights of the benches as trials of a campaign: known by what was flown and by the source of all that flies it.

One store for all (`wakewise.experiments.campaigns.store`): a bench that was stopped goes on where it was, a flight that
is known is not flown again, and two benches may run side by side.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wakewise.core.jit.precompile import compile_kernels
from wakewise.experiments.campaigns import ProcessExecutor, TrialExecutor, run, task
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.task import Figures, Task, WorkProgress, function_named
from wakewise.experiments.trials.timing import BenchOptions

_BENCHES = ("studies/gentle", "studies/worlds")
FLIES = (*task.FLIES, *_BENCHES)
"""Parts of the package that can change a flight of a bench."""
PHOTOGRAPHS = (*task.PHOTOGRAPHS, *_BENCHES)
"""Parts of the package that can change a model made from a flight's photographs."""


def store_folder(bench: str = "gentle") -> Path:
    """Where a bench's flights are kept unless told otherwise: the user's cache folder (XDG base directories)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "wakewise" / "campaigns" / bench


@dataclass(frozen=True)
class FlightStore:
    """Figures of flights by what was flown and by the source of `parts`; `fresh` forgets what is there."""

    folder: Path
    fresh: bool = False
    parts: tuple[str, ...] = FLIES

    def task(self, trial: Any, fly: str, name: str = "") -> Task:
        """A flight as a trial of a campaign.

        Parameters
        ----------
        trial : dataclass of plain values
        fly : str
            ``package.module:function`` that gives its figures.
        name : str
            For people.
        """
        kind = type(trial)
        settings = {"fly": fly, "kind": f"{kind.__module__}:{kind.__qualname__}", "trial": asdict(trial)}
        return Task(name=name, work=f"{__name__}:fly_kept", settings=settings, sources=self.parts)

    def load(self, trial: Any, fly: str) -> dict[str, float | None] | None:
        """Figures of a trial that was flown before, or None."""
        if self.fresh or not self.folder.exists():
            return None
        figures = open_store(self.folder).figures(self.task(trial, fly).key)
        return None if figures is None else numbers(figures)


def fly_kept(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:  # noqa: ARG001
    """Work of such a trial: build it from its plain values and fly it."""
    kind, fly = function_named(settings["kind"]), function_named(settings["fly"])
    figures: Figures = fly(kind(**{name: _hashable(value) for name, value in settings["trial"].items()}))
    return figures


def numbers(figures: Figures) -> dict[str, float | None]:
    """Figures of a flight that are numbers, as all of the benches' are."""
    return {name: value for name, value in figures.items() if not isinstance(value, str)}


def _hashable(value: Any) -> Any:
    """Tuples, as trials have them, for the lists that JSON makes of them."""
    return tuple(map(_hashable, value)) if isinstance(value, list) else value


Key = tuple[str, str, int]
"""World or flow, method or other name, seed."""
Row = Mapping[str, float | None]
Engines = Callable[[int], TrialExecutor]
"""Makes an engine for a number of workers."""


@dataclass(frozen=True)
class FlightFailure:
    """A flight that gave no figures, and why."""

    flow: str
    name: str
    seed: int
    reason: str


def fly_all(
    trials: Mapping[Key, Any],
    fly: str,
    store: FlightStore,
    options: BenchOptions,
    engine: Engines = ProcessExecutor,
) -> tuple[dict[Key, Row], list[FlightFailure], int]:
    """Figures of all flights, those that failed, and how many were known already.

    Flights that failed in an earlier run are tried again.

    Parameters
    ----------
    trials : mapping
        What to fly, by key; plain dataclasses, which go to other processes.
    fly : str
        ``package.module:function``, which gives the figures of one.
    store : FlightStore
    options : BenchOptions
    engine : callable
        Makes the engine for a number of workers.
    """
    tasks = {key: store.task(trial, fly, "/".join(map(str, key))) for key, trial in trials.items()}
    here = open_store(store.folder)
    if store.fresh:
        for task in tasks.values():
            here.forget(task.key)
    if any(here.figures(task.key) is None for task in tasks.values()):
        compile_kernels(progress=options.progress)  # else each of the processes would
    outcomes = run(list(tasks.values()), store.folder, engine(options.workers), progress=options.progress, again=True)
    rows: dict[Key, Row] = {}
    failures: list[FlightFailure] = []
    for key, outcome in zip(tasks, outcomes, strict=True):
        if outcome.figures is None:
            failures.append(FlightFailure(*key, reason=outcome.reason or "not flown"))
        else:
            rows[key] = numbers(outcome.figures)
    return rows, failures, sum(outcome.known and outcome.figures is not None for outcome in outcomes)

"""Flies many flights of a bench side by side as a campaign, and goes on where a run was stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from wakewise.core.jit.precompile import compile_kernels
from wakewise.experiments.campaigns import ProcessExecutor, TrialExecutor, run
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_paper.flight_store import FlightStore, numbers

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

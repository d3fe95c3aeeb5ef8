"""Flies many flights in processes side by side, keeps what each gave, and goes on where a run was stopped."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, TypeVar

import numpy as np

from wakewise.errors import WakewiseError
from wakewise.studies.flight_store import FlightStore
from wakewise.trials.timing import BenchOptions
from wakewise.warming import warm

Key = tuple[str, str, int]
"""World or flow, method or other name, seed."""
Row = Mapping[str, float | None]
Pool = Callable[[int], AbstractContextManager[Any]]
T = TypeVar("T")


@dataclass(frozen=True)
class Failure:
    """A flight that gave no figures, and why."""

    flow: str
    name: str
    seed: int
    reason: str


@contextmanager
def processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes of their own (no shared random state, no forked threads); what waits is dropped on trouble."""
    pool = ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def fly_all(
    trials: Mapping[Key, T],
    fly: Callable[[T], dict[str, float | None]],
    store: FlightStore,
    options: BenchOptions,
    pool: Pool = processes,
) -> tuple[dict[Key, Row], list[Failure], int]:
    """Figures of all flights, those that failed, and how many were known already.

    Parameters
    ----------
    trials : mapping
        What to fly, by key; plain dataclasses, which go to other processes.
    fly : callable
        A function of a module, which gives the figures of one.
    store : FlightStore
    options : BenchOptions
    pool : callable
        Makes the executor for a number of workers.
    """
    rows: dict[Key, Row] = {}
    for key, trial in trials.items():
        figures = store.load(trial)
        if figures is not None:
            rows[key] = figures
    kept = len(rows)
    failures: list[Failure] = []
    missing = [key for key in trials if key not in rows]
    options.progress(kept, len(trials), f"{kept} flights known already")
    if not missing:
        return rows, failures, kept
    warm(progress=options.progress)  # else each of the processes would
    began = time.monotonic()
    with pool(options.workers) as executor:
        waiting: dict[Future[dict[str, float | None]], Key] = {
            executor.submit(fly, trials[key]): key for key in missing
        }
        for done, future in enumerate(as_completed(waiting), start=1):
            key = waiting[future]
            try:
                rows[key] = future.result()
            except (WakewiseError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
                failures.append(Failure(*key, reason=f"{type(error).__name__}: {error}"))
            else:
                store.save(trials[key], dict(rows[key]))
            left_s = (time.monotonic() - began) * (len(missing) - done) / done
            words = f"{key[0]}: {key[1]}, seed {key[2]}; {left_s / 60.0:.0f} min left"
            options.progress(kept + done, len(trials), words)
    return rows, failures, kept

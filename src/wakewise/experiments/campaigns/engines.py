"""Where a campaign's trials are made: what an engine is, and the one that makes them in processes of this computer."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.worker_process import close_slots

MOST_WORKERS = 1024


@dataclass(frozen=True, kw_only=True)
class WorkerPool:
    """Those who work.

    Parameters
    ----------
    executor : Executor
        Makes calls of `wakewise.experiments.campaigns.worker_process.attempt`.
    threads : int
        Of each attempt's libraries.
    size : callable
        How many attempts are made at once now. No more are handed over, so that what waits can still be stopped, or
        taken by others.
    check : callable
        Raises if there is nobody left.
    """

    executor: Executor
    threads: int
    size: Callable[[], int]
    check: Callable[[], None]


class TrialExecutor(Protocol):
    """Gives a crew for the length of a block."""

    @property
    def name(self) -> str:
        """Of the engine, as the command line knows it."""
        ...

    def crew(self, driver: Path) -> AbstractContextManager[WorkerPool]:
        """Workers that see the driver's file, in the campaign's folder; leaving the block ends their processes."""
        ...


@dataclass(frozen=True)
class ProcessExecutor:
    """Processes of this computer, started anew (no forks), each of which makes one trial after the other.

    Parameters
    ----------
    workers : int
        How many at once; as many as there are cores if not given.

    Raises
    ------
    InputError
    """

    workers: int | None = None
    name: str = "processes"

    def __post_init__(self) -> None:
        check_workers(self.workers)

    @contextmanager
    def crew(self, driver: Path) -> Iterator[WorkerPool]:
        """Threads that each mind one process."""
        workers = self.workers or cores()
        executor = ThreadPoolExecutor(workers, thread_name_prefix="campaign")
        try:
            yield WorkerPool(
                executor=executor,
                threads=threads_each(cores(), workers),
                size=lambda: workers,
                check=lambda: None,
            )
        finally:
            executor.shutdown(wait=False, cancel_futures=True)
            close_slots(str(driver))
            executor.shutdown(wait=True)
            close_slots(str(driver))  # of a thread that had just taken a ticket


def check_workers(workers: int | None) -> None:
    """Refuse a number of workers that cannot be."""
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"workers: {workers}, allowed 1 to {MOST_WORKERS}")


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_each(there: int, workers: int) -> int:
    """Threads of each worker, so that all together have a core each."""
    return max(1, there // workers)

"""Where a campaign's trials are made: what an engine is, and the one that makes them in processes of this computer.

Trials on a Dask cluster: one that runs already, on any number of computers, or one of this computer.

Dask only says which computer makes which attempt: claims, attempts, time-outs, memory and retries are the slots' and
the driver's, as with processes, so that the figures are the same. Its settings follow from how it treats workers that
die: every task that a dying worker *has been assigned* is suspected, and after `allowed-failures` of them given up
(distributed issues 5234, 2694), so that few are handed over at once and many failures are allowed.
"""

from __future__ import annotations

import gc
import math
import os
import platform
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.optional_dependencies import need
from wakewise.experiments.campaigns.task import source_version
from wakewise.experiments.campaigns.worker_process import close_slots

if TYPE_CHECKING:
    from distributed import Client


MOST_WORKERS = 1024


@dataclass(frozen=True, kw_only=True)
class WorkerPool:
    """Where attempts are made.

    `executor` makes calls of `worker_process.attempt`; `threads` are those of each attempt's libraries; `size` says how
    many attempts are made at once now, so that what waits can still be stopped or taken by others; `check` raises if
    no worker is left.
    """

    executor: Executor
    threads: int
    size: Callable[[], int]
    check: Callable[[], None]


class TrialExecutor(Protocol):
    """Gives a crew for the length of a block."""

    @property
    def name(self) -> str:
        """Of the engine, on the command line."""
        ...

    def crew(self, driver: Path) -> AbstractContextManager[WorkerPool]:
        """Workers that see the driver's file, in the campaign's folder; leaving the block ends their processes."""
        ...


@dataclass(frozen=True)
class ProcessExecutor:
    """Processes of this computer, started anew (no forks), each of which makes one trial after the other.

    As many as there are cores if `workers` is not given. Raises InputError if `workers` is out of range.
    """

    workers: int | None = None
    name: str = "processes"

    def __post_init__(self) -> None:
        check_workers(self.workers)

    @contextmanager
    def crew(self, driver: Path) -> Iterator[WorkerPool]:
        """Threads that each supervise one process."""
        workers = self.workers or cores()
        executor = ThreadPoolExecutor(workers, thread_name_prefix="campaign")
        try:
            yield WorkerPool(
                executor=executor, threads=threads_each(cores(), workers), size=lambda: workers, check=lambda: None
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


SETTINGS = {
    "distributed.scheduler.allowed-failures": 1000,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.admin.log-format": "%(message)s",
    "distributed.logging": {"distributed": "critical", "distributed.nanny": "critical"},
}
"""Of the cluster that is made here; docs/campaigns.md says how one is started elsewhere."""
CONNECT_S, WORKERS_S, SIZE_S = 10.0, 60.0, 1.0
"""How long a scheduler may take to answer, and to have its first worker; how long its number of workers is believed, as
it tells of every one."""


@dataclass(frozen=True)
class DaskExecutor:
    """Workers of a Dask cluster.

    `scheduler` is the address of a scheduler, or its scheduler file; a cluster on this computer is made if not given,
    with `workers` workers, one per core if not given. Of a running cluster at most `workers` are used. Raises
    MissingExtra without the extra `dask`, and InputError if `workers` is out of range.
    """

    scheduler: str | None = None
    workers: int | None = None
    name: str = "dask"

    def __post_init__(self) -> None:
        need("--engine dask", "dask")
        check_workers(self.workers)

    @contextmanager
    def crew(self, driver: Path) -> Iterator[WorkerPool]:
        """Threads of the cluster's workers.

        Raises InputError if the address does not answer, or a worker does not see the campaign's folder, or has other
        sources.
        """
        import dask

        import_module("distributed")  # its defaults first: leaving the block would take them away again

        with dask.config.set(SETTINGS), self._client() as client:
            told = self._probed(client, driver)
            on_host = Counter(host for host, _, threads in told for _ in range(threads))
            each = min(threads_each(there, on_host[host]) for host, there, _ in told)
            executor = client.get_executor(retries=0, pure=False)

            asked, known_size = -math.inf, 1

            def size() -> int:
                nonlocal asked, known_size
                if time.monotonic() - asked < SIZE_S:
                    return known_size
                known = client.scheduler_info(n_workers=-1).get("workers", {}).values()  # {} where it went away
                there = sum(int(worker["nthreads"]) for worker in known)
                asked, known_size = time.monotonic(), max(1, min(there, self.workers or there))
                return known_size

            def check() -> None:
                if client.status != "running":
                    raise EnvironmentFailure(
                        f"--scheduler {self.scheduler or 'of this computer'}: the connection was lost; what was "
                        "finished is kept, run the same command again to go on"
                    )

            try:
                yield WorkerPool(executor=executor, threads=each, size=size, check=check)
            finally:
                with suppress(Exception):  # whatever a cluster raises that is going away
                    client.run(close_slots, str(driver))

    @contextmanager
    def _client(self) -> Iterator[Client]:
        """A client of the cluster."""
        from distributed import Client, LocalCluster

        if self.scheduler is None:
            with (
                LocalCluster(
                    n_workers=self.workers or cores(),
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                ) as cluster,
                Client(cluster) as client,
            ):
                yield client
            return
        where = {"scheduler_file": self.scheduler} if Path(self.scheduler).is_file() else {"address": self.scheduler}
        client, reason = None, ""
        try:
            client = Client(**where, timeout=CONNECT_S)
        except (OSError, ValueError) as fault:
            reason = "" if isinstance(fault, TimeoutError) else f" ({' '.join(str(fault).split())[:120]})"
        if client is None:
            # What was half made is closed now: by the collector it may be in the midst of making another one, which
            # holds the lock that closing waits for (distributed 2026.8, LoopRunner).
            gc.collect()
            raise InputError(
                f"--scheduler {self.scheduler}: no Dask scheduler answers there{reason}; one is started with "
                "`dask scheduler`, and prints its address such as tcp://10.0.0.1:8786"
            )
        with client:
            yield client

    def _probed(self, client: Client, driver: Path) -> list[tuple[str, int, int]]:
        """Host, cores and threads of each worker, each of which sees the folder and has these sources."""
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise InputError(
                f"--scheduler {self.scheduler}: has had no worker for {WORKERS_S:g} s; one is started with "
                f"`dask worker {self.scheduler} --nthreads 1`"
            ) from None
        workers: dict[str, Any] = client.scheduler_info(n_workers=-1)["workers"]
        told: dict[str, tuple[str, int, bool, str]] = client.run(_look_round, str(driver))
        for address, (host, _, sees, version) in told.items():
            if not sees:
                raise InputError(
                    f"--out {driver.parents[1]}: the worker {address} on {host} does not see it; give a folder that "
                    "all computers of the cluster have under this name"
                )
            if version != source_version():
                raise InputError(
                    f"--scheduler {self.scheduler}: the worker {address} on {host} has other sources of Wakewise "
                    f"({version[:8]}, here {source_version()[:8]}); install the same version on all computers"
                )
        return [(host, there, int(workers[a]["nthreads"])) for a, (host, there, _, _) in told.items() if a in workers]


def _look_round(driver: str) -> tuple[str, int, bool, str]:
    """What a worker's process sees: its host's name and cores, whether the folder is there, its sources."""
    return platform.node(), cores(), Path(driver).exists(), source_version()

"""Makes the trials of a campaign that are not made yet, on an engine, and goes on where an earlier run was stopped.

The driver keeps nothing that matters: what is finished stands in the trials' folders, and any number of drivers may
work on one folder, each taking what no other is at.
"""

from __future__ import annotations

import errno
import json
import math
import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from wakewise.core.errors import FULL, InputError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.experiments.campaigns import attempt_log, trial_lock
from wakewise.experiments.campaigns.engines import TrialExecutor, WorkerPool
from wakewise.experiments.campaigns.index import listing
from wakewise.experiments.campaigns.store import CampaignStore, open_store, report_full_disk
from wakewise.experiments.campaigns.task import Task, TrialOutcome, source_version
from wakewise.experiments.campaigns.worker import AttemptRequest
from wakewise.experiments.campaigns.worker_process import AttemptReport, attempt

DRIVERS = ".drivers"
_LOOK_S = 0.2
SILENT_S = 120.0
"""A holder on another computer that shows no heartbeat for so long is gone; twelve beats."""


@dataclass(frozen=True)
class _Held:
    """A trial that another process is at: its heartbeat, and since when that has not changed (monotonic)."""

    task: Task
    beat: int | None
    since: float


def never() -> bool:
    """No reason to stop."""
    return False


def run(
    tasks: Sequence[Task],
    folder: Path,
    engine: TrialExecutor,
    *,
    timeout_s: float | None = None,
    memory_MB: float | None = None,
    retries: int = 2,
    progress: Progress = no_progress,
    stop: Callable[[], bool] = never,
    until: float | None = None,
    again: bool = False,
) -> list[TrialOutcome]:
    """Make what is missing of some trials.

    `tasks` have one outcome each, in this order; those of one key are made once. `folder` is made if it is not there;
    with a Dask cluster, all of its computers see it. An attempt that takes longer than `timeout_s`, or whose processes
    take more than `memory_MB`, is ended. A trial whose process died, took too long or too much is tried again `retries`
    times, as is one that met a failure of the computer, which each run tries again; an exception of the work is final.
    `stop` is asked a few times a second: true ends what is under way and returns, as does the instant `until`
    (`time.monotonic`, s). `again` tries trials anew that failed in an earlier run.

    Raises InputError if the folder holds something else or results of another version. Raises EnvironmentFailure if the
    disk is full; what was finished is kept, and the same call goes on.
    """
    check_bounds(timeout_s, memory_MB, retries)
    with report_full_disk(folder):
        store = open_store(folder)
        driver = _Driver(store, tasks, timeout_s, memory_MB, retries, progress, until, again)
        if driver.pending:
            with _driver_file(folder) as name, engine.crew(name) as crew:
                driver.work(crew, name, stop)
        return driver.outcomes(tasks)


def check_bounds(timeout_s: float | None, memory_MB: float | None, retries: int) -> None:
    """Raise InputError for a bound that cannot be kept."""
    for name, value, unit in (("timeout", timeout_s, "s"), ("memory", memory_MB, "MB")):
        if value is not None and not value > 0.0:
            raise InputError(f"{name}: {value:g} {unit}, must be more than 0")
    if not 0 <= retries <= 100:
        raise InputError(f"retries: {retries}, allowed 0 to 100")


class _Driver:
    """One run: what is left to do, what is under way, what came of it."""

    def __init__(
        self,
        store: CampaignStore,
        tasks: Sequence[Task],
        timeout_s: float | None,
        memory_MB: float | None,
        retries: int,
        progress: Progress,
        until: float | None,
        again: bool,
    ) -> None:
        self._store, self._retries, self._progress = store, retries, progress
        self._timeout_s, self._memory_MB = timeout_s, memory_MB
        self._until = math.inf if until is None else until
        self._done: dict[str, TrialOutcome] = {}
        self._held: dict[str, _Held] = {}
        self._abandoned: dict[str, int | None] = {}
        self._met: Counter[str] = Counter()  # failures of the computer, by trial
        self.pending: deque[Task] = deque()
        self._began = time.monotonic()
        self._made, self._made_s = 0, 0.0
        unique = {task.key: task for task in tasks}
        self._total = len(unique)
        listed = listing(store)
        for key, task in unique.items():
            kept = listed.get(key)
            if kept is not None and kept.figures is None and kept.attempts.is_failure(retries) and again:
                attempt_log.clear_failures(store.place(key))
                kept = None
            if kept is None or not (kept.figures is not None or kept.attempts.is_failure(retries)):
                self.pending.append(task)
                continue
            figures, told = kept.figures, kept.attempts
            reason = None if figures is not None else told.reason
            self._done[key] = TrialOutcome(
                task=task, figures=figures, reason=reason, attempts=told.begun, took_s=kept.took_s, known=True
            )

    def work(self, crew: WorkerPool, driver: Path, stop: Callable[[], bool]) -> None:
        """Hand out what is pending until nothing is left, `stop` says so or the time is over."""
        futures: dict[Future[AttemptReport], Task] = {}
        try:
            self._tell(crew, None)
            while (self.pending or self._held or futures) and not (stop() or time.monotonic() > self._until):
                while self.pending and len(futures) < crew.size():
                    self._hand_out(self.pending.popleft(), crew, driver, futures)
                self._look_at_held()
                if not futures:
                    time.sleep(_LOOK_S)
                    continue
                for future in wait(futures, _LOOK_S, FIRST_COMPLETED).done:
                    self._take_back(futures.pop(future), future, crew)
                    self._tell(crew, None)
        finally:
            with suppress(OSError):
                driver.unlink(missing_ok=True)  # ends what is under way elsewhere
            for future in futures:
                future.cancel()

    def outcomes(self, tasks: Sequence[Task]) -> list[TrialOutcome]:
        """What became of each."""
        return [self._done.get(task.key) or self._store.outcome(task) for task in tasks]

    def _hand_out(self, task: Task, crew: WorkerPool, driver: Path, futures: dict[Future[AttemptReport], Task]) -> None:
        """Have a trial made, unless another process has made it or is at it."""
        key, place = task.key, self._store.place(task.key)
        if self._is_settled(task):
            return
        holder, beat = trial_lock.holder_of(place), trial_lock.heartbeat_of(place)
        left = self._abandoned.pop(key, None)
        if holder is not None and not holder.is_gone and (left is None or left != beat):
            self._held[key] = _Held(task, beat, time.monotonic())
            return
        ticket = AttemptRequest(
            place=str(place.resolve()),
            trial=task.plain(),
            timeout_s=self._timeout_s,
            memory_MB=self._memory_MB,
            driver=str(driver),
            abandoned_beat=left,
            version=source_version(task.sources),
            cwd=str(Path.cwd()),
        )
        futures[crew.executor.submit(attempt, ticket, crew.threads)] = task

    def _take_back(self, task: Task, future: Future[AttemptReport], crew: WorkerPool) -> None:
        """What came of an attempt."""
        key, place = task.key, self._store.place(task.key)
        try:
            report = future.result()
        except (Exception, CancelledError) as fault:  # the engine lost its worker, with whatever exception it has
            crew.check()
            report = AttemptReport(key=key, how="died", reason=" ".join(f"{type(fault).__name__}: {fault}".split()))
            place.mkdir(parents=True, exist_ok=True)
            attempt_log.end(place, "died", report.reason, 0.0)
        if report.reason == FULL:
            raise OSError(errno.ENOSPC, FULL)
        self._met[key] += report.how == "computer"
        if report.how == "held":
            self._held[key] = _Held(task, trial_lock.heartbeat_of(place), time.monotonic())
            return
        if self._is_settled(task):
            if report.how == "done":
                self._made, self._made_s = self._made + 1, self._made_s + report.took_s
            return
        if self._met[key] > self._retries:  # left for another run
            self._done[key] = replace(self._store.outcome(task), reason=report.reason, how="computer")
            return
        self.pending.append(task)

    def _is_settled(self, task: Task) -> bool:
        """Whether a trial is finished or has failed for good; then its outcome is kept."""
        place = self._store.place(task.key)
        outcome = self._store.outcome(task)
        if outcome.figures is None and not attempt_log.read_attempts(place).is_failure(self._retries):
            return False
        self._done[task.key] = outcome
        return True

    def _look_at_held(self) -> None:
        """Take up again what another process has given back, or whose holder is gone."""
        for key, held in list(self._held.items()):
            place = self._store.place(key)
            holder, beat = trial_lock.holder_of(place), trial_lock.heartbeat_of(place)
            now = time.monotonic()
            if holder is not None and not holder.is_gone:
                if beat != held.beat:
                    self._held[key] = _Held(held.task, beat, now)
                    continue
                if holder.is_here or now - held.since < SILENT_S:
                    continue
                self._abandoned[key] = beat
            del self._held[key]
            if not self._is_settled(held.task):
                self.pending.append(held.task)

    def _tell(self, crew: WorkerPool, note: str | None) -> None:
        done = len(self._done)
        failed = sum(outcome.figures is None for outcome in self._done.values())
        words = f"{failed} failed; " if failed else ""
        if self._made:
            left_s = self._made_s / self._made * (self._total - done) / crew.size()
            left_s = max(0.0, min(left_s, self._until - time.monotonic()))
            words += f"{left_s / 60.0:.0f} min left" if left_s >= 90.0 else f"{left_s:.0f} s left"
        else:
            words += f"{done} known already"
        self._progress(done, self._total, note or words)


@contextmanager
def _driver_file(folder: Path) -> Iterator[Path]:
    """A file that is there as long as this driver is; those of drivers that are gone are removed."""
    place = (folder / DRIVERS).resolve()
    place.mkdir(exist_ok=True)
    active_drivers(folder)
    path = place / f"{os.getpid()}-{os.urandom(4).hex()}.json"
    try:
        path.write_text(json.dumps(asdict(trial_lock.this_process())), encoding="utf-8")
        yield path
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def active_drivers(folder: Path) -> list[trial_lock.LockHolder]:
    """Drivers that are at a campaign; files of those that are gone are removed."""
    found = []
    for path in sorted((folder / DRIVERS).glob("*.json")):
        try:
            holder = trial_lock.LockHolder(**json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            continue
        if holder.is_gone:
            with suppress(OSError):
                path.unlink(missing_ok=True)
        else:
            found.append(holder)
    return found

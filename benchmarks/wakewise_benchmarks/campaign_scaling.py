"""A campaign on Dask with 1, 2 and 4 workers, and a model of many: measured costs of a trial that take turns.

Trials that do nothing show what a trial costs beside its work, and trials that wait a known time show how many are made
in a second without needing a core each. The model: n workers make min(n / (task + between), 1 / serial(n)) trials a
second. `between`: from one trial's end to the next one's, one worker. `serial(n)`: processor time of the driver and
the scheduler, the claim and the notes in the shared folder as if its server took one trial at a time, and what the
driver's waiting costs for each trial under way.
"""

from __future__ import annotations

import math
import pickle
import statistics
import time
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from wakewise.core.errors import StageError
from wakewise.experiments.campaigns import Task, TrialExecutor
from wakewise.experiments.campaigns import run as make
from wakewise.experiments.campaigns.engines import DaskExecutor
from wakewise.experiments.campaigns.task import Figures, WorkProgress, source_version
from wakewise.experiments.campaigns.worker import AttemptRequest, run_attempt
from wakewise.experiments.campaigns.worker_process import AttemptReport, attempt

WORKERS, MANY, TASKS_S = (1, 2, 4), (10, 100, 1000), (10.0, 60.0)
"""Workers that are measured, workers that the model is asked for, and durations of a trial, s, besides the measured."""
EMPTY, WAITS, WAIT_S, CLAIMS, WAITED = 40, 10, 1.0, 20, 1000
"""Trials without work; trials that wait, for each worker; how long they wait; claims; trials that are waited for."""


def waiting(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Work that takes a given time and no processor."""
    time.sleep(settings["wait_s"])
    return {"number": float(settings["number"])}


def _task(number: int, wait_s: float) -> Task:
    settings = {"number": number, "wait_s": wait_s}
    return Task(name=f"{number}", work=f"{__name__}:waiting", settings=settings, sources=("core/files.py",))


@dataclass(frozen=True, kw_only=True)
class ScalingModel:
    """Costs of a trial in s: between two trials of a worker; driver and scheduler; shared folder; per worker."""

    between_s: float
    driver_s: float
    claim_s: float
    per_worker_s: float

    def serial_s(self, workers: int) -> float:
        """What the trials of so many workers take one after the other, each."""
        return self.driver_s + self.claim_s + self.per_worker_s * workers

    def rate_per_s(self, workers: int, task_s: float) -> float:
        """Trials a second that so many workers make."""
        return min(workers / (task_s + self.between_s), 1.0 / self.serial_s(workers))

    def efficiency_pct(self, workers: int, task_s: float) -> float:
        """Share of the workers' time that is work."""
        return 100.0 * self.rate_per_s(workers, task_s) * task_s / workers

    def saturates_at(self, task_s: float) -> int:
        """Workers beyond which no more trials are made: n serial(n) = task + between."""
        fixed, grows, length = self.driver_s + self.claim_s, self.per_worker_s, task_s + self.between_s
        return int(2.0 * length / (fixed + math.sqrt(fixed**2 + 4.0 * grows * length)))


def measured(folder: Path, engine: TrialExecutor, workers: int) -> tuple[float, float, float]:
    """Seconds between trials without work, processor seconds of this process for each, and trials a second that wait.

    What comes before each worker has made some trials does not count, so that no start does.
    """
    count = EMPTY + WAITS * workers
    tasks = [_task(number, 0.0 if number < EMPTY else WAIT_S) for number in range(count)]
    ends: dict[float, tuple[float, float]] = {}

    def note(done: float, *_: object) -> None:
        ends.setdefault(done, (time.perf_counter(), time.process_time()))

    outcomes = make(tasks, folder, engine, progress=note)
    if any(outcome.figures is None for outcome in outcomes):
        raise StageError(f"bench campaign: trials of {engine.name} failed with {workers} workers")
    ended = sorted(ends)
    first = next(done for done in ended if done >= 4 * workers)
    last = max(done for done in ended if done <= EMPTY)
    second = next(done for done in ended if done >= EMPTY + workers)
    wall_s, cpu_s = (b - a for a, b in zip(ends[first], ends[last], strict=True))
    rate = (ended[-1] - second) / (ends[ended[-1]][0] - ends[second][0])
    return wall_s / (last - first), cpu_s / (last - first), rate


def claims(folder: Path) -> tuple[float, int]:
    """Wall time of a claim, notes and figures in a folder, median; bytes to a worker and back for a trial, pickled."""
    times, size = [], 0
    for number in range(CLAIMS):
        task = _task(number, 0.0)
        ticket = AttemptRequest(
            place=str(folder / task.key), trial=task.plain(), version=source_version(task.sources), cwd=str(Path.cwd())
        )
        began = time.perf_counter()
        report = run_attempt(ticket, lambda *_: None, quiet=False)
        times.append(time.perf_counter() - began)
        size = len(pickle.dumps((attempt, ticket, 1))) + len(pickle.dumps(AttemptReport(key=task.key, **report)))
    return statistics.median(times), size


def waited_s() -> float:
    """What it costs the driver to wait for the next of many trials, s for each that is under way."""
    futures: list[Future[None]] = [Future() for _ in range(WAITED)]
    futures[WAITED // 2].set_result(None)
    times = []
    for _ in range(CLAIMS):
        began = time.thread_time()
        wait(futures, 1.0, FIRST_COMPLETED)
        times.append(time.thread_time() - began)
    return statistics.median(times) / WAITED


def dask_scaling(folder: Path, trial_s: float | None) -> dict[str, Any]:
    """Rates of 1, 2 and 4 workers beside the model's, its costs, and what it says of many. `trial_s`: of a real one."""
    claim_s, size = claims(folder / "claims")
    found = {n: measured(folder / f"{n}", DaskExecutor(workers=n), n) for n in WORKERS}
    model = ScalingModel(
        between_s=found[1][0],
        driver_s=statistics.median(cpu for _, cpu, _ in found.values()),
        claim_s=claim_s,
        per_worker_s=waited_s(),
    )
    lengths = [*TASKS_S, *([] if trial_s is None else [trial_s])]
    return {
        "costs": asdict(model),
        "bytes_per_task": size,
        "measured": {
            str(n): {
                "between_s": between,
                "driver_s": cpu,
                "rate_per_s": rate,
                "model_per_s": model.rate_per_s(n, WAIT_S),
            }
            for n, (between, cpu, rate) in found.items()
        },
        "model": {
            f"task_{length:.0f}_s": {f"efficiency_{n}_pct": model.efficiency_pct(n, length) for n in MANY}
            | {
                "saturates_at_workers": model.saturates_at(length),
                "saturates_by_driver_at_workers": replace(model, claim_s=0.0).saturates_at(length),
            }
            for length in lengths
        },
    }

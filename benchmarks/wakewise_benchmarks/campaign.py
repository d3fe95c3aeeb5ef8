"""What a campaign costs: a standard trial, two workers beside one, what lies between trials, a list of many, Dask.

The trial is the quick preset with photographs and model, `wake-aware`; one worker has all cores, two share them. Times
are those of a clock on the wall, so other work on the computer shows; `load_average` says how much there was before.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wakewise.core.errors import StageError
from wakewise.core.files import write_json, write_text
from wakewise.core.jit.precompile import compile_kernels
from wakewise.core.optional_dependencies import has, how_to_install
from wakewise.experiments.campaigns import ProcessExecutor, Task, TrialExecutor, planned_trials
from wakewise.experiments.campaigns import run as make
from wakewise.experiments.campaigns.attempt_log import ATTEMPTS
from wakewise.experiments.campaigns.definition import check_campaign
from wakewise.experiments.campaigns.engines import cores
from wakewise.experiments.campaigns.index import INDEX, listing
from wakewise.experiments.campaigns.store import FIGURES, open_store
from wakewise.experiments.campaigns.task import Figures, WorkProgress
from wakewise.experiments.trials.timing import BenchOptions

TRIALS, EMPTY, MANY, REPEATS = 2, 40, 10_000, 3
_OF_TRIALS = ("trial_s", "efficiency_2_workers", "overhead_pct", "overhead_dask_pct")


def run(options: BenchOptions) -> dict[str, Any]:
    """Figures of this page; those of trials are null without the extras that a trial needs."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    with tempfile.TemporaryDirectory(prefix="wakewise-campaign-") as name:
        folder = Path(name)
        options.progress(0, 5, f"a list of {MANY} trials")
        found: dict[str, Any] = {"load_average": load, "cores": cores()} | list_many(folder / "many", MANY)
        options.progress(1, 5, f"{EMPTY} trials without work")
        found["between_trials_s"] = between_trials_s(folder / "empty", ProcessExecutor(1))
        found["between_trials_dask_s"] = _dask_s(folder / "dask")
        of_dask = ("between_trials_dask_s", "overhead_dask_pct", "dask")
        why = {} if has("dask") else dict.fromkeys(of_dask, how_to_install("dask"))
        if not (has("photos") and has("logs")):
            reason = f"a trial needs more: {how_to_install('photos,logs')}"
            found["dask"] = _dask_scaling(folder / "scaling", None)
            return found | dict.fromkeys(_OF_TRIALS) | {"why": why | dict.fromkeys(_OF_TRIALS, reason)}
        compile_kernels(progress=options.progress)
        options.progress(2, 5, f"{TRIALS} trials, one worker")
        alone_s, took_s = standard_trials(folder / "one", ProcessExecutor(1))
        options.progress(4, 5, f"{TRIALS} trials, two workers")
        beside_s, _ = standard_trials(folder / "two", ProcessExecutor(2))
        trial_s = statistics.mean(took_s)
        found["dask"] = _dask_scaling(folder / "scaling", trial_s)
    between, dask = found["between_trials_s"], found["between_trials_dask_s"]
    return found | {
        "trial_s": trial_s,
        "efficiency_2_workers": alone_s / beside_s,
        "one_worker_s": alone_s,
        "two_workers_s": beside_s,
        "overhead_pct": 100.0 * between / trial_s,
        "overhead_dask_pct": None if dask is None else 100.0 * dask / trial_s,
        "why": why,
    }


def nothing(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Work that is none."""
    return {"number": float(settings["number"])}


def between_trials_s(folder: Path, engine: TrialExecutor) -> float:
    """Wall time that a trial costs whose work is nothing: claim, notes, figures on the disk, handing out.

    From the end of the first trial to that of the last, so that the engine's start does not count.
    """
    tasks = [
        Task(name=f"{number}", work=f"{__name__}:nothing", settings={"number": number}, sources=("core/files.py",))
        for number in range(EMPTY + 1)
    ]
    ends: dict[float, float] = {}

    def note(done: float, *_: object) -> None:
        ends.setdefault(done, time.perf_counter())

    make(tasks, folder, engine, progress=note)
    return (ends[EMPTY + 1] - ends[1]) / EMPTY


def _dask_s(folder: Path) -> float | None:
    """The same on a cluster of this computer; None without Dask."""
    if not has("dask"):
        return None
    from wakewise.experiments.campaigns.engines import DaskExecutor

    return between_trials_s(folder, DaskExecutor(workers=1))


def _dask_scaling(folder: Path, trial_s: float | None) -> dict[str, Any] | None:
    """How a campaign on Dask grows with its workers; None without Dask."""
    if not has("dask"):
        return None
    from wakewise_benchmarks.campaign_scaling import dask_scaling

    return dask_scaling(folder, trial_s)


def list_many(folder: Path, count: int) -> dict[str, float]:
    """Wall time of listing so many finished trials, from the cache (and the processor's) and without it."""
    store = open_store(folder)
    figures = {f"figure_{number}": number / 7.0 for number in range(40)}
    for number in range(count):
        place = store.place(f"{number:032x}")
        place.mkdir()
        write_json(place / FIGURES, {"figures": figures, "took_s": 60.0})
        write_text(place / ATTEMPTS, '{"event": "begun"}\n{"event": "ended", "how": "done", "took_s": 60.0}\n')
    times, worked = [], []
    for _ in range(1 + REPEATS):
        began, cpu = time.perf_counter(), time.process_time()
        if len(listing(store)) != count:
            raise StageError(f"bench campaign: {INDEX} lists other than {count} trials")
        times.append(time.perf_counter() - began)
        worked.append(time.process_time() - cpu)
    return {
        f"list_{count}_s": statistics.median(times[1:]),
        f"list_{count}_cpu_s": statistics.median(worked[1:]),
        f"list_{count}_anew_s": times[0],
    }


def standard_trials(folder: Path, engine: TrialExecutor) -> tuple[float, list[float]]:
    """Wall time of some standard trials, and how long each took."""
    campaign = check_campaign({"methods": ["wake-aware"], "seeds": TRIALS, "stages": "model"})
    tasks = [one.task for one in planned_trials(campaign)]
    began = time.perf_counter()
    outcomes = make(tasks, folder, engine, retries=0)
    wall_s = time.perf_counter() - began
    for outcome in outcomes:
        if outcome.figures is None:
            raise StageError(f"bench campaign: {outcome.task.name}: {outcome.reason}")
    return wall_s, [outcome.took_s for outcome in outcomes]

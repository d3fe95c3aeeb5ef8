"""Whatever is killed, and whenever: no finished trial is lost, none is made twice, no file is half there."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cheap
import pytest

from wakewise.core.errors import EnvironmentFailure
from wakewise.core.run_lock import is_running
from wakewise.experiments.campaigns import ProcessExecutor, Task, run
from wakewise.experiments.campaigns.attempt_log import read_attempts
from wakewise.experiments.campaigns.index import listing
from wakewise.experiments.campaigns.store import FIGURES, CampaignStore, open_store
from wakewise.experiments.campaigns.trial_lock import holder_of

KILLS = 20


@pytest.mark.slow
def test_twenty_kills_at_random_instants_of_worker_driver_and_all(tmp_path: Path) -> None:
    """A campaign that is killed again and again, from its beginning to its end, ends with every trial made once."""
    folder, tasks = tmp_path / "c", cheap.adding(70, takes_s=0.06)
    chance = random.Random(20)
    store, finished = open_store(folder), {}
    driver = _begin(folder, tasks, 0.06)
    for kill in range(KILLS):
        time.sleep(chance.uniform(0.05, 0.6))
        victim = ("worker", "driver", "all")[kill % 3]
        if victim in ("worker", "all"):
            _kill_workers(store)
        if victim in ("driver", "all"):
            driver.kill()
            driver.wait()
        _check_nothing_changed(store, tasks, finished)
        if driver.poll() is not None:
            driver = _begin(folder, tasks, 0.06)
    assert driver.wait(60) == 0
    _check_nothing_changed(store, tasks, finished)
    assert len(finished) == len(tasks)
    _check_all_once(store, tasks)


def test_no_worker_outlives_its_driver(tmp_path: Path) -> None:
    """A driver that is killed takes its workers with it, and the next one takes their claims over at once."""
    folder, tasks = tmp_path / "c", cheap.adding(2, takes_s=300.0)
    driver = _begin(folder, tasks, 300.0)
    store = open_store(folder)
    end = time.monotonic() + 120.0  # a busy computer's; else a second
    while not _all_begun(store, tasks, 1):
        assert time.monotonic() < end
        time.sleep(0.02)
    holders = [holder for task in tasks if (holder := holder_of(store.place(task.key))) is not None]
    assert len(holders) == 2
    driver.kill()
    driver.wait()
    end = time.monotonic() + 60.0
    while any(is_running(holder.pid, holder.start) for holder in holders):
        assert time.monotonic() < end
        time.sleep(0.02)
    outcomes = run(tasks, folder, ProcessExecutor(2), stop=lambda: _all_begun(store, tasks, 2))
    assert [outcome.attempts for outcome in outcomes] == [2, 2]


def test_a_kill_between_writing_and_naming_leaves_no_figures(tmp_path: Path) -> None:
    """Figures that were on the disk under a temporary name are no figures; the trial is made again and tidied up."""
    task = cheap.one("die_before_the_name")
    (outcome,) = run([task], tmp_path / "c", ProcessExecutor(1), retries=0)
    place = open_store(tmp_path / "c").place(task.key)
    assert outcome.figures is None
    assert not (place / FIGURES).exists()
    assert [left.name.startswith(".figures") for left in place.glob(".*")] == [True]
    (outcome,) = run([task], tmp_path / "c", ProcessExecutor(1), retries=1)
    assert (outcome.figures, outcome.attempts) == ({"tries": 2.0}, 2)
    assert not list(place.glob(".*"))


@pytest.mark.slow
def test_two_drivers_on_one_folder_share_the_work(tmp_path: Path) -> None:
    """Each takes what the other is not at; no trial is made twice."""
    folder, tasks = tmp_path / "c", cheap.adding(40, takes_s=0.05)
    drivers = [_begin(folder, tasks, 0.05) for _ in range(2)]
    assert [driver.wait(60) for driver in drivers] == [0, 0]
    _check_all_once(open_store(folder), tasks)
    for task in tasks:
        assert (open_store(folder).place(task.key) / "work" / "made.txt").read_text() == "made\n"


def test_clocks_need_not_be_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of the future and of long ago change nothing, nor does a clock that is set back an hour at every look."""
    folder, tasks = tmp_path / "c", cheap.adding(3)
    run(tasks, folder, ProcessExecutor(1))
    store = open_store(folder)
    listing(store)
    for times, task in zip(((0, 0), (2**33, 2**33), (1e9, 1e9)), tasks, strict=True):
        os.utime(store.place(task.key) / FIGURES, times)
    os.utime(folder / "index.parquet", (0, 0))
    hour_s = iter(range(10**9, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: float(next(hour_s)))
    monkeypatch.setattr(time, "time_ns", lambda: 10**9 * next(hour_s))
    outcomes = run([*tasks, *cheap.adding(5)[3:]], folder, ProcessExecutor(1), timeout_s=60.0, retries=0)
    assert [outcome.known for outcome in outcomes] == [True, True, True, False, False]
    monkeypatch.undo()
    tasks += cheap.adding(5)[3:]
    assert {key: listed.figures for key, listed in listing(store).items()} == {
        task.key: {"twice": 2.0 * seed} for seed, task in enumerate(tasks)
    }


def test_a_disk_that_fills_up_loses_nothing(small_disk: Path) -> None:
    """A run on a full disk, and one that begins on it, end in a line; with room every trial is made once."""
    folder, tasks = small_disk / "c", cheap.adding(16)
    for _ in range(2):
        with pytest.raises(EnvironmentFailure, match="the disk is full; what was finished is kept"):
            run(tasks, folder, ProcessExecutor(2))
    store, finished = open_store(folder), {}
    _check_nothing_changed(store, tasks, finished)
    assert 0 < len(finished) < len(tasks)
    subprocess.run(["mount", "-o", "remount,size=4m", str(small_disk)], check=True)
    assert all(outcome.figures is not None for outcome in run(tasks, folder, ProcessExecutor(2)))
    _check_nothing_changed(store, tasks, finished)
    _check_all_once(store, tasks)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system in memory with room for some trials."""
    place = tmp_path / "disk"
    place.mkdir()
    told = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=160k", "none", str(place)], capture_output=True, text=True, check=False
    ) if shutil.which("mount") else None  # fmt: skip
    if told is None or told.returncode:
        pytest.skip("file systems can be mounted by root alone")
    yield place
    subprocess.run(["umount", "--lazy", str(place)], check=True)


def _begin(folder: Path, tasks: list[Task], takes_s: float) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, cheap.__file__, str(folder), str(len(tasks)), str(takes_s)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )


def _kill_workers(store: CampaignStore) -> None:
    for place in store.trials.glob("*"):
        holder = holder_of(place)
        if holder is not None and is_running(holder.pid, holder.start):
            os.kill(holder.pid, signal.SIGKILL)


def _all_begun(store: CampaignStore, tasks: list[Task], times: int) -> bool:
    return all(read_attempts(store.place(task.key)).begun == times for task in tasks)


def _check_nothing_changed(store: CampaignStore, tasks: list[Task], finished: dict[str, tuple[int, int]]) -> None:
    """What was finished before is there still, the same file; what is finished now is remembered."""
    for task in tasks:
        path = store.place(task.key) / FIGURES
        if task.key not in finished and not path.exists():
            continue
        facts = path.stat()
        assert finished.setdefault(task.key, (facts.st_ino, facts.st_mtime_ns)) == (facts.st_ino, facts.st_mtime_ns)


def _check_all_once(store: CampaignStore, tasks: list[Task]) -> None:
    """Figures of every trial are right, nothing was begun after a trial was done, and no file is half there."""
    for seed, task in enumerate(tasks):
        place = store.place(task.key)
        assert store.figures(task.key) == {"twice": 2.0 * seed}
        lines = [json.loads(line) for line in (place / "attempts.jsonl").read_text().split("\n") if line]
        done = [line.get("how") for line in lines].count("done")
        assert done <= 1  # none where it was killed between its figures and the note
        assert lines[-1]["event"] == ("ended" if done else lines[-1]["event"])
        for path in (place / FIGURES, place / "trial.json"):
            json.loads(path.read_text())
        assert not list(place.glob(".figures*"))
    assert {path.name for path in store.trials.iterdir() if not path.name.startswith(".")} == {t.key for t in tasks}

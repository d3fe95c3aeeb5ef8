"""On a Dask engines a campaign is the same campaign: the same figures, whatever dies."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cheap
import pytest

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.run_lock import is_running
from wakewise.experiments.campaigns import ProcessExecutor, engines, run
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.trial_lock import holder_of

pytest.importorskip("distributed")
from wakewise.experiments.campaigns.engines import DaskExecutor

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # those of other people's threads and sockets


def test_figures_are_the_same_on_either_engine(tmp_path: Path) -> None:
    """To the last bit: attempts are made by the same processes, with the same threads."""
    tasks = [cheap.one("draw", seed=seed) for seed in range(4)] + [cheap.one("refuse"), cheap.one("die", times=1)]
    ours = run(tasks, tmp_path / "processes", ProcessExecutor(2))
    theirs = run(tasks, tmp_path / "dask", DaskExecutor(workers=2))
    assert [outcome.figures for outcome in ours] == [outcome.figures for outcome in theirs]
    assert ours[0].figures is not None
    assert [outcome.reason for outcome in ours] == [outcome.reason for outcome in theirs]
    assert [outcome.attempts for outcome in theirs] == [1, 1, 1, 1, 1, 2]


def test_a_cluster_that_runs_is_used_and_its_workers_may_die(tmp_path: Path, running: _Cluster) -> None:
    """By address or scheduler file; Dask's workers are killed while they work, and every trial is made once."""
    tasks = cheap.adding(16, takes_s=0.15)
    found: list[object] = []
    driver = threading.Thread(target=lambda: found.append(run(tasks, tmp_path / "c", DaskExecutor(running.address))))
    driver.start()
    store = open_store(tmp_path / "c")
    while driver.is_alive() and not any(store.figures(task.key) for task in tasks):
        time.sleep(0.02)
    running.workers[0].kill()
    driver.join(60)
    assert len(found) == 1
    assert [store.figures(task.key) for task in tasks] == [{"twice": 2.0 * seed} for seed in range(16)]
    known = run(tasks, tmp_path / "c", DaskExecutor(str(running.file)))
    assert all(outcome.known for outcome in known)


def test_a_cluster_that_goes_away_is_told_of_in_a_line(
    tmp_path: Path, running: _Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was finished is kept, what was begun counts as no failure."""
    monkeypatch.setattr(engines, "CONNECT_S", 2.0)  # how long it is looked for before it is given up
    tasks = cheap.adding(30, takes_s=0.2)
    store = open_store(tmp_path / "c")

    def end() -> None:
        end = time.monotonic() + 30.0
        while not any(store.figures(task.key) for task in tasks) and time.monotonic() < end:
            time.sleep(0.02)
        running.scheduler.kill()

    ending = threading.Thread(target=end)
    ending.start()
    with pytest.raises(EnvironmentFailure, match="the connection was lost; what was finished is kept"):
        run(tasks, tmp_path / "c", DaskExecutor(running.address), retries=0)
    ending.join()
    assert all(outcome.figures is not None for outcome in run(tasks, tmp_path / "c", ProcessExecutor(2), retries=0))


def test_stopping_ends_what_is_under_way_on_the_cluster(tmp_path: Path, running: _Cluster) -> None:
    """The engines stays, the trial's process does not."""
    (task,) = cheap.adding(1, takes_s=60.0)
    place = open_store(tmp_path / "c").place(task.key)
    holders = []

    def stop() -> bool:
        holder = holder_of(place)
        if holder is not None:
            holders.append(holder)
        return bool(holders)

    run([task], tmp_path / "c", DaskExecutor(running.address), stop=stop)
    end = time.monotonic() + 10.0
    while is_running(holders[0].pid, holders[0].start):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_an_address_that_does_not_answer_is_told_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With what would answer."""
    monkeypatch.setattr(engines, "CONNECT_S", 0.5)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        for wrong in (address, "nonsense://x", "no-such-scheduler.json"):
            with pytest.raises(InputError, match="no Dask scheduler answers there"):
                run(cheap.adding(1), tmp_path / "c", DaskExecutor(wrong))


def test_settings_of_a_campaign_are_gone_after_it_and_no_others(tmp_path: Path) -> None:
    """In a process that had not loaded Dask before, its own defaults stay, so that a second campaign finds them."""
    code = (
        "import sys, pathlib, dask.config\n"
        "from wakewise.experiments.campaigns import engines\n"
        "engines.CONNECT_S = 0.1\n"
        "for _ in range(2):\n"
        "    try:\n"
        "        engines.DaskExecutor('tcp://127.0.0.1:1').crew(pathlib.Path('x')).__enter__()\n"
        "    except engines.InputError: pass\n"
        "print(dask.config.get('distributed.comm.require-encryption'))\n"
        "print(dask.config.get('distributed.scheduler.allowed-failures'))\n"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.split() == ["None", "3"]


def test_a_cluster_without_workers_is_told_of(
    tmp_path: Path, running: _Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a while, with how one is started."""
    monkeypatch.setattr(engines, "WORKERS_S", 0.5)
    for worker in running.workers:
        worker.terminate()
        worker.wait()
    with pytest.raises(InputError, match=r"has had no worker for 0\.5 s"):
        run(cheap.adding(1), tmp_path / "c", DaskExecutor(running.address))


class _Cluster:
    """A scheduler and two workers, as people start them."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}

        def begin(*words: str) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
                env=environment,
                cwd=folder,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

        where = ("--scheduler-file", str(self.file))
        self.scheduler = begin("scheduler", *where, "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        while not self.file.exists():
            assert self.scheduler.poll() is None
            time.sleep(0.05)
        own = ("--nthreads", "1", "--no-nanny", "--host", "127.0.0.1", "--no-dashboard")
        self.workers = [begin("worker", *where, *own) for _ in range(2)]

    @property
    def address(self) -> str:
        import json

        return str(json.loads(self.file.read_text())["address"])

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture
def running(tmp_path: Path) -> Iterator[_Cluster]:
    folder = tmp_path / "cluster"
    folder.mkdir()
    found = _Cluster(folder)
    yield found
    found.end()

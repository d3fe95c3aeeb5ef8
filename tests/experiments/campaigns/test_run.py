"""A driver makes what is missing, once, and says why something is not there.

Trials here cost nothing (`cheap.py`); what becomes of a campaign whose processes are killed is in test_kills.py.
"""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import cheap
import pytest

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.experiments.campaigns import ProcessExecutor, Task, run
from wakewise.experiments.campaigns.attempt_log import read_attempts
from wakewise.experiments.campaigns.store import open_store


def test_every_trial_has_its_figures_and_what_fails_its_reason(tmp_path: Path) -> None:
    """Outcomes come in the order asked for; an exception of the work is final, a process that died is tried again."""
    tasks = [*cheap.adding(5), cheap.one("refuse"), cheap.one("die", times=2), cheap.one("die", times=9)]
    told: list[tuple[float, float, str]] = []
    outcomes = run(tasks, tmp_path / "c", ProcessExecutor(2), retries=2, progress=lambda *words: told.append(words))
    assert [outcome.task for outcome in outcomes] == tasks
    assert [outcome.figures for outcome in outcomes[:5]] == [{"twice": 2.0 * seed} for seed in range(5)]
    refused, late, lost = outcomes[5:]
    assert (refused.figures, refused.reason, refused.attempts) == (None, "ZeroDivisionError: nothing to share", 1)
    assert (late.figures, late.attempts) == ({"tries": 3.0}, 3)
    assert lost.figures is None
    assert lost.reason == "its process was ended by SIGKILL: about to go"
    assert lost.attempts == 3
    assert told[-1][:2] == (8, 8)
    assert "2 failed" in told[-1][2]


def test_a_second_run_makes_nothing_and_again_tries_what_failed(tmp_path: Path) -> None:
    """Finished trials and failures are known; `again` begins failures anew and leaves the finished alone."""
    tasks = [*cheap.adding(3), cheap.one("die", times=2)]
    run(tasks, tmp_path / "c", ProcessExecutor(1), retries=0)
    second = run(tasks, tmp_path / "c", ProcessExecutor(1), retries=0)
    assert all(outcome.known for outcome in second)
    assert second[-1].figures is None
    run(tasks, tmp_path / "c", ProcessExecutor(1), retries=0, again=True)
    third = run(tasks, tmp_path / "c", ProcessExecutor(1), retries=0, again=True)
    assert third[-1].figures == {"tries": 3.0}
    assert [outcome.attempts for outcome in third] == [1, 1, 1, 3]


@pytest.mark.slow
def test_more_retries_go_on_where_fewer_gave_up(tmp_path: Path) -> None:
    """Attempts are counted in the folder, over runs."""
    task = cheap.one("die", times=2)
    assert run([task], tmp_path / "c", ProcessExecutor(1), retries=1)[0].figures is None
    assert run([task], tmp_path / "c", ProcessExecutor(1), retries=2)[0].attempts == 3


@pytest.mark.slow
def test_a_trial_that_never_ends_is_ended(tmp_path: Path) -> None:
    """Even one that never gives the interpreter's lock back; the others are not held up by it."""
    tasks = [cheap.one("hang"), *cheap.adding(1)]
    store = open_store(tmp_path / "c")

    def other_is_made() -> bool:
        return store.figures(tasks[1].key) is not None

    hung, made = run(tasks, tmp_path / "c", ProcessExecutor(2), stop=other_is_made)
    assert (hung.figures, made.figures) == (None, {"twice": 0.0})
    (hung,) = run(tasks[:1], tmp_path / "c", ProcessExecutor(1), timeout_s=0.5, retries=0)
    assert hung.reason == "took longer than 0.5 s"


def test_a_trial_that_takes_too_much_memory_is_ended(tmp_path: Path) -> None:
    """Memory is that of the trial's processes, and the reason says how much."""
    (swollen,) = run(
        [cheap.one("swell")], tmp_path / "c", ProcessExecutor(1), memory_MB=300.0, retries=0, timeout_s=30.0
    )
    assert swollen.reason is not None
    assert swollen.reason.startswith("took ")
    assert swollen.reason.endswith("MB of memory, allowed 300")


def test_a_full_disk_is_told_in_a_line_and_nothing_is_lost(tmp_path: Path) -> None:
    """The run stops; with room the same call makes what is missing and nothing else."""
    folder, room = tmp_path / "c", tmp_path / "room"
    tasks = [*cheap.adding(2), cheap.one("no_room", room=str(room))]
    with pytest.raises(EnvironmentFailure, match="the disk is full; what was finished is kept"):
        run(tasks, folder, ProcessExecutor(1))
    store = open_store(folder)
    assert [store.figures(task.key) for task in tasks] == [{"twice": 0.0}, {"twice": 2.0}, None]
    room.touch()
    outcomes = run(tasks, folder, ProcessExecutor(1))
    assert [outcome.known for outcome in outcomes] == [True, True, False]
    assert len(outcomes[-1].figures or {}) == 200
    assert not list(store.place(tasks[-1].key).glob(".*"))


@pytest.mark.slow
def test_a_table_that_does_not_fit_is_a_full_disk_too(tmp_path: Path) -> None:
    """Whoever tells of it: nothing is left under the table's name, and with room the same call makes the trial."""
    folder, room = tmp_path / "c", tmp_path / "room"
    task = cheap.one("too_large", room=str(room))
    for _ in range(4):  # more than there are retries
        with pytest.raises(EnvironmentFailure, match="the disk is full; what was finished is kept"):
            run([task], folder, ProcessExecutor(1))
    assert not list((open_store(folder).place(task.key) / "work").iterdir())
    room.touch()
    (outcome,) = run([task], folder, ProcessExecutor(1))
    assert outcome.figures == {"made": 1.0}


@pytest.mark.slow
def test_failures_of_the_computer_are_never_the_trials_own(tmp_path: Path) -> None:
    """A run tries them again and then leaves them, with their reason; every later run tries them anew."""
    room = tmp_path / "room"
    tasks = [*cheap.adding(1), *(cheap.one("fail", fault=name, room=str(room)) for name in cheap.FAULTS)]
    for runs in (1, 2):
        first, *others = run(tasks, tmp_path / "c", ProcessExecutor(2), retries=1)
        assert first.figures == {"twice": 0.0}
        assert [(one.figures, one.how, one.attempts) for one in others] == [(None, "computer", 2 * runs)] * len(others)
    assert others[0].reason == "out of memory (Unable to allocate 9 GiB)"
    assert [one.reason for one in others[1:]] == [
        "Input/output error", "Read-only file system", "Too many open files", "Stale file handle",
    ]  # fmt: skip
    room.touch()
    assert all(one.figures is not None for one in run(tasks, tmp_path / "c", ProcessExecutor(2), retries=1))


def test_stopping_ends_what_is_under_way_and_it_counts_as_no_failure(tmp_path: Path) -> None:
    """What was stopped is made by the next run, as if it had not been begun."""
    task = cheap.adding(1, takes_s=300.0)[0]
    place = open_store(tmp_path / "c").place(task.key)
    (outcome,) = run([task], tmp_path / "c", ProcessExecutor(1), stop=lambda: read_attempts(place).begun > 0)
    assert outcome.figures is None
    told = read_attempts(place)
    assert (told.begun, told.failed, told.how) == (1, 0, "stopped")
    assert not told.is_failure(0)


@pytest.mark.slow
def test_time_that_is_over_ends_what_is_under_way_and_no_more_than_it_is_told(tmp_path: Path) -> None:
    """Twenty seconds of trials within five: the first are kept, and at most five seconds are told to be left."""
    told: list[str] = []
    tasks = cheap.adding(40, takes_s=0.5)
    until = time.monotonic() + 5.0
    outcomes = run(
        tasks, tmp_path / "c", ProcessExecutor(1), until=until, progress=lambda *words: told.append(words[2])
    )
    made = [outcome.figures is not None for outcome in outcomes]
    assert made == sorted(made, reverse=True) and not made[-1]
    left_s = [float(words.removesuffix(" s left")) for words in told if words.endswith("s left")]
    assert left_s and max(left_s) <= 5.0


@pytest.mark.slow
def test_workers_share_the_cores(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Libraries in a worker are told how many threads they may have: cores over workers, at least one."""
    monkeypatch.setattr("wakewise.experiments.campaigns.engines.cores", lambda: 8)
    (outcome,) = run([cheap.one("threads")], tmp_path / "c", ProcessExecutor(2))
    assert outcome.figures == {"threads": 4.0, "omp": 4.0}


@pytest.mark.slow
def test_two_drivers_in_one_process_do_not_disturb_each_other(tmp_path: Path) -> None:
    """The end of one ends its own workers alone, and no trial is made twice."""
    tasks = cheap.adding(12, takes_s=0.05)
    both: list[list[float | None]] = []

    def drive() -> None:
        found = run(tasks, tmp_path / "c", ProcessExecutor(1))
        both.append([outcome.took_s for outcome in found if outcome.figures is not None])

    drivers = [threading.Thread(target=drive) for _ in range(2)]
    for driver in drivers:
        driver.start()
    for driver in drivers:
        driver.join()
    assert [len(found) for found in both] == [12, 12]
    store = open_store(tmp_path / "c")
    for task in tasks:
        assert (store.place(task.key) / "work" / "made.txt").read_text() == "made\n"


@pytest.mark.slow
def test_what_is_made_says_of_what(tmp_path: Path) -> None:
    """A trial's folder tells its work, settings and versions, so that anyone can make it again."""
    (task,) = cheap.adding(1)
    run([task], tmp_path / "c", ProcessExecutor(1))
    told = json.loads((open_store(tmp_path / "c").place(task.key) / "trial.json").read_text())
    assert told["settings"] == {"seed": 0, "takes_s": 0.0}
    assert told["key"] == task.key
    assert {"python", "numpy", "wakewise"} <= set(told["versions"])


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ({"timeout_s": 0.0}, "timeout: 0 s, must be more than 0"),
        ({"memory_MB": -1.0}, "memory: -1 MB, must be more than 0"),
        ({"retries": -1}, "retries: -1, allowed 0 to 100"),
    ],
)
def test_bounds_that_nothing_can_keep_are_refused(tmp_path: Path, bounds: dict[str, Any], words: str) -> None:
    """In one line, before anything is begun."""
    with pytest.raises(InputError, match=words):
        run(cheap.adding(1), tmp_path / "c", ProcessExecutor(1), **bounds)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("workers", [0, -2, 5000])
def test_a_number_of_workers_that_cannot_be_is_refused(workers: int) -> None:
    """At least one, and no more than a machine could have."""
    with pytest.raises(InputError, match="workers"):
        ProcessExecutor(workers)


def test_no_tasks_are_no_work(tmp_path: Path) -> None:
    """An empty campaign has no outcomes."""
    assert run([], tmp_path / "c", ProcessExecutor(1)) == []


def test_tasks_of_one_key_are_made_once(tmp_path: Path) -> None:
    """And each has the outcome."""
    task, other = (
        cheap.adding(1)[0],
        Task(name="b", work="cheap:add", settings={"takes_s": 0.0, "seed": 0}, sources=("core/files.py",)),
    )
    outcomes = run([task, other], tmp_path / "c", ProcessExecutor(2))
    assert [outcome.figures for outcome in outcomes] == [{"twice": 0.0}] * 2
    assert outcomes[0].attempts == 1

"""One process at a time has a trial; a claim whose holder is gone is taken over, one that lives is let be."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from wakewise.experiments.campaigns import trial_lock
from wakewise.experiments.campaigns.trial_lock import CLAIM, LockHolder, this_process


def _write(folder: Path, holder: LockHolder) -> None:
    (folder / CLAIM).write_text(json.dumps(asdict(holder)))


def test_a_claim_is_had_once_and_given_back(tmp_path: Path) -> None:
    """Who holds it stands in it; what is given back can be had again."""
    assert trial_lock.acquire_lock(tmp_path)
    assert trial_lock.holder_of(tmp_path) == this_process()
    assert trial_lock.owns_lock(tmp_path)
    assert not trial_lock.acquire_lock(tmp_path)
    trial_lock.release_lock(tmp_path)
    assert trial_lock.holder_of(tmp_path) is None
    assert trial_lock.acquire_lock(tmp_path)
    assert not list(tmp_path.glob(".claim*"))


def test_a_claim_of_a_process_that_ended_is_taken_over(tmp_path: Path) -> None:
    """Its number tells."""
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    _write(tmp_path, replace(this_process(), pid=gone.pid, start=1))
    assert trial_lock.acquire_lock(tmp_path)


def test_a_claim_of_a_process_that_nobody_has_waited_for_is_taken_over(tmp_path: Path) -> None:
    """A zombie has its number still, and holds nothing."""
    zombie = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    from wakewise.core.run_lock import start_of

    _write(tmp_path, replace(this_process(), pid=zombie.pid, start=start_of(zombie.pid)))
    assert not trial_lock.acquire_lock(tmp_path)
    zombie.kill()
    while start_of(zombie.pid) != -1:
        pass
    assert trial_lock.acquire_lock(tmp_path)
    zombie.communicate()


@pytest.mark.parametrize("change", [{"start": 1}, {"boot": "another start of the computer"}])
def test_a_number_given_anew_is_not_taken_for_its_holder(tmp_path: Path, change: dict[str, Any]) -> None:
    """A process of the same number that started at another time, or in another run of the computer, is another."""
    _write(tmp_path, replace(this_process(), **change))
    assert trial_lock.holder_of(tmp_path) is not None
    assert trial_lock.acquire_lock(tmp_path)


def test_a_holder_on_another_computer_is_gone_when_its_heart_stops(tmp_path: Path) -> None:
    """Of it nothing but the heartbeat is known: only a beat that was seen not to change makes its claim free."""
    _write(tmp_path, LockHolder("elsewhere", "b", 1, 1))
    assert not trial_lock.acquire_lock(tmp_path)
    beat = trial_lock.heartbeat_of(tmp_path)
    assert beat is not None
    assert not trial_lock.acquire_lock(tmp_path, beat - 1)
    os.utime(tmp_path / CLAIM, (2**33, 2**33))  # it lives, and its clock is centuries off
    assert not trial_lock.acquire_lock(tmp_path, beat)
    assert trial_lock.acquire_lock(tmp_path, trial_lock.heartbeat_of(tmp_path))


def test_a_beat_changes_what_is_compared(tmp_path: Path) -> None:
    """Showing that one is alive changes the claim's stamp."""
    trial_lock.acquire_lock(tmp_path)
    os.utime(tmp_path / CLAIM, (5, 5))
    before = trial_lock.heartbeat_of(tmp_path)
    trial_lock.renew_lock(tmp_path)
    assert trial_lock.heartbeat_of(tmp_path) != before


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"host": 1}', "\x00\x01"])
def test_a_damaged_claim_is_nobodys(tmp_path: Path, text: str) -> None:
    """Claims are written whole, so that one that cannot be read was damaged later."""
    (tmp_path / CLAIM).write_text(text)
    assert trial_lock.holder_of(tmp_path) is None
    assert trial_lock.acquire_lock(tmp_path)


def test_what_holds_others_off_is_gone_after_a_take_over(tmp_path: Path) -> None:
    """One that a kill left behind, too."""
    trial = tmp_path / "trial"
    trial.mkdir()
    (tmp_path / ".taking-over").touch()
    (trial / trial_lock.CLAIM).write_text("damaged")
    assert trial_lock.acquire_lock(trial)
    assert [path.name for path in tmp_path.iterdir()] == ["trial"]


def test_of_many_who_take_over_one_succeeds(tmp_path: Path) -> None:
    """However many see the same stale claim at once."""
    code = (
        "import sys, pathlib; from wakewise.experiments.campaigns import trial_lock\n"
        "print('ready', flush=True); input()\n"
        "print(trial_lock.acquire_lock(pathlib.Path(sys.argv[1])), flush=True); input()"
    )
    for _ in range(3):
        _write(tmp_path, replace(this_process(), start=1))
        rivals = [
            subprocess.Popen(
                [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            for _ in range(4)
        ]
        assert [_line(rival) for rival in rivals] == ["ready"] * 4
        go = [threading.Thread(target=_send, args=(rival,)) for rival in rivals]
        for one in go:
            one.start()
        for one in go:
            one.join()
        assert sorted(_line(rival) for rival in rivals) == ["False"] * 3 + ["True"]
        for rival in rivals:
            rival.kill()
            rival.communicate()


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def _send(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()

"""An interrupt of COLMAP: the call has come back before anything else goes on, however often it is pressed."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from wakewise.core.errors import StageError
from wakewise.vision.reconstruction.sfm import colmap


@pytest.fixture(autouse=True)
def interruptible():
    """Ctrl-C as in a terminal: a shell that runs the tests in the background has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press(after_s: float) -> threading.Timer:
    """A Ctrl-C after a while."""
    timer = threading.Timer(after_s, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_an_interrupted_call_has_ended_before_the_interrupt_goes_on():
    """At any of eight moments, those within a wait with a time limit among them, the work sees its token and ends."""
    rng = random.Random(1)
    for _ in range(8):
        running = threading.Event()

        def work(cancellation_token, running=running):
            running.set()
            while not cancellation_token.is_cancelled:
                time.sleep(0.005)
            time.sleep(0.05)  # it tidies up
            running.clear()

        press(rng.uniform(0.05, 0.5))
        with pytest.raises(KeyboardInterrupt):
            colmap.call(work, "matching")
        assert not running.is_set()


def test_a_second_interrupt_does_not_leave_the_work_running():
    """Pressed again while the work ends, it is still waited for."""
    ended = []

    def work(cancellation_token):
        while not cancellation_token.is_cancelled:
            time.sleep(0.005)
        time.sleep(0.6)
        ended.append(True)

    press(0.1)
    press(0.35)
    with pytest.raises(KeyboardInterrupt):
        colmap.call(work, "matching")
    assert ended == [True]


def test_what_cannot_be_cancelled_runs_apart_and_says_why_it_fails(tmp_path):
    """A function of pycolmap in a process of its own: its fault is one line; an interrupt ends it at once."""
    with pytest.raises(StageError, match=r"mesh: COLMAP stopped: .*nothing"):
        colmap.call_in_process("mesh", "poisson_meshing", tmp_path / "nothing.ply", tmp_path / "out.ply")
    press(0.3)
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        while time.perf_counter() < start + 20.0:
            colmap.call_in_process("mesh", "set_random_seed", 1)


@pytest.mark.slow
def test_ctrl_c_at_random_moments_of_the_command_is_exit_130_and_one_line(relief_photos, tmp_path):
    """In starting, features, matching or mapping: exit code 130, one line, and no file that is half-done."""
    folder, _ = relief_photos
    begun, out = tmp_path / "begun", tmp_path / "model"
    # Python itself ends otherwise before the command has begun, however long its imports take on a busy machine.
    code = f"import pathlib; from wakewise.ui.cli.main import main; pathlib.Path({str(begun)!r}).touch(); main()"
    rng = random.Random(2)
    for _ in range(3):
        words = [sys.executable, "-c", code, "reconstruct", str(folder), "--out", str(out), "--json"]
        begun.unlink(missing_ok=True)
        child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not begun.exists() and child.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.2, 2.5))
        child.send_signal(signal.SIGINT)
        said, told = child.communicate(timeout=60)
        if child.returncode == 0:  # a machine so quick that it had ended
            continue
        assert (child.returncode, said) == (130, "")
        assert told.splitlines() == [
            "wakewise: stopped; what was finished is kept, run the same command again to go on"
        ]
        assert [path for path in Path(out).glob(".*") if out.exists()] == []

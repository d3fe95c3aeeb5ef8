"""Child processes: the parent's modules, framed messages both ways, and an end that leaves nothing open."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from wakewise.core.subprocesses import end_process, read_message, start_python, wait_for, write_message

ECHO = """
import sys
from wakewise.core.subprocesses import ignore_interrupt, private_stdout, read_message, write_message
ignore_interrupt()
answers = private_stdout()
print("a library talks")
while (message := read_message(sys.stdin.buffer)) is not None:
    write_message(answers, message[::-1])
"""


def test_messages_go_there_and_back_whatever_else_is_printed():
    """Empty and long messages come back whole, after Ctrl-C too; the child ends when its pipe is closed."""
    child = start_python("-c", ECHO)
    write_message(child.stdin, b"abc")
    assert read_message(child.stdout) == b"cba"
    child.send_signal(signal.SIGINT)
    for message in (b"", bytes(range(256)) * 1000):
        write_message(child.stdin, message)
        assert read_message(child.stdout) == message[::-1]
    child.stdin.close()
    assert read_message(child.stdout) is None
    assert wait_for(child) == 0


def test_a_child_finds_what_its_parent_finds(tmp_path, monkeypatch):
    """A module of the parent's path, a variable of the call, and the folder to work in."""
    (tmp_path / "only_here.py").write_text("WORD = 'found'\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    code = "import only_here, os; print(only_here.WORD, os.environ['GIVEN'], os.getcwd())"
    child = start_python("-c", code, stdin=None, variables={"GIVEN": "too"}, text=True, cwd=tmp_path)
    said, _ = child.communicate(timeout=60)
    assert said.split() == ["found", "too", str(tmp_path.resolve())]


def test_half_a_message_is_none():
    """Where the pipe ends within the length or the content there is no message."""
    whole = io.BytesIO()
    write_message(whole, b"0123456789")
    for cut in (0, 5, 12):
        assert read_message(io.BytesIO(whole.getvalue()[:cut])) is None
    assert read_message(io.BytesIO(whole.getvalue())) == b"0123456789"


def test_ending_closes_the_pipes_and_tells_the_status():
    """Killed: the signal's number below zero, and every pipe closed; a second time it is the same."""
    child = start_python("-c", "import time; time.sleep(60)", stderr=subprocess.PIPE)
    assert end_process(child) == -signal.SIGKILL
    assert child.stdin.closed
    assert child.stdout.closed
    assert child.stderr.closed
    assert end_process(child) == -signal.SIGKILL


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="the system has no process groups")
def test_a_group_is_ended_with_what_its_process_started():
    """The grandchild of a child of a session of its own ends with it."""
    code = (
        "import subprocess, sys, time\n"
        "other = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        "print(other.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    child = start_python("-c", code, text=True, new_session=True)
    grandchild = int(child.stdout.readline())
    end_process(child, group=True)
    until = time.monotonic() + 10.0
    while _runs(grandchild) and time.monotonic() < until:
        time.sleep(0.02)
    assert not _runs(grandchild)


def test_what_cannot_be_started_is_an_os_error(monkeypatch):
    """No interpreter, no process."""
    monkeypatch.setattr(sys, "executable", "/does/not/exist")
    with pytest.raises(OSError, match="exist"):
        start_python("-c", "pass")


def _runs(pid: int) -> bool:
    try:
        state = Path("/proc", str(pid), "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"

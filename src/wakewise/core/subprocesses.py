"""Python child processes: starting them, framed messages through their pipes, ending them.

A child finds the modules that its parent finds: `PYTHONPATH` is the parent's `sys.path`. A message is its length as
eight bytes, least significant first, and that many bytes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any


def start_python(
    *arguments: str,
    stdin: int | None = subprocess.PIPE,
    stdout: int | IO[bytes] | None = subprocess.PIPE,
    stderr: int | IO[bytes] | None = subprocess.DEVNULL,
    variables: Mapping[str, str] | None = None,
    text: bool = False,
    cwd: str | Path | None = None,
    new_session: bool = False,
) -> subprocess.Popen[Any]:
    """Start `python *arguments`; pipes carry bytes, or str where `text` is set.

    `variables` are added to the environment. With `new_session` a terminal's Ctrl-C reaches the parent only.

    Raises
    ------
    OSError
        If no process can be started.
    """
    path = os.pathsep.join(place for place in sys.path if place)
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        env=os.environ | {"PYTHONPATH": path} | dict(variables or {}),
        text=text,
        cwd=cwd,
        start_new_session=new_session,
    )


def end_process(process: subprocess.Popen[Any], *, group: bool = False) -> int:
    """Kill a process, wait for its end and close its pipes; the exit status.

    `group`: also kill all processes of its session; it must have been started with `new_session`.
    """
    with suppress(OSError):
        if group and hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()
    return wait_for(process)


def wait_for(process: subprocess.Popen[Any]) -> int:
    """Close a process's pipes and wait for its end; the exit status."""
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
    return process.wait()


def write_message(pipe: IO[bytes], message: bytes) -> None:
    """Write one message.

    Raises
    ------
    OSError
        If nobody reads the pipe any more.
    """
    pipe.write(len(message).to_bytes(8, "little") + message)
    pipe.flush()


def read_message(pipe: IO[bytes]) -> bytes | None:
    """The next message; None at the end of the pipe, or where it ends within a message."""
    head = pipe.read(8)
    if len(head) < 8:
        return None
    size = int.from_bytes(head, "little")
    message = pipe.read(size)
    return message if len(message) == size else None


def ignore_interrupt() -> None:
    """Ignore SIGINT in a child that its parent ends."""
    with suppress(ValueError):  # only the main thread may
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def private_stdout() -> IO[bytes]:
    """Standard output for messages alone; what libraries print goes to standard error from now on."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return answers

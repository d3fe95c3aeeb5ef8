"""Photographs are rendered while the flight goes on, by a process of their own that is fed the exposures as they come.

The other process begins with the scenario and gets each exposure in the form in which the flight's record keeps it, so
that a photograph has the same bytes whether it was made beside the flight or after it. The flight never waits: what the
other process has no room for, or does not come to, is left to the stage after the flight.
"""

from __future__ import annotations

import pickle
import queue
import subprocess
import sys
import tempfile
import threading
import warnings
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO

from wakewise.core.run_lock import remove_stale
from wakewise.core.subprocesses import ignore_interrupt, read_message, start_python, write_message
from wakewise.operation.flight_log import ExposureRecord, packed, unpacked
from wakewise.operation.parts import Parts

MOST_WAITING = 16
"""Exposures that wait for the other process at most, each with its grid of silt."""
_NEEDED = ("target", "route")


class BackgroundRenderer:
    """Takes exposures during a flight and has them rendered into a trial's folder; use it in a `with` statement.

    `parts`: where target or route were given in Python, nothing is done: the other process could not make them.
    `folder`: of the trial.
    """

    def __init__(self, parts: Parts, folder: Path) -> None:
        self._parts, self._folder = parts, folder
        self._able = not any(name in parts.given for name in _NEEDED)
        self._waiting: queue.Queue[bytes | None] = queue.Queue(MOST_WAITING)
        self._process: subprocess.Popen[bytes] | None = None
        self._feeder: threading.Thread | None = None
        self._said: IO[bytes] | None = None

    def __enter__(self) -> BackgroundRenderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        process = self._process
        if process is None:
            return
        process.kill()
        process.wait()
        self._waiting.put(None)  # what waits before it is dropped, now that nobody reads
        if self._feeder is not None:
            self._feeder.join()
        remove_stale(self._folder)
        self._close()

    def ready(self) -> None:
        """Have the other process load its libraries and make its scene, which takes seconds; never waits."""
        if not self._able or self._process is not None:
            return
        try:
            self._begin()
        except OSError as fault:
            self._able = False
            _warn(str(fault))
            self._close()

    def take(self, number: int, exposure: ExposureRecord) -> None:
        """Have an exposure rendered if there is room for it; never waits."""
        if self._waiting.full():
            return
        self.ready()
        if self._able:
            with suppress(queue.Full):
                self._waiting.put_nowait(packed(number, exposure))

    def finish(self) -> None:
        """Wait until what was taken is rendered; says in a warning if the other process failed."""
        if self._process is None or self._feeder is None or self._said is None:
            return
        self._waiting.put(None)
        self._feeder.join()
        if self._process.wait() != 0:
            self._said.seek(0)
            words = self._said.read().decode(errors="replace").strip().splitlines()
            reason = words[-1] if words else f"exit status {self._process.returncode}"
            _warn(reason)
        self._close()

    def _begin(self) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115  (kept until the other process has ended)
        self._process = start_python(
            "-m", "wakewise.operation.background_renderer", stdout=subprocess.DEVNULL, stderr=self._said
        )
        self._waiting.put(pickle.dumps((self._parts.scenario, self._folder.resolve())))
        self._feeder = threading.Thread(target=self._feed, args=(self._process,), name="darkroom", daemon=True)
        self._feeder.start()

    def _feed(self, process: subprocess.Popen[bytes]) -> None:
        """Hand on what waits, up to None; where the other process has ended, take it all the same and drop it."""
        pipe = process.stdin
        while (message := self._waiting.get()) is not None:
            if process.poll() is None and pipe is not None:
                with suppress(OSError):
                    write_message(pipe, message)
        if pipe is not None:
            with suppress(OSError):
                pipe.close()

    def _close(self) -> None:
        if self._said is not None:
            self._said.close()
        self._process = self._feeder = self._said = None


def _warn(reason: str) -> None:
    words = f"photographs: could not be rendered beside the flight ({reason}), so they are after it"
    warnings.warn(words, RuntimeWarning, stacklevel=3)


def render_from_pipe(pipe: IO[bytes]) -> None:
    """Render the exposures that come through a pipe until it ends: the other process."""
    from wakewise.operation.photography import take_photograph

    first = read_message(pipe)
    if first is None:
        return
    scenario, folder = pickle.loads(first)
    parts = scenario.parts()
    _ = parts.scene, parts.compliance, parts.route  # made while the vehicle is still on its way to the first view
    while (message := read_message(pipe)) is not None:
        take_photograph(parts, folder, *unpacked(message))


if __name__ == "__main__":
    ignore_interrupt()
    render_from_pipe(sys.stdin.buffer)

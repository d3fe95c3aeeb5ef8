"""The log file of `wakewise reconstruct`: what was asked, when each stage began, what was said, how it ended."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from wakewise import __version__

if TYPE_CHECKING:
    from wakewise.core.interfaces import Progress

NAME = "reconstruct.log"


class RunLog:
    """Lines with the time, appended to `out/reconstruct.log`; nothing is written before the folder is there."""

    def __init__(self, out: Path) -> None:
        self._path = out / NAME
        self._waiting = [f"wakewise {__version__}: {' '.join(sys.argv[1:])}"]
        self._stage = ""

    def say(self, line: str) -> None:
        """Add a line."""
        self._waiting.append(line)
        if self._path.parent.is_dir():
            now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%SZ")
            with self._path.open("a", encoding="utf-8") as file:
                file.writelines(f"{now}  {' '.join(each.split())}\n" for each in self._waiting)
            self._waiting = []

    def watching(self, progress: Progress) -> Progress:
        """The same progress, with a line whenever the work changes."""

        def tell(done: float, total: float, note: str = "") -> None:
            if note != self._stage:
                self._stage = note
                self.say(f"{note} ...")
            progress(done, total, note)

        return tell


@contextmanager
def logged(out: Path) -> Iterator[RunLog]:
    """A log that also tells of a failure, which goes on its way."""
    log = RunLog(out)
    try:
        yield log
    except BaseException as fault:
        log.say("stopped by the user" if isinstance(fault, KeyboardInterrupt) else f"failed: {fault}")
        raise

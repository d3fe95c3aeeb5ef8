"""Journal of a session: one line of JSON for each event, safe against a killed process and a power failure.

Each line is one write at the end of the file. `sync` flushes to disk; time-critical threads do not call it. The reader
omits and reports a last line that is incomplete.
"""

from __future__ import annotations

import json
import math
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from wakewise.core.errors import EnvironmentFailure, InputError

JOURNAL_FILE = "journal.jsonl"


class SessionLog:
    """Appends to a file that nobody else writes; any thread may.

    Parameters
    ----------
    path : Path
        Made with its folder; one that is there already goes on.
    clock : callable
        Seconds that never go back, the `t_s` of each line.
    wall : callable
        Seconds since 1970, the `utc_s` of each line: to be held against other logs, never reckoned with.

    Raises
    ------
    EnvironmentFailure
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.path, self._clock, self._wall = path, clock, wall
        self._lock = threading.Lock()
        self._is_new, self._made_folder = not path.exists(), not path.parent.exists()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
            if path.stat().st_size and path.read_bytes()[-1:] != b"\n":
                os.write(self._file, b"\n")  # so that a line cut short stays alone
        except OSError as fault:
            raise EnvironmentFailure(f"{path}: cannot be written ({fault.strerror})") from None
        self.lost = 0
        """Lines that the disk did not take, as when it is full: a session is not ended by that."""

    def write(self, event: str, **told: Any) -> None:
        """One line: when, what, and what else there is to tell of it; a number that is none becomes null."""
        line = {"t_s": round(self._clock(), 6), "utc_s": round(self._wall(), 3), "event": event, **_plain(told)}
        text = (json.dumps(line, allow_nan=False) + "\n").encode()
        with self._lock:
            if self._file is None:
                return
            try:
                self.lost += os.write(self._file, text) != len(text)
            except OSError:
                self.lost += 1

    def sync(self) -> None:
        """Have the disk keep what was written; may take long."""
        file = self._file
        if file is not None:
            try:
                os.fsync(file)
            except OSError:
                self.lost += 1

    def close(self) -> None:
        """Keep all of it and end."""
        self.sync()
        with self._lock:
            if self._file is not None:
                os.close(self._file)
                self._file = None

    def discard(self) -> None:
        """End, and remove a file that was begun here, with its folder if that was, too, and is empty."""
        self.close()
        if self._is_new:
            with suppress(OSError):
                self.path.unlink()
                if self._made_folder:
                    self.path.parent.rmdir()


def read_journal(path: Path) -> tuple[list[dict[str, Any]], int]:
    """Lines of a journal in their order, and how many could not be read, as the one that a power cut ended.

    Raises
    ------
    InputError
        If there is no such file.
    """
    try:
        text = path.read_bytes()
    except OSError:
        raise InputError(f"{path}: cannot be read, the journal of a session is needed") from None
    lines: list[dict[str, Any]] = []
    count_bad = 0
    for raw in text.split(b"\n"):
        if not raw.strip():
            continue
        try:
            line = json.loads(raw)
        except ValueError:
            line = None
        if isinstance(line, dict) and isinstance(line.get("event"), str):
            lines.append(line)
        else:
            count_bad += 1
    return lines, count_bad


def _plain(value: Any) -> Any:
    """The value as JSON has it."""
    if isinstance(value, dict):
        return {str(name): _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, bool | int | str | None):
        return value
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    return str(value)

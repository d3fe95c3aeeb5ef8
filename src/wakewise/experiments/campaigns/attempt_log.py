"""How often a trial was begun, and how each attempt ended: a file of lines that is only ever added to.

A process that is killed leaves at worst half a line, which is not read. An attempt without an end is one whose process
was taken down with the run; it is no failure of the trial.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

ATTEMPTS = "attempts.jsonl"

How = Literal["done", "error", "computer", "died", "late", "memory", "stopped"]
"""How an attempt ended: figures; an exception of the work; a failure of the computer, such as a full disk; the process
died; it took too long; it took more memory than it was allowed; the user stopped the run."""
FINAL: tuple[How, ...] = ("error",)
"""Ends that would be the same the next time: the same configuration and seed give the same exception."""
RETRIED: tuple[How, ...] = ("died", "late", "memory")
"""Ends after which a trial is tried again, a few times. A failure of the computer is none of the trial's: every run
tries it again."""


@dataclass(frozen=True)
class Attempts:
    """What a trial's file of attempts says."""

    begun: int = 0
    failed: int = 0
    """Attempts that ended in one of `RETRIED`, since a retry of the trial was last asked for."""
    how: How | None = None
    """How the last one ended; None if none has, or if it is tried anew."""
    reason: str | None = None
    took_s: float = 0.0

    def is_failure(self, retries: int) -> bool:
        """Whether there is nothing more to try."""
        return self.how in FINAL or (self.how in RETRIED and self.failed > retries)


def begin(folder: Path, **facts: Any) -> None:
    """Note that an attempt begins."""
    _add(folder, {"event": "begun"} | facts)


def end(folder: Path, how: How, reason: str | None, took_s: float) -> None:
    """Note how an attempt ended."""
    _add(folder, {"event": "ended", "how": how, "reason": reason, "took_s": round(took_s, 3)})


def clear_failures(folder: Path) -> None:
    """Forget earlier failures: the trial is tried again."""
    _add(folder, {"event": "anew"})


def read_attempts(folder: Path) -> Attempts:
    """What was noted of a trial; nothing for one that was never begun."""
    try:
        text = (folder / ATTEMPTS).read_bytes()
    except OSError:
        return Attempts()
    return gather_attempts(text)


def gather_attempts(text: bytes) -> Attempts:
    """What lines of a file of attempts say; lines that are none are passed over."""
    begun = failed = 0
    how: How | None = None
    reason: str | None = None
    took_s = 0.0
    for line in text.split(b"\n"):
        try:
            told = json.loads(line)
        except ValueError:
            continue
        event = told.get("event") if isinstance(told, dict) else None
        if event == "begun":
            begun += 1
        elif event == "anew":
            failed, how, reason = 0, None, None
        elif event == "ended" and parse_outcome(told.get("how")) is not None:
            how = parse_outcome(told["how"])
            reason = str(told["reason"]) if told.get("reason") else None
            took = told.get("took_s")
            took_s = float(took) if isinstance(took, (int, float)) else 0.0
            failed += how in RETRIED
    return Attempts(begun, failed, how, reason, took_s)


def parse_outcome(word: object) -> How | None:
    """The end that a word of a file names; None if it names none."""
    return next((how for how in get_args(How) if how == word), None)


def _add(folder: Path, told: dict[str, Any]) -> None:
    # The first line end closes a line that a kill has left open.
    line = f"\n{json.dumps(told)}\n".encode()
    handle = os.open(folder / ATTEMPTS, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(handle, line)
        os.fsync(handle)
    finally:
        os.close(handle)

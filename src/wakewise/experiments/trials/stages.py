"""Stages of a trial: who watches them, what they cost, and what is already done.

A report beside a result: should it fail, the result is there all the same, and what failed is reported in one line.
"""

from __future__ import annotations

import json
import os
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from wakewise.core.errors import WakewiseError
from wakewise.core.files import write_json
from wakewise.core.interfaces import no_progress

_NOT_MEASURED = ("the stages before it are kept", "; the disk of ", "can no longer be read")


class ProgressListener(Protocol):
    """Shows a person how far a stage is."""

    def stage(self, name: str) -> AbstractContextManager[Callable[..., None]]:
        """Begin a stage; inside the block, call what it gives as `(done, total, note)`."""
        ...

    def skipped(self, name: str) -> None:
        """Say that a stage was already done."""
        ...


class SilentProgress:
    """A `ProgressListener` that shows nothing."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[..., None]]:
        """Show nothing."""
        del name
        yield no_progress

    def skipped(self, name: str) -> None:
        """Say nothing."""


@dataclass(frozen=True)
class StageCosts:
    """What each stage cost, kept in stages.json so that a trial done in several sittings adds up."""

    path: Path

    def read(self) -> dict[str, dict[str, float]]:
        """Wall and CPU seconds by stage; CPU over all threads of the process and of those that it began."""
        if not self.path.exists():
            return {}
        costs: dict[str, dict[str, float]] = json.loads(self.path.read_text(encoding="utf-8"))
        return costs

    @contextmanager
    def account(self, name: str) -> Iterator[None]:
        """Add what the block costs to this stage, also when it is cut short."""
        wall, cpu = time.perf_counter(), cpu_s()
        try:
            yield
        except BaseException:
            with suppress(OSError):  # a full disk has been reported already
                self._add(name, wall, cpu)
            raise
        self._add(name, wall, cpu)

    def _add(self, name: str, wall: float, cpu: float) -> None:
        costs = self.read()
        before = costs.get(name, {"wall_s": 0.0, "cpu_s": 0.0})
        costs[name] = {
            "wall_s": before["wall_s"] + time.perf_counter() - wall,
            "cpu_s": before["cpu_s"] + cpu_s() - cpu,
        }
        write_json(self.path, costs)

    def total(self, kind: str) -> float:
        """Sum of "wall_s" or "cpu_s" over the stages."""
        return sum(cost[kind] for cost in self.read().values())


def cpu_s() -> float:
    """CPU time of this process and of those that it began and that have ended, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def of_the_computer(failure: str | None) -> bool:
    """Whether a failure kept by versions up to 0.1.0 concerns the disk or a file, not the photographs."""
    return failure is not None and any(words in failure for words in _NOT_MEASURED)


@dataclass
class ReportAttempt:
    """Whether a report came about; `fault` says in one line what failed, None where nothing did."""

    fault: str | None = None


@contextmanager
def report_attempt() -> Iterator[ReportAttempt]:
    """Run the block that writes a report and keep what fails in it; Ctrl-C goes through, whatever was made of it."""
    attempt = ReportAttempt()
    try:
        yield attempt
    except Exception as fault:
        cause: BaseException | None = fault
        while cause is not None:
            if isinstance(cause, KeyboardInterrupt):
                raise
            cause = cause.__cause__
        attempt.fault = _in_a_line(fault)


def _in_a_line(fault: Exception) -> str:
    said = " ".join(str(fault).split())
    if isinstance(fault, (WakewiseError, OSError)):
        return said
    # A fault of the program: its place helps to mend it.
    last = traceback.extract_tb(fault.__traceback__)[-1]
    return f"{type(fault).__name__}: {said} ({Path(last.filename).name}:{last.lineno})"

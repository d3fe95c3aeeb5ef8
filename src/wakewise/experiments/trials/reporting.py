"""A report beside a result: should it fail, the result is there all the same, and what failed is told in one line."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from wakewise.core.errors import WakewiseError


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
    # A fault of the program: whoever mends it wants to know where.
    last = traceback.extract_tb(fault.__traceback__)[-1]
    return f"{type(fault).__name__}: {said} ({Path(last.filename).name}:{last.lineno})"

"""How benches measure: thread CPU, median and p99 after warm-up."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.interfaces import Progress, no_progress


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """What every bench is given.

    Parameters
    ----------
    data : Path or None
        Folder of reference data that the package does not contain; None where there is none.
    progress : Progress
    """

    data: Path | None = None
    progress: Progress = no_progress


def timed_us(work: Callable[[], Any], repeats: int) -> dict[str, float]:
    """Median and p99 of a call in microseconds of thread CPU, after a warm-up."""
    for _ in range(max(3, repeats // 20)):
        work()
    spans = np.empty(repeats)
    for k in range(repeats):
        began = time.thread_time_ns()
        work()
        spans[k] = (time.thread_time_ns() - began) / 1e3
    return {"median_us": float(np.median(spans)), "p99_us": float(np.percentile(spans, 99))}

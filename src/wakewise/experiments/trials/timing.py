"""How benches measure: thread CPU, median and p99 after warm-up."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress, no_progress


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """What every bench is given.

    `data` holds reference data that the package does not contain. Of benches that fly: `seeds`, flights per method,
    seeds 1 to this; `methods`, `scenarios`, `worlds` and `w_tracks` (on the paper's scale), None for all; `mechanisms`,
    switched one by one, None for none; `models`, seeds from 1 for which a scan and its model are made; `judge`, seeds
    that are flown in the lattice as well; `bound`, seeds whose optimum is worked out; `fresh` flies anew what is known;
    `workers` side by side; `store` keeps flights, the user's cache folder if None. `only`: parts of a bench by name,
    None for all. `photographs`: numbers of photographs of which models are made, each at least 3.
    """

    data: Path | None = None
    progress: Progress = no_progress
    seeds: int = 10
    methods: tuple[str, ...] | None = None
    scenarios: tuple[str, ...] | None = None
    mechanisms: tuple[str, ...] | None = None
    worlds: tuple[str, ...] | None = None
    w_tracks: tuple[float, ...] | None = None
    models: int = 1
    judge: int = 0
    bound: int = 0
    fresh: bool = False
    workers: int = 2
    store: Path | None = None
    only: tuple[str, ...] | None = None
    photographs: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        for name, value, most in (("seeds", self.seeds, 1000), ("workers", self.workers, 64)):
            if not 1 <= value <= most:
                raise InputError(f"{name}: {value}, allowed 1 to {most}")
        for name, value in (("models", self.models), ("judge", self.judge), ("bound", self.bound)):
            if not 0 <= value <= 1000:
                raise InputError(f"{name}: {value}, allowed 0 to 1000")
        for count in self.photographs or ():
            if not 3 <= count <= 5000:
                raise InputError(f"photographs: {count}, allowed 3 to 5000")


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

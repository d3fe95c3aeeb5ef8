"""The lattice-Boltzmann solver: cell updates per core, and the distance from its readable twin."""

from __future__ import annotations

import time
from typing import Any

import numba
import numpy as np

from wakewise.lattice import load_mean_field
from wakewise.lattice.kernel import OPEN, smagorinsky_factor, step
from wakewise.lattice.twin import twin_step
from wakewise.trials.timing import BenchOptions


def run(options: BenchOptions) -> dict[str, Any]:
    """Million cell updates per second of thread CPU on one core, on a grid far larger than the caches."""
    cells, rounds, steps = (128, 110, 110), 7, 6
    shape = (19, cells[0] + 2, (cells[1] + 2) * (cells[2] + 2))
    rng = np.random.default_rng(0)
    now = (1e-4 * rng.standard_normal(shape)).astype(np.float32)
    later = np.zeros_like(now)
    tau_x, tau_yz = np.full(shape[1], 0.5005, np.float32), np.zeros(shape[2], np.float32)
    faces = np.full(6, OPEN)
    eddies = smagorinsky_factor(0.12)

    def advance(n: int) -> None:
        nonlocal now, later
        for _ in range(n):
            step(now, later, cells[1], cells[2], tau_x, tau_yz, eddies, faces)
            now, later = later, now

    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        advance(2)
        rates = []
        for k in range(rounds):
            options.progress(k, rounds, "cell updates")
            began = time.thread_time()
            advance(steps)
            rates.append(np.prod(cells) * steps / (time.thread_time() - began) / 1e6)
    finally:
        numba.set_num_threads(threads)
    small = (10, 11, 12)
    start = (1e-2 * rng.standard_normal((19, *(n + 2 for n in small)))).astype(np.float32)
    fast = np.zeros((19, small[0] + 2, (small[1] + 2) * (small[2] + 2)), np.float32)
    x, yz = np.linspace(0.52, 0.6, small[0] + 2), np.linspace(0, 0.1, (small[1] + 2) * (small[2] + 2))
    step(
        start.reshape(fast.shape), fast, small[1], small[2], x.astype(np.float32), yz.astype(np.float32), eddies, faces
    )
    slow = twin_step(start.astype(float), x, yz.reshape(small[1] + 2, small[2] + 2), eddies)
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    gap = fast.reshape(start.shape)[inside] - slow
    published = {name: load_mean_field(name) for name in ("free", "swirl")}
    convergence = {name: table.figures.get("grid_convergence_pct") for name, table in published.items()}
    missing = [name for name, value in convergence.items() if value is None]
    return {
        "mlups_per_core": float(np.median(rates)),
        "mlups_per_core_best": float(np.max(rates)),
        "cells": int(np.prod(cells)),
        "bytes_per_cell": 2 * 19 * 4,
        "twin_rel_error": float(np.abs(gap).max() / np.abs(slow).max()),
        "grid_convergence_pct": convergence,
        "cells_per_diameter": {name: table.cells_per_D for name, table in published.items()},
        "why": {f"grid_convergence_pct.{name}": "its table holds no run on a second grid" for name in missing},
    }

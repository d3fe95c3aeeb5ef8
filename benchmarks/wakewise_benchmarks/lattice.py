"""The lattice-Boltzmann solver: cell updates per core beside a plain loop, and the distance from its readable twin.

The peer of the lattice's kernel: a plain loop over cells that pulls, collides and writes, as textbooks have it.

It has the kernel's own collision and none of its care for memory: no pieces, no stores past the caches, and no faces
either, so that it does less. The numbers of cells are constants of the compiled code, and both lattices lie in one
array; the compiler then sees that nothing overlaps and works on several cells at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import float32

from wakewise.core.jit.njit import njit
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.simulation.lattice import load_mean_field
from wakewise.simulation.lattice.collision import Populations, collide
from wakewise.simulation.lattice.kernel import step
from wakewise.simulation.lattice.stencil import (
    OPEN,
    PERIODIC,
    VELOCITIES,
    Lattice,
    box,
    plane_row,
    smagorinsky_factor,
    still_water,
)
from wakewise_paper.lattice_reference.engines import why_no_gpu
from wakewise_paper.lattice_reference.numpy_step import twin_step

_cell = njit(fastmath=True, error_model="numpy", inline="always")(collide)


def make_sweep(cells: tuple[int, int, int], there: int) -> Callable[[Lattice, float, float], None]:
    """A function of (both, tau0, eddies) that steps lattice 1 - there of `both`, flat, into lattice `there`.

    `both` holds two lattices of shape (19, nx + 2, ny + 2, nz + 2); halos are read as they are.
    """
    NX, NY, NZ = cells
    ROW, PLANE = NZ + 2, (NY + 2) * (NZ + 2)
    STREAM = (NX + 2) * PLANE
    FROM, TO = (1 - there) * 19 * STREAM, there * 19 * STREAM
    pulled = [int(FROM + i * STREAM - c @ (PLANE, ROW, 1)) for i, c in enumerate(VELOCITIES)]
    A, B, C, D, E, F, G, H, J, K, L, M, N, P, Q, R, S, T, U = pulled

    @njit(fastmath=True, error_model="numpy", boundscheck=False)
    def pull(f: Lattice, at: int) -> Populations:
        return (
            f[A + at],
            f[B + at],
            f[C + at],
            f[D + at],
            f[E + at],
            f[F + at],
            f[G + at],
            f[H + at],
            f[J + at],
            f[K + at],
            f[L + at],
            f[M + at],
            f[N + at],
            f[P + at],
            f[Q + at],
            f[R + at],
            f[S + at],
            f[T + at],
            f[U + at],
        )

    @njit(fastmath=True, error_model="numpy", boundscheck=False)
    def sweep(f: Lattice, tau0: float, eddies: float) -> None:
        for x in range(1, NX + 1):
            for y in range(1, NY + 1):
                for z in range(1, NZ + 1):
                    at = x * PLANE + y * ROW + z
                    to = TO + at
                    (
                        f[to],
                        f[to + STREAM],
                        f[to + 2 * STREAM],
                        f[to + 3 * STREAM],
                        f[to + 4 * STREAM],
                        f[to + 5 * STREAM],
                        f[to + 6 * STREAM],
                        f[to + 7 * STREAM],
                        f[to + 8 * STREAM],
                        f[to + 9 * STREAM],
                        f[to + 10 * STREAM],
                        f[to + 11 * STREAM],
                        f[to + 12 * STREAM],
                        f[to + 13 * STREAM],
                        f[to + 14 * STREAM],
                        f[to + 15 * STREAM],
                        f[to + 16 * STREAM],
                        f[to + 17 * STREAM],
                        f[to + 18 * STREAM],
                    ) = _cell(pull(f, at), tau0, eddies)

    return sweep


def two_lattices(cells: tuple[int, int, int]) -> Lattice:
    """Flat array of two lattices at rest, for `make_sweep`."""
    nx, ny, nz = cells
    return np.zeros(2 * 19 * (nx + 2) * (ny + 2) * (nz + 2), np.float32)


CELLS = (128, 110, 110)
"""Far more than the caches hold, and their nineteen rows lie half a page apart, which is hard on a plain loop."""
_EDDIES = smagorinsky_factor(0.12)
_TAU = 0.5005
_STEPS = 4


def run(options: BenchOptions) -> dict[str, Any]:
    """Million cell updates per second of thread CPU on one core, kernel and plain loop by turns in one process."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        figures = _rates(options)
    finally:
        numba.set_num_threads(threads)
    published = {name: load_mean_field(name) for name in ("free", "swirl")}
    convergence = {name: table.figures.get("grid_convergence_pct") for name, table in published.items()}
    why = {
        f"grid_convergence_pct.{name}": "its table holds no run on a second grid"
        for name, value in convergence.items()
        if value is None
    }
    no_gpu = why_no_gpu()
    if no_gpu:
        why["glups_gpu"] = no_gpu
    return {
        **figures,
        "glups_gpu": None if no_gpu else _gpu_rate(),
        "cells": int(np.prod(CELLS)),
        "bytes_per_cell": 2 * 19 * 4,
        "twin_rel_error": _twin_gap(),
        "grid_convergence_pct": convergence,
        "cells_per_diameter": {name: table.cells_per_D for name, table in published.items()},
        "why": why,
    }


def _rates(options: BenchOptions, rounds: int = 9) -> dict[str, Any]:
    """Rates of the kernel with six open faces and without, where it does no more than the plain loop, and of that."""
    rng = np.random.default_rng(0)
    nx, ny, nz = CELLS
    now, later = still_water(CELLS), still_water(CELLS)
    box(now, ny, nz)[:] = 1e-4 * rng.standard_normal((19, nx + 2, ny + 2, nz + 2))
    tau_x, tau_yz = np.full(nx + 2, _TAU, np.float32), plane_row(np.zeros((ny + 2, nz + 2)))
    both = two_lattices(CELLS)
    both[:] = 1e-4 * rng.standard_normal(both.size)
    sweeps = [make_sweep(CELLS, there) for there in (1, 0)]

    def kernel(face: int) -> None:
        for src, dst in _STEPS // 2 * ((now, later), (later, now)):
            step(src, dst, ny, nz, tau_x, tau_yz, _EDDIES, np.full(6, face))

    def plain() -> None:
        for sweep in _STEPS // 2 * sweeps:
            sweep(both, float32(_TAU), float32(_EDDIES))

    kernel(OPEN)
    plain()
    ours, bare, peer = [], [], []
    for k in range(rounds):
        options.progress(k, rounds, "cell updates")
        ours.append(_mlups(lambda: kernel(OPEN)))
        peer.append(_mlups(plain))
        bare.append(_mlups(lambda: kernel(PERIODIC)))  # what the halo holds is read as it is
    return {
        "mlups_per_core": float(np.median(ours)),
        "mlups_per_core_best": float(np.max(ours)),
        "mlups_per_core_without_faces": float(np.median(bare)),
        "plain_mlups_per_core": float(np.median(peer)),
        "plain_ratio": float(np.median(np.divide(bare, peer))),
        "plain_ratio_with_faces": float(np.median(np.divide(ours, peer))),
        "plain_rel_error": plain_gap(),
    }


def _gpu_rate() -> float:
    from wakewise_paper.lattice_reference.cuda_engine import giga_updates_per_s

    return giga_updates_per_s()


def _mlups(work: Callable[[], None]) -> float:
    began = time.thread_time()
    work()
    return float(np.prod(CELLS)) * _STEPS / (time.thread_time() - began) / 1e6


def plain_gap(cells: tuple[int, int, int] = (4, 12, 21)) -> float:
    """Largest difference between a step of the plain loop and of the kernel, over the largest population."""
    nx, ny, nz = cells
    both = two_lattices(cells)
    halves = both.reshape(2, 19, nx + 2, ny + 2, nz + 2)
    halves[0] = 1e-2 * np.random.default_rng(1).standard_normal(halves[0].shape)
    src, dst = still_water(cells), still_water(cells)
    box(src, ny, nz)[:] = halves[0]
    make_sweep(cells, 1)(both, float32(_TAU), float32(_EDDIES))
    flat = plane_row(np.zeros((ny + 2, nz + 2)))
    step(src, dst, ny, nz, np.full(nx + 2, _TAU, np.float32), flat, _EDDIES, np.full(6, PERIODIC))
    inside = (slice(None), slice(1, -1), slice(1, -1), slice(1, -1))
    gap = np.abs(halves[1][inside] - box(dst, ny, nz)[inside]).max()
    return float(gap / np.abs(halves[1][inside]).max())


def _twin_gap() -> float:
    cells = (10, 11, 12)
    nx, ny, nz = cells
    start = (1e-2 * np.random.default_rng(0).standard_normal((19, *(n + 2 for n in cells)))).astype(np.float32)
    src, dst = still_water(cells), still_water(cells)
    box(src, ny, nz)[:] = start
    x, yz = np.linspace(0.52, 0.6, nx + 2), np.linspace(0, 0.1, (ny + 2) * (nz + 2)).reshape(ny + 2, nz + 2)
    # Beyond periodic faces lies what the halo holds.
    step(src, dst, ny, nz, x.astype(np.float32), plane_row(yz), _EDDIES, np.full(6, PERIODIC))
    slow = twin_step(start.astype(float), x, yz, _EDDIES)
    gap = box(dst, ny, nz)[:, 1:-1, 1:-1, 1:-1] - slow
    return float(np.abs(gap).max() / np.abs(slow).max())

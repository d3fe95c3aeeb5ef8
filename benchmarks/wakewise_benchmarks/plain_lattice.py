"""The peer of the lattice's kernel: a plain loop over cells that pulls, collides and writes, as textbooks have it.

It has the kernel's own collision and none of its care for memory: no pieces, no stores past the caches, and no faces
either, so that it does less. The numbers of cells are constants of the compiled code, and both lattices lie in one
array; the compiler then sees that nothing overlaps and works on several cells at once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wakewise.core.jit.njit import njit
from wakewise.simulation.lattice.collision import Populations, collide
from wakewise.simulation.lattice.stencil import VELOCITIES, Lattice

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
    A, B, C, D, E, F, G, H, I, J, K, L, M, N, O, P, Q, R, S = pulled  # noqa: E741

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
            f[I + at],
            f[J + at],
            f[K + at],
            f[L + at],
            f[M + at],
            f[N + at],
            f[O + at],
            f[P + at],
            f[Q + at],
            f[R + at],
            f[S + at],
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

"""D3Q19 stencil: velocities, weights, Hermite tensors, and the memory layout of the populations.

A lattice holds g_i = f_i - w_i, the deviation from fluid at rest, in float32, so slow flow keeps its digits. Its shape
is (19, nx + 2, size): one halo layer on every face, each plane of constant x in one row with z fastest. Cell (y, z) of
a plane, halo included, is at `origin` + y (nz + 2) + z. The origin aligns the first inner cell with a cache line, and
the remainder of a plane makes whole pieces.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.simulation.lattice.streaming_stores import LINE

Lattice = NDArray[np.float32]

OPEN, WALL, PERIODIC = 0, 1, 2
"""What a face of the box may be."""

PIECE = 128
"""Cells that collide together: nineteen rows of them fill a fifth of a first-level cache."""

VELOCITIES = np.array(
    [
        (0, 0, 0),
        *[(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)],
        *[(1, 1, 0), (-1, -1, 0), (1, -1, 0), (-1, 1, 0)],
        *[(1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1)],
        *[(0, 1, 1), (0, -1, -1), (0, 1, -1), (0, -1, 1)],
    ],
    dtype=np.int64,
)
"""The nineteen velocities in cells per step, shape (19, 3); after the first, each is followed by its opposite."""

OPPOSITE = np.array([0, *[i + 1 if i % 2 else i - 1 for i in range(1, 19)]], dtype=np.int64)
"""Index of the opposite velocity, shape (19,)."""

WEIGHTS = np.array([1 / 3] + [1 / 18] * 6 + [1 / 36] * 12)
"""Equilibrium populations of fluid at rest, shape (19,)."""


def _shapes() -> Array:
    """3 on the diagonal of H along each nonzero component and 9/2 between two of them; see `collision`."""
    out = np.zeros((19, 3, 3))
    for H, c in zip(out, VELOCITIES, strict=True):
        moving = np.count_nonzero(c)
        H[:] = 4.5 * np.outer(c, c)
        np.fill_diagonal(H, [3.0 if component else (-1.0, -3.0, 0.0)[moving] for component in c])
    return out


SHAPES = _shapes()
"""What rho u u adds to each population over its weight, shape (19, 3, 3)."""

HERMITE = 4.5 * (np.einsum("ia,ib->iab", VELOCITIES, VELOCITIES) - np.eye(3) / 3)
"""What the stress adds, shape (19, 3, 3)."""


def smagorinsky_factor(constant: float) -> float:
    """18 sqrt(2) Cs^2 of the closed form in `collision`, for Smagorinsky's constant Cs."""
    return 18 * math.sqrt(2) * constant**2


@njit
def origin(nz: int) -> int:
    """Where cell (0, 0) of a plane's halo lies in its row."""
    return (-(nz + 3)) % LINE


def plane_size(ny: int, nz: int) -> int:
    """Length of the row that holds a plane: whole pieces from the first cell inside, and their neighbours."""
    first = origin(nz) + nz + 3
    pieces = math.ceil((ny * (nz + 2) - 2) / PIECE)
    return math.ceil((first + pieces * PIECE + nz + 3) / LINE) * LINE


def still_water(cells: tuple[int, int, int]) -> Lattice:
    """A lattice at rest, shape (19, nx + 2, size), its planes on lines of cache."""
    nx, ny, nz = cells
    shape = (19, nx + 2, plane_size(ny, nz))
    raw = np.zeros(math.prod(shape) + LINE, np.float32)
    start = -raw.ctypes.data // 4 % LINE
    return raw[start : start + math.prod(shape)].reshape(shape)


def box(f: Lattice, ny: int, nz: int) -> Lattice:
    """View of a lattice, or of anything else with rows of planes, with y and z apart: (..., ny + 2, nz + 2)."""
    start = origin(nz)
    return f[..., start : start + (ny + 2) * (nz + 2)].reshape(*f.shape[:-1], ny + 2, nz + 2)


def plane_row(values: Array | Lattice) -> Lattice:
    """Values of a plane, shape (ny + 2, nz + 2), as the row that the kernels read."""
    ny, nz = values.shape[0] - 2, values.shape[1] - 2
    out = np.zeros(plane_size(ny, nz), np.float32)
    box(out, ny, nz)[:] = values
    return out

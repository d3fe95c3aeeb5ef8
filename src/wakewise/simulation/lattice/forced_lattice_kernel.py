"""What a live box of water needs beside the step itself: forces at points, bodies at rest, velocity at points."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.lattice.stencil import VELOCITIES, WEIGHTS, Lattice, origin


@njit
def share_out(at: Array, forces: Array, grid: Array) -> IntArray:
    """Share forces, shape (k, 3), between the eight cells about each place; the cells that got some, shape (c, 3).

    Parameters
    ----------
    at : ndarray, shape (k, 3)
        Places in cells, whole numbers at the middles of cells.
    grid : ndarray, shape (nx, ny, nz, 3)
        All zero; gets the forces. A share that would fall outside is left out.
    """
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    cells = np.empty((8 * at.shape[0], 3), np.int64)
    count = 0
    for k in range(at.shape[0]):
        i, j, m = math.floor(at[k, 0]), math.floor(at[k, 1]), math.floor(at[k, 2])
        u, v, w = at[k, 0] - i, at[k, 1] - j, at[k, 2] - m
        for corner in range(8):
            a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
            x, y, z = i + a, j + b, m + c
            if not (0 <= x < nx and 0 <= y < ny and 0 <= z < nz):
                continue
            share = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
            if share <= 0.0:
                continue
            if grid[x, y, z, 0] == 0.0 and grid[x, y, z, 1] == 0.0 and grid[x, y, z, 2] == 0.0:
                cells[count, 0], cells[count, 1], cells[count, 2] = x, y, z
                count += 1
            for axis in range(3):
                grid[x, y, z, axis] += share * forces[k, axis]
            if grid[x, y, z, 0] == 0.0 and grid[x, y, z, 1] == 0.0 and grid[x, y, z, 2] == 0.0:
                grid[x, y, z, 0] = 1e-300  # it is listed already, although its forces cancel
    return cells[:count].copy()


@njit
def at_rest(src: Lattice, dst: Lattice, nz: int, cells: IntArray) -> None:
    """Put the water of some cells, shape (k, 3), counted with halo, to rest; what came keeps its pressure."""
    mz, start = nz + 2, origin(nz)
    for k in range(cells.shape[0]):
        x, at = cells[k, 0], start + cells[k, 1] * mz + cells[k, 2]
        excess = 0.0
        for i in range(19):
            excess += src[i, x - VELOCITIES[i, 0], at - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]]
        for i in range(19):
            dst[i, x, at] = WEIGHTS[i] * excess


@njit
def interpolated(field: Lattice, solid: BoolArray, at: Array) -> Array:
    """A field of vectors, shape (3, nx, ny, nz), at places in cells, shape (k, 3): linear between, level outside.

    Cells of solid bodies, shape (nx, ny, nz), have no say: beside a wall it is the water there that is told of. Where
    all cells about a place are solid it is zero.
    """
    out = np.zeros((at.shape[0], 3))
    for k in range(at.shape[0]):
        x = min(max(at[k, 0], 0.0), field.shape[1] - 1.0)
        y = min(max(at[k, 1], 0.0), field.shape[2] - 1.0)
        z = min(max(at[k, 2], 0.0), field.shape[3] - 1.0)
        i, j, m = int(x), int(y), int(z)
        i, j, m = min(i, field.shape[1] - 2), min(j, field.shape[2] - 2), min(m, field.shape[3] - 2)
        u, v, w = x - i, y - j, z - m
        whole = 0.0
        for corner in range(8):
            a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
            if solid[i + a, j + b, m + c]:
                continue
            share = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
            whole += share
            for axis in range(3):
                out[k, axis] += share * field[axis, i + a, j + b, m + c]
        if whole > 0.0:
            for axis in range(3):
                out[k, axis] /= whole
    return out

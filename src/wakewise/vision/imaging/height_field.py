"""The bed as a height field on a grid: where a ray first meets it, found by walking from cell to cell.

Heights stand on the crossings of lines that need not be evenly spaced, and each cell is two triangles, so that the
surface is exactly a triangle mesh. A ray needs no tree for it: it walks over blocks of cells, passes over those whose
highest point stays below it, and in the others over the cells in its way, along which the gap to a triangle is linear.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit

BLOCK = 8
"""Cells along a block's side."""


class HeightField(NamedTuple):
    """Heights over a square grid, for compiled kernels.

    `lines_m` (n,) places of the grid's lines along x and y; `per_cell` (n - 1,) one over the spacing; `cell_at` (m,)
    the cell of the start of each bin, `bin_m` wide, no wider than a cell; `z_m` (n, n), downward, first axis x;
    `tops_m` (b, b) least z of each block; `range_m` (2,) least and greatest z. A tuple, which kernels can take apart.
    """

    lines_m: Array
    per_cell: Array
    cell_at: NDArray[np.int32]
    bin_m: float
    z_m: NDArray[np.float32]
    tops_m: NDArray[np.float32]
    range_m: Array


def height_field(lines_m: Array, z_m: NDArray[np.float32]) -> HeightField:
    """A height field from the grid's lines, rising, shape (n,), and z downward at their crossings, shape (n, n)."""
    steps, n = np.diff(lines_m), len(lines_m)
    bin_m = float(steps.min())
    starts = lines_m[0] + bin_m * np.arange(int((lines_m[-1] - lines_m[0]) / bin_m) + 2)
    cell_at = np.clip(np.searchsorted(lines_m, starts, side="right") - 1, 0, n - 2)
    z_m = np.ascontiguousarray(z_m, np.float32)
    cells = np.minimum(np.minimum(z_m[:-1, :-1], z_m[1:, :-1]), np.minimum(z_m[:-1, 1:], z_m[1:, 1:]))
    firsts = np.arange(0, n - 1, BLOCK)
    tops = np.minimum.reduceat(np.minimum.reduceat(cells, firsts, axis=0), firsts, axis=1)
    return HeightField(
        lines_m, 1.0 / steps, cell_at.astype(np.int32), bin_m, z_m, tops, np.array([z_m.min(), z_m.max()], np.float64)
    )


def grid_faces(n: int) -> IntArray:
    """Triangles, shape (2 (n - 1)**2, 3), of a grid of n x n crossings; corners numbered row by row, first axis x.

    Each cell is cut from its corner at least x and y to the opposite one; the halves at higher x come first. Normals
    lead to z < 0.
    """
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])


@njit(nogil=True)
def cell_of(lines: Any, cell_at: Any, per_bin: float, x: float) -> int:
    """Cell along an axis in which x lies, the first or last if it is outside."""
    place = min(max(int((x - lines[0]) * per_bin), 0), cell_at.shape[0] - 1)
    i = cell_at[place]
    while i < lines.shape[0] - 2 and lines[i + 1] <= x:
        i += 1
    return i


@njit(nogil=True)
def meet(
    lines: Any, per_cell: Any, cell_at: Any, z: Any, tops: Any, per_bin: float, top: float, bottom: float,
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, most: float,
) -> tuple[float, int, int, float, float]:  # fmt: skip
    """Where a ray from (ox, oy, oz) along (dx, dy, dz) first comes down through the surface.

    Returns
    -------
    (t, i, j, u, v)
        Distance in lengths of the direction, infinite if the surface is not met before `most`; the cell, and the place
        in it along x and y, 0 to 1 each. From below the surface, at its start or where it
        comes in from the side, a ray meets nothing.
    """
    cells = lines.shape[0] - 1
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    t, last = 0.0, most
    # Only between the planes of the highest and lowest point, a hair farther so that rounding loses nothing.
    if dz > 0.0:
        t = max(t, (top - oz) * iz - 1e-7)
        last = min(last, (bottom - oz) * iz + 1e-7)
    elif oz < top:
        return np.inf, 0, 0, 0.0, 0.0
    elif dz < 0.0:
        last = min(last, (top - oz) * iz + 1e-7)
    entered = t
    for axis in range(2):
        o, d, inverse = (ox, dx, ix) if axis == 0 else (oy, dy, iy)
        if d == 0.0:
            if not lines[0] <= o <= lines[cells]:
                return np.inf, 0, 0, 0.0, 0.0
        else:
            one, other = (lines[0] - o) * inverse, (lines[cells] - o) * inverse
            t = max(t, min(one, other))
            last = min(last, max(one, other))
    if not t < last:
        return np.inf, 0, 0, 0.0, 0.0
    i, j = cell_of(lines, cell_at, per_bin, ox + t * dx), cell_of(lines, cell_at, per_bin, oy + t * dy)
    if t == 0.0 or t > entered:
        u, v = (ox + t * dx - lines[i]) * per_cell[i], (oy + t * dy - lines[j]) * per_cell[j]
        if oz + t * dz >= _surface(z, i, j, u, v):
            return np.inf, 0, 0, 0.0, 0.0
    east, south = dx > 0.0, dy > 0.0
    while True:
        bi, bj = i // BLOCK, j // BLOCK
        i_low, j_low = bi * BLOCK, bj * BLOCK
        i_high, j_high = min(i_low + BLOCK, cells), min(j_low + BLOCK, cells)
        tx = (lines[i_high if east else i_low] - ox) * ix if dx != 0.0 else np.inf
        ty = (lines[j_high if south else j_low] - oy) * iy if dy != 0.0 else np.inf
        leave = min(tx, ty, last)
        block_top = tops[bi, bj]
        if max(oz + t * dz, oz + leave * dz) >= block_top:
            if dz > 0.0:
                enter = (block_top - oz) * iz - 1e-7
                if enter > t:
                    t = enter
                    i = min(max(cell_of(lines, cell_at, per_bin, ox + t * dx), i_low), i_high - 1)
                    j = min(max(cell_of(lines, cell_at, per_bin, oy + t * dy), j_low), j_high - 1)
            while True:
                cx = (lines[i + 1 if east else i] - ox) * ix if dx != 0.0 else np.inf
                cy = (lines[j + 1 if south else j] - oy) * iy if dy != 0.0 else np.inf
                end = max(min(cx, cy, last), t)
                u0, v0 = (ox + t * dx - lines[i]) * per_cell[i], (oy + t * dy - lines[j]) * per_cell[j]
                u1, v1 = (ox + end * dx - lines[i]) * per_cell[i], (oy + end * dy - lines[j]) * per_cell[j]
                w0, w1 = u0 - v0, u1 - v1
                za, zc = np.float64(z[i, j]), np.float64(z[i + 1, j + 1])
                side = w1 if abs(w1) > abs(w0) else w0
                met = False
                at, gap = end, 0.0
                if w0 * w1 < 0.0:
                    # The cut between the two triangles is crossed on the way.
                    share = w0 / (w0 - w1)
                    at = t + (end - t) * share
                    gap = oz + at * dz - za - (u0 + (u1 - u0) * share) * (zc - za)
                    side = w0
                    met = gap >= 0.0
                    if not met:
                        at, side = end, w1
                if not met:
                    gap = oz + end * dz - _on_triangle(z, i, j, u1, v1, side)
                    met = gap >= 0.0
                if met:
                    if side > 0.0:
                        along_u, along_v = np.float64(z[i + 1, j]) - za, zc - np.float64(z[i + 1, j])
                    else:
                        along_u, along_v = zc - np.float64(z[i, j + 1]), np.float64(z[i, j + 1]) - za
                    closing = dz - along_u * dx * per_cell[i] - along_v * dy * per_cell[j]
                    if closing > 0.0:
                        at -= gap / closing
                    if at > most:
                        return np.inf, 0, 0, 0.0, 0.0
                    u, v = (ox + at * dx - lines[i]) * per_cell[i], (oy + at * dy - lines[j]) * per_cell[j]
                    # A hair beyond the cut would be in the other triangle.
                    if side > 0.0:
                        u = max(u, v)
                    else:
                        v = max(u, v)
                    return at, i, j, u, v
                t = end
                if end >= leave:
                    break
                if cx < cy:
                    i += 1 if east else -1
                else:
                    j += 1 if south else -1
        t = leave
        if leave >= last:
            return np.inf, 0, 0, 0.0, 0.0
        if tx < ty:
            i = i_high if east else i_low - 1
            j = min(max(cell_of(lines, cell_at, per_bin, oy + t * dy), j_low), j_high - 1)
        else:
            j = j_high if south else j_low - 1
            i = min(max(cell_of(lines, cell_at, per_bin, ox + t * dx), i_low), i_high - 1)
        if not (0 <= i < cells and 0 <= j < cells):
            return np.inf, 0, 0, 0.0, 0.0


@njit(nogil=True, inline="always")
def _on_triangle(z: Any, i: int, j: int, u: float, v: float, side: float) -> float:
    """Height at (u, v) of a cell's triangle at higher u (side > 0) or at higher v, extended beyond its borders."""
    a, c = np.float64(z[i, j]), np.float64(z[i + 1, j + 1])
    if side > 0.0:
        b = np.float64(z[i + 1, j])
        return a + u * (b - a) + v * (c - b)
    d = np.float64(z[i, j + 1])
    return a + v * (d - a) + u * (c - d)


@njit(nogil=True, inline="always")
def _surface(z: Any, i: int, j: int, u: float, v: float) -> float:
    """Height at (u, v) of a cell."""
    return _on_triangle(z, i, j, u, v, u - v)

"""In which order points are taken, so that those that follow each other are mostly neighbours in space.

Along Hilbert's curve through the cells of a cube: J. Skilling 2004, Programming the Hilbert curve, AIP Conf. Proc. 707,
381, doi 10.1063/1.1751381. Where on the curve each cell lies is worked out once.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit

FEW_POINTS = 40
"""Fewer are taken as they come."""
_BITS = 5
_SIDE = 2**_BITS  # cells along each side of the cube


def spatial_order(points_W_m: Array) -> IntArray:
    """Order, shape (n,), in which points, shape (n, 3), that follow each other are mostly neighbours in space."""
    if len(points_W_m) < FEW_POINTS:
        return np.arange(len(points_W_m))
    order: IntArray = ordered(np.ascontiguousarray(points_W_m, dtype=np.float64), curve())
    return order


@cache
def curve() -> np.ndarray:
    """Place on the curve of each cell of the cube, shape (32768,), cells counted along z, then y, then x."""
    cells = np.arange(_SIDE)
    x = [axis.ravel() for axis in np.meshgrid(cells, cells, cells, indexing="ij")]
    for bit in (1 << k for k in range(_BITS - 1, 0, -1)):
        for k in range(3):
            flip = (x[k] & bit) != 0
            swapped = np.where(flip, 0, (x[0] ^ x[k]) & (bit - 1))
            x[0] = np.where(flip, x[0] ^ (bit - 1), x[0] ^ swapped)
            if k:
                x[k] = x[k] ^ swapped
    x[1] = x[1] ^ x[0]
    x[2] = x[2] ^ x[1]
    turn = np.zeros_like(x[0])
    for bit in (1 << k for k in range(_BITS - 1, 0, -1)):
        turn ^= np.where((x[2] & bit) != 0, bit - 1, 0)
    place = np.zeros_like(x[0])
    for bit in (1 << k for k in range(_BITS - 1, -1, -1)):
        for k in range(3):
            place = 2 * place + (((x[k] ^ turn) & bit) != 0)
    return place.astype(np.uint16)


@njit(apart=True, nogil=True)
def ordered(points: Array, places: np.ndarray) -> IntArray:
    """Order of points, shape (n, 3), by the places of their cells on the curve."""
    n = points.shape[0]
    low, high = points[0].copy(), points[0].copy()
    for p in range(n):
        for k in range(3):
            low[k], high[k] = min(low[k], points[p, k]), max(high[k], points[p, k])
    size = max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9) * (1.0 + 1e-9)
    per_cell = _SIDE / size
    key = np.empty(n, np.uint16)
    for p in range(n):
        i, j = int((points[p, 0] - low[0]) * per_cell), int((points[p, 1] - low[1]) * per_cell)
        key[p] = places[(i * _SIDE + j) * _SIDE + int((points[p, 2] - low[2]) * per_cell)]
    return sorted_keys(key)


@njit(apart=True, nogil=True)
def sorted_keys(key: np.ndarray) -> IntArray:
    """Order that sorts keys of two bytes, shape (n,): byte by byte, and like ones as they come."""
    n = key.shape[0]
    order, other = np.arange(n), np.empty(n, np.int64)
    for digit in range(2):
        shift = 8 * digit
        starts = np.zeros(257, np.int64)
        for p in range(n):
            starts[((key[p] >> shift) & 255) + 1] += 1
        for v in range(256):
            starts[v + 1] += starts[v]
        for q in range(n):
            v = (key[order[q]] >> shift) & 255
            other[starts[v]] = order[q]
            starts[v] += 1
        order, other = other, order
    return order

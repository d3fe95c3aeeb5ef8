"""Points that share a cell of a grid become one, their mean; in one pass over them, however many there are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit


@njit(nogil=True)
def _slot_of(slots: NDArray[np.int32], cells: IntArray, x: int, y: int, z: int) -> int:
    """Where in the table a cell is, or the free place where it belongs (open addressing, linear probing)."""
    # Large odd multipliers, the upper bits folded down: neighbouring cells land far apart.
    mixed = x * 0x1F1F1F1F1F1F1F1 + y * 0x2E8BA2E8BA2E8BB + z * 0x37ABE8F92C45D2B
    at = (mixed ^ (mixed >> 29)) & (len(slots) - 1)
    while slots[at] >= 0:
        row = slots[at]
        if cells[row, 0] == x and cells[row, 1] == y and cells[row, 2] == z:
            break
        at = (at + 1) & (len(slots) - 1)
    return at


@njit(nogil=True)
def _rehash(slots: NDArray[np.int32], cells: IntArray, used: int) -> None:
    """Enter the cells that are in use into an empty table."""
    for row in range(used):
        slots[_slot_of(slots, cells, cells[row, 0], cells[row, 1], cells[row, 2])] = row


@njit(nogil=True)
def _add(
    slots: NDArray[np.int32],
    cells: IntArray,
    sums: Array,
    counts: IntArray,
    used: int,
    rows: Array,
    weights: IntArray,
    cell_m: float,
) -> int:
    """Add rows, whose first three columns are positions, to their cells; the number of cells afterwards."""
    columns = rows.shape[1]
    for k in range(len(rows)):
        x, y, z = np.floor(rows[k, 0] / cell_m), np.floor(rows[k, 1] / cell_m), np.floor(rows[k, 2] / cell_m)
        at = _slot_of(slots, cells, int(x), int(y), int(z))
        row = slots[at]
        if row < 0:
            row = used
            slots[at] = row
            cells[row, 0], cells[row, 1], cells[row, 2] = int(x), int(y), int(z)
            used += 1
        weight = weights[k] if len(weights) else 1
        counts[row] += weight
        for c in range(columns):
            sums[row, c] += weight * rows[k, c]
    return used


class CellMeans:
    """Running means of rows of numbers by cell; adding in the same order gives the same bytes."""

    def __init__(self, columns: int, cell_m: float) -> None:
        self._cell_m = cell_m
        self._used = 0
        self._cells = np.zeros((0, 3), dtype=np.int64)
        self._sums = np.zeros((0, columns))
        self._counts = np.zeros(0, dtype=np.int64)
        self._slots = np.full(2, -1, dtype=np.int32)

    def add(self, rows: Array, weights: IntArray | None = None) -> None:
        """Add rows, shape (n, columns), that begin with a position; each counts `weights` times, shape (n,)."""
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        self._make_room(self._used + len(rows))
        heavy = np.zeros(0, dtype=np.int64) if weights is None else np.ascontiguousarray(weights, dtype=np.int64)
        self._used = _add(
            self._slots, self._cells, self._sums, self._counts, self._used, rows, heavy, float(self._cell_m)
        )

    def means(self) -> tuple[Array, IntArray]:
        """Mean row of each cell, shape (m, columns), in order of the cells' places, and how many rows it had."""
        used = self._used
        cells = self._cells[:used]
        order = np.lexsort((cells[:, 2], cells[:, 1], cells[:, 0]))
        count = self._counts[:used][order]
        mean = self._sums[:used][order]
        mean /= count[:, None]
        return mean, count

    def _make_room(self, rows: int) -> None:
        if rows <= len(self._counts):
            return
        size = max(rows, 3 * len(self._counts) // 2)

        def grown(old: NDArray[np.generic]) -> NDArray[np.generic]:
            new = np.zeros((size, *old.shape[1:]), dtype=old.dtype)
            new[: self._used] = old[: self._used]
            return new

        self._cells, self._sums, self._counts = grown(self._cells), grown(self._sums), grown(self._counts)  # type: ignore[assignment]
        table = 1 << int(2 * size).bit_length()
        if table > len(self._slots):
            self._slots = np.full(table, -1, dtype=np.int32)
            _rehash(self._slots, self._cells, self._used)

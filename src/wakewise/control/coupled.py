"""Kernels for null spaces whose directions are coupled: not proven to be global, and said so in the result.

They build on `search.line_minimum`, which is exact along a line; the cost f is defined there.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from wakewise.arrays import Array
from wakewise.control.search import TOLERANCE, box_range, cost, line_minimum


@njit(cache=True)
def _move(
    G: Array, thrusts: Array, direction: Array, lower: Array, upper: Array, previous: Array, weights: Array
) -> float:
    """Move `thrusts` (in place) to the global minimum along a line through it; return the gain."""
    low, high = box_range(thrusts, direction, lower, upper)
    if not low < high or not np.isfinite(high - low):
        return 0.0
    low, high = min(low, 0.0), max(high, 0.0)
    counted = np.ones(thrusts.size, np.bool_)
    trial = thrusts.copy()
    before = cost(G, thrusts, previous, weights)
    t, _, _ = line_minimum(G, thrusts, direction, counted, low, high, previous, weights, np.inf)
    if not np.isfinite(t):
        return 0.0
    for i in range(trial.size):
        trial[i] = min(max(thrusts[i] + t * direction[i], lower[i]), upper[i])
    after = cost(G, trial, previous, weights)
    if after < before:
        thrusts[:] = trial
        return before - after
    return 0.0


@njit(cache=True)
def _descend(
    G: Array, thrusts: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array, sweeps: int
) -> float:
    """Line searches along the null vectors and along what keeps silent thrusters silent; in place, returns f."""
    n, k = null.shape
    held = np.empty((n, k))
    for _ in range(sweeps):
        gain = 0.0
        for c in range(k):
            gain += _move(G, thrusts, null[:, c].copy(), lower, upper, previous, weights)
        # In a kink (T_i = 0) f rises steeply to both sides: go on along the valley, with those T_i held.
        count = 0
        for i in range(n):
            if abs(thrusts[i]) < 1e-9 and count < k - 1:
                row = null[i].copy()
                for h in range(count):
                    row -= held[h] * np.dot(row, held[h])
                size = np.sqrt(np.dot(row, row))
                if size > 1e-9:
                    held[count] = row / size
                    count += 1
        if count > 0:
            for c in range(k):
                step = np.zeros(k)
                step[c] = 1.0
                for h in range(count):
                    step -= held[h] * held[h, c]
                size = np.sqrt(np.dot(step, step))
                if size > 1e-6:
                    gain += _move(G, thrusts, null @ (step / size), lower, upper, previous, weights)
        if gain <= TOLERANCE * cost(G, thrusts, previous, weights):
            break
    return cost(G, thrusts, previous, weights)


@njit(cache=True)
def _try_line(
    G: Array,
    best: Array,
    value: float,
    base: Array,
    direction: Array,
    lower: Array,
    upper: Array,
    previous: Array,
    weights: Array,
) -> float:
    """Replace `best` (in place) by the minimum of a line if that is lower; return the lowest f."""
    low, high = box_range(base, direction, lower - 1e-9, upper + 1e-9)
    if not low < high or not np.isfinite(high - low):
        return value
    constant_part = base.copy()
    for i in range(base.size):
        if abs(direction[i]) >= 1e-12:
            constant_part[i] = 0.0
        elif base[i] < lower[i] - 1e-9 or base[i] > upper[i] + 1e-9:
            return value
    constant = cost(G, constant_part, constant_part, np.array([weights[0], weights[1], 0.0]))
    for i in range(base.size):
        if abs(direction[i]) < 1e-12:
            constant += weights[2] * (base[i] - previous[i]) ** 2
    counted = np.ones(base.size, np.bool_)
    t, _, _ = line_minimum(G, base, direction, counted, low, high, previous, weights, value - constant)
    if np.isfinite(t):
        trial = np.minimum(np.maximum(base + t * direction, lower), upper)
        found = cost(G, trial, previous, weights)
        if found < value:
            best[:] = trial
            return found
    return value


@njit(cache=True)
def planar_search(
    G: Array, start: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array, lines: int
) -> tuple[Array, float]:
    """Minimum over a two-dimensional null space whose two directions are coupled.

    Every minimum lies on a line T_i = 0 or T_i = limit (searched exactly, one by one) or inside a cell between them
    (found from `lines` parallel lines in each of two directions, spread over the disc that effort allows, and descent).
    `null`, shape (n, 2), has orthonormal columns. Returns the thrusts and an estimate of the gap: the gain that the
    second half of the parallel lines still brought.
    """
    n = start.size
    best = start.copy()
    value = _descend(G, best, null, lower, upper, previous, weights, 3)
    origin = start - null @ (null.T @ start)
    for i in range(n):
        size = null[i, 0] ** 2 + null[i, 1] ** 2
        if size < 1e-18:
            continue
        direction = null @ (np.array([-null[i, 1], null[i, 0]]) / np.sqrt(size))
        direction[i] = 0.0
        for side in range(3):
            wanted = 0.0 if side == 0 else (lower[i] if side == 1 else upper[i])
            if side > 0 and wanted == 0.0:
                continue
            base = origin + null @ (null[i] * ((wanted - origin[i]) / size))
            base[i] = wanted
            value = _try_line(G, best, value, base, direction, lower, upper, previous, weights)
    value = min(value, _descend(G, best, null, lower, upper, previous, weights, 3))
    # The minimum has w_u |T|^2 <= f: no coordinate in the null space can lie outside this disc.
    reach = np.sqrt(np.dot(np.maximum(np.abs(lower), np.abs(upper)), np.maximum(np.abs(lower), np.abs(upper))))
    if weights[1] > 0.0:
        reach = min(reach, np.sqrt(max(value / weights[1] - np.dot(origin, origin), 0.0)))
    first = value
    for half in range(2):
        if half == 1:
            first = value
        for step in range(lines // 2):
            # Squared spacing: denser near zero, where the sign changes lie.
            u = 2.0 * (2 * step + half + 0.5) / lines - 1.0
            offset = reach * u * abs(u)
            for c in range(2):
                base = origin + offset * null[:, c]
                value = _try_line(G, best, value, base, null[:, 1 - c].copy(), lower, upper, previous, weights)
    value = min(value, _descend(G, best, null, lower, upper, previous, weights, 8))
    return best, max(first - value, TOLERANCE * abs(value))


@njit(cache=True)
def restart_search(
    G: Array, starts: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array
) -> tuple[Array, float]:
    """Best of descents from several feasible starts, shape (r, n), for null spaces of more than two dimensions.

    The gap estimate is what the second half of the starts still gained over the first.
    """
    best = starts[0].copy()
    value = np.inf
    half_value = np.inf
    for r in range(starts.shape[0]):
        if r == (starts.shape[0] + 1) // 2:
            half_value = value
        thrusts = starts[r].copy()
        found = _descend(G, thrusts, null, lower, upper, previous, weights, 12)
        if found < value:
            value = found
            best = thrusts
    gap = half_value - value if np.isfinite(half_value) else abs(value)
    return best, max(gap, TOLERANCE * abs(value))

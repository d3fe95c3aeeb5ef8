"""Descent where the directions of the null space are coupled: to a minimum from a start, quickly and without proof.

It builds on `search.line_minimum`, which is exact along a line; the cost f is defined there. `boxes` proves.
"""

from __future__ import annotations

import numpy as np

from wakewise.allocation.search import TOLERANCE, box_range, cost, line_minimum
from wakewise.arrays import Array
from wakewise.compiled import assign, njit


@njit(apart=True)
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
        assign(thrusts, trial)
        return before - after
    return 0.0


@njit(apart=True)
def descend(
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
                    assign(held[count], row / size)
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


@njit(apart=True)
def explore(
    G: Array, thrusts: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array, rounds: int
) -> float:
    """Leave a minimum by bringing one thruster at a time to rest, or across zero, and descend from there; in place.

    Ends after a round without gain. Returns f.
    """
    n = thrusts.size
    value = cost(G, thrusts, previous, weights)
    for _ in range(rounds):
        before = value
        for i in range(n):
            along = np.dot(null[i], null[i])
            if along < 1e-9:
                continue
            direction = null @ null[i]
            for kick in range(2):
                goal, size = 0.0 if kick == 0 else -thrusts[i], 0.0
                for j in range(n):
                    size += abs(thrusts[j])
                if abs(thrusts[i]) < 1e-9:
                    goal = size / n if kick == 0 else -size / n
                low, high = box_range(thrusts, direction, lower, upper)
                t = min(max((goal - thrusts[i]) / along, min(low, 0.0)), max(high, 0.0))
                trial = np.empty(n)
                for j in range(n):
                    trial[j] = min(max(thrusts[j] + t * direction[j], lower[j]), upper[j])
                found = descend(G, trial, null, lower, upper, previous, weights, 4)
                if found < value * (1.0 - 1e-9):
                    value = found
                    assign(thrusts, trial)
        if value >= before:
            break
    return value

"""Multistart descent in a coupled null space: coupled directions, starting points, local minima without proof.

Descent is by `line_search.line_minimum`, which is exact along a line; `branch_and_bound` proves the minimum.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.allocation.line_search import TOLERANCE, box_range, cost, line_minimum
from wakewise.core.arrays import Array, BoolArray
from wakewise.core.jit.njit import assign, njit

_STARTS = (0, 0, 6, 12, 24, 32)
_RESTS, _RESTS_KEPT = 400, 8


@njit
def coupled_directions(G: Array, owners: BoolArray, limit: float) -> BoolArray:
    """Which parts of the null space share a Gram entry, shape (b, b).

    `owners`, shape (b, n), are the thrusters of each part; what is below `limit` times the largest entry is none.
    """
    b, n = owners.shape
    strength, tied, largest = np.zeros((n, n)), np.zeros((b, b), np.bool_), 0.0
    for i in range(2 * n):
        for j in range(2 * n):
            strength[i % n, j % n] = max(strength[i % n, j % n], abs(G[i, j]))
            largest = max(largest, abs(G[i, j]))
    for p in range(b):
        for q in range(b):
            for i in range(n):
                for j in range(n):
                    if owners[p, i] and owners[q, j] and strength[i, j] > limit * largest:
                        tied[p, q] = True
    return tied


@cache
def start_directions(k: int) -> Array:
    """Unit vectors, shape (r, k), along which starts lie: a fixed stream, so that a wrench always gives its thrusts."""
    directions = np.random.default_rng(0).normal(size=(_STARTS[min(k, len(_STARTS) - 1)], k))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@njit
def feasible_starts(start: Array, previous: Array, null: Array, directions: Array, lower: Array, upper: Array) -> Array:
    """The least thrusts, the previous ones brought to this wrench, and points along directions, shape (r + 2, n).

    - `start`, `previous`, shape (n,): least thrusts and those of before.
    - `null`, shape (n, k): orthonormal columns.
    - Shapes: `directions` (r, k); `lower`, `upper` (n,).
    """
    n, k = null.shape
    many = directions.shape[0]
    starts, step = np.empty((many + 2, n)), np.empty(n)
    for number in range(-2, many):
        share = 0.0 if number == -2 else 1.0
        if number >= 0:
            share = ((number + 1) / many) ** 2
        step[:] = 0.0
        for c in range(k):
            along = 0.0
            if number >= 0:
                along = directions[number, c]
            else:
                for i in range(n):
                    along += null[i, c] * (previous[i] - start[i])
            for i in range(n):
                step[i] += along * null[i, c]
        far = share * step_limit(start, step, lower, upper, np.inf if number >= 0 else 1.0)
        for i in range(n):
            starts[number + 2, i] = min(max(start[i] + far * step[i], lower[i]), upper[i])
    return starts


@njit
def step_limit(start: Array, step: Array, lower: Array, upper: Array, most: float) -> float:
    """Largest t <= most that keeps start + t step within limits."""
    far = most
    for i in range(step.size):
        if abs(step[i]) > 1e-12:
            far = min(far, ((upper[i] if step[i] > 0.0 else lower[i]) - start[i]) / step[i])
    return max(far, 0.0)


def idle_starts(
    start: Array, previous: Array, null: Array, G: Array, packed: Array, lower: Array, upper: Array
) -> Array:
    """The cheapest of many points where as many thrusters rest as the null space has dimensions: minima like these."""
    k = null.shape[1]
    moving = np.flatnonzero(np.any(np.abs(null) > 1e-12, axis=1))
    rng = np.random.default_rng(0)
    sets = np.array([rng.permutation(moving)[:k] for _ in range(_RESTS)])
    sets = sets[np.abs(np.linalg.det(null[sets])) > 1e-3 / 2.0**k]
    shifts = np.linalg.solve(null[sets], start[sets][:, :, None])[:, :, 0]
    T = start - shifts @ null.T
    np.put_along_axis(T, sets, 0.0, axis=1)
    T = T[np.all((lower <= T) & (upper >= T), axis=1)]
    values = np.array([cost(G, row, previous, packed) for row in T])
    return np.ascontiguousarray(T[np.argsort(values, kind="stable")[:_RESTS_KEPT]])


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
    """Line searches along the null vectors and along what keeps immovable thrusters immovable; in place, returns f."""
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
def multistart_descent(
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

"""Where branch and bound begins: which parts of the null space belong together, and thrusts to descend from."""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.allocation.search import cost
from wakewise.arrays import Array, BoolArray
from wakewise.compiled import njit

_STARTS = (0, 0, 6, 12, 24, 32)
_RESTS, _RESTS_KEPT = 400, 8


@njit
def tied_parts(G: Array, owners: BoolArray, limit: float) -> BoolArray:
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

    Parameters
    ----------
    start, previous : ndarray, shape (n,)
        Least thrusts and those of before.
    null : ndarray, shape (n, k)
        Orthonormal columns.
    directions : ndarray, shape (r, k)
    lower, upper : ndarray, shape (n,)
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
        far = share * reach(start, step, lower, upper, np.inf if number >= 0 else 1.0)
        for i in range(n):
            starts[number + 2, i] = min(max(start[i] + far * step[i], lower[i]), upper[i])
    return starts


@njit
def reach(start: Array, step: Array, lower: Array, upper: Array, most: float) -> float:
    """Largest t <= most that keeps start + t step within limits."""
    far = most
    for i in range(step.size):
        if abs(step[i]) > 1e-12:
            far = min(far, ((upper[i] if step[i] > 0.0 else lower[i]) - start[i]) / step[i])
    return max(far, 0.0)


def starts_at_rest(
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

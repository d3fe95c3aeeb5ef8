"""One sharing for each stretch of a flight: the least wash that a bound on energy allows."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, IntArray

_LEVELS = 2000
"""Steps in which the energy over the least is counted; each choice is rounded up, so that the bound is kept."""


def choose_under_budget(wash: Array, energy: Array, most: float) -> IntArray:
    """Which choice to take in each stretch, shape (b,), so that the sum of wash is least and that of energy in bounds.

    Exact but for the rounding of energy, by dynamic programming over stretches (the knapsack with one choice of each).

    Parameters
    ----------
    wash, energy : ndarray, shape (b, j)
        What each choice adds in each stretch.
    most : float
        Bound on the sum of energy, infinite for none; where nothing is within it, the choices of least energy.
    """
    least = energy.min(axis=1)
    free = most - float(least.sum())
    if not np.isfinite(most):
        return np.asarray(wash.argmin(axis=1))
    if free <= 0.0:
        return np.asarray(energy.argmin(axis=1))
    cost = np.ceil((energy - least[:, None]) / free * _LEVELS - 1e-9)
    taken: list[tuple[IntArray, Array]] = []
    best = np.zeros(_LEVELS + 1)  # least wash by how much of the room may be used
    for own, steps in zip(wash, cost, strict=True):
        after, pick = np.full(_LEVELS + 1, np.inf), np.zeros(_LEVELS + 1, dtype=np.int64)
        for j in np.flatnonzero(steps <= _LEVELS):
            shift = int(steps[j])
            total = best[: _LEVELS + 1 - shift] + own[j]
            better = total < after[shift:]
            after[shift:][better] = total[better]
            pick[shift:][better] = j
        best = after
        taken.append((pick, steps))
    picks, left = np.zeros(len(taken), dtype=np.int64), _LEVELS
    for b in reversed(range(len(taken))):
        pick, steps = taken[b]
        picks[b] = pick[left]
        left -= round(float(steps[picks[b]]))
    return picks


def sum_of(values: Array, picks: IntArray) -> float:
    """Sum over stretches of what was picked, of values of shape (b, j)."""
    return float(values[np.arange(len(picks)), picks].sum())

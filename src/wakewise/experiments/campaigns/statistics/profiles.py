"""Whole distributions held against each other, where a mean would hide what most trials do."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics.intervals import RESAMPLES, Interval

Groups = Mapping[Any, Sequence[float] | Array]
"""Values of trials by target, world or other stratum."""


def probability_of_improvement(
    ours: Groups, theirs: Groups, *, less_is_better: bool = True, seed: int = 0
) -> tuple[float, Interval | None]:
    """How likely a trial of ours is better than one of theirs on a stratum drawn evenly, and its 95 % interval.

    Ties count half (Mann-Whitney's U over n m, averaged over strata; Agarwal et al. 2021,
    doi 10.48550/arXiv.2108.13264). One half: neither.

    Raises
    ------
    InputError
        If they share no stratum.
    """
    shared: list[Hashable] = [name for name in ours if name in theirs and len(ours[name]) and len(theirs[name])]
    if not shared:
        raise InputError("probability of improvement: the two methods share no stratum")
    sign = 1.0 if less_is_better else -1.0
    pairs = [(sign * np.asarray(ours[n], dtype=float), sign * np.asarray(theirs[n], dtype=float)) for n in shared]
    wins = [_wins(a, b) for a, b in pairs]
    value = float(np.mean([w.mean() for w in wins]))
    if all(w.size == 1 for w in wins):
        return value, None
    rng = np.random.default_rng(seed)
    drawn = np.zeros(RESAMPLES)
    for won in wins:
        n, m = won.shape
        rows, columns = rng.integers(n, size=(RESAMPLES, n)), rng.integers(m, size=(RESAMPLES, m))
        drawn += won[rows[:, :, None], columns[:, None, :]].mean(axis=(1, 2)) / len(wins)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return value, Interval(float(low), float(high))


def performance_profile(values: Sequence[float] | Array, thresholds: Sequence[float] | Array) -> Array:
    """Share of trials whose figure is at most each threshold, shape of `thresholds`; a trial that is NaN never is.

    Raises
    ------
    InputError
        If there are no trials.
    """
    known = np.asarray(values, dtype=np.float64)
    if known.size == 0:
        raise InputError("performance profile: no trials, needs one or more")
    return np.asarray((known[:, None] <= np.asarray(thresholds, dtype=np.float64)[None]).mean(axis=0))


def _wins(ours: Array, theirs: Array) -> Array:
    """1 where ours is less, one half where both are alike; shape (n, m)."""
    return np.asarray((ours[:, None] < theirs[None]) + 0.5 * (ours[:, None] == theirs[None]))

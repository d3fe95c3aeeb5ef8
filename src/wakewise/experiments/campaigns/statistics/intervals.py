"""Intervals: of a share (Wilson), and of anything else by drawing the trials anew within their strata."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

RESAMPLES = 4000
Statistic = Callable[[Array], Array]
"""From rows drawn, shape (draws, n, columns), to one value of each draw, shape (draws,)."""


class Interval(NamedTuple):
    """Both ends."""

    low: float
    high: float


def wilson(successes: int, n: int, confidence: float = 0.95) -> Interval:
    """Interval of a share from counts (Wilson 1927); of none or all it does not shrink to a point.

    Raises
    ------
    InputError
        If counts do not fit each other.
    """
    if not 0 <= successes <= n or n < 1:
        raise InputError(f"share: {successes} of {n}, must be 0 to n of 1 or more")
    found = stats.binomtest(successes, n).proportion_ci(confidence, method="wilson")
    return Interval(float(found.low), float(found.high))


def mean_of(drawn: Array) -> Array:
    """Mean of the first column, shape (draws,)."""
    return np.asarray(drawn[:, :, 0].mean(axis=1))


def ratio_of_sums(drawn: Array) -> Array:
    """Sum of the first column over the sum of the second, shape (draws,); not finite where that is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(drawn[:, :, 0].sum(axis=1) / drawn[:, :, 1].sum(axis=1))


def interquartile_mean(drawn: Array) -> Array:
    """Mean of the middle half of the first column, shape (draws,): less moved by a lucky flight than the mean.

    The share of a value that a quartile cuts counts as much as lies inside, as in Agarwal et al. 2021
    (doi 10.48550/arXiv.2108.13264); of one value it is the value.
    """
    ordered = np.sort(drawn[:, :, 0], axis=1)
    n = ordered.shape[1]
    edges = np.arange(n + 1) / n
    inside = np.clip(np.minimum(edges[1:], 0.75) - np.maximum(edges[:-1], 0.25), 0.0, None)
    return np.asarray(ordered @ (inside / inside.sum()))


def stratified_bootstrap(
    rows: Sequence[float] | Sequence[Sequence[float]] | Array,
    strata: Sequence[Hashable] | None = None,
    statistic: Statistic = mean_of,
    *,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> tuple[float, Interval | None]:
    """A statistic of trials and its percentile interval, by drawing trials anew, each stratum as often as it is there.

    Parameters
    ----------
    rows : array_like, shape (n,) or (n, columns)
        Columns of one row stay together, so that pairs stay pairs.
    strata : sequence of n hashables, optional
        Such as the target of each trial. Where a stratum holds a single trial all are drawn from together, since
        within it nothing could vary.
    statistic : callable
        From rows drawn, shape (draws, n, columns).

    Returns
    -------
    float, Interval or None
        None of a single row, which says nothing of the next.

    Raises
    ------
    InputError
        If there are no rows, or one is not finite.
    """
    values = np.asarray(rows, dtype=np.float64)
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2 or len(values) == 0 or not np.isfinite(values).all():
        raise InputError(f"bootstrap: rows of shape {values.shape}, must be finite and one or more")
    value = float(statistic(values[None])[0])
    if len(values) < 2:
        return value, None
    names = [""] * len(values) if strata is None else list(strata)
    groups = [np.flatnonzero([where == name for where in names]) for name in dict.fromkeys(names)]
    if min(len(group) for group in groups) < 2:
        groups = [np.arange(len(values))]
    rng = np.random.default_rng(seed)
    picked = np.concatenate([group[rng.integers(len(group), size=(resamples, len(group)))] for group in groups], axis=1)
    drawn = statistic(values[picked])
    drawn = drawn[np.isfinite(drawn)]
    if len(drawn) == 0:
        return value, None
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(drawn, [tail, 100.0 - tail])
    return value, Interval(float(low), float(high))

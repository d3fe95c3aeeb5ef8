"""Two methods on the same seeds: is one better, and by how much in units of the spread between pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, sqrt

import numpy as np
from scipy import stats

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

FEWEST = 2
"""A single pair has no spread."""


@dataclass(frozen=True, kw_only=True)
class PairedTest:
    """What pairs say of a difference, ours less theirs.

    Parameters
    ----------
    n : int
        Pairs.
    mean, low, high : float
        Mean difference and its 95 % interval by Student's t; the ends are None of a single pair.
    t, p_t : float or None
        Paired t-test, two-sided. None of a single pair; of differences that are all alike p is 0, or 1 where all are 0.
    p_wilcoxon : float or None
        Signed-rank test, two-sided, exact up to 50 pairs without ties; zeros are left out (Wilcoxon's way). None of a
        single pair.
    d_z : float or None
        Cohen's d for pairs: mean over the standard deviation of the differences (Cohen 1988; Lakens 2013,
        doi 10.3389/fpsyg.2013.00863). None where that is zero.
    g_z : float or None
        The same with Hedges' correction for few pairs, exact (Hedges 1981).
    """

    n: int
    mean: float
    low: float | None
    high: float | None
    t: float | None
    p_t: float | None
    p_wilcoxon: float | None
    d_z: float | None
    g_z: float | None


def paired_test(ours: Sequence[float] | Array, theirs: Sequence[float] | Array, confidence: float = 0.95) -> PairedTest:
    """Test pairs; row k of both is one seed.

    Parameters
    ----------
    ours, theirs : array_like, shape (n,)
        Finite.
    confidence : float
        Of the interval.

    Raises
    ------
    InputError
        If there are no pairs, lengths differ, or a value is not finite.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if a.ndim != 1 or a.shape != b.shape or len(a) == 0:
        raise InputError(f"pairs: shapes {a.shape} and {b.shape}, must be the same (n,) with n of 1 or more")
    difference = a - b
    if not np.isfinite(difference).all():
        raise InputError("pairs: a value is not finite; leave such pairs out, or let them count as the worst")
    n, mean = len(a), float(difference.mean())
    if n < FEWEST:
        return PairedTest(n=n, mean=mean, low=None, high=None, t=None, p_t=None, p_wilcoxon=None, d_z=None, g_z=None)
    spread = float(difference.std(ddof=1))
    half = float(stats.t.ppf(0.5 + 0.5 * confidence, n - 1)) * spread / sqrt(n)
    if spread <= 1e-12 * float(np.abs(difference).max(initial=0.0)):  # all alike: t is infinite, or there is nothing
        t, p_t, d_z = None, 1.0 if mean == 0.0 else 0.0, None
    else:
        t = mean / (spread / sqrt(n))
        p_t, d_z = 2.0 * float(stats.t.sf(abs(t), n - 1)), mean / spread
    return PairedTest(
        n=n,
        mean=mean,
        low=mean - half,
        high=mean + half,
        t=t,
        p_t=p_t,
        p_wilcoxon=_wilcoxon(difference),
        d_z=d_z,
        g_z=None if d_z is None else d_z * hedges_correction(n - 1),
    )


def hedges_correction(freedom: int) -> float:
    """J(m) = Gamma(m/2) / (sqrt(m/2) Gamma((m-1)/2)), by which d of m degrees of freedom is too large (Hedges 1981)."""
    from scipy.special import gammaln

    if freedom < 2:
        return 0.0  # the limit: of two pairs nothing is left of d
    m = float(freedom)
    return float(np.exp(gammaln(0.5 * m) - gammaln(0.5 * (m - 1.0))) / np.sqrt(0.5 * m))


def _wilcoxon(difference: Array) -> float:
    if not difference.any():
        return 1.0
    p = float(stats.wilcoxon(difference).pvalue)
    return 1.0 if isnan(p) else p

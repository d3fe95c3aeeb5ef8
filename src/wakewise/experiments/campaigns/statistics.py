"""Statistics of many trials: intervals of means, shares and ratios, tests of pairs, Holm's correction, sample sizes.

SciPy computes exact intervals of shares (`binomtest`), the paired t-test (`ttest_rel`), the signed-rank test
(`wilcoxon`), the Mann-Whitney statistic (`mannwhitneyu`) and the distributions behind intervals and power (`t`, `nct`).
Ours are:

- Student's interval of a mean within strata (Welch-Satterthwaite degrees of freedom), of a ratio of geometric means and
  of a ratio of means (Fieller): SciPy has the first without strata alone;
- Holm's correction: SciPy has Benjamini-Hochberg alone (`false_discovery_control`);
- Hedges' correction, power of pairs and the number of trials needed: SciPy has `power` by simulation alone;
- probability of improvement and performance profiles (Agarwal et al. 2021, doi 10.48550/arXiv.2108.13264).

There is no bootstrap: percentile intervals of 2, 5 and 21 pairs without a difference excluded zero in 50, 19 and 8 % of
simulated cases instead of 5 %. The coverage of the intervals here is tested by simulation for 2 to 30 trials.
Arrays in, plain records out.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan, sqrt
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import optimize, special, stats

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError


class Interval(NamedTuple):
    """Both ends."""

    low: float
    high: float


def share_interval(successes: int, n: int) -> Interval:
    """Exact 95 % interval of a share from counts (Clopper and Pearson 1934): it covers at least as often as it says.

    Raises InputError if counts do not fit each other.
    """
    if not 0 <= successes <= n or n < 1:
        raise InputError(f"share: {successes} of {n}, must be 0 to n of 1 or more")
    found = stats.binomtest(successes, n).proportion_ci(0.95, method="exact")
    return Interval(float(found.low), float(found.high))


def mean_interval(
    values: Sequence[float] | Array, strata: Sequence[Hashable] | None = None
) -> tuple[float, Interval | None]:
    """Mean of trials, shape (n,), and its 95 % interval by Student's t, with the variance within strata.

    `strata` name the stratum of each value, such as its target. If a stratum holds a single value, all are one stratum,
    since nothing could vary within it. Degrees of freedom: Welch 1947, Satterthwaite 1946. The interval of a single
    value is None. Of values with a long tail (log-normal of spread 1) it covers about 85 % where it says 95.

    Raises InputError if there are no values, or one is not finite.
    """
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or len(x) == 0 or not np.isfinite(x).all():
        raise InputError(f"mean: values of shape {x.shape}, must be finite and one or more")
    mean, n = float(x.mean()), len(x)
    if n < 2:
        return mean, None
    names = [""] * n if strata is None else list(strata)
    groups = [x[[where == name for where in names]] for name in dict.fromkeys(names)]
    if min(len(group) for group in groups) < 2:
        groups = [x]
    parts = np.array([len(group) * float(group.var(ddof=1)) / n**2 for group in groups])
    if not parts.sum() > 0.0:
        return mean, Interval(mean, mean)
    freedom = float(parts.sum() ** 2 / (parts**2 / np.array([len(group) - 1.0 for group in groups])).sum())
    half = float(stats.t.ppf(0.975, freedom)) * sqrt(float(parts.sum()))
    return mean, Interval(mean - half, mean + half)


def geometric_ratio(
    ours: Sequence[float] | Array, theirs: Sequence[float] | Array, strata: Sequence[Hashable] | None = None
) -> tuple[float, Interval | None]:
    """Ratio of the geometric means of pairs, shape (n,) each, and its 95 % interval: that of the mean log ratio.

    It has the stated coverage where pairs differ by factors, as speeds and energies of one seed do.

    Raises InputError if there are no pairs, or a value is not finite and more than 0.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if a.shape != b.shape or not (a > 0.0).all() or not (b > 0.0).all():
        raise InputError("ratio: values of pairs must be more than 0, one of each for every seed")
    mean, ends = mean_interval(np.log(a / b), strata)
    return float(np.exp(mean)), None if ends is None else Interval(float(np.exp(ends.low)), float(np.exp(ends.high)))


def ratio_of_means(
    ours: Sequence[float] | Array, theirs: Sequence[float] | Array
) -> tuple[float | None, Interval | None]:
    """Ratio of the means of pairs, shape (n,) each, and Fieller's 95 % interval (1954, J. R. Statist. Soc. B 16, 175).

    The ratio is None where the mean of theirs is not more than 0. The interval is None of one pair, and where the mean
    of theirs is so unsure that no ratio is excluded on one side. It excludes 1 where the paired t-test rejects.

    Raises InputError if there are no pairs.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if a.ndim != 1 or a.shape != b.shape or len(a) == 0:
        raise InputError(f"ratio: shapes {a.shape} and {b.shape}, must be the same (n,) with n of 1 or more")
    if not b.mean() > 0.0:
        return None, None
    value, n = float(a.mean() / b.mean()), len(a)
    if n < 2:
        return value, None
    scale = float(stats.t.ppf(0.975, n - 1)) ** 2 / n
    (v_aa, v_ab), (_, v_bb) = scale * np.cov(a, b, ddof=1)
    # The ratios r with (mean of a - r b)^2 <= t^2 var(a - r b) / n.
    square, middle, rest = float(b.mean() ** 2 - v_bb), float(a.mean() * b.mean() - v_ab), float(a.mean() ** 2 - v_aa)
    if square <= 1e-12 * float(b.mean() ** 2):
        return value, None
    half = sqrt(max(0.0, middle**2 - square * rest))
    return value, Interval((middle - half) / square, (middle + half) / square)


# Reductions over pairs ---------------------------------------------------------------------------------------------

LEAST_M_S = 0.5e-3
"""Speeds below count as this in logarithms, m/s: the tank merges vortex rings with errors of up to three times that,
and the logarithm of a flight that leaves nothing would dominate a mean."""

Figures = Mapping[str, float | None]
Pairs = list[tuple[float, float, Hashable]]
"""Theirs, ours and the stratum, trial by trial."""


def pairs_of(
    base: Mapping[Any, Figures], other: Mapping[Any, Figures], figure: str, strata: Mapping[Any, Hashable]
) -> Pairs:
    """Values of a figure where both trials of a key have it, with the stratum of that key."""
    found: Pairs = []
    for key in sorted(set(base) & set(other), key=str):
        theirs, ours = base[key].get(figure), other[key].get(figure)
        if theirs is not None and ours is not None and np.isfinite(theirs) and np.isfinite(ours):
            found.append((float(theirs), float(ours), strata.get(key, "")))
    return found


def log_reduction_pct(pairs: Pairs, unanswered: int = 0) -> tuple[float | None, Interval | None, float | None]:
    """Mean reduction 1 - exp(mean ln(ours / theirs)) in percent, its interval, and the reduction of the worst pair.

    `unanswered` counts trials of ours that failed where the other's did not: each counts as no reduction.
    """
    if not pairs and not unanswered:
        return None, None, None
    logs = [float(np.log(max(ours, LEAST_M_S) / max(theirs, LEAST_M_S))) for theirs, ours, _ in pairs]
    logs += [0.0] * unanswered
    strata = [where for _, _, where in pairs] + ["failed"] * unanswered
    mean, ends = mean_interval(logs, strata)
    log_ends = None if ends is None else Interval(float(np.exp(ends.low)), float(np.exp(ends.high)))
    return *as_reduction(float(np.exp(mean)), log_ends), 100.0 * (1.0 - float(np.exp(max(logs))))


def ratio(pairs: Pairs) -> tuple[float | None, Interval | None]:
    """Sum of ours over the sum of theirs, and its interval; None where the sum of theirs is not more than 0."""
    if not pairs:
        return None, None
    return ratio_of_means([ours for _, ours, _ in pairs], [theirs for theirs, _, _ in pairs])


def reduction_pct(
    base: Mapping[Any, Figures], other: Mapping[Any, Figures], figure: str
) -> tuple[float | None, Interval | None]:
    """Reduction of the mean of a figure, in percent of the base's, over the keys that both have; and its interval."""
    return as_reduction(*ratio(pairs_of(base, other, figure, {})))


def as_reduction(value: float | None, ends: Interval | None) -> tuple[float | None, Interval | None]:
    """A ratio and its interval as a reduction in percent."""
    if value is None:
        return None, None
    return 100.0 * (1.0 - value), None if ends is None else Interval(100.0 * (1.0 - ends[1]), 100.0 * (1.0 - ends[0]))


def mean_figures(rows: Iterable[Figures], keys: Iterable[str], worst: Sequence[str] = ()) -> dict[str, Any]:
    """Number of trials (`flights`), and of each figure its mean (KEY) and interval (KEY_interval) over trials.

    Figures in `worst` are the largest of all trials instead and have no interval. None where no trial has the figure.
    """
    listed = list(rows)
    answer: dict[str, Any] = {"flights": len(listed)}
    for key in keys:
        known = [float(v) for v in (row.get(key) for row in listed) if v is not None and np.isfinite(v)]
        if key in worst:
            answer[key], answer[f"{key}_interval"] = max(known, default=None), None
        else:
            answer[key], answer[f"{key}_interval"] = mean_interval(known) if known else (None, None)
    return answer


def holm(p: Sequence[float] | Array) -> Array:
    """Holm's step-down correction: never larger than Bonferroni's, as safe (Holm 1979, Scand. J. Statist. 6, 65).

    Raises InputError if one is not between 0 and 1.
    """
    values = _checked(p)
    order = np.argsort(values, kind="stable")
    weighed = (len(values) - np.arange(len(values))) * values[order]
    adjusted = np.empty_like(values)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(weighed))
    return adjusted


def _checked(p: Sequence[float] | Array) -> Array:
    values = np.asarray(p, dtype=np.float64)
    if values.ndim != 1 or not np.all((values >= 0.0) & (values <= 1.0)):
        raise InputError(f"p-values: {values!r}, must be a list of numbers from 0 to 1")
    return values


# Trials without figures: left out, as the paper does, or counted as the worst, as trials of medicines do. A method that
# fails on the hard seeds looks better by what is left, so both are shown wherever a model is judged.

WORST: dict[str, float] = {"rmse_mm": 20.0, "success": 0.0} | dict.fromkeys(
    ("completeness_pct", "completeness_1mm_pct", "completeness_visible_pct"), 0.0
)
"""What a trial counts as that was to make a model and made none: the cap of the RMSE, nothing covered, no success."""

Row = Mapping[str, Any]


def dropped(rows: Iterable[Row | None], figure: str) -> Array:
    """Values of a figure over the trials that have it, shape (n,)."""
    known = (None if row is None else row.get(figure) for row in rows)
    return np.array([float(v) for v in known if v is not None and np.isfinite(v)], dtype=np.float64)


def as_worst(rows: Iterable[Row | None], figure: str) -> Array:
    """Values over all trials that were meant to be made, shape (n,); those without one count as the worst.

    Raises KeyError if no worst is stated for this figure, such as the energy of a failed flight.
    """
    least = WORST[figure]
    known = (None if row is None else row.get(figure) for row in rows)
    return np.array([least if v is None or not np.isfinite(v) else float(v) for v in known], dtype=np.float64)


# Two methods on the same seeds -------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class PairedTest:
    """Tests and effect sizes of paired differences, ours less theirs; all but `n` and `mean` are None of one pair.

    `low` and `high` are the 95 % interval of the mean by Student's t. `t`, `p_t`: paired t-test, two-sided; of
    differences that are all alike t is None and p is 0, or 1 where all are 0. `p_wilcoxon`: signed-rank test,
    two-sided, exact up to 50 pairs without ties, zeros left out. `d_z`: Cohen's d for pairs, mean over the standard
    deviation of the differences (Cohen 1988; Lakens 2013, doi 10.3389/fpsyg.2013.00863), None where that is zero.
    `g_z`: the same with Hedges' correction for few pairs, exact (Hedges 1981).
    """

    n: int
    mean: float
    low: float | None = None
    high: float | None = None
    t: float | None = None
    p_t: float | None = None
    p_wilcoxon: float | None = None
    d_z: float | None = None
    g_z: float | None = None


def paired_test(ours: Sequence[float] | Array, theirs: Sequence[float] | Array) -> PairedTest:
    """Test the differences of pairs, shape (n,) each and finite; row k of both is one seed.

    Raises InputError if there are no pairs, lengths differ, or a value is not finite.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if a.ndim != 1 or a.shape != b.shape or len(a) == 0:
        raise InputError(f"pairs: shapes {a.shape} and {b.shape}, must be the same (n,) with n of 1 or more")
    difference = a - b
    if not np.isfinite(difference).all():
        raise InputError("pairs: a value is not finite; leave such pairs out, or let them count as the worst")
    n, mean = len(a), float(difference.mean())
    if n < 2:
        return PairedTest(n=n, mean=mean)
    signed_rank = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
    p_wilcoxon = 1.0 if isnan(signed_rank) else signed_rank
    spread = float(difference.std(ddof=1))
    if spread <= 1e-12 * float(np.abs(difference).max(initial=0.0)):  # all alike: t is infinite, or there is nothing
        p_t = 1.0 if mean == 0.0 else 0.0
        return PairedTest(n=n, mean=mean, low=mean, high=mean, p_t=p_t, p_wilcoxon=p_wilcoxon)
    test = stats.ttest_rel(a, b)
    ends = test.confidence_interval(0.95)
    d_z, t, p_t = mean / spread, float(test.statistic), float(test.pvalue)
    found = PairedTest(n=n, mean=mean, low=float(ends.low), high=float(ends.high), t=t, p_t=p_t)
    return replace(found, p_wilcoxon=p_wilcoxon, d_z=d_z, g_z=d_z * hedges_correction(n - 1))


@dataclass(frozen=True, kw_only=True)
class PairedComparison:
    """Ratio of ours to theirs, its 95 % interval, and the test of the same quantity, so that they agree at 1.

    `of` is what the ratio is of: geometric means, where all values are more than 0, or means. `ratio` is None where the
    mean of theirs is not more than 0.
    """

    of: Literal["geometric means", "means"]
    ratio: float | None
    interval: Interval | None
    test: PairedTest


def compare_pairs(ours: Sequence[float] | Array, theirs: Sequence[float] | Array) -> PairedComparison:
    """Compare pairs, shape (n,) each; row k of both is one seed.

    Raises InputError as `paired_test` does.
    """
    a, b = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    test = paired_test(a, b)
    if (a > 0.0).all() and (b > 0.0).all():
        value, ends = geometric_ratio(a, b)
        return PairedComparison(
            of="geometric means", ratio=value, interval=ends, test=paired_test(np.log(a), np.log(b))
        )
    mean, ends = ratio_of_means(a, b)
    return PairedComparison(of="means", ratio=mean, interval=ends, test=test)


def hedges_correction(freedom: int) -> float:
    """J(m) = Gamma(m/2) / (sqrt(m/2) Gamma((m-1)/2)), by which d of m degrees of freedom is too large (Hedges 1981)."""
    if freedom < 2:
        return 0.0  # the limit: of two pairs nothing is left of d
    m = float(freedom)
    return float(np.exp(special.gammaln(0.5 * m) - special.gammaln(0.5 * (m - 1.0))) / np.sqrt(0.5 * m))


# Whole distributions beside each other, where a mean hides what most trials do -------------------------------------

Groups = Mapping[Any, Sequence[float] | Array]
"""Values of trials by target, world or other stratum."""


def probability_of_improvement(ours: Groups, theirs: Groups, *, less_is_better: bool = True) -> float:
    """Probability that a trial of ours is better than one of theirs in a stratum drawn evenly.

    Ties count half: Mann-Whitney's U over n m, averaged over strata. One half means neither is better.

    Raises InputError if they share no stratum.
    """
    shared: list[Hashable] = [name for name in ours if name in theirs and len(ours[name]) and len(theirs[name])]
    if not shared:
        raise InputError("probability of improvement: the two methods share no stratum")
    sign = 1.0 if less_is_better else -1.0
    pairs = [(sign * np.asarray(ours[n], dtype=float), sign * np.asarray(theirs[n], dtype=float)) for n in shared]
    return float(np.mean([_wins(a, b).mean() for a, b in pairs]))


def _wins(ours: Array, theirs: Array) -> Array:
    """1 where ours is less, one half where both are alike; shape (n, m)."""
    return np.asarray((ours[:, None] < theirs[None]) + 0.5 * (ours[:, None] == theirs[None]))


def performance_profile(values: Sequence[float] | Array, thresholds: Sequence[float] | Array) -> Array:
    """Share of trials whose figure is at most each threshold, shape of `thresholds`; a trial that is NaN never is.

    Raises InputError if there are no trials.
    """
    known = np.asarray(values, dtype=np.float64)
    if known.size == 0:
        raise InputError("performance profile: no trials, needs one or more")
    return np.asarray((known[:, None] <= np.asarray(thresholds, dtype=np.float64)[None]).mean(axis=0))


# How many trials a question needs, and how small a difference a number of them can show -----------------------------

MOST = 100_000


def power_of_pairs(d_z: float, n: int, alpha: float = 0.05) -> float:
    """Probability that n pairs show a true effect d_z by a two-sided paired t-test (noncentral t).

    Raises InputError with fewer than 2 pairs, or if alpha is not between 0 and 1.
    """
    if n < 2 or not 0.0 < alpha < 1.0:
        raise InputError(f"power: {n} pairs at alpha {alpha}, needs 2 or more and 0 to 1")
    limit = float(stats.t.ppf(1.0 - 0.5 * alpha, n - 1))
    shift = abs(d_z) * sqrt(n)
    above, below = stats.nct.cdf(-limit, n - 1, -shift), stats.nct.cdf(-limit, n - 1, shift)
    # Far out in a tail SciPy gives up; there it is nothing, and the other one everything.
    return float((1.0 if isnan(above) else above) + (0.0 if isnan(below) else below))


def pairs_needed(d_z: float, power: float = 0.8) -> int | None:
    """Fewest pairs with which an effect d_z is shown with that chance at alpha 0.05; None beyond a hundred thousand."""
    low, high = 1, 2
    while power_of_pairs(d_z, high) < power:
        low, high = high, 2 * high
        if high > MOST:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_of_pairs(d_z, middle) >= power else (middle, high)
    return high


def smallest_effect(n: int) -> float | None:
    """Smallest d_z that n pairs show with a chance of 80 % at alpha 0.05; None of fewer than 2."""
    if n < 2:
        return None
    return float(optimize.brentq(lambda d: power_of_pairs(d, n) - 0.8, 1e-6, 100.0))


def trials_for_rate(rate: float, half_width: float = 0.05) -> int:
    """Fewest trials after which the exact 95 % interval of a share about `rate` is no wider than twice this.

    Raises InputError if either is not within 0 and 1.
    """
    if not 0.0 <= rate <= 1.0 or not 0.0 < half_width < 1.0:
        raise InputError(f"rate {rate}, half width {half_width}: must be within 0 and 1")

    def width(n: int) -> float:
        low, high = share_interval(round(rate * n), n)
        return high - low

    n = 1
    while width(n) > 2.0 * half_width:
        n += max(1, n // 50)  # a few per cent are near enough for a plan
    return n

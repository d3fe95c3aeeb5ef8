"""Intervals cover what they say, from two trials on."""

import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.proportion import proportion_confint

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import (
    compare_pairs,
    geometric_ratio,
    mean_interval,
    paired_test,
    ratio_of_means,
    share_interval,
)

SIMULATED = 1200
NOISE = 3.0 * math.sqrt(0.95 * 0.05 / SIMULATED)
"""Three standard errors of a simulated coverage of 95 %."""
SIZES = [2, 3, 4, 5, 7, 10, 21, 30]


def _covered(ends, truth):
    return ends is not None and ends.low <= truth <= ends.high


@pytest.mark.parametrize("n", SIZES)
def test_a_mean_is_covered_in_95_of_100_cases(n):
    """Of normal values, for any number of trials; a percentile bootstrap covered 52 % at n = 2."""
    draws = np.random.default_rng(n).normal(5.0, 2.0, (SIMULATED, n))
    share = np.mean([_covered(mean_interval(x)[1], 5.0) for x in draws])
    assert share == pytest.approx(0.95, abs=NOISE)


@pytest.mark.parametrize("n", SIZES)
def test_no_difference_is_called_one_in_5_of_100_cases(n):
    """Flights log-normal of spread 1, noise .4 of each method: the case in which a bootstrap erred in 50 % at n = 2."""
    rng = np.random.default_rng(100 + n)
    seeds = np.exp(rng.normal(0.0, 1.0, (SIMULATED, n)))
    ours, theirs = (seeds * np.exp(rng.normal(0.0, 0.4, seeds.shape)) for _ in range(2))
    wrong = np.mean([not _covered(geometric_ratio(a, b)[1], 1.0) for a, b in zip(ours, theirs, strict=True)])
    assert wrong == pytest.approx(0.05, abs=NOISE)


@pytest.mark.parametrize("n", SIZES)
def test_a_ratio_of_geometric_means_is_covered_in_95_of_100_cases(n):
    """Ours are a third of theirs."""
    rng = np.random.default_rng(200 + n)
    ratios = np.exp(rng.normal(math.log(1.0 / 3.0), 0.5, (SIMULATED, n)))
    share = np.mean([_covered(geometric_ratio(x, np.ones(n))[1], 1.0 / 3.0) for x in ratios])
    assert share == pytest.approx(0.95, abs=NOISE)


@pytest.mark.parametrize("n", SIZES)
def test_fiellers_interval_of_a_ratio_of_means_covers_at_least_what_it_says(n):
    """Normal pairs, ours half of theirs; an interval that is None excludes nothing, so it counts as covering,
    which is often so for few pairs.
    """
    rng = np.random.default_rng(300 + n)
    theirs = rng.normal(10.0, 2.0, (SIMULATED, n))
    ours = 0.5 * theirs + rng.normal(0.0, 1.0, theirs.shape)
    found = [ratio_of_means(a, b)[1] for a, b in zip(ours, theirs, strict=True)]
    share = np.mean([ends is None or _covered(ends, 0.5) for ends in found])
    assert 0.95 - NOISE <= share <= (0.95 + NOISE if n > 4 else 1.0)


@pytest.mark.parametrize("sizes", [(2, 2), (2, 5), (3, 3, 3), (10, 11)])
def test_a_mean_over_strata_is_covered_in_about_95_of_100_cases(sizes):
    """Targets far apart, each with the same spread; Satterthwaite's degrees of freedom are conservative for few."""
    rng = np.random.default_rng(sum(sizes))
    names = [k for k, size in enumerate(sizes) for _ in range(size)]
    centre = np.array([10.0 * k for k in names])
    draws = centre + rng.normal(0.0, 1.0, (SIMULATED, len(names)))
    share = np.mean([_covered(mean_interval(x, names)[1], centre.mean()) for x in draws])
    assert 0.95 - NOISE <= share <= 0.99


@pytest.mark.parametrize("rate", [0.1, 0.45, 0.985])
@pytest.mark.parametrize("n", [2, 5, 20, 60])
def test_a_share_is_covered_at_least_as_often_as_it_says(n, rate):
    """Summed over all counts, without drawing."""
    counts = np.arange(n + 1)
    covered = [_covered(share_interval(int(k), n), rate) for k in counts]
    assert float(stats.binom.pmf(counts, n, rate) @ covered) >= 0.95


@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 20), (7, 20), (20, 20), (197, 200)])
def test_the_interval_of_a_share_is_statsmodels(k, n):
    """Shares of none and all included, where the plain interval would be a point."""
    assert share_interval(k, n) == pytest.approx(proportion_confint(k, n, method="beta"), abs=1e-9)


def test_the_interval_of_a_mean_is_scipys():
    """Without strata."""
    values = np.random.default_rng(1).normal(5.0, 2.0, 9)
    mean, ends = mean_interval(values)
    assert mean == pytest.approx(values.mean())
    assert ends == pytest.approx(stats.ttest_1samp(values, 0.0).confidence_interval(0.95))


def test_strata_take_the_difference_between_targets_out_of_the_interval():
    """Two targets far apart, each alike within: stratified, nearly nothing is left to vary."""
    rows = np.concatenate([np.linspace(1.0, 1.1, 10), np.linspace(9.0, 9.1, 10)])
    _, narrow = mean_interval(rows, ["a"] * 10 + ["b"] * 10)
    _, wide = mean_interval(rows)
    assert narrow.high - narrow.low < 0.1 * (wide.high - wide.low)


def test_a_stratum_of_one_is_none_of_its_own():
    """Within it nothing could vary, so its spread would be left out: all are one stratum instead."""
    rows = np.array([1.0, 1.1, 1.2, 9.0])
    single = mean_interval(rows, ["a", "a", "a", "b"])
    assert single == mean_interval(rows)
    assert mean_interval(rows, ["a", "a", "b", "b"]) != single


def test_a_ratio_that_is_the_same_in_every_pair_has_no_spread():
    """However different the pairs are, by geometric means and by means."""
    theirs = np.array([1.0, 10.0, 100.0])
    value, ends = geometric_ratio(0.3 * theirs, theirs)
    assert (value, *ends) == pytest.approx((0.3, 0.3, 0.3))
    near = np.array([9.0, 10.0, 11.0])
    value, ends = ratio_of_means(0.3 * near, near)
    assert (value, *ends) == pytest.approx((0.3, 0.3, 0.3), abs=1e-6)


def test_a_ratio_to_something_unsure_has_no_interval():
    """A mean of theirs that may be nothing bounds no ratio; one that is nothing has no ratio."""
    assert ratio_of_means([1.0, 2.0], [0.1, 30.0]) == (pytest.approx(3.0 / 30.1), None)
    assert ratio_of_means([1.0, 2.0], [0.0, 0.0]) == (None, None)


@pytest.mark.parametrize("floor", [0.0, 1.0])
def test_interval_and_test_of_a_comparison_agree(floor):
    """The interval excludes 1 where p is below .05, by geometric means and, where a value is 0, by means."""
    rng = np.random.default_rng(4)
    seen = set()
    for _ in range(200):
        theirs = rng.uniform(2.0, 3.0, 6)
        ours = theirs * rng.normal(0.9, 0.12, 6)
        ours[0] *= floor
        found = compare_pairs(ours, theirs)
        if found.interval is not None:
            outside = not _covered(found.interval, 1.0)
            assert outside == (found.test.p_t < 0.05)
            seen.add((found.of, outside))
    assert len(seen) == 2


def test_a_comparison_of_positive_values_is_tested_on_logarithms():
    """As the interval is."""
    ours, theirs = [1.0, 2.0, 1.5], [2.0, 3.0, 9.0]
    assert compare_pairs(ours, theirs).test == paired_test(np.log(ours), np.log(theirs))


def test_one_trial_has_no_interval_and_no_trials_no_value():
    """A single trial says nothing of the next."""
    assert mean_interval([2.0]) == (2.0, None)
    assert ratio_of_means([1.0], [2.0]) == (0.5, None)
    with pytest.raises(InputError, match="mean: values"):
        mean_interval([])
    with pytest.raises(InputError, match="ratio"):
        geometric_ratio([0.0], [1.0])
    with pytest.raises(InputError, match="ratio: shapes"):
        ratio_of_means([1.0], [1.0, 2.0])
    with pytest.raises(InputError, match="share"):
        share_interval(3, 2)

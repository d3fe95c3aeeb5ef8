"""Wilson's interval and the stratified bootstrap."""

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import ratio_of_sums, stratified_bootstrap, wilson


@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 20), (7, 20), (20, 20), (197, 200)])
def test_wilson_is_statsmodels(k, n):
    """Shares of none and all included, where the plain interval would be a point."""
    assert wilson(k, n) == pytest.approx(proportion_confint(k, n, method="wilson"), abs=1e-9)


def test_the_bootstrap_of_a_mean_is_its_standard_error():
    """Of many normal values the interval is that of the theory, within its own noise."""
    values = np.random.default_rng(1).normal(5.0, 2.0, 400)
    mean, ends = stratified_bootstrap(values)
    assert mean == pytest.approx(values.mean())
    half = 1.96 * values.std() / 20.0
    assert (ends.high - ends.low) / 2.0 == pytest.approx(half, rel=0.06)


def test_strata_take_the_difference_between_targets_out_of_the_interval():
    """Two targets far apart, each alike within: stratified, nearly nothing is left to vary."""
    rows = np.concatenate([np.linspace(1.0, 1.1, 10), np.linspace(9.0, 9.1, 10)])
    strata = ["a"] * 10 + ["b"] * 10
    _, narrow = stratified_bootstrap(rows, strata)
    _, wide = stratified_bootstrap(rows)
    assert narrow.high - narrow.low < 0.1 * (wide.high - wide.low)


def test_a_stratum_of_one_is_not_drawn_alone():
    """Within it nothing could vary, so its spread would be left out: all are drawn from together instead."""
    rows = np.array([1.0, 1.1, 1.2, 9.0])
    single = stratified_bootstrap(rows, ["a", "a", "a", "b"])
    assert single == stratified_bootstrap(rows)
    assert single[1].high - single[1].low > 2.0
    assert stratified_bootstrap(rows, ["a", "a", "b", "b"]) != single


def test_columns_of_a_pair_stay_together():
    """A ratio that is the same in every pair has no spread, however different the pairs are."""
    theirs = np.array([1.0, 10.0, 100.0])
    value, ends = stratified_bootstrap(np.column_stack([0.3 * theirs, theirs]), None, ratio_of_sums)
    assert (value, ends.low, ends.high) == (pytest.approx(0.3), pytest.approx(0.3), pytest.approx(0.3))


def test_one_trial_has_no_interval_and_no_trials_no_value():
    """A single trial says nothing of the next."""
    assert stratified_bootstrap([2.0]) == (2.0, None)
    with pytest.raises(InputError, match="bootstrap"):
        stratified_bootstrap([])
    with pytest.raises(InputError, match="share"):
        wilson(3, 2)


def test_the_same_seed_gives_the_same_interval():
    """A table printed twice is the same table."""
    values = np.random.default_rng(0).normal(size=9)
    assert stratified_bootstrap(values) == stratified_bootstrap(values)

"""Probability of improvement and performance profiles."""

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import performance_profile, probability_of_improvement


def test_on_one_stratum_it_is_mann_whitneys_u():
    """U over n m, ties counted half."""
    rng = np.random.default_rng(2)
    ours, theirs = np.round(rng.normal(0.0, 1.0, 14), 1), np.round(rng.normal(0.4, 1.0, 11), 1)
    value = probability_of_improvement({"a": ours}, {"a": theirs})
    assert value == pytest.approx(mannwhitneyu(theirs, ours).statistic / (14 * 11))


def test_strata_count_alike_however_many_trials_they_have():
    """A win on a target flown once weighs as much as a loss on one flown ten times."""
    value = probability_of_improvement({"a": [1.0], "b": [9.0] * 10}, {"a": [2.0], "b": [1.0] * 10})
    assert value == 0.5


def test_which_side_is_better_is_the_callers():
    """Completeness is better where it is more."""
    more = probability_of_improvement({"a": [9.0]}, {"a": [1.0]}, less_is_better=False)
    less = probability_of_improvement({"a": [9.0]}, {"a": [1.0]})
    assert (more, less) == (1.0, 0.0)


def test_without_a_common_stratum_nothing_is_compared():
    """Trials on different targets are no comparison."""
    with pytest.raises(InputError, match="share no stratum"):
        probability_of_improvement({"a": [1.0]}, {"b": [1.0]})


def test_a_profile_counts_trials_at_most_a_threshold_and_failures_never():
    """It rises from none to the share that has a figure at all."""
    shares = performance_profile([1.0, 2.0, np.nan, 4.0], [0.5, 2.0, 10.0])
    assert shares.tolist() == [0.0, 0.5, 0.75]
    with pytest.raises(InputError):
        performance_profile([], [1.0])

"""How many trials a difference needs, held against statsmodels."""

from math import isnan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.power import TTestPower

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import (
    pairs_needed,
    power_of_pairs,
    share_interval,
    smallest_effect,
    trials_for_rate,
)


@settings(max_examples=25)
@given(st.floats(0.0, 2.0), st.integers(2, 120))
def test_the_power_of_pairs_is_statsmodels(d_z, n):
    """Both use the noncentral t; statsmodels has none far out, where the power is 1."""
    oracle = float(TTestPower().power(d_z, n, 0.05))
    assert power_of_pairs(d_z, n) == pytest.approx(1.0 if isnan(oracle) else oracle, abs=1e-6)


def test_the_fewest_pairs_are_just_enough():
    """One fewer would not do; a medium effect needs 34 pairs (Cohen 1988)."""
    assert pairs_needed(0.5) == 34
    assert power_of_pairs(0.5, 34) >= 0.8 > power_of_pairs(0.5, 33)
    assert pairs_needed(0.001, power=0.99) is None


@pytest.mark.parametrize("n", [2, 3, 10, 60])
def test_the_smallest_effect_turns_it_round(n):
    """What n pairs can just show, they show with a chance of 80 %."""
    assert power_of_pairs(smallest_effect(n), n) == pytest.approx(0.8, abs=1e-6)
    assert smallest_effect(1) is None


def test_a_share_needs_many_trials():
    """98.5 % to 2 % either way."""
    n = trials_for_rate(0.985, 0.02)
    low, high = share_interval(round(0.985 * n), n)
    assert high - low <= 0.04 and n > 100


def test_what_cannot_be_is_refused():
    """A test of one pair, a share of more than all."""
    with pytest.raises(InputError):
        power_of_pairs(0.5, 1)
    with pytest.raises(InputError):
        trials_for_rate(1.5)

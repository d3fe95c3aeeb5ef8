"""Pairs of one seed: tests and effect sizes, held against statsmodels."""

import numpy as np
import pytest
from statsmodels.stats.weightstats import DescrStatsW

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import hedges_correction, paired_test


def test_the_t_test_and_its_interval_are_statsmodels():
    """t, p and both ends agree with another library's to rounding."""
    rng = np.random.default_rng(3)
    ours, theirs = rng.normal(1.0, 0.4, 17), rng.normal(1.3, 0.7, 17)
    found, oracle = paired_test(ours, theirs), DescrStatsW(ours - theirs)
    t, p, _ = oracle.ttest_mean(0.0)
    assert (found.t, found.p_t) == (pytest.approx(t, rel=1e-12), pytest.approx(p, rel=1e-9))
    assert (found.low, found.high) == pytest.approx(oracle.tconfint_mean(0.05), rel=1e-12)
    assert found.d_z == pytest.approx((ours - theirs).mean() / (ours - theirs).std(ddof=1), rel=1e-12)


def test_the_signed_rank_p_of_few_pairs_is_exact():
    """Five pairs that all went down have p = 2 / 2^5, the least that five pairs can give."""
    found = paired_test([1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 3.5, 5.0, 6.7, 8.1])
    assert found.p_wilcoxon == pytest.approx(2.0 / 32.0)
    assert found.mean < 0.0


def test_hedges_correction_is_the_known_one():
    """Exact values (Hedges 1981, table 1) and the usual approximation 1 - 3 / (4 m - 1)."""
    assert hedges_correction(2) == pytest.approx(0.5642, abs=1e-4)
    assert hedges_correction(10) == pytest.approx(0.9228, abs=1e-4)
    for m in (20, 100):
        assert hedges_correction(m) == pytest.approx(1.0 - 3.0 / (4.0 * m - 1.0), abs=2e-4)


def test_a_single_pair_has_a_difference_and_nothing_else():
    """No spread, no p, no effect size are made up of one pair."""
    found = paired_test([1.0], [3.0])
    assert (found.mean, found.p_t, found.d_z, found.low, found.p_wilcoxon) == (-2.0, None, None, None, None)


def test_differences_that_are_all_alike_are_sure_or_nothing():
    """Equal pairs say p = 1; a constant difference p = 0; neither has an effect size, whose spread would be zero."""
    assert paired_test([1.0, 2.0], [1.0, 2.0]).p_t == 1.0
    constant = paired_test([1.0, 2.0, 3.0], [2.0, 3.0, 4.0])
    assert (constant.p_t, constant.d_z) == (0.0, None)


@pytest.mark.parametrize("pairs", [([], []), ([1.0], [1.0, 2.0]), ([np.nan, 1.0], [1.0, 2.0])])
def test_what_is_no_pairs_is_refused(pairs):
    """None, unequal numbers of them, or values that are not finite."""
    with pytest.raises(InputError, match="pairs"):
        paired_test(*pairs)

"""Reductions over pairs of trials: by logarithms and by sums, intervals within strata."""

import pytest

from wakewise.experiments.campaigns.statistics import (
    LEAST_M_S,
    log_reduction_pct,
    mean_figures,
    pairs_of,
    ratio,
    reduction_pct,
)

SPEED = "target_speed_mean_m_s"


def rows(values):
    return {k: {SPEED: v} for k, v in enumerate(values)}


def test_a_reduction_by_logarithms_is_that_of_the_usual_flight():
    """Halves are 50 % with no width; a half and a double are none, and the worst is the double."""
    assert log_reduction_pct([(1.0, 0.5, ""), (3.0, 1.5, "")])[:2] == (pytest.approx(50.0), pytest.approx((50.0, 50.0)))
    value, interval, worst = log_reduction_pct([(1.0, 0.5, ""), (1.0, 2.0, "")])
    assert value == pytest.approx(0.0) and worst == pytest.approx(-100.0) and interval[0] < 0.0 < interval[1]
    assert log_reduction_pct([]) == (None, None, None)
    assert log_reduction_pct([(1.0, 0.2, "")]) == (pytest.approx(80.0), None, pytest.approx(80.0))


def test_a_speed_of_nothing_carries_no_mean():
    """What lies below the water's own resolution counts as that."""
    assert log_reduction_pct([(10.0 * LEAST_M_S, 0.0, "")])[0] == pytest.approx(90.0)
    assert log_reduction_pct([(0.1 * LEAST_M_S, 0.0, "")])[0] == pytest.approx(0.0)


def test_a_flight_that_failed_counts_as_no_gain():
    """Two quarters and one failure are less than two quarters."""
    pairs = [(1.0, 0.25, ""), (1.0, 0.25, "")]
    whole, part = log_reduction_pct(pairs)[0], log_reduction_pct(pairs, unanswered=1)
    assert whole == pytest.approx(75.0) and part[0] == pytest.approx(100.0 * (1.0 - 0.25 ** (2 / 3)))
    assert part[2] == pytest.approx(0.0)


def test_strata_are_drawn_within():
    """Where flights of a stratum agree, its share in the mean is certain, whatever the strata's difference."""
    pairs = [(1.0, 0.5, "heavy"), (1.0, 0.5, "heavy"), (1.0, 1.0, "light"), (1.0, 1.0, "light")]
    value, interval, _ = log_reduction_pct(pairs)
    assert interval == pytest.approx((value, value))
    loose = log_reduction_pct([(a, b, "") for a, b, _ in pairs])[1]
    assert loose[0] < value - 5.0 and loose[1] > value + 5.0


def test_a_ratio_of_sums_and_only_what_both_flew():
    """Pairs of the same seed; a seed without any has no share of its own but counts in the sums."""
    base = rows([1.0, 100.0])
    value, interval = reduction_pct(base, {0: {SPEED: 0.2}}, SPEED)
    assert value == pytest.approx(80.0) and interval is None
    assert reduction_pct(base, {7: base[0]}, SPEED) == (None, None)
    value, interval = reduction_pct(rows([1.9, 2.0]), rows([1.0, 1.0]), SPEED)
    assert value == pytest.approx(100.0 * (1.0 - 2.0 / 3.9)) and interval[0] < value < interval[1]
    assert reduction_pct(rows([0.0, 2.0]), rows([0.0, 1.0]), SPEED) == (pytest.approx(50.0), None)
    assert ratio([(0.0, 1.0, "")]) == (None, None)
    assert pairs_of(rows([1.0]), {0: {SPEED: None}}, SPEED, {}) == []


def test_means_have_intervals_and_some_figures_are_the_worst():
    """A figure that no flight has is null; one flight has no interval."""
    found = mean_figures([{"a": 1.0, "ms": 3.0}, {"a": 3.0, "ms": 9.0}], ("a", "b", "ms"), worst=("ms",))
    assert (
        found["a"] == 2.0
        and found["b"] is None
        and found["ms"] == 9.0
        and found["ms_interval"] is None
        and found["flights"] == 2
    )
    assert found["a_interval"][0] < 2.0 < found["a_interval"][1] and found["b_interval"] is None
    assert mean_figures([{"a": 1.0}], ("a",))["a_interval"] is None

"""What correlated readings are worth."""

import math

import numpy as np
import pytest

from wakewise.robot.thrusters.lag_fit import newey_west_errors, samples_per_reading


def test_independent_readings_count_one_each_and_constant_ones_too() -> None:
    white = np.random.default_rng(0).normal(size=20_000)
    assert samples_per_reading(white) == pytest.approx(1.0, abs=0.2)
    assert samples_per_reading(np.ones(50)) == 1.0


def test_a_first_order_series_has_the_known_count() -> None:
    """For x' = a x + noise it is (1 + a) / (1 - a)."""
    rng, a = np.random.default_rng(1), 0.8
    series = np.zeros(40_000)
    for k in range(1, series.size):
        series[k] = a * series[k - 1] + rng.normal()
    assert samples_per_reading(series) == pytest.approx((1.0 + a) / (1.0 - a), rel=0.15)


def test_for_white_noise_the_errors_are_the_textbooks() -> None:
    """Standard error of a mean is sigma / sqrt(n); columns of any scale come out alike."""
    residual = np.random.default_rng(2).normal(0.0, 3.0, 10_000)
    jacobian = np.stack([np.full(10_000, 1e6), np.zeros(10_000)], axis=1)
    errors = newey_west_errors(jacobian, residual)
    assert errors[0] == pytest.approx(3.0 / math.sqrt(10_000) / 1e6, rel=0.2)
    assert math.isinf(errors[1])

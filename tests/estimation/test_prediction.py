"""Prediction: the covariance moves as the mean does, noise adds up, commands are followed in their order."""

import numpy as np
import pytest
from estimation_helpers import (
    ALLOCATION,
    ERRORS,
    PACKED,
    REST,
    SILENT,
    STEADY,
    difference,
    jacobian,
    random_covariance,
    random_mean,
)

from wakewise.estimation.eskf_kernels import CURRENT, GAINS, advance, predict


@pytest.mark.slow
def test_the_covariance_moves_as_the_mean_does():
    """Without noise P becomes F P F', F by differences of the moved mean: exact, but 1 % for what varies in a step."""
    rng = np.random.default_rng(0)
    mean, thrusts, dt = random_mean(rng), rng.normal(size=8), 0.01
    root = rng.normal(size=(ERRORS, ERRORS))
    root[CURRENT:GAINS] *= 0.1
    P = root @ root.T

    def after(start):
        out, unused = start.copy(), np.zeros((ERRORS, ERRORS))
        predict(PACKED, ALLOCATION, out, unused, thrusts, REST, dt, SILENT, *STEADY)
        return out

    middle = after(mean)
    F = jacobian(lambda start: difference(after(start), middle), mean)
    for kept, tolerance in ((np.r_[0:CURRENT, GAINS:ERRORS], 1e-7), (np.arange(ERRORS), 0.01)):
        part = np.zeros_like(P)
        part[np.ix_(kept, kept)] = P[np.ix_(kept, kept)]
        expected, found = F @ part @ F.T, part.copy()
        predict(PACKED, ALLOCATION, mean.copy(), found, thrusts, REST, dt, SILENT, *STEADY)
        np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())
        np.testing.assert_array_equal(found, found.T)


@pytest.mark.slow
def test_every_unknown_moves_the_vehicle_as_the_jacobian_says():
    """Column by column, twist after a step by current, drag and inertia: within 3 % of differences."""
    rng = np.random.default_rng(0)
    mean, thrusts, dt = random_mean(rng), 0.3 * rng.normal(size=8), 0.005
    mean[7:13] *= 0.5

    def after(start):
        out, unused = start.copy(), np.zeros((ERRORS, ERRORS))
        predict(PACKED, ALLOCATION, out, unused, thrusts, REST, dt, SILENT, *STEADY)
        return out[7:13]

    expected, found = jacobian(after, mean), np.zeros((ERRORS, ERRORS))
    for j in range(CURRENT, GAINS):
        found = np.zeros((ERRORS, ERRORS))
        found[j, j] = 1.0
        predict(PACKED, ALLOCATION, mean.copy(), found, thrusts, REST, dt, SILENT, *STEADY)
        column = expected[:, j]
        np.testing.assert_allclose(found[6:12, j], column, atol=0.03 * np.abs(column).max() + 1e-6)


def test_lasting_errors_keep_their_spread():
    """Without measurements a Gauss-Markov error forgets what was known of it and ends at its stated spread."""
    rng = np.random.default_rng(0)
    spread, time_constants_s = np.full(ERRORS - CURRENT, 0.2), np.full(ERRORS - CURRENT, 0.1)
    mean, P = random_mean(rng), np.zeros((ERRORS, ERRORS))
    for _ in range(100):
        predict(PACKED, ALLOCATION, mean, P, np.zeros(8), REST, 0.01, SILENT, spread, time_constants_s)
    np.testing.assert_allclose(np.sqrt(np.diag(P)[CURRENT:]), 0.2, rtol=1e-6)
    assert np.abs(mean[1 + CURRENT :]).max() < 1e-3


def test_noise_adds_up_over_steps():
    """Two steps of 10 ms give the covariance of one of 20 ms, within what the motion's curvature leaves."""
    rng = np.random.default_rng(0)
    mean, noise = random_mean(rng), np.array([0.02, 0.2, 0.1, 0.01, 1e-3, 1e-2])
    once, twice = np.zeros((ERRORS, ERRORS)), np.zeros((ERRORS, ERRORS))
    predict(PACKED, ALLOCATION, mean.copy(), once, np.zeros(8), REST, 0.02, noise, *STEADY)
    walker = mean.copy()
    for _ in range(2):
        predict(PACKED, ALLOCATION, walker, twice, np.zeros(8), REST, 0.01, noise, *STEADY)
    np.testing.assert_allclose(np.diag(twice), np.diag(once), rtol=0.06)
    assert np.linalg.eigvalsh(twice).min() > -1e-15


def test_commands_are_followed_one_after_another():
    """Compiled like the readable twin: a step to each change, thrusts by their first-order lag, their mean as push."""
    rng = np.random.default_rng(0)
    lag_s, noise = rng.uniform(0.05, 0.2, size=8), np.array([0.02, 0.2, 0.1, 0.01, 1e-3, 1e-2])
    since_s, commands_N = np.array([0.0, 0.013, 0.02]), rng.normal(size=(3, 8))
    mean, P, thrusts_N = random_mean(rng), random_covariance(rng), rng.normal(size=8)
    found = mean.copy(), P.copy(), thrusts_N.copy()
    law = PACKED, ALLOCATION
    reached = advance(*law, lag_s, *found, REST, since_s, commands_N, 0.005, 0.03, noise, 3.0, *STEADY)
    loud = noise * np.array([3.0, 3.0, 3.0, 3.0, 1.0, 1.0])
    for command, begin_s, end_s in zip(commands_N, (0.005, 0.013, 0.02), (0.013, 0.02, 0.03), strict=True):
        dt_s = end_s - begin_s
        kept = np.exp(-dt_s / lag_s)
        push = command + (thrusts_N - command) * (lag_s / dt_s) * (1.0 - kept)
        predict(PACKED, ALLOCATION, mean, P, push, REST, dt_s, loud, *STEADY)
        thrusts_N = command + kept * (thrusts_N - command)
    assert reached == 0.03
    for one, other in zip(found, (mean, P, thrusts_N), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)


def test_a_command_of_the_future_holds_where_there_is_none_before():
    """As at the very start; and no time is no change."""
    rng = np.random.default_rng(0)
    mean, P, thrusts_N, lag_s = random_mean(rng), random_covariance(rng), np.zeros(8), np.full(8, 1e-9)
    rest = REST, np.array([1.0]), np.ones((1, 8))
    before = mean.copy()
    assert advance(PACKED, ALLOCATION, lag_s, mean, P, thrusts_N, *rest, 0.01, 0.01, SILENT, 1.0, *STEADY) == 0.01
    np.testing.assert_array_equal(mean, before)
    advance(PACKED, ALLOCATION, lag_s, mean, P, thrusts_N, *rest, 0.0, 0.01, SILENT, 1.0, *STEADY)
    np.testing.assert_allclose(thrusts_N, 1.0)

"""The network of the learned wake: what its coordinates promise holds whatever its weights are."""

from itertools import pairwise

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake.learned import EDGES, INPUTS, JetPoints, Network, history_bins, remembered

BINS = len(EDGES) - 1


def points(seed=0, n=40):
    rng = np.random.default_rng(seed)
    return JetPoints(x_D=rng.uniform(-5, 20, n), r_D=rng.uniform(0, 6, n))


def test_it_has_about_eighteen_thousand_weights():
    """The size of the paper's smallest good one."""
    assert Network.drawn(np.random.default_rng(0)).size == 17_982


def test_the_pass_forward_is_the_sum_over_units():
    """Matrices against loops over units, one row at a time."""
    network = Network.drawn(np.random.default_rng(1), hidden=(7, 5))
    inputs = points(n=3).inputs(np.random.default_rng(2).random((3, BINS)))
    for row, found in zip(inputs, network.forward(inputs), strict=True):
        values = list(row)
        for k, (w, b) in enumerate(zip(network.weights, network.biases, strict=True)):
            sums = [b[j] + sum(v * w[i, j] for i, v in enumerate(values)) for j in range(w.shape[1])]
            values = sums if k == 2 else [np.tanh(s) for s in sums]
        np.testing.assert_allclose(found, values, rtol=1e-12)


def test_a_bin_holds_the_mean_thrust_of_its_delays():
    """Against sums over a fine clock; what lies before the start counts as rest."""
    times, thrusts = np.array([0.0, 1.0, 2.5, 4.0]), np.array([1.0, 0.0, 3.0, 0.5])
    now, delays = 5.0, np.array([0.4, 1.0, 3.0])
    clock = np.arange(0.0005, 60.0, 0.001)
    for t, bins in zip(delays, history_bins(times, thrusts, now, delays, 3.0), strict=True):
        at = now - clock
        pushed = np.where(at > 0, thrusts[np.maximum(np.searchsorted(times, at, side="right") - 1, 0)], 0.0)
        means = [pushed[(clock > a * t) & (clock < b * t)].mean() / 3.0 for a, b in pairwise(EDGES)]
        np.testing.assert_allclose(bins, means, atol=5e-3)


def test_an_even_push_fills_every_bin():
    """So the form without history asks f with ones."""
    bins = history_bins(np.zeros(1), np.array([2.0]), 1000.0, np.array([0.1, 5.0]), 2.0)
    np.testing.assert_allclose(bins, np.ones((2, BINS)), rtol=1e-9)


def test_what_pushed_before_the_memory_is_forgotten():
    """And what begins later has not pushed yet."""
    times, thrusts = np.array([0.0, 1.0, 50.0]), np.array([9.0, 1.0, 5.0])
    assert remembered(times, thrusts, 40.0, 60.0) == 9.0
    assert remembered(times, thrusts, 40.0, 30.0) == 1.0
    assert remembered(times, thrusts, 51.0, 30.0) == 5.0
    assert remembered(times, thrusts, 0.0, 30.0) == 0.0


def test_inputs_stay_finite_at_and_behind_the_disk():
    """On the axis the part across is nil."""
    at = JetPoints(x_D=np.array([0.0, 3.0, -4.0, 500.0]), r_D=np.array([0.0, 0.0, 0.0, 3.0]))
    inputs = at.inputs(np.ones((4, BINS)))
    assert inputs.shape == (4, INPUTS)
    assert np.isfinite(inputs).all()
    assert (at.across_share[:3] == 0.0).all()


def test_weights_that_do_not_fit_or_are_not_finite_are_refused():
    """One line says which layer."""
    good = Network.drawn(np.random.default_rng(0), hidden=(4,))
    with pytest.raises(InputError, match="layer 0 has shapes"):
        Network(weights=(good.weights[0][1:], good.weights[1]), biases=good.biases)
    with pytest.raises(InputError, match="layer 1 holds NaN"):
        Network(weights=(good.weights[0], good.weights[1] * np.nan), biases=good.biases)

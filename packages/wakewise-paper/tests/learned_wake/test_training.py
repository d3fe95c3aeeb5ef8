"""The training of the learned wake: its gradient, and that it learns."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake.learned import Network, shape
from wakewise_paper.learned_wake.training import Batch, loss_and_gradient, train
from wakewise_paper.learned_wake.truth import even_lattice_rows


def lattice_batch(count=300):
    return Batch.of([even_lattice_rows("free", np.random.default_rng(0), count)], [1.0])


def test_the_gradient_is_that_of_the_loss():
    """Every layer against central differences."""
    network, batch = Network.drawn(np.random.default_rng(1), hidden=(6, 5)), lattice_batch(40)
    weights, biases = [w.copy() for w in network.weights], [b.copy() for b in network.biases]
    _, (by_weights, by_biases) = loss_and_gradient(weights, biases, batch)
    rng = np.random.default_rng(2)
    for values, slopes in ((weights, by_weights), (biases, by_biases)):
        for value, slope in zip(values, slopes, strict=True):
            for _ in range(4):
                at = tuple(rng.integers(0, n) for n in value.shape)
                kept, both = value[at], []
                for sign in (1.0, -1.0):
                    value[at] = kept + sign * 1e-6
                    both.append(loss_and_gradient(weights, biases, batch)[0])
                value[at] = kept
                assert slope[at] == pytest.approx((both[0] - both[1]) / 2e-6, rel=1e-4, abs=1e-9)


def test_training_and_use_pass_forward_alike():
    """The loss of the training is that of the model's own f."""
    rows = even_lattice_rows("free", np.random.default_rng(0), 50)
    network = Network.drawn(np.random.default_rng(1))
    batch = Batch.of([rows], [1.0])
    loss, _ = loss_and_gradient(list(network.weights), list(network.biases), batch)
    error = shape(network, rows.points, rows.history) - rows.f
    assert loss == pytest.approx(float(np.sum(batch.weights[:, None] * error**2)), rel=1e-12)


def test_it_learns_the_lattices_jet():
    """A small network takes nine tenths of the first loss away, and the same seed gives the same network."""
    batch = lattice_batch()
    start = Network.drawn(np.random.default_rng(1), hidden=(16, 16))
    found, losses = train(start, batch, np.random.default_rng(2), steps=600, rows=128, rate=1e-2)
    assert losses[-1] < 0.1 * losses[0]
    again, _ = train(start, batch, np.random.default_rng(2), steps=600, rows=128, rate=1e-2)
    np.testing.assert_array_equal(found.weights[0], again.weights[0])


def test_each_truth_has_its_share():
    """However many rows it has; an empty training is refused."""
    few, many = (even_lattice_rows("free", np.random.default_rng(k), n) for k, n in ((0, 30), (1, 300)))
    batch = Batch.of([few, many], [0.5, 0.5])
    soft = batch.weights * (0.3 + np.linalg.norm(batch.f, axis=1))
    assert soft[:30].sum() == pytest.approx(soft[30:].sum())
    with pytest.raises(InputError, match="0 truths"):
        Batch.of([], [])

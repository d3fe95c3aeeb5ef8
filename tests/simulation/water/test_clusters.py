"""Clusters of impulses: nearly the sum one by one, and the same bytes on any number of threads."""

import numpy as np

from wakewise.simulation.water import induction
from wakewise.simulation.water.clusters import ImpulseField
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.induction import impulse_velocity, spatial_order


def _jets():
    """Eight rows of parcels as jets leave them, with their images in a tank."""
    rng = np.random.default_rng(3)
    places, impulses, sigmas = [], [], []
    for _ in range(8):
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        reach = np.cumsum(0.02 + 0.002 * np.arange(40))
        origin = rng.uniform([-0.6, -0.6, 0.6], [0.6, 0.6, 1.0])
        row = origin + reach[:, None] * axis
        row[:, 2] = np.clip(row[:, 2], 0.05, 1.45)
        places.append(row)
        impulses.append(np.full((40, 1), 2e-5) * axis)
        sigmas.append(0.02 + 0.08 * reach)
    return TankFaces.of(1.5, (3.0, 2.5), surface=True).with_images(
        np.clip(np.concatenate(places), [-2.9, -2.4, 0.0], [2.9, 2.4, 1.5]),
        np.concatenate(impulses),
        np.concatenate(sigmas),
    )


def test_clusters_are_right_to_one_percent():
    """Against the sum one by one in double precision: the error's rms is within 1 % of the speed's."""
    sources = _jets()
    points = np.random.default_rng(0).uniform([-1, -1, 0.5], [1, 1, 1.5], (2000, 3))
    points = points[spatial_order(points)]
    exact = impulse_velocity(points, *sources, exact=True)
    error = ImpulseField.of(*sources).velocity(points) - exact
    assert ImpulseField.of(*sources).clusters > 20
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.01 * np.sqrt((exact**2).sum(axis=1).mean())


def test_threads_do_not_change_a_byte(monkeypatch):
    """One thread or four give the same velocities."""
    sources = _jets()
    points = np.random.default_rng(1).uniform([-1, -1, 0.5], [1, 1, 1.5], (3000, 3))
    field = ImpulseField.of(*sources)
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 10**12)
    alone = field.velocity(points)
    monkeypatch.setattr(induction, "_THREADED_PAIRS", 1)
    monkeypatch.setattr(induction, "cores", lambda: 4)
    assert field.velocity(points).tobytes() == alone.tobytes()


def test_few_impulses_are_summed_one_by_one():
    """Below the least number there are no clusters and no difference."""
    X, m, sigma = (a[:100] for a in _jets())
    points = np.random.default_rng(2).uniform(-1, 1, (300, 3))
    assert np.array_equal(ImpulseField.of(X, m, sigma).velocity(points), impulse_velocity(points, X, m, sigma))

"""The inner loop: exactly free of divergence, near the Gaussian, and the same on any path through the code."""

import numpy as np
import pytest
from scipy.special import gammainc

from wakewise.simulation.water.induction import FixedSources, impulse_velocity, smooth_share


def _some(count=30, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.5, 0.5, (count, 3)), rng.normal(0, 1e-3, (count, 3)), rng.uniform(0.03, 0.2, count)


def test_the_shape_is_a_gaussian_s():
    """A(q) is within 2e-4 of the Gaussian's everywhere, near and far."""
    q = np.logspace(-3, 4, 400)
    assert smooth_share(q) == pytest.approx(gammainc(1.5, q / 2) / (4 * np.pi * q**1.5), rel=2e-4)


def test_there_is_no_divergence():
    """In double precision, differences of fourth order sum to 1e-6 of the gradient or less."""
    points, h = np.random.default_rng(1).uniform(-0.6, 0.6, (100, 3)), 1e-3

    def u(shift):
        return impulse_velocity(points + shift, *_some(), exact=True)

    gradient = np.stack([(8 * (u(h * e) - u(-h * e)) - u(2 * h * e) + u(-2 * h * e)) / (12 * h) for e in np.eye(3)])
    assert np.abs(np.einsum("ini->n", gradient)).max() < 1e-6 * np.abs(gradient).max()


def test_single_precision_is_enough():
    """Single and double precision differ by less than 1e-5 of the largest speed."""
    points = np.random.default_rng(2).uniform(-3, 3, (500, 3))
    exact = impulse_velocity(points, *_some(), exact=True)
    assert np.abs(impulse_velocity(points, *_some()) - exact).max() < 1e-5 * np.abs(exact).max()


def test_a_source_gives_out_its_strength():
    """The flux through a sphere round a source of 1 m3/s is 1."""
    k = np.arange(4000) + 0.5
    z, turn = 1 - 2 * k / 4000, k * np.pi * (3 - 5**0.5)
    normals = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
    sources = FixedSources(np.array([[0.1, 0.0, -0.05]]), np.array([0.05]))
    u = sources.velocity(normals, np.ones(1))
    assert 4 * np.pi * np.einsum("ni,ni->n", u, normals).mean() == pytest.approx(1.0, rel=1e-3)

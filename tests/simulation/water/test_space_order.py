"""The order in which points are taken: neighbours follow each other, and Hilbert's curve is one."""

import numpy as np
import pytest

from wakewise.simulation.water.induction import curve, sorted_keys, spatial_order


def test_the_curve_visits_neighbours():
    """It comes to every cell of the cube once, and each step leads to a cell beside the last one."""
    cells = np.stack(np.meshgrid(*[np.arange(32)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    visited = cells[np.argsort(curve())]
    assert len(np.unique(curve())) == 32**3
    assert np.all(np.abs(np.diff(visited, axis=0)).sum(axis=1) == 1)


def test_keys_are_sorted_and_like_ones_stay():
    """As NumPy's stable sort, whichever byte tells keys apart."""
    key = np.random.default_rng(5).integers(0, 2**16, 3000).astype(np.uint16)
    key[::3] &= 0xFF00
    assert np.array_equal(sorted_keys(key), np.argsort(key, kind="stable"))


def test_the_order_in_space_is_an_order():
    """Every point comes once, and steps between neighbours in the list are short."""
    points = np.random.default_rng(4).uniform(0, 1, (4000, 3))
    order = spatial_order(points)
    assert np.array_equal(np.sort(order), np.arange(4000))
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    assert steps.mean() < 0.3 * np.linalg.norm(np.diff(points, axis=0), axis=1).mean()
    assert steps.mean() == pytest.approx(0.1, abs=0.06)

"""Means by cell equal their slow twin, whatever is added when."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.vision.reconstruction.dense.fusion import CellMeans


def slow_means(rows, weights, cell_m):
    """Mean row and number by cell, one after the other."""
    found = {}
    for row, weight in zip(rows, weights, strict=True):
        found.setdefault(tuple(np.floor(row[:3] / cell_m)), []).append((weight, row))
    means = [sum(w * r for w, r in found[cell]) / sum(w for w, _ in found[cell]) for cell in sorted(found)]
    return np.array(means), [sum(w for w, _ in found[cell]) for cell in sorted(found)]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), parts=st.integers(1, 5), spread=st.sampled_from([0.5, 5.0, 1e6]))
def test_means_equal_their_twin(seed, parts, spread):
    """Rows added in any number of parts give the twin's means, in order of the cells' places."""
    rng = np.random.default_rng(seed)
    rows, weights = spread * rng.normal(size=(200, 5)), rng.integers(1, 4, 200)
    cells = CellMeans(5, 0.3)
    for part in np.array_split(np.arange(200), parts):
        cells.add(rows[part], weights[part])
    means, counts = cells.means()
    wanted, numbers = slow_means(rows, weights, 0.3)
    assert np.allclose(means, wanted, rtol=1e-12, atol=1e-12 * spread) and counts.tolist() == numbers


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), spread=st.sampled_from([0.5, 5.0]))
def test_coarser_cells_hold_what_they_would_have_held_from_the_first(seed, spread):
    """Rows that came before and rows that come after are in the means and numbers of cells twice as large."""
    rng = np.random.default_rng(seed)
    rows, weights = spread * rng.normal(size=(200, 5)), rng.integers(1, 4, 200)
    cells = CellMeans(5, 0.3)
    cells.add(rows[:120], weights[:120])
    fine = len(cells)
    cells = cells.coarser()
    assert len(cells) <= fine
    cells.add(rows[120:], weights[120:])
    means, counts = cells.means()
    wanted, numbers = slow_means(rows, weights, 0.6)
    assert np.allclose(means, wanted, rtol=1e-12, atol=1e-12 * spread)
    assert counts.tolist() == numbers


def test_nothing_gives_nothing():
    """No rows, no cells."""
    means, counts = CellMeans(9, 1.0).means()
    assert means.shape == (0, 9) and len(counts) == 0

"""Few weighted points keep totals and first moments, and sum tubes better than where they started."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.scene.targets.region import (
    LIKENESS_M,
    _likeness_sums,
    cell_middles,
    centroidal,
    relaxed,
    reweighted,
    sampling_error_pct,
)


def blob(count=4000, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.15, 0.15, (count, 3)), rng.uniform(0.2, 1.0, count)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60), st.integers(0, 1000))
def test_cells_keep_total_and_first_moment(cells, seed):
    """Whatever the number of cells, a linear function is summed exactly."""
    points, weights = blob(60 + seed % 100, seed)
    middles, totals = cell_middles(points, weights, cells)
    assert np.all(totals > 0)
    assert totals.sum() == pytest.approx(weights.sum())
    np.testing.assert_allclose(totals @ middles, weights @ points, atol=1e-12)


def test_clusters_keep_total_and_first_moment_and_are_tighter_than_cells():
    """Lloyd's iteration is exact for linear functions and has less spread within clusters than equal cells."""
    points, weights = blob()

    def second_moment(middles, totals):
        return weights @ np.sum(points**2, axis=1) - totals @ np.sum(middles**2, axis=1)

    cells, clusters = cell_middles(points, weights, 50), centroidal(points, weights, 50)
    np.testing.assert_allclose(clusters[1] @ clusters[0], weights @ points, atol=1e-12)
    assert clusters[1].sum() == pytest.approx(weights.sum())
    assert 0 < second_moment(*clusters) < second_moment(*cells)


def test_points_at_one_place_are_no_trouble():
    """A cluster that nothing is nearest to does not become NaN."""
    middles, totals = centroidal(np.zeros((20, 3)), np.ones(20), 5)
    assert np.all(np.isfinite(middles))
    assert totals.sum() == pytest.approx(20.0)


def test_likeness_sums_are_the_formula_and_their_slope_its_derivative():
    """The kernel equals NumPy's double sum, and its gradient central differences."""
    points, weights = blob(40)
    at = points[:7] + 0.01
    values, slope = _likeness_sums(at, points, weights)
    r2 = np.sum((at[:, None] - points) ** 2, axis=2)
    np.testing.assert_allclose(values, (1 / (1 + r2 / LIKENESS_M**2)) @ weights, rtol=1e-12)
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        rise = _likeness_sums(at + step, points, weights)[0] - _likeness_sums(at - step, points, weights)[0]
        np.testing.assert_allclose(slope[:, k], rise / 2e-6, rtol=1e-5, atol=1e-6)


def tube_errors(points, weights, cells, cell_weights, seed=5, width_m=0.035):
    """Errors of sums of random Gaussian tubes, relative to the largest."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(300, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    through = rng.uniform(-0.15, 0.15, (300, 3))

    def sums(places, w):
        away = places[None] - through[:, None]
        along = np.einsum("tnk,tk->tn", away, axes)
        return np.exp(-(np.sum(away**2, axis=2) - along**2) / (2 * width_m**2)) @ w

    truth = sums(cells, cell_weights)
    return np.abs(sums(points, weights) - truth) / truth.max()


def test_relaxing_sums_tubes_better_and_keeps_the_total():
    """Random tubes, none of which the method has seen, are summed with a third less error than by clusters."""
    cells, cell_weights = blob(3000)
    start, weights = centroidal(cells, cell_weights, 80)
    place, w = relaxed(start, weights, np.ones(80, dtype=bool), cells, cell_weights)
    assert np.all(w > 0)
    assert w.sum() == pytest.approx(cell_weights.sum())
    before = np.sqrt(np.mean(tube_errors(start, weights, cells, cell_weights) ** 2))
    after = np.sqrt(np.mean(tube_errors(place, w, cells, cell_weights) ** 2))
    assert after < 0.67 * before


def test_held_points_stay_and_their_weights_improve():
    """Points that may not move do not; weights alone already sum tubes better."""
    cells, cell_weights = blob(3000)
    start, weights = centroidal(cells, cell_weights, 80)
    free = np.arange(80) >= 30
    place, _ = relaxed(start, weights, free, cells, cell_weights, rounds=5)
    np.testing.assert_array_equal(place[:30], start[:30])
    w = reweighted(start, weights, cells, cell_weights)
    assert w.sum() == pytest.approx(cell_weights.sum())
    before = np.mean(tube_errors(start, weights, cells, cell_weights) ** 2)
    assert np.mean(tube_errors(start, w, cells, cell_weights) ** 2) < before


def test_errors_are_relative_where_it_matters():
    """Relative to the reference, or to a thousandth of the largest where the reference is less."""
    errors = sampling_error_pct(np.array([1.01, 0.0, 0.0012]), np.array([1.0, 0.0001, 0.0015]))
    np.testing.assert_allclose(errors, [1.0, 10.0, 20.0])


@pytest.mark.parametrize("reference", [np.zeros(3), np.ones(2), np.array([1.0, np.nan, 1.0])])
def test_errors_against_nothing_are_refused(reference):
    """All zero, of another length, or NaN."""
    with pytest.raises(InputError, match="sampling error"):
        sampling_error_pct(np.ones(3), reference)

"""Displacements from image pairs: round trips of known fields, outliers, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.piv import averaged, correlate, displacements
from wakewise_paper.wake_piv import ShearFlow, round_trip


@pytest.mark.parametrize("flow", [ShearFlow(0.43, 0.0), ShearFlow(0.3, 1.0)], ids=["uniform", "shear"])
def test_the_correlation_meets_known_fields(flow):
    """Median error of a round trip is below 0.02 px, and 98 % of the vectors are valid."""
    trip = round_trip(flow, np.random.default_rng(1), size_px=384)
    assert trip.median_px < 0.02
    assert trip.valid_pct > 98.0


def test_a_shifted_picture_moves_by_the_shift():
    """Whole pixels, right and down, come back to within a hundredth, and windows sit at their centres."""
    rng = np.random.default_rng(3)
    wide = rng.uniform(0, 255, (300, 300))
    wide = (wide + np.roll(wide, 1, 0) + np.roll(wide, 1, 1) + np.roll(wide, -1, 0)) / 4
    first, second = wide[20:276, 20:276].astype(np.uint8), wide[18:274, 15:271].astype(np.uint8)
    found = correlate(first, second)
    inner = (slice(2, -2), slice(2, -2))
    np.testing.assert_allclose(np.median(found.right_px[inner]), 5.0, atol=0.01)
    np.testing.assert_allclose(np.median(found.down_px[inner]), 2.0, atol=0.01)
    assert found.columns_px[0] == 8.0
    assert found.columns_px[-1] == 248.0


def test_a_vector_unlike_its_neighbours_is_marked():
    """Where one picture holds noise alone, vectors are marked and averaging leaves them out."""
    rng = np.random.default_rng(5)
    first = rng.uniform(0, 255, (256, 256))
    first = ((first + np.roll(first, 1, 0) + np.roll(first, 1, 1)) / 3).astype(np.uint8)
    second = np.roll(first, 3, axis=1)
    second[96:160, 96:160] = rng.integers(0, 255, (64, 64))
    found = correlate(first, second)
    hole = np.ix_((found.rows_px > 104) & (found.rows_px < 152), (found.columns_px > 104) & (found.columns_px < 152))
    assert found.valid[hole].mean() < 0.6
    assert found.valid.mean() > 0.85
    clean = correlate(first, np.roll(first, 3, axis=1))
    both = averaged([found, clean])
    assert both.valid[hole].mean() > 0.9


def test_pictures_that_do_not_fit_are_refused():
    """No pairs, pairs of different sizes and pictures smaller than two windows are bad input."""
    small, large = np.zeros((64, 64), np.uint8), np.zeros((256, 256), np.uint8)
    for pairs in ([], [(large, large[:200])], [(small, small)]):
        with pytest.raises(InputError):
            displacements(pairs)
    with pytest.raises(InputError):
        correlate(large, large[:200])

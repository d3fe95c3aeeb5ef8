"""Shares within thresholds, and thresholds that suit the object."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.evaluation import read_thresholds, shares


def test_shares_are_counts_of_distances_below():
    """Two of four points and all of the truth within 1 mm: precision 50, recall 100, F their harmonic mean."""
    found = shares(np.array([0.1, 0.9, 1.0, 4.0]), np.array([0.2, 0.3]), (1.0, 5.0))
    assert (found[0].accuracy_pct, found[0].completeness_pct) == (50.0, 100.0)
    assert found[0].f_score == pytest.approx(200.0 / 3.0)
    assert found[1].f_score == 100.0
    assert shares(np.array([2.0]), np.array([2.0]), (1.0,))[0].f_score == 0.0


def test_thresholds_are_lengths_or_parts_of_the_object():
    """By default a hundredth and less of the extent; millimetres and percent may be mixed; others are refused."""
    assert read_thresholds(None, 36.0) == pytest.approx((0.09, 0.18, 0.36))
    assert read_thresholds("2, 0.5%,2", 100.0) == (0.5, 2.0)
    for words in ("", "0", "-1", "one", "1,,2", "nan", "1%%"):
        with pytest.raises(InputError, match="--thresholds"):
            read_thresholds(words, 100.0)

"""Several tests at once, held against statsmodels."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statsmodels.stats.multitest import multipletests

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.statistics import holm

P = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12)


@given(P)
def test_it_is_statsmodels(p):
    """Adjusted p-values agree, in whatever order they are given."""
    with patch("gc.collect"):  # which statsmodels calls each time: half a second where many modules are loaded
        theirs = multipletests(p, method="holm")[1]
    assert holm(p) == pytest.approx(theirs, abs=1e-12)


@given(P)
def test_holm_is_never_stricter_than_bonferroni(p):
    """And neither makes a p smaller."""
    assert np.all(holm(p) <= np.minimum(1.0, len(p) * np.asarray(p)) + 1e-15)
    assert np.all(holm(p) >= np.asarray(p) - 1e-15)


@pytest.mark.parametrize("p", [[1.2], [-0.1], [np.nan]])
def test_what_is_no_probability_is_refused(p):
    """A p-value lies between 0 and 1."""
    with pytest.raises(InputError, match="p-values"):
        holm(p)

"""Three hundred points stand for a hundred thousand."""

import pytest

from wakewise_benchmarks.disturbance import sampling_errors


@pytest.mark.slow
def test_disturbance_of_300_points_is_within_one_percent_of_100000():
    """Median error over poses on the worst coral, for the paper's model and, where it touches, for the narrow jet."""
    errors = sampling_errors(seed=0)
    assert errors["paper"]["worst"]["median_pct"] <= 1.0
    assert errors["paper"]["worst"]["touched_median_pct"] <= 1.0
    assert errors["jet"]["worst"]["touched_median_pct"] <= 1.0
    # One jet in twenty only grazes the region, and few points see it.
    assert errors["paper"]["worst"]["p95_pct"] <= 5.0
    assert errors["jet"]["worst"]["touched_p95_pct"] <= 10.0
    assert all(errors["jet"][kind]["touched_share"] > 0.2 for kind in ("branching", "brain", "plate"))

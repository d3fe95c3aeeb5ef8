"""Trials without figures, left out and counted as failures."""

import pytest

from wakewise.experiments.campaigns.statistics import as_worst, dropped

ROWS = [{"rmse_mm": 1.0}, None, {"rmse_mm": None}, {"rmse_mm": 3.0}, {"rmse_mm": float("nan")}]


def test_dropping_failures_flatters_and_counting_them_does_not():
    """Two of five models: their mean is 2 mm, that of all who set out 12.8 mm."""
    assert dropped(ROWS, "rmse_mm").tolist() == [1.0, 3.0]
    assert as_worst(ROWS, "rmse_mm").mean() == pytest.approx(12.8)
    assert as_worst([None, {"completeness_pct": 90.0}], "completeness_pct").tolist() == [0.0, 90.0]


def test_no_worst_is_made_up():
    """Nobody knows what a flight that failed would have cost."""
    with pytest.raises(KeyError):
        as_worst(ROWS, "energy_kJ")

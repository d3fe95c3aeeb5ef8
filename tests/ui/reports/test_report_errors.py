"""Laws of the measured model: it agrees with the score that evaluation gives."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from wakewise.ui.reports.errors import model_errors
from wakewise.ui.reports.trial import Trial, read_trial
from wakewise.vision.evaluation import Crop, evaluate_surface


@pytest.fixture(scope="module")
def trial(made_up: Path) -> Trial:
    """The made-up trial."""
    return read_trial(made_up)


def test_the_pictures_show_what_the_score_says(trial: Trial) -> None:
    """Same median, RMSE and completeness as `evaluate_surface`, up to the sampling of the truth."""
    errors = model_errors(trial)
    assert errors is not None
    assert errors.fine_aligned
    score = evaluate_surface(trial.cloud_m, trial.truth, crop=Crop(bed_z_m=trial.bed_z_m))
    assert 1e3 * np.median(errors.accuracy_m) == pytest.approx(score.accuracy_median_mm, rel=0.02)
    assert 1e3 * np.sqrt((errors.accuracy_m**2).mean()) == pytest.approx(score.rmse_mm, rel=0.02)
    assert errors.completeness_pct(0.003) == pytest.approx(score.completeness_pct, abs=0.5)
    assert errors.completeness_pct(0.001) == pytest.approx(score.completeness_1mm_pct, abs=0.5)


def test_what_touches_the_bed_does_not_count(trial: Trial) -> None:
    """Points less than a centimetre above the bed are neither model nor truth."""
    errors = model_errors(trial)
    assert errors is not None
    assert (errors.points_m[:, 2] < trial.bed_z_m - 0.0099).all()
    np.testing.assert_array_equal(errors.counts, trial.truth.vertices_m[:, 2] < trial.bed_z_m - 0.010)


def test_a_cloud_elsewhere_is_no_model(trial: Trial) -> None:
    """A cloud far from the truth cannot be measured, and says nothing rather than nonsense."""
    assert model_errors(dataclasses.replace(trial, cloud_m=trial.cloud_m + 5.0)) is None
    assert model_errors(dataclasses.replace(trial, cloud_m=None)) is None
    few = model_errors(dataclasses.replace(trial, cloud_m=trial.cloud_m[:5]))
    assert few is None or not few.fine_aligned

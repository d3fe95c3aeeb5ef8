"""The guide against a model: agreement is what it says, on models whose completeness is known."""

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.coverage import (
    agreement_with,
    coverage_figures,
    coverage_of,
    measure_coverage,
    shots_of,
)
from wakewise.operation import Parts, Scenario
from wakewise.scene.targets import Target


@pytest.fixture(scope="module")
def parts() -> Parts:
    return Scenario.preset("quick").parts()


@pytest.fixture(scope="module")
def photos(parts: Parts) -> pl.DataFrame:
    """Rows of images.csv as a flight on its route would leave them, without errors of the estimate."""
    rows = [
        {f"est_{axis}_m": X.p_m[i] for i, axis in enumerate("xyz")}
        | {f"est_q{axis}": X.q[i] for i, axis in enumerate("wxyz")}
        | {"sharpness": None if k == 0 else 40.0}
        for k, X in enumerate(parts.route.X_WC_planned)
    ]
    return pl.DataFrame(rows)


def surface_of(target: Target, keep: np.ndarray | None = None) -> np.ndarray:
    """A cloud on the target's surface, denser than the threshold."""
    middles = target.mesh.triangles_m.mean(axis=1)
    return middles if keep is None else middles[keep]


def test_a_whole_model_agrees_with_what_was_seen_well(parts: Parts, photos: pl.DataFrame) -> None:
    """Of a model that has everything all patches are complete; agreement is then the share of patches seen well."""
    coverage = coverage_of(parts.surveyed_target, parts.camera, shots_of(photos))
    both = agreement_with(coverage, parts, surface_of(parts.target))
    assert both.completeness_pct == 100.0
    assert both.trivial_pct == 100.0
    assert both.agreement_pct == pytest.approx(100.0 * coverage.well.mean(), abs=1.0)


def test_half_a_model_halves_the_agreement(parts: Parts, photos: pl.DataFrame) -> None:
    """A model without its northern half disagrees there, where photographs saw well."""
    middles = parts.target.mesh.triangles_m.mean(axis=1)
    south = middles[:, 0] < parts.target.centre_W_m[0]
    coverage = coverage_of(parts.surveyed_target, parts.camera, shots_of(photos))
    both = agreement_with(coverage, parts, surface_of(parts.target, south))
    assert 30.0 < both.completeness_pct < 75.0
    assert abs(both.agreement_pct - both.completeness_pct) < 15.0
    assert both.trivial_pct < 75.0


def test_what_was_not_photographed_and_is_not_there_agrees(parts: Parts, photos: pl.DataFrame) -> None:
    """Photographs of the south and a model of it: the guide tells most patches rightly, better than any guess."""
    middles = parts.target.mesh.triangles_m
    outward = np.cross(middles[:, 1] - middles[:, 0], middles[:, 2] - middles[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    some = photos.filter(pl.col("est_x_m") < float(parts.target.centre_W_m[0]) - 0.1)
    both = agreement_with(
        coverage_of(parts.surveyed_target, parts.camera, shots_of(some)),
        parts,
        surface_of(parts.target, outward[:, 0] < 0.3),
    )
    assert both.agreement_pct > 70.0


def test_figures_without_a_model_are_the_prediction_alone(parts: Parts, photos: pl.DataFrame) -> None:
    """What the guide expects does not hang on a model; how far that agrees does."""
    alone = coverage_figures(parts, photos, None)
    assert set(alone) == {"coverage_predicted_pct", "coverage_sure_pct"}
    assert alone["coverage_sure_pct"] <= alone["coverage_predicted_pct"]
    figures = coverage_figures(parts, photos, surface_of(parts.target))
    assert figures["coverage_predicted_pct"] == alone["coverage_predicted_pct"] > 90.0
    assert figures["coverage_agreement_pct"] > 90.0


def test_what_is_no_trial_with_a_model_is_refused(tmp_path) -> None:
    """The file that is missing is named."""
    with pytest.raises(InputError, match=r"has no scenario\.yaml"):
        measure_coverage(tmp_path)


def test_the_missions_own_viewpoints_cover_nine_tenths(parts: Parts) -> None:
    """The planned photographs show more than 90 % of the surveyed target well."""
    shots = [(X_WC, None) for X_WC in parts.route.X_WC_planned]
    assert coverage_of(parts.surveyed_target, parts.camera, shots).share > 0.9

"""Coverage by a surface that was mapped in flight, held against a model: in the truth's frame, patch by patch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import wakewise as ww
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.experiments.trials.coverage import mapped_figures
from wakewise.operation.finding import MISSED_RGB, SEEN_RGB, SURFACE_FILE
from wakewise.vision.evaluation import Crop, sample_surface
from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud

PARTS = ww.Scenario.preset("quick", world="payload").parts()
TRUTH = sample_surface(PARTS.target.mesh, Crop(bed_z_m=PARTS.target.bed_z_m), np.random.default_rng(1))
FEW = slice(None, None, 20)
POINTS, NORMALS = TRUTH.points_m[FEW], TRUTH.normals[FEW]
X_MW = Pose(np.array([0.02, -0.01, 0.01]), quat_from_euler(0.01, -0.01, 0.02))
"""The map's frame stands off the world's."""
HALF = POINTS[:, 0] > np.median(POINTS[:, 0])


def photographs() -> pl.DataFrame:
    """Places of the camera as they were and as the map has them."""
    true = PARTS.target.centre_W_m + np.random.default_rng(2).normal(0.0, 0.4, (12, 3))
    believed = X_MW.apply(true)
    columns = {f"true_{axis}_m": true[:, k] for k, axis in enumerate("xyz")}
    return pl.DataFrame(columns | {f"est_{axis}_m": believed[:, k] for k, axis in enumerate("xyz")})


@pytest.mark.parametrize(("said", "agrees"), [(HALF, (90.0, 100.0)), (~HALF, (0.0, 10.0))])
def test_patches_agree_where_the_model_has_what_was_said(
    tmp_path: Path, said: np.ndarray, agrees: tuple[float, float]
) -> None:
    """With half of the surface in the model: right for almost all patches, and wrong if told the other way."""
    colours = np.where(said[:, None], SEEN_RGB, MISSED_RGB)
    mapped = OrientedPointCloud(points_m=X_MW.apply(POINTS), normals=NORMALS @ X_MW.R.T, colours=colours)
    write_cloud(tmp_path / SURFACE_FILE, mapped)
    model = TRUTH.points_m[TRUTH.points_m[:, 0] > np.median(POINTS[:, 0])]
    found = mapped_figures(PARTS, tmp_path, photographs(), model)
    assert found["coverage_predicted_pct"] == pytest.approx(100.0 * said.mean())
    assert agrees[0] <= found["coverage_agreement_pct"] <= agrees[1]
    assert found["coverage_trivial_pct"] == pytest.approx(50.0, abs=10.0)


def test_without_a_model_only_what_was_said_is_told(tmp_path: Path) -> None:
    """Agreement needs a model."""
    colours = np.tile(SEEN_RGB, (len(POINTS), 1))
    write_cloud(tmp_path / SURFACE_FILE, OrientedPointCloud(points_m=POINTS, normals=NORMALS, colours=colours))
    assert mapped_figures(PARTS, tmp_path, photographs(), None) == {"coverage_predicted_pct": 100.0}

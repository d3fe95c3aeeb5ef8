"""A field of a trial is judged as its dense cloud is; that of another model says why it is not."""

import json

import numpy as np
import pytest

from wakewise.core.files import write_json
from wakewise.operation import load_scenario, write_scenario
from wakewise.vision.evaluation import Crop
from wakewise.vision.evaluation.cloud_to_surface import sample_surface
from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud
from wakewise_nerf import neural
from wakewise_nerf.field import PROFILES

ALIKE = {"device": "cpu", "mesh": True, "progress": lambda *_: None, "region": None}


def test_a_model_without_truth_has_no_score(tmp_path, monkeypatch):
    """Every figure of the surface is None with a reason; those of the field stay."""
    monkeypatch.setattr(
        neural, "build_field", lambda *_, **__: {"psnr_db": 20.0, "ssim": None, "why": {"ssim": "small"}}
    )
    assert not neural.is_trial(tmp_path)
    figures = neural.field_of_model(tmp_path, tmp_path, tmp_path, PROFILES["cpu"], **ALIKE)
    assert figures["psnr_db"] == 20.0 and figures["why"]["ssim"] == "small"
    missing = {key for key, value in figures.items() if value is None}
    assert {"rmse_mm", "completeness_pct", "dense_rmse_mm", "ssim"} <= missing
    assert missing == set(figures["why"])
    write_json(tmp_path / "figures.json", figures)


def test_points_of_a_trial_are_measured_against_the_truth(tmp_path, monkeypatch):
    """True points with 1 mm of noise score what they must; the region is the plan's; a missing dense cloud is said."""
    scenario = load_scenario("quick", None, {"world": "tank"})
    parts = scenario.parts()
    write_scenario(tmp_path / "scenario.yaml", scenario, {})
    (tmp_path / "images.csv").write_text("name,true_x_m,true_y_m,true_z_m\na,0.5,0,1.2\nb,-0.5,0,1.2\nc,0,0.5,1.2\n")
    rng = np.random.default_rng(0)
    surface = sample_surface(parts.target.mesh, Crop(bed_z_m=parts.target.bed_z_m), rng, 20_000)
    points = surface.points_m + 1e-3 * rng.normal(size=(len(surface.points_m), 1)) * surface.normals
    asked = {}

    def fake(folder, photos, out, settings, *, region, **others):
        asked["region"] = region
        write_cloud(
            out / "points.ply", OrientedPointCloud(points_m=points, normals=surface.normals, colours=0.5 + 0 * points)
        )
        return {"psnr_db": 25.0, "why": {}}

    monkeypatch.setattr(neural, "build_field", fake)
    assert neural.is_trial(tmp_path)
    out = tmp_path / "nerf"
    figures = neural.field_of_trial(tmp_path, tmp_path / "images", out, PROFILES["cpu"], **ALIKE)
    np.testing.assert_allclose(asked["region"][0], parts.surveyed_target.centre_W_m)
    assert asked["region"][1] > parts.target.radius_m
    assert figures["rmse_mm"] == pytest.approx(1.0, abs=0.35)
    assert figures["completeness_pct"] > 95.0 and figures["success"] is True
    assert figures["dense_rmse_mm"] is None and figures["why"]["dense_rmse_mm"] == "the trial left no dense.ply"
    assert json.loads((out / "metrics.json").read_text()) == figures

"""What a trial keeps for a page; a trial without a model or without photographs is no fault."""

import json

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.experiments.campaigns.pictures import MODEL, keep_pictures, photographs_of
from wakewise.scene.targets import Mesh
from wakewise.scene.targets.target import place_on_bed
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, write_cloud

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
TARGET = place_on_bed("ball", Mesh(BALL.vertices + np.array([0.0, 0.0, 0.1]), BALL.faces), 2.0)


@pytest.fixture
def places(tmp_path):
    """A trial's folder, and the one that keeps."""
    trial, folder = tmp_path / "trial", tmp_path / "kept"
    (trial / "images").mkdir(parents=True)
    folder.mkdir()
    return trial, folder


def photographed(trial, times_s):
    """Photographs at these times, each of its own grey."""
    rows = ["name,time_s"]
    for k, time_s in enumerate(times_s):
        cv2.imwrite(str(trial / "images" / f"{k}.png"), np.full((300, 400, 3), 20 * k, dtype=np.uint8))
        rows.append(f"{k}.png,{time_s}")
    (trial / "images.csv").write_text("\n".join(rows) + "\n")


def test_three_photographs_stay_small(places):
    """Those nearest to 0, 5 and 10 s after the first."""
    trial, folder = places
    photographed(trial, [7.0, 9.0, 12.5, 14.0, 16.4, 30.0])
    keep_pictures(TARGET, trial, folder)
    kept = photographs_of(folder)
    assert [after_s for after_s, _ in kept] == pytest.approx([0.0, 5.5, 9.4])
    greys = [int(cv2.imread(str(path)).mean()) for _, path in kept]
    assert greys == pytest.approx([0, 40, 80], abs=2)
    assert all(cv2.imread(str(path)).shape[1] == 480 for _, path in kept)
    assert not (folder / MODEL).exists()


def test_a_model_stays_with_its_errors(places):
    """Points 1 mm off the truth are kept as such."""
    trial, folder = places
    points, normals = BALL.vertices * 1.01 + np.array([0.0, 0.0, 1.9]), BALL.vertex_normals
    write_cloud(
        trial / "dense.ply", OrientedPointCloud(points_m=points, normals=normals, colours=np.full_like(points, 0.5))
    )
    keep_pictures(TARGET, trial, folder)
    with np.load(folder / MODEL) as kept:
        assert kept["points_m"].shape[0] == kept["error_mm"].shape[0] > 100
        assert np.median(np.abs(kept["error_mm"])) < 2.0


@pytest.mark.parametrize("images", ["none", "no table"])
def test_a_trial_that_took_no_photograph_keeps_nothing(places, images):
    """And does not fail by it."""
    trial, folder = places
    if images == "none":
        photographed(trial, [])
    keep_pictures(TARGET, trial, folder)
    assert list(folder.iterdir()) == [] and photographs_of(folder) == []


def test_a_broken_list_of_photographs_is_none(tmp_path):
    """A page shows what it can."""
    (tmp_path / "photographs.json").write_text("{")
    assert photographs_of(tmp_path) == []
    (tmp_path / "photographs.json").write_text(json.dumps([]))
    assert photographs_of(tmp_path) == []

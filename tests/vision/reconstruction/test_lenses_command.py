"""Two cameras of one pixel size, from the folder of photographs to the words on the screen."""

import json

import cv2
import numpy as np
import pytest
import relief

from wakewise.ui.cli.main import run
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction.sfm.colmap import pycolmap

FAST = ["--no-mesh", "--set", "detector=opencv", "--set", "max_features=1500", "--set", "stereo_partners=1"]
CAMERA = "1 SIMPLE_PINHOLE 320 240 {focal:g} 160 120\n"


def longer(image):
    """The middle two thirds, as a lens of 1.5 times the focal length takes it."""
    return cv2.resize(image[40:200, 54:267], (320, 240), interpolation=cv2.INTER_CUBIC)


def off_pct(sparse, truth):
    """Error of the cameras after the similarity, rms, in percent of their spread."""
    model = pycolmap.Reconstruction(sparse)
    found = {image.name: image.projection_center() for image in model.images.values() if image.has_pose}
    a, b = (np.array([centres[n] for n in sorted(found)]) for centres in (found, truth))
    error = np.linalg.norm(umeyama(a, b).apply(a) - b, axis=1)
    return 100.0 * np.sqrt((error**2).mean() / ((b - b.mean(axis=0)) ** 2).sum(axis=1).mean())


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """Two folders of photographs of one relief, the right one's lens half as long again; the true places by name."""
    monkeypatch.chdir(tmp_path)
    taken = relief.take_photos(tmp_path / "taken", 12)
    truth = {}
    for side in ("left", "right"):
        (tmp_path / "photos" / side).mkdir(parents=True)
    for k, (name, X_WC) in enumerate(taken.items()):
        image = cv2.imread(str(tmp_path / "taken" / name))
        side = ("left", "right")[k % 2]
        cv2.imwrite(str(tmp_path / "photos" / side / name), longer(image) if k % 2 else image)
        truth[f"{side}/{name}"] = X_WC.p_m
    return truth


@pytest.mark.slow
def test_each_lens_gets_its_camera_and_is_told_with_its_photos(rig, tmp_path, capsys):
    """A camera per folder: each begins from its own, cameras within 1 % of the spread, photos named by lens."""
    for side, focal in (("left", relief.FOCAL), ("right", 1.5 * relief.FOCAL)):
        (tmp_path / f"{side}.txt").write_text(CAMERA.format(focal=focal))
    cameras = ["--camera", "left=left.txt", "--camera", "right=right.txt"]
    (tmp_path / "photos" / "left" / "dive.MP4").write_bytes(b"film")
    (tmp_path / "photos" / "right" / "08.heic").write_bytes(b"other")
    assert run(["reconstruct", "photos", "--out", "model", *cameras, *FAST, "--json"]) == 0
    said = capsys.readouterr()
    figures = json.loads(said.out)
    assert [one["name"] for one in figures["lenses"]] == ["left", "right"]
    assert all({photo.split("/")[0] for photo in one["photos"]} == {one["name"]} for one in figures["lenses"])
    assert figures["lenses"][1]["focal_px"] / figures["lenses"][0]["focal_px"] == pytest.approx(1.5, rel=0.01)
    assert figures["registered_images"] == 12 and not figures["lenses_split"]
    assert figures["warnings"] == [] and figures["reprojection_met"]
    assert off_pct("model/sparse", rig) < 1.0
    assert said.err.startswith("wakewise: files that are not read: 1 of video, 1 of HEIC;")
    assert figures["passed_over"] == {"video": 1, "HEIC": 1}
    assert "lens left, " in said.err and "lens right, " in said.err


def test_a_camera_of_no_lens_is_refused_before_anything_runs(rig, capsys):
    """The lenses that there are stand in the message."""
    assert run(["reconstruct", "photos", "--out", "model", "--camera", "top=gone.txt"]) == 2
    assert "gone.txt" in capsys.readouterr().err

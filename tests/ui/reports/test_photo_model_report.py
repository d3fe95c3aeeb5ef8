"""The report of a model from photographs: said from its files, whole in one page."""

import json

import cv2
import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.ui.reports.photo_model import write_model_report
from wakewise.ui.reports.photo_model.page import match_figure, model_page, model_scene, model_up
from wakewise.vision.reconstruction.quality.photo_statistics import ModelStatistics, PhotoStatistics


def fact(name, placed=True):
    return PhotoStatistics(
        name=name,
        R_WC=np.diag([1.0, -1.0, -1.0]) if placed else None,
        p_WC=np.array([0.1 * len(name), 0.0, 1.0]) if placed else None,
        features=500,
        observations=200 if placed else 0,
        error_px=0.4 if placed else None,
        focal_px=600.0,
        fov_deg=40.0,
        aspect=4 / 3,
    )


FACTS = ModelStatistics(
    photos=(fact("a.jpg"), fact("bb.jpg"), fact("<c>.jpg", placed=False)),
    matches=np.array([[0, 90, 0], [90, 0, 7], [0, 7, 0]]),
    points=np.random.default_rng(0).normal(size=(50, 3)) * 0.1,
    colours=np.full((50, 3), 0.5),
)
BAR = {"name": "3-7", "length_m": 0.5, "sigma_m": 0.0005, "found_m": 0.501, "off_mm": 1.0, "off_pct": 0.2,
       "check_pct": 0.4, "photos": 5}  # fmt: skip
TARGET = {"target": 3, "photos": 5, "error_px": 0.2, "sides_mm": [40, 40, 40, 40], "corner_sigma_mm": 0.1,
          "middle_m": [0, 0, 1]}  # fmt: skip
FIGURES = {
    "images": 3, "registered_images": 2, "warnings": [], "reprojection_px": 0.41, "reprojection_uncut_px": 0.55,
    "cut_pct": 4.0, "points": 12_345, "track_length": 3.2, "dense_points": None, "mesh_faces": None, "mapping": "x",
    "point_spacing_mm": None, "scale": None, "duplicates": 0, "sub_models": [2], "passed_over": {"video": 1},
    "left_out": [{"name": "<c>.jpg", "partner": "bb.jpg", "matches": 7}], "stages_s": {"map": 3.0},
    "scale_bars": {"used": True, "uncertainty_pct": 0.12, "model_off_pct": 0.0, "family": "aruco_4x4", "bars": [BAR],
                   "targets": [TARGET]},
    "why": {"scale": "no reference cameras"},
}  # fmt: skip


def test_the_page_says_what_the_files_say():
    """Verdict, bars, each photograph, what was cut; names of files are text, not markup."""
    page = model_page("reef", FIGURES, FACTS, None)
    assert "A sound model of 2 of 3 photographs" in page
    assert "0.55 px with outliers (4 %)" in page
    assert "500.00 ± 0.50 mm" in page
    assert "+1.00 mm" in page
    assert "none; 7 matches with bb.jpg" in page
    assert "&lt;c&gt;.jpg" in page
    assert "<c>" not in page
    assert "no reference cameras" in page
    doubtful = model_page("reef", FIGURES | {"warnings": ["a mirror"], "scale_bars": None}, FACTS, None)
    assert "The model is doubtful" in doubtful
    assert "a mirror" in doubtful
    assert "The model has no scale" in doubtful


def test_up_is_where_pictures_or_backs_of_cameras_point():
    """Level cameras have their own up; cameras that look down in every turn have it against their sight."""
    assert model_up(FACTS) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    turns = [
        np.array([[np.cos(a), 0, np.sin(a)], [-np.sin(a), 0, np.cos(a)], [0, -1, 0]]) for a in (0.0, 1.6, 3.1, 4.7)
    ]
    level = [Pose.from_matrix(R, np.zeros(3)) for R in turns]
    turned = ModelStatistics(
        photos=tuple(
            PhotoStatistics(**{**vars(fact("a")), "R_WC": pose.R}) for pose in level
        ), matches=FACTS.matches, points=FACTS.points, colours=FACTS.colours
    )  # fmt: skip
    assert abs(model_up(turned)[2]) == pytest.approx(1.0, abs=1e-6)
    assert match_figure(FACTS.matches) is not None
    assert match_figure(np.zeros((1, 1), dtype=np.int64)) is None


def test_a_folder_becomes_a_page_with_the_scene(tmp_path):
    """Scene of points and cameras without a network; a folder without a model is refused."""
    for photo in FACTS.photos[:2]:
        cv2.imwrite(str(tmp_path / photo.name), np.full((60, 80, 3), 90, np.uint8))
    html = model_scene(tmp_path, tmp_path, FACTS)
    assert html is not None
    assert len(html) > 100_000
    with pytest.raises(InputError, match="holds no reconstruction"):
        write_model_report(tmp_path, tmp_path)
    (tmp_path / "reconstruction.json").write_text(json.dumps(FIGURES))
    with pytest.raises(InputError, match="holds no model"):
        write_model_report(tmp_path, tmp_path)

"""Metres by bars: on rendered photographs, and what is refused."""

import json

import cv2
import numpy as np
import pytest
import tagged_relief as scene

from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.vision.reconstruction.photos.photo_folder import PhotoStore
from wakewise.vision.reconstruction.scale import ScaleBar, ScaleBars
from wakewise.vision.reconstruction.scale.marks import find_board
from wakewise.vision.reconstruction.scale.stage import scale_model
from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

UNIT_M = 0.137


def bar(one, two, times=1.0):
    return ScaleBar(ends=(one, two), length_m=times * scene.bar_m(one, two), sigma_m=1e-4)


GOOD = (bar(3, 20), bar(7, 12))


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tagged")
    return folder, scene.take_photos(folder, which=(0, 2, 5, 7))


@pytest.fixture
def sparse(photos, tmp_path):
    scene.true_model(tmp_path / "sparse", photos[1], UNIT_M)
    return tmp_path / "sparse"


def test_two_bars_give_metres_within_a_thousandth(photos, sparse):
    """A model in units of 137 mm comes back with its cameras where they were; family found, bars agree, and again."""
    folder, truth = photos
    said = scale_model(PhotoStore(folder), sparse, ScaleBars(bars=GOOD, tag_m=scene.TAG_M), 2, no_progress)[
        "scale_bars"
    ]
    centres = camera_centres(sparse)
    for one in centres:
        for two in centres:
            if one < two:
                wanted = np.linalg.norm(truth[one].p_m - truth[two].p_m)
                assert np.linalg.norm(centres[one] - centres[two]) == pytest.approx(wanted, rel=1e-3)
    assert said["family"] == "apriltag_36h11"
    assert said["uncertainty_pct"] < 0.2
    assert all(abs(one["off_mm"]) < 0.25 for one in said["bars"])
    assert {one["target"] for one in said["targets"]} == set(scene.TARGETS)
    assert all(side == pytest.approx(1e3 * scene.TAG_M, rel=0.02) for t in said["targets"] for side in t["sides_mm"])
    assert json.dumps(said)
    again = scale_model(
        PhotoStore(folder), sparse, ScaleBars(bars=GOOD, family="apriltag_36h11"), 2, no_progress, keep=True
    )["scale_bars"]
    assert not again["used"]
    assert abs(again["model_off_pct"]) < 1e-6


def test_what_cannot_give_a_scale_is_said_in_a_line(photos, sparse, tmp_path):
    """A target nobody sees, one seen once, bars that disagree, another printed size: named, the model as it was."""
    folder, truth = photos
    before = camera_centres(sparse)
    known = {"family": "apriltag_36h11"}
    store = PhotoStore(folder)
    for bars, words in (
        (
            ScaleBars(bars=(bar(3, 20), ScaleBar(ends=(3, 99), length_m=0.1, sigma_m=1e-4)), **known),
            "target 99 .* in no regist",
        ),
        (ScaleBars(bars=(bar(3, 20), bar(7, 12, 1.04)), **known), r"3-20 and 7-12 differ by 4\.. %"),
        (ScaleBars(bars=GOOD, tag_m=0.040, **known), r"3[56]\.\d mm by the bars, 40 mm were"),
        (ScaleBars(bars=(bar(3, 20),), family="aruco_7x7"), "seen are none"),
    ):
        with pytest.raises(InputError, match=words):
            scale_model(store, sparse, bars, 2, no_progress)
    once = tmp_path / "once"
    once.mkdir()
    for k, path in enumerate(sorted(folder.iterdir())):
        image = cv2.imread(str(path))
        if k:  # a hand over target 7 in all photographs but one
            X_WC = truth[path.name]
            x, y, z = (np.array([*scene.TARGETS[7], 1.0]) - X_WC.p_m) @ X_WC.R
            place = scene.FOCAL * np.array([x, y]) / z + np.array([scene.WIDTH, scene.HEIGHT]) / 2
            cv2.circle(image, tuple(int(v) for v in place), 45, (90, 90, 90), -1)
        cv2.imwrite(str(once / path.name), image)
    with pytest.raises(InputError, match=r"target 7 is seen in one photo only \(00\.png\)"):
        scale_model(PhotoStore(once), sparse, ScaleBars(bars=GOOD, **known), 2, no_progress)
    after = camera_centres(sparse)
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_a_board_is_found_with_its_places(tmp_path):
    """Corners of a drawn ChArUco board come back at their pixels, numbered as its places in m."""
    from wakewise.vision.reconstruction import CalibrationBoard

    board = CalibrationBoard(columns=6, rows=5, square_m=0.03, marker_m=0.022)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
    drawn = cv2.aruco.CharucoBoard((6, 5), 0.03, 0.022, dictionary).generateImage((600, 500))
    page = np.full((640, 760), 255, np.uint8)
    page[70:570, 80:680] = drawn
    cv2.imwrite(str(tmp_path / "a.png"), page)
    places, seen = find_board(PhotoStore(tmp_path), ["a.png"], board, no_progress)
    assert len(seen) == len(places) == 20
    for number, by in seen.items():
        wanted = np.array([80.0, 70.0]) + places[number][:2] / 0.03 * 100.0
        assert np.abs(by["a.png"][0] - wanted).max() < 1.0

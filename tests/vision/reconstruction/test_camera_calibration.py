"""Calibration from drawn boards with a known camera; what is no board is told."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.ui.cli.main import run
from wakewise.vision.reconstruction import CalibrationBoard, calibrate, read_lens
from wakewise.vision.reconstruction.photos.calibration import APRILTAG, board_detector

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
BOARD = CalibrationBoard(columns=7, rows=5, square_m=0.03, marker_m=0.022)
K = np.array([[700.0, 0, 319.5], [0, 700.0, 239.5], [0, 0, 1]])


TURNS = [(0, 25, 0), (25, 0, 10), (-25, 10, 0), (10, -28, -15), (-18, -18, 5), (20, 20, 90)]


def draw(folder, turns, family="DICT_5X5_1000"):
    """Photographs of the board by a pinhole camera: homographies of its printed image."""
    folder.mkdir()
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family))
    printed = cv2.aruco.CharucoBoard((7, 5), 0.03, 0.022, dictionary).generateImage((1050, 750))
    # Printed pixel to board metres: 150 px a square, corner to corner.
    to_board = np.array([[0.0002, 0, 0.0001], [0, 0.0002, 0.0001], [0, 0, 1]])
    for k, (rx, ry, rz) in enumerate(turns):
        R = cv2.Rodrigues(np.radians(np.array([rx, ry, rz], dtype=float)))[0]
        t = np.array([0.0, 0.0, 0.42]) - R @ [0.105, 0.075, 0.0]
        H = K @ np.column_stack([R[:, 0], R[:, 1], t]) @ to_board
        photo = cv2.warpPerspective(printed, H, (640, 480), flags=cv2.INTER_AREA, borderValue=200)
        cv2.imwrite(str(folder / f"{k}.png"), cv2.GaussianBlur(photo, (0, 0), 0.7))


@pytest.fixture(scope="module")
def boards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boards") / "photos"
    draw(folder, TURNS)
    return folder


def test_the_camera_that_drew_them_is_found(boards):
    """Focal length to 1 %, a residual of a few tenths of a pixel, no model worse than a simpler one."""
    found = calibrate(boards, BOARD)
    assert found.dictionary == "DICT_5X5_1000"
    assert found.photos == 6 and found.corners > 100
    assert found.focal_x_px == pytest.approx(700.0, rel=0.01)
    assert found.residual_px < 0.4
    residuals = list(found.residuals_px.values())
    assert residuals == sorted(residuals, reverse=True) or np.ptp(residuals) < 0.05
    assert set(found.summary()["photo_residual_px"]) == {f"{k}.png" for k in range(6)}


def test_what_is_no_board_is_told(tmp_path, boards):
    """No photos, no markers, another board, photos of different sizes, silly boards and models: one line each."""
    with pytest.raises(InputError, match="holds no photos"):
        calibrate(tmp_path, BOARD)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((60, 80), 90, np.uint8))
    with pytest.raises(StageError, match="no marker"):
        calibrate(tmp_path, BOARD)
    cv2.imwrite(str(tmp_path / "3.png"), np.full((60, 90), 90, np.uint8))
    with pytest.raises(InputError, match="one camera has one size"):
        calibrate(tmp_path, BOARD)
    with pytest.raises(InputError, match="allowed are pinhole"):
        calibrate(boards, BOARD, "magic")
    with pytest.raises(InputError, match="at least 2 x 2"):
        CalibrationBoard(columns=1, rows=5, square_m=0.03, marker_m=0.02)
    with pytest.raises(InputError, match="markers must"):
        CalibrationBoard(columns=7, rows=5, square_m=0.03, marker_m=0.03)


@pytest.mark.slow
def test_real_boards_behind_an_aquarium_wall():
    """Twelve real photographs through a wall with a strongly bending lens: half a pixel is left, a pinhole leaves 3."""
    folder = DATA / "charuco_aquarium" / "Example_data" / "worst_case_distortion"
    if not folder.is_dir():
        pytest.skip("charuco_aquarium is not among the shared data")
    found = calibrate(folder, CalibrationBoard(columns=11, rows=8, square_m=0.008, marker_m=0.006))
    assert found.photos == 12
    assert found.residual_px < 0.5
    assert found.residuals_px["pinhole"] > 2.0


@pytest.mark.slow
def test_what_is_no_file_among_the_photos_is_let_be(boards, tmp_path):
    """A pipe, a folder and a hidden file beside the photos are not waited for nor read."""
    for k in range(3):
        (tmp_path / f"{k}.png").write_bytes((boards / f"{k}.png").read_bytes())
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / ".hidden.png").touch()
    assert calibrate(tmp_path, BOARD).photos == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    "family",
    [
        "DICT_6X6_1000",
        "DICT_ARUCO_ORIGINAL",
        *APRILTAG,
    ],
)
def test_the_family_of_the_markers_is_found(family, tmp_path):
    """ArUco's and AprilTag's, by the corners that the board has with it."""
    draw(tmp_path / "photos", TURNS[:1], family)
    grey = cv2.imread(str(tmp_path / "photos" / "0.png"), cv2.IMREAD_GRAYSCALE)
    name, detector = board_detector([grey], BOARD)
    assert name == family
    assert len(detector.detectBoard(grey)[1]) == 24


def test_another_board_or_too_few_photos_say_what_is_seen(boards, tmp_path):
    """Markers, their family and numbers, and what the board that was named would have."""
    (tmp_path / "0.png").write_bytes((boards / "0.png").read_bytes())
    with pytest.raises(
        StageError, match=r"is found in 1 of 1 photos, at least 3 .*; seen are markers of DICT_5X5_1000"
    ):
        calibrate(tmp_path, BOARD)
    with pytest.raises(StageError) as fault:
        calibrate(tmp_path, CalibrationBoard(columns=4, rows=3, square_m=0.03, marker_m=0.022))
    assert "seen are markers of DICT_5X5_1000, 17 in a photo and numbered up to 16" in str(fault.value)
    assert "a board of 4 x 3 squares has 6, numbered up to 5: does --board give its squares?" in str(fault.value)


@pytest.mark.slow
def test_what_calibrate_writes_reconstruct_begins_with(boards, tmp_path, capsys):
    """As JSON and as COLMAP's cameras.txt: one camera, whose four coefficients were fitted to the same corners."""
    for name in ("cal.json", "cameras.txt"):
        out = tmp_path / name
        arguments = ["calibrate", str(boards), "--board", "7x5", "--square-mm", "30", "--marker-mm", "22"]
        assert run([*arguments, "--out", str(out)]) == 0
        assert f"--camera {out}" in capsys.readouterr().out
        lens = read_lens(out)
        assert (lens.width, lens.height) == (640, 480)
        assert lens.params[:4] == pytest.approx([700.0, 700.0, 320.0, 240.0], rel=0.02)
    found = json.loads((tmp_path / "cal.json").read_text(encoding="utf-8"))
    assert found["colmap"]["model"] == "OPENCV"
    assert found["colmap"]["residual_px"] == pytest.approx(found["residuals_px"]["opencv"])
    assert read_lens(tmp_path / "cal.json").params == pytest.approx(lens.params)
    assert run(["calibrate", str(boards), "--out", str(tmp_path)]) == 2
    assert "a file is needed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is no whole JSON"),
        ("[1, 2]", "is no calibration; COLMAP's cameras.txt with one camera, or the JSON of `wakewise calibrate"),
        ('{"a": 1}', "is no calibration"),
        ('{"focal_x_px": 700.0}', "earlier version, calibrate again"),
        (
            '{"colmap": {"model": "OPENCV", "width": 640, "height": 480, "params": [1, 2]}}',
            "2 parameters, OPENCV has 8",
        ),
        ('{"colmap": {"model": "OPENCV", "width": "640", "height": 480, "params": []}}', "must hold model"),
        ('{"colmap": {"model": "MAGIC", "width": 640, "height": 480, "params": []}}', "must hold model"),
        ('{"colmap": {"model": "PINHOLE", "width": 640, "height": 480, "params": [1, 2, 3, "x"]}}', "must hold model"),
        ('{"colmap": {"model": "PINHOLE", "width": 640, "height": 480, "params": [NaN, 2, 3, 4]}}', "all finite"),
        ('{"colmap": {"model": "PINHOLE", "width": 0, "height": 480, "params": [1, 2, 3, 4]}}', "must be above 0"),
    ],
)
@pytest.mark.parametrize("look", [[], ["--look"]], ids=["model", "look"])
def test_a_json_that_is_no_camera_is_refused_in_words(text, words, look, boards, tmp_path, capsys):
    """Before anything is made, by a look at the photographs, too."""
    (tmp_path / "cal.json").write_text(text, encoding="utf-8")
    out, camera = str(tmp_path / "out"), str(tmp_path / "cal.json")
    assert run(["reconstruct", str(boards), "--out", out, "--camera", camera, *look]) == 2
    told = capsys.readouterr()
    assert words in told.err and told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--camera", "--cameras", "--reference-cameras", "--lens", "--bars", "--fixes"])
def test_a_look_swallows_no_bad_file(option, boards, tmp_path, capsys):
    """Whatever the look itself has no need of."""
    (tmp_path / "bad.txt").write_text("hello", encoding="utf-8")
    arguments = [
        "reconstruct",
        str(boards),
        "--out",
        str(tmp_path / "out"),
        "--look",
        option,
        str(tmp_path / "bad.txt"),
    ]
    assert run(arguments) == 2
    assert capsys.readouterr().err.startswith("wakewise: ")

"""Calibration from drawn boards with a known camera; what is no board is told."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.errors import InputError, StageError
from wakewise.reconstruction import Board, calibrate

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))
BOARD = Board(columns=7, rows=5, square_m=0.03, marker_m=0.022)
K = np.array([[700.0, 0, 319.5], [0, 700.0, 239.5], [0, 0, 1]])


def draw(folder, turns):
    """Photographs of the board by a pinhole camera: homographies of its printed image."""
    folder.mkdir()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
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
    draw(folder, [(0, 25, 0), (25, 0, 10), (-25, 10, 0), (10, -28, -15), (-18, -18, 5), (20, 20, 90)])
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
        Board(columns=1, rows=5, square_m=0.03, marker_m=0.02)
    with pytest.raises(InputError, match="markers must"):
        Board(columns=7, rows=5, square_m=0.03, marker_m=0.03)


@pytest.mark.slow
def test_real_boards_behind_an_aquarium_wall():
    """Twelve real photographs through a wall with a strongly bending lens: half a pixel is left, a pinhole leaves 3."""
    folder = DATA / "charuco_aquarium" / "Example_data" / "worst_case_distortion"
    if not folder.is_dir():
        pytest.skip("charuco_aquarium is not among the shared data")
    found = calibrate(folder, Board(columns=11, rows=8, square_m=0.008, marker_m=0.006))
    assert found.photos == 12
    assert found.residual_px < 0.5
    assert found.residuals_px["pinhole"] > 2.0


def test_what_is_no_file_among_the_photos_is_let_be(boards, tmp_path):
    """A pipe, a folder and a hidden file beside the photos are not waited for nor read."""
    for photo in boards.iterdir():
        (tmp_path / photo.name).write_bytes(photo.read_bytes())
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / ".hidden.png").touch()
    assert calibrate(tmp_path, BOARD).photos == 6

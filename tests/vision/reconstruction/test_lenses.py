"""A calibrated camera is read from COLMAP's file, and what it bends is undone."""

import numpy as np
import pycolmap
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.imaging import ImagingSettings, calibrate
from wakewise.vision.reconstruction import read_lens
from wakewise.vision.reconstruction.photos.lenses import LAYOUTS, lens_of
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto

OPENCV = np.array([700.0, 690.0, 480.0, 361.0, -0.21, 0.04, 0.002, -0.001])


def view_of(params, fisheye=False):
    """A view at the origin, looking along z, with an OPENCV lens or a fisheye."""
    return RegisteredPhoto(
        name="a.png",
        width=960,
        height=720,
        focal_px=params[0],
        centre_px=params[2:4],
        radial=params[4],
        R_CW=np.eye(3),
        p_WC_m=np.zeros(3),
        near_m=0.1,
        far_m=1.0,
        focus_W_m=np.array([0, 0, 0.5]),
        seen=np.zeros(0, np.int64),
        stretch=params[1] / params[0],
        bend=params[5:],
        fisheye=fisheye,
    )


def test_a_view_bends_as_colmap_does_and_back():
    """Points fall where COLMAP's OPENCV puts them, and the rays of those pixels go through the points."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.3, 0.3, (200, 2)), rng.uniform(0.5, 0.9, 200)])
    view = view_of(OPENCV)
    pixels, depth = view.project(points)
    camera = pycolmap.Camera(model="OPENCV", width=960, height=720, params=OPENCV)
    assert np.allclose(pixels, camera.img_from_cam(points), atol=1e-9)
    assert np.allclose(view.rays(pixels) * depth[:, None], points, atol=1e-9)


@pytest.mark.parametrize("model", LAYOUTS)
def test_every_model_is_a_special_case(model):
    """A camera of each known model projects as the OPENCV camera, or the fisheye, made of it."""
    params = {3: [700.0, 470.0, 350.0], 4: [700.0, 470.0, 350.0, -0.1], 5: [700.0, 470.0, 350.0, -0.1, 0.02]}
    whole = {"PINHOLE": [700.0, 690.0, 470.0, 350.0], "OPENCV": OPENCV.tolist(), "OPENCV_FISHEYE": OPENCV.tolist()}
    given = whole.get(model)
    camera = pycolmap.Camera.create_from_model_name(1, model, 700.0, 960, 720)
    camera.params = given or params[len(camera.params)]
    points = np.random.default_rng(2).uniform([-0.3, -0.3, 0.6], [0.3, 0.3, 0.9], (50, 3))
    lens = lens_of(camera)
    assert lens.fisheye == ("FISHEYE" in model)
    ours = view_of(lens.params, lens.fisheye).project(points)[0]
    assert np.allclose(ours, camera.img_from_cam(points), atol=1e-9)
    again = pycolmap.Camera(model=lens.for_colmap()[0], width=960, height=720)
    again.params = [float(word) for word in lens.for_colmap()[1].split(",")]
    assert np.allclose(again.img_from_cam(points), ours, atol=1e-9)


def test_a_trials_camera_is_read(tmp_path):
    """What a trial writes of its camera comes back, from the file and from its folder."""
    camera = ImagingSettings(distortion=(-0.1, 0.01, 0.001, 0.0)).camera()
    written = calibrate(camera)
    written.write(tmp_path)
    for path in (tmp_path, tmp_path / "cameras.txt"):
        lens = read_lens(path)
        assert (lens.width, lens.height) == (960, 720) and np.allclose(lens.params, written.params, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds 0 cameras"),
        ("1 PINHOLE 9 9 1 1 1 1\n2 PINHOLE 9 9 1 1 1 1\n", "holds 2 cameras"),
        ("1 FISHEYE 9 9 1 1 1 1\n", "FISHEYE"),
        ("1\n", "camera model '1'"),
        ("1 PINHOLE 9 nine 1 1 1 1\n", "no number"),
        ("1 PINHOLE 9 9 1 1 1\n", "PINHOLE has 4"),
        ("1 PINHOLE 9 9 nan 1 1 1\n", "all finite"),
        ("1 PINHOLE 9 0 1 1 1 1\n", "above 0"),
    ],
)
def test_a_wrong_camera_file_is_refused(tmp_path, text, words):
    """What is wrong with the file is said in one line."""
    path = tmp_path / "cameras.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_lens(path)
    assert "\n" not in str(caught.value)


def test_a_missing_camera_file_is_refused(tmp_path):
    """A folder without the file, and a file that is not text."""
    with pytest.raises(InputError, match="does not exist"):
        read_lens(tmp_path)
    (tmp_path / "cameras.txt").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="no text"):
        read_lens(tmp_path)

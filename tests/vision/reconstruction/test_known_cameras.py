"""Poses and lenses of photographs from every format that states them, and what is refused."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_matrix
from wakewise.vision.reconstruction import Photo, read_known_cameras
from wakewise.vision.reconstruction.photos.known_cameras import match_known

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
RNG = np.random.default_rng(0)
POSES = {f"{k:02d}.png": (matrix_from_quat(RNG.normal(size=4)), RNG.normal(size=3)) for k in range(4)}
PARAMS = {"00.png": [500.0, 510.0, 320.0, 240.0, 0.1, -0.02, 1e-3, -2e-3]}
PARAMS |= {name: [700.0, 700.0, 318.0, 242.0, 0.0, 0.0, 0.0, 0.0] for name in ("01.png", "02.png", "03.png")}


def photo(name, size=(640, 480)):
    return Photo(name=name, width=size[0], height=size[1], digest=name)


def as_colmap(folder, binary):
    model = pycolmap.Reconstruction()
    for number, params in enumerate((PARAMS["00.png"], PARAMS["01.png"]), 1):
        kind = "OPENCV" if number == 1 else "PINHOLE"
        camera = pycolmap.Camera(model=kind, width=640, height=480, params=params[: 8 if number == 1 else 4])
        camera.camera_id = number
        model.add_camera_with_trivial_rig(camera)
    for number, (name, (R, p)) in enumerate(POSES.items(), 1):
        image = pycolmap.Image(name=name, camera_id=1 if name == "00.png" else 2, image_id=number)
        image.points2D = [pycolmap.Point2D([3.0, 4.0])] * (number % 3)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(R.T), -R.T @ p))
    (folder / "sparse" / "0").mkdir(parents=True)
    (model.write_binary if binary else model.write_text)(folder / "sparse" / "0")
    (folder / "sparse" / "0" / f"points3D{'.bin' if binary else '.txt'}").unlink()
    return folder


def as_nerfstudio(folder):
    frames = []
    for name, (R, p) in POSES.items():
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = R @ np.diag([1.0, -1.0, -1.0]), p
        keys = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")
        lens = dict(zip(keys, PARAMS[name], strict=True)) | {"w": 640, "h": 480}
        frames.append({"file_path": f"./images/{name}", "transform_matrix": matrix.tolist()} | lens)
    (folder / "transforms.json").write_text(json.dumps({"camera_model": "OPENCV", "frames": frames}))
    return folder


def as_table(folder):
    with (folder / "cameras.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        lens = ["width", "height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]
        writer.writerow(["name", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", *lens])
        for name, (R, p) in POSES.items():
            writer.writerow([name, *p, *quat_from_matrix(R), 640, 480, *PARAMS[name]])
    return folder / "cameras.csv"


@pytest.mark.parametrize(
    "write",
    [lambda f: as_colmap(f, binary=False), lambda f: as_colmap(f, binary=True), as_nerfstudio, as_table],
    ids=["colmap text", "colmap binary", "nerfstudio", "csv"],
)
def test_every_format_gives_the_same_cameras(tmp_path, write):
    """Rotations, places and two lenses come back as they were written, matched to the photos' names."""
    found = match_known(read_known_cameras(write(tmp_path)), tuple(photo(name) for name in POSES))
    assert list(found.positions) == list(POSES)
    for name, (R, p) in POSES.items():
        np.testing.assert_allclose(found.rotations[name], R, atol=1e-9)
        np.testing.assert_allclose(found.positions[name], p, atol=1e-9)
        np.testing.assert_allclose(found.lenses[name].params, PARAMS[name])


def test_a_lens_of_larger_photos_is_scaled_and_of_another_shape_refused(tmp_path):
    """Photos at half the size: lengths in pixels are halved, distortion stays."""
    known = read_known_cameras(as_table(tmp_path))
    half = match_known(known, tuple(photo(name, (320, 240)) for name in POSES))
    np.testing.assert_allclose(half.lenses["00.png"].params[:4], [250.0, 255.0, 160.0, 120.0])
    np.testing.assert_allclose(half.lenses["00.png"].params[4:], PARAMS["00.png"][4:])
    with pytest.raises(InputError, match="same shape"):
        match_known(known, tuple(photo(name, (320, 320)) for name in POSES))


def test_names_fit_without_folder_or_suffix_and_never_two(tmp_path):
    """left/00.jpg has the camera of 00.png; where two cameras fit it is asked for more; too few are refused."""
    known = read_known_cameras(as_table(tmp_path))
    assert set(match_known(known, (photo("left/00.jpg"), photo("left/01.png"))).positions) == {
        "left/00.jpg",
        "left/01.png",
    }
    with pytest.raises(InputError, match="1 of 2 photos"):
        match_known(known, (photo("00.png"), photo("other.png")))
    text = (tmp_path / "cameras.csv").read_text()
    (tmp_path / "cameras.csv").write_text(text.replace("01.png", "b/00.png").replace("\n00.png", "\na/00.png"))
    with pytest.raises(InputError, match="fits a/00"):
        match_known(read_known_cameras(tmp_path / "cameras.csv"), (photo("00.png"), photo("02.png")))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "name,x_m,y_m,z_m\n", "no column qw"),
        ("a.csv", "name,x_m,y_m,z_m,qw,qx,qy,qz\na,1,2,3,1,0,0,one\n", "line 2"),
        ("a.csv", "name,x_m,y_m,z_m,qw,qx,qy,qz\na,1,2,3,0,0,0,0\n", "quaternion"),
        ("a.csv", "name,x_m,y_m,z_m,qw,qx,qy,qz,fx\na,1,2,3,1,0,0,0,5\n", "lens needs all"),
        ("a.json", "{}", "frames"),
        ("a.json", '{"frames": [{"file_path": "a", "transform_matrix": [[1]]}]}', "frame 0"),
        (
            "a.json",
            '{"frames": [{"file_path": "a", "transform_matrix": [[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]}]}',
            "no rotation",
        ),
        (
            "a.json",
            '{"camera_model": "EQUIRECTANGULAR", "frames": [{"file_path": "a", "w": 2, "h": 2, "fl_x": 1, '
            '"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}',
            "allowed is OPENCV, PINHOLE or OPENCV_FISHEYE",
        ),
        (
            "a.json",
            '{"camera_model": "OPENCV_FISHEYE", "p1": 0.1, "frames": [{"file_path": "a", "w": 2, "h": 2, "fl_x": 1, '
            '"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}',
            "p1, which the four coefficients of OPENCV_FISHEYE",
        ),
        ("images.txt", "1 1 0 0 0 0 0\n\n", "cameras.txt: does not exist"),
    ],
)
def test_what_states_no_cameras_is_refused_in_one_line(tmp_path, name, text, words):
    """Where, what, and what would be right."""
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as told:
        read_known_cameras(tmp_path if name == "images.txt" else tmp_path / name)
    assert "\n" not in str(told.value)


def test_damaged_binary_files_are_refused(tmp_path):
    """Cut anywhere, COLMAP's files are bad input, never a traceback."""
    folder = as_colmap(tmp_path, binary=True) / "sparse" / "0"
    whole = {name: (folder / name).read_bytes() for name in ("cameras.bin", "images.bin")}
    for name, data in whole.items():
        for size in range(0, len(data) - 1, 7):
            (folder / name).write_bytes(data[:size])
            with pytest.raises(InputError):
                read_known_cameras(tmp_path)
        (folder / name).write_bytes(data)
    (folder / "images.bin").unlink()
    with pytest.raises(InputError, match="holds no cameras"):
        read_known_cameras(tmp_path)


@pytest.mark.skipif(not (DATA / "strecha_fountain").is_dir(), reason="the fountain is not there")
def test_surveyed_cameras_of_real_photographs():
    """Strecha's files: eleven cameras at half the size they were calibrated for, as SOURCE.txt says."""
    known = read_known_cameras(DATA / "strecha_fountain" / "gt_dense_cameras")
    photos = tuple(photo(f"{k:04d}.jpg", (1536, 1024)) for k in range(11))
    found = match_known(known, photos)
    assert len(found.positions) == 11
    assert found.lenses["0000.jpg"].params[0] == pytest.approx(1379.74)

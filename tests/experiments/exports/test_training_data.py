"""For trainers of fields and splats: the split, pictures without distortion, dense points, water."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.experiments.exports import Photographs, SparsePoints, write_colmap, write_nerfstudio
from wakewise.experiments.exports.records import flu_of
from wakewise.experiments.exports.training_data import WaterAttenuation, held_out_names, undistorted, write_dense
from wakewise.vision.imaging.camera import OpenCVCamera
from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud

NAMES = [f"{k:03}.png" for k in range(40)]


def test_one_of_each_run_of_neighbours_is_held_out():
    """Five of 40 at one in eight: one of the first eight, one of the next, and so on; the same for the same seed."""
    held = held_out_names(NAMES, 8, 3)
    assert [NAMES.index(name) // 8 for name in held] == [0, 1, 2, 3, 4]
    assert held == held_out_names(NAMES, 8, 3)
    assert held != held_out_names(NAMES, 8, 4)


@pytest.mark.parametrize(
    ("count", "one_in", "held"), [(1, 8, 0), (2, 8, 1), (7, 8, 1), (16, 8, 2), (9, 2, 4), (9, 0, 0)]
)
def test_few_photographs_are_shared_between_training_and_judging(count, one_in, held):
    """At least one of two is held out and one is not; none where none is asked for."""
    assert len(held_out_names(NAMES[:count], one_in, 0)) == held


def test_a_split_that_leaves_nothing_to_learn_is_refused():
    for one_in in (1, -3):
        with pytest.raises(InputError, match=r"--held-out"):
            held_out_names(NAMES, one_in, 0)


@pytest.fixture
def pictures(photographs: Photographs, tmp_path: Path) -> Photographs:
    """Real pictures in place of the bytes: a pixel's colour says where the ray through it points."""
    ours = _camera(photographs.params)
    places = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5), axis=-1).reshape(-1, 2)
    rays = _slopes(ours, places).reshape(48, 64, 2)
    picture = np.dstack([np.full((48, 64), 90.0), 128.0 + 150.0 * rays])
    files = tuple(file.with_suffix(".png") for file in photographs.files)
    for file in files:
        cv2.imwrite(str(file), np.clip(np.rint(picture), 0, 255).astype(np.uint8))
    return Photographs(files=files, track=photographs.track, width=64, height=48, params=photographs.params)


def _camera(params: np.ndarray) -> OpenCVCamera:
    return OpenCVCamera(width=64, height=48, params=params, ahead_m=0.0, rms_px=0.0, max_px=0.0, depths_m=np.ones(1))


def _slopes(camera: OpenCVCamera, pixels: np.ndarray) -> np.ndarray:
    """Slopes of pixels' rays, by Newton's method on the camera's own projection."""
    slopes = (pixels - camera.params[2:4]) / camera.params[:2]
    for _ in range(20):
        error = camera.project(np.column_stack([slopes, np.ones(len(slopes))])) - pixels
        slopes = slopes - error / camera.params[:2]
    return slopes


def test_undistorted_pictures_are_those_of_a_pinhole(pictures: Photographs, tmp_path: Path):
    """The colour, which is the ray, is that of the pinhole's ray at every pixel, to a grey level and a half."""
    flat, _ = undistorted(pictures, None, tmp_path / "flat")
    assert not flat.params[4:].any()
    image = cv2.imread(str(flat.files[0])).astype(np.float64)
    assert image.shape == (48, 64, 3)
    column, row = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    fx, fy, cx, cy = flat.params[:4]
    wanted = 128.0 + 150.0 * np.dstack([(column - cx) / fx, (row - cy) / fy])
    assert np.abs(image[..., 1:] - wanted).max() < 1.5
    assert (image[..., 0] == 90.0).all()  # nothing black at the rim


def test_observations_move_with_the_pictures(pictures: Photographs, cloud: SparsePoints, tmp_path: Path):
    """A point seen by the lens at a pixel is seen by the pinhole at its undistorted pixel, to 1e-6 px."""
    ours = _camera(pictures.params)
    points_C = np.array([[0.2, 0.1, 1.0], [-0.3, 0.2, 1.2], [0.0, -0.2, 0.8]])
    name = pictures.files[0].name
    seen = SparsePoints(
        points_W_m=cloud.points_W_m,
        colours=cloud.colours,
        errors_px=cloud.errors_px,
        seen={name: (ours.project(points_C), np.arange(3))},
    )
    flat, moved = undistorted(pictures, seen, tmp_path / "flat")
    assert moved is not None
    fx, fy, cx, cy = flat.params[:4]
    wanted = points_C[:, :2] / points_C[:, 2:] * [fx, fy] + [cx, cy]
    np.testing.assert_allclose(moved.seen[name][0], wanted, atol=1e-6)


def test_a_lens_without_distortion_keeps_its_pictures(photographs: Photographs, tmp_path: Path):
    """Same bytes, same camera; COLMAP's model is a PINHOLE then."""
    plain = np.append(photographs.params[:4], np.zeros(4))
    straight = Photographs(files=photographs.files, track=photographs.track, width=64, height=48, params=plain)
    flat, _ = undistorted(straight, None, tmp_path / "flat")
    assert [file.read_bytes() for file in flat.files] == [file.read_bytes() for file in photographs.files]
    write_colmap(tmp_path / "flat", flat, held_out=("001.jpg",))
    assert (tmp_path / "flat" / "sparse_text" / "cameras.txt").read_text().splitlines()[1].split()[1] == "PINHOLE"
    pycolmap = pytest.importorskip("pycolmap")
    camera = pycolmap.Reconstruction(tmp_path / "flat" / "sparse" / "0").cameras[1]
    assert camera.model.name == "PINHOLE"
    np.testing.assert_allclose(camera.params, plain[:4])


def test_both_formats_name_what_is_held_out(photographs: Photographs, tmp_path: Path):
    """nerfstudio: three lists of files; COLMAP: test.txt, which trainers of splats read."""
    for name in ("ns", "colmap"):
        (tmp_path / name).mkdir()
    write_nerfstudio(tmp_path / "ns", photographs, held_out=("002.jpg",))
    told = json.loads((tmp_path / "ns" / "transforms.json").read_text())
    assert told["train_filenames"] == ["images/000.jpg", "images/001.jpg", "images/003.jpg"]
    assert told["test_filenames"] == told["val_filenames"] == ["images/002.jpg"]
    write_colmap(tmp_path / "colmap", photographs, held_out=("002.jpg",))
    assert (tmp_path / "colmap" / "sparse" / "0" / "test.txt").read_text() == "002.jpg\n"


@pytest.mark.parametrize("z_up", [True, False])
def test_dense_points_stand_in_the_axes_of_the_export(z_up: bool, tmp_path: Path):
    """Points and normals are turned together; colours stay."""
    rng = np.random.default_rng(2)
    normals = np.tile([0.0, 0.0, -1.0], (5, 1))
    cloud = OrientedPointCloud(points_m=rng.normal(size=(5, 3)), normals=normals, colours=rng.uniform(size=(5, 3)))
    write_cloud(tmp_path / "dense.ply", cloud)
    assert write_dense(tmp_path / "dense.ply", tmp_path / "out.ply", z_up=z_up) == 5
    read = trimesh.load(tmp_path / "out.ply", process=False)
    wanted = flu_of(cloud.points_m) if z_up else cloud.points_m
    np.testing.assert_allclose(read.vertices, wanted, atol=1e-6)
    table = read.metadata["_ply_raw"]["vertex"]["data"]
    assert set(np.ravel(table["nz"])) == {1.0 if z_up else -1.0}


def test_water_is_told_by_channel_or_why_not():
    known = WaterAttenuation(source="trial", attenuation_per_m=np.array([0.5, 0.2, 0.1])).figures()
    assert known["attenuation_per_m"] == {"red": 0.5, "green": 0.2, "blue": 0.1}
    unknown = WaterAttenuation(source=None, why="no model").figures()
    assert (unknown["attenuation_per_m"], unknown["why"]) == (None, "no model")

"""Laws of the coloured model: colours are those of the photographs, hidden parts get none, and the file is standard."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.core.geometry import look_at
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto
from wakewise.vision.texturing import textured
from wakewise.vision.texturing.colour import srgb_decode
from wakewise.vision.texturing.photo_colours import RangeMaps, correct_photos
from wakewise.vision.texturing.textured import (
    fill_unseen_colours,
    read_textured,
    vertex_colours,
    write_textured,
    y_up_vertices,
)

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def _view(name: str, eye: np.ndarray, radial: float = 0.0) -> RegisteredPhoto:
    R_WC = look_at(eye, np.zeros(3)) @ R_BODY_CAMERA
    return RegisteredPhoto(
        name=name, width=200, height=160, focal_px=180.0, centre_px=np.array([100.0, 80.0]), radial=radial,
        R_CW=R_WC.T, p_WC_m=eye, near_m=0.1, far_m=5.0, focus_W_m=np.zeros(3), seen=np.arange(8),
    )  # fmt: skip


@pytest.fixture
def ball(tmp_path: Path) -> tuple[trimesh.Trimesh, tuple[RegisteredPhoto, ...], Path]:
    """A ball, a red photograph of its north side and a blue one of its south side."""
    for name, bgr in (("n.png", (0, 0, 200)), ("s.png", (200, 0, 0))):
        cv2.imwrite(str(tmp_path / name), np.full((160, 200, 3), bgr, np.uint8))
    views = (_view("n.png", np.array([1.0, 0.0, 0.0])), _view("s.png", np.array([-1.0, 0.0, 0.0])))
    return trimesh.creation.icosphere(subdivisions=3, radius=0.2), views, tmp_path


def test_each_side_has_its_photographs_colour(ball: tuple[trimesh.Trimesh, tuple[RegisteredPhoto, ...], Path]) -> None:
    """North is red, south is blue, the rim that both see too slanted is seen by neither; hidden sides get nothing."""
    mesh, views, photos = ball
    vertices = np.asarray(mesh.vertices)
    colours, seen = vertex_colours(vertices, np.asarray(mesh.faces), views, photos)
    red, blue = srgb_decode(np.array([200], np.uint8))[0], srgb_decode(np.array([200], np.uint8))[0]
    assert np.allclose(colours[vertices[:, 0] > 0.1], [red, 0, 0], atol=1e-6)
    assert np.allclose(colours[vertices[:, 0] < -0.1], [0, 0, blue], atol=1e-6)
    assert not seen[np.abs(vertices[:, 0]) < 0.01].any()


def test_what_stands_before_hides(tmp_path: Path) -> None:
    """A plate behind another plate is not seen."""
    cv2.imwrite(str(tmp_path / "n.png"), np.full((160, 200, 3), 99, np.uint8))
    front = trimesh.creation.box((0.01, 0.6, 0.6))
    back = trimesh.creation.box((0.01, 0.2, 0.2))
    back.apply_translation((-0.3, 0, 0))
    both = trimesh.util.concatenate([front, back])
    views = (_view("n.png", np.array([1.0, 0.0, 0.0])),)
    _, seen = vertex_colours(np.asarray(both.vertices), np.asarray(both.faces), views, tmp_path)
    assert seen[: len(front.vertices)].sum() >= 4
    assert not seen[len(front.vertices) :].any()


def test_gaps_take_their_neighbours_colour() -> None:
    """An unseen vertex gets the mean of its neighbours, once for each face they share; seen ones keep theirs."""
    faces = np.array([[0, 1, 2], [1, 3, 2]])
    colours = np.array([[1.0, 0, 0], [0.0, 1, 0], [0, 0, 0], [9, 9, 9]])
    out = fill_unseen_colours(colours, np.array([True, True, False, False]), faces)
    assert np.allclose(out[0], [1, 0, 0])
    assert np.allclose(out[2], [1 / 3, 2 / 3, 0])
    assert np.allclose(out[3], [0, 1, 0])


def test_the_file_is_standard_and_comes_back(
    ball: tuple[trimesh.Trimesh, tuple[RegisteredPhoto, ...], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A GLB 2 with positions, normals, colours and metre lengths, y up; reading it gives the mesh that went in."""
    mesh, views, folder = ball
    mesh.export(folder / "mesh.ply")
    monkeypatch.setattr(textured, "read_views", lambda *_: (views, np.zeros((0, 3))))
    share = write_textured(folder, folder, folder / "mesh.glb", bed_z_m=1.5)
    assert 0.5 < share < 1.0
    data = (folder / "mesh.glb").read_bytes()
    assert struct.unpack("<4sII", data[:12]) == (b"glTF", 2, len(data))
    tree = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    assert set(tree["meshes"][0]["primitives"][0]["attributes"]) == {"POSITION", "NORMAL", "COLOR_0"}
    vertices, faces, colours = read_textured(folder / "mesh.glb")
    assert np.allclose(vertices, y_up_vertices(np.asarray(mesh.vertices), 1.5), atol=1e-6)
    assert np.array_equal(faces, mesh.faces)
    assert colours.max() <= 1.0
    north = vertices[:, 2] < -0.1
    assert np.all(colours[north, 0] > 5 * colours[north, 2])
    (folder / "no.glb").write_bytes(b"something else altogether")
    with pytest.raises(ValueError, match="GLB"):
        read_textured(folder / "no.glb")


def test_standing_turns_down_into_up() -> None:
    """A point 0.3 m above the bed, 1 m north and 2 m east is at x = 2, y = 0.3, z = -1; handedness is kept."""
    assert np.allclose(y_up_vertices(np.array([[1.0, 2.0, 1.2]]), 1.5), [[2.0, 0.3, -1.0]])
    axes = y_up_vertices(np.eye(3), 0.0)
    assert np.isclose(np.linalg.det(axes), 1.0)


def test_rays_undo_projection() -> None:
    """A point along a pixel's ray projects back onto the pixel, with radial distortion, to a hundredth of a pixel."""
    view = _view("n.png", np.array([1.0, 0.2, -0.4]), radial=-0.12)
    pixels = np.array([[10.0, 12.0], [100.0, 80.0], [190.0, 150.0], [33.3, 120.7]])
    points = view.p_WC_m + 0.7 * view.rays(pixels) @ view.R_CW
    back, depth = view.project(points)
    assert np.allclose(back, pixels, atol=0.01)
    assert np.allclose(depth, 0.7)


def test_ranges_on_a_plane_are_right() -> None:
    """From scattered points of a plane the range of every pixel is right to 1 %, far pixels beyond them too."""
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.4, 0.4, (300, 2)), np.zeros(300)])
    eye = np.array([0.6, 0.1, -0.6])
    view = _view("n.png", eye)
    view = RegisteredPhoto(**{**{f: getattr(view, f) for f in view.__dataclass_fields__}, "seen": np.arange(300)})
    depths = RangeMaps(views={"n.png": view}, points_m=points, mesh=None, corners_m=np.zeros((0, 3)))
    found = depths.ranges_m("n.png", (160, 200)).astype(float)
    rows, columns = np.mgrid[0:160, 0:200] + 0.5
    ways = view.rays(np.stack([columns.ravel(), rows.ravel()], axis=1)) @ view.R_CW
    true = (-eye[2] / ways[:, 2] * np.linalg.norm(ways, axis=1)).reshape(160, 200)
    known = np.isfinite(found)
    assert known.mean() > 0.7
    assert np.all(np.abs(found[known] / true[known] - 1.0) < 0.01)
    assert not depths.knows("n.png", (200, 160))
    assert not depths.knows("x.png", (160, 200))


def test_photographs_without_a_model_are_balanced(tmp_path: Path) -> None:
    """Each photograph gets a corrected JPEG, the reason is said, and a second call leaves them as they are."""
    photos = tmp_path / "photos"
    photos.mkdir()
    rng = np.random.default_rng(0)
    for k in range(2):
        cv2.imwrite(str(photos / f"{k}.png"), rng.integers(0, 255, (60, 80, 3), np.uint8))
    done = correct_photos(photos, tmp_path / "out")
    assert (done.physical, done.balanced) == (0, 2)
    assert done.summary()["why"]["veil"] == "no model was given"
    assert "without depths" in done.words()[0]
    before = (tmp_path / "out" / "0.jpg").stat().st_mtime_ns
    correct_photos(photos, tmp_path / "out", model=tmp_path)
    assert (tmp_path / "out" / "0.jpg").stat().st_mtime_ns == before

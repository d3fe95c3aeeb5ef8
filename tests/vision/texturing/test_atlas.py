"""Photographs as a texture: each triangle has its place and the colours that the photographs have of it."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.core.errors import StageError
from wakewise.core.geometry import look_at
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto
from wakewise.vision.texturing import atlas
from wakewise.vision.texturing.atlas import lay_out, paint, write_atlas

R_BC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def view(name: str, eye: np.ndarray) -> RegisteredPhoto:
    R_WC = look_at(eye, np.zeros(3)) @ R_BC
    return RegisteredPhoto(
        name=name, width=400, height=320, focal_px=360.0, centre_px=np.array([200.0, 160.0]), radial=0.0,
        R_CW=R_WC.T, p_WC_m=eye, near_m=0.1, far_m=5.0, focus_W_m=np.zeros(3), seen=np.arange(8),
    )  # fmt: skip


def plate() -> tuple[np.ndarray, np.ndarray]:
    """A square plate in y and z that looks along x, 20 x 20 cells."""
    y, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.2, 0.2, 21), np.linspace(-0.2, 0.2, 21)))
    n = np.arange(441).reshape(21, 21)
    a, b, c, d = n[:-1, :-1].ravel(), n[:-1, 1:].ravel(), n[1:, 1:].ravel(), n[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([np.zeros(441), y, z], axis=1), faces


@pytest.mark.parametrize("faces", [1, 2, 7, 5000])
def test_no_two_triangles_share_a_pixel(faces: int) -> None:
    """Every triangle has pixels of its own, its corners among or beside them, all in the picture."""
    layout = lay_out(faces)
    owned = []
    for half in (0, 1):
        inside, bary = atlas._pattern(layout, half)
        assert np.allclose(bary.sum(axis=1), 1.0)
        mine = np.arange(half, faces, 2)
        owned.append(atlas._texels(layout, mine, inside).ravel())
    every = np.concatenate(owned)
    assert len(np.unique(every)) == len(every)
    assert every.max() < layout.side**2
    assert layout.corners_px.min() >= 0.0
    assert layout.corners_px.max() <= layout.side
    assert layout.cell >= atlas.CELL_PX


def test_the_texture_is_what_the_photograph_shows(tmp_path: Path) -> None:
    """A picture of stripes on a plate: the texture at each triangle's middle has the stripe's colour there."""
    vertices, faces = plate()
    own = view("a.png", np.array([1.0, 0.0, 0.0]))
    u = np.arange(400)
    stripes = np.tile((120 + 100 * np.sin(u / 25.0)).astype(np.uint8), (320, 1))
    cv2.imwrite(str(tmp_path / "a.png"), np.stack([stripes, stripes // 2, 255 - stripes], axis=-1))
    layout = lay_out(len(faces))
    picture, seen = paint(layout, vertices, faces, (own,), tmp_path)
    assert seen in (0.0, 1.0)
    if seen == 0.0:  # it looks the other way
        faces = faces[:, ::-1]
        picture, seen = paint(layout, vertices, faces, (own,), tmp_path)
    assert seen == 1.0
    place = layout.corners_px.mean(axis=1)
    got = picture[place[:, 1].astype(int), place[:, 0].astype(int)].astype(float)
    pixels = own.project(vertices[faces].mean(axis=1))[0]
    wanted = 120 + 100 * np.sin((pixels[:, 0] - 0.5) / 25.0)
    assert np.abs(got[:, 2] - wanted).max() < 14.0
    assert np.abs(got[:, 2] - wanted).mean() < 4.0
    assert np.abs(got[:, 0] - (255 - wanted)).mean() < 4.0


def test_files_open_in_a_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OBJ and GLB hold the same triangles and picture; no surface and one too fine are refused."""
    vertices, faces = plate()
    faces = np.concatenate([faces, faces[:, ::-1]])
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "mesh.ply")
    cv2.imwrite(str(tmp_path / "a.png"), np.full((320, 400, 3), (10, 90, 200), np.uint8))
    own = view("a.png", np.array([1.0, 0.0, 0.0]))
    monkeypatch.setattr(atlas, "read_views", lambda *_: ((own,), None))
    assert write_atlas(tmp_path, tmp_path, tmp_path) == 0.5
    for name in ("textured.obj", "textured.glb"):
        loaded = trimesh.load(tmp_path / name, process=False, force="mesh")
        assert len(loaded.faces) == len(faces)
        assert np.allclose(loaded.triangles.reshape(-1, 3), vertices[faces].reshape(-1, 3), atol=1e-6)
        uv = np.asarray(loaded.visual.uv)[np.asarray(loaded.faces)].mean(axis=1)
        material = loaded.visual.material
        image = np.asarray(material.image if name.endswith("obj") else material.baseColorTexture)[..., :3]
        texel = image[((1.0 - uv[:, 1]) * len(image)).astype(int), (uv[:, 0] * len(image)).astype(int)]
        assert (np.abs(texel.astype(int) - [200, 90, 10]).max(axis=1) < 3).mean() == 0.5
    (tmp_path / "mesh.ply").unlink()
    with pytest.raises(StageError, match="holds no triangles"):
        write_atlas(tmp_path, tmp_path, tmp_path)
    with pytest.raises(StageError, match="lower mesh_depth"):
        lay_out(10_000_000)

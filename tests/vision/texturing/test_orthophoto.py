"""A flat subject from straight above: pictures without perspective, heights as they are."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.core.geometry import look_at
from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto
from wakewise.vision.texturing import orthophoto
from wakewise.vision.texturing.orthophoto import closed, grid_faces, without_strays, write_orthophoto

R_BC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_a_slanted_photograph_of_a_wall_is_straightened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disc that slanted photographs show as ellipses is round, of its size, at its place; a bump has its height."""
    views = []
    for k, eye in enumerate((np.array([0.5, 0.3, -1.0]), np.array([-0.5, 0.3, -1.0]))):
        R_WC = look_at(eye, np.zeros(3)) @ R_BC
        own = RegisteredPhoto(
            name=f"{k}.png", width=640, height=480, focal_px=700.0, centre_px=np.array([320.0, 240.0]), radial=0.0,
            R_CW=R_WC.T, p_WC_m=eye, near_m=0.1, far_m=5.0, focus_W_m=np.zeros(3), seen=np.arange(8),
        )  # fmt: skip
        rays = own.rays(np.stack([a.ravel() + 0.5 for a in np.meshgrid(np.arange(640), np.arange(480))], axis=1))
        way = rays @ own.R_CW
        ground = eye + way * (-eye[2] / way[:, 2])[:, None]
        disc = np.hypot(ground[:, 0] - 0.05, ground[:, 1]) < 0.08
        image = np.where(disc, 220, 60).astype(np.uint8).reshape(480, 640)
        cv2.imwrite(str(tmp_path / own.name), np.repeat(image[..., None], 3, axis=2))
        views.append(own)
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.3, 0.3, 121), np.linspace(-0.2, 0.2, 81)))
    z = np.where((x < -0.2) & (y > 0.1), -0.02, 0.0)
    cloud = OrientedPointCloud(
        points_m=np.stack([x, y, z], axis=1),
        normals=np.tile([0.0, 0, -1], (len(x), 1)),
        colours=np.full((len(x), 3), 0.5),
    )
    write_cloud(tmp_path / "dense.ply", cloud)
    monkeypatch.setattr(orthophoto, "read_views", lambda *_: (tuple(views), None))
    facts = write_orthophoto(tmp_path, tmp_path, tmp_path, cell=0.005)
    assert facts == json.loads((tmp_path / "orthophoto.json").read_text())
    picture = cv2.imread(str(tmp_path / "orthophoto.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (facts["rows"], facts["columns"], 4)
    bright = (picture[..., 0] > 140) & (picture[..., 3] == 255)
    assert bright.sum() * 0.005**2 == pytest.approx(np.pi * 0.08**2, rel=0.06)
    rows, columns = np.nonzero(bright)
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), abs=2)
    # The middle pixel, by the world file, is the disc's middle in the model.
    world = [float(line) for line in (tmp_path / "orthophoto.pgw").read_text().split()]
    told = np.array([world[4] + columns.mean() * world[0], world[5] + rows.mean() * world[3], 0.0])
    middle = told @ np.array(facts["axes_across_along_up"]) + facts["origin"]
    assert middle[:2] == pytest.approx([0.05, 0.0], abs=0.004)
    levels = cv2.imread(str(tmp_path / "heights.png"), cv2.IMREAD_UNCHANGED).astype(float)
    height = np.where(levels > 0, facts["height_lowest"] + (levels - 1) * facts["height_step"], np.nan)
    assert np.nanmax(height) - np.nanmedian(height) == pytest.approx(0.02, abs=0.002)


def test_holes_are_closed_only_near_what_is_known() -> None:
    """A hole of one cell closes, a wide one does not; triangles only where four cells are known; strays go."""
    grid = np.full((5, 9), np.nan)
    grid[:, :3] = 1.0
    grid[2, 1] = np.nan
    out = closed(grid, 1.5)
    assert out[2, 1] == 1.0
    assert np.isfinite(out).sum() == 5 * 4
    assert len(grid_faces(np.isfinite(out))) == 2 * 4 * 3
    told = np.random.default_rng(0).uniform(0, 1, (1000, 3))
    kept = without_strays(np.concatenate([told, [[9.0, 0, 0], [0.5, 0.5, -4.0]]]))
    assert len(kept) == 1000

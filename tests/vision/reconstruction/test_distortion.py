"""Lenses bend as COLMAP has it, and back; photographs of a fisheye become a model."""

import cv2
import numpy as np
import pycolmap
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter, map_coordinates

from wakewise.core.interfaces import no_progress
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction import Lens, ReconstructionSettings, read_cloud, reconstruct
from wakewise.vision.reconstruction.photos.lenses import WIDEST, distort, undistort

FISHEYE = np.array([150.0, 150.0, 160.0, 120.0, 0.03, -0.01, 0.004, -0.001])


@given(st.integers(0, 10_000), st.floats(0.0, 0.05))
@settings(max_examples=40, deadline=None)
def test_what_is_bent_is_made_straight(seed, most):
    """Slopes come back, of either kind of lens, a fisheye's up to 88 deg from its axis."""
    rng = np.random.default_rng(seed)
    params = rng.uniform(-most, most, 4) * [1.0, 0.3, 0.05, 0.01]
    turn = rng.uniform(0, 2 * np.pi, 100)
    angle = rng.uniform(0.0, np.radians(88.0), 100)
    wide = np.tan(angle)[:, None] * np.stack([np.cos(turn), np.sin(turn)], 1)
    assert np.allclose(undistort(distort(wide, params, fisheye=True), params, fisheye=True), wide, rtol=1e-6, atol=1e-9)
    near = wide[angle < 0.7]
    assert np.allclose(undistort(distort(near, params, fisheye=False), params, fisheye=False), near, atol=1e-9)


def test_a_fisheye_bends_as_colmap_has_it():
    """Points fall where COLMAP's OPENCV_FISHEYE puts them; on the axis, too."""
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-2.0, 2.0, (300, 2)), rng.uniform(0.3, 1.0, 300)])
    points[0] = 0.0, 0.0, 1.0
    camera = pycolmap.Camera(model="OPENCV_FISHEYE", width=320, height=240, params=FISHEYE)
    ours = distort(points[:, :2] / points[:, 2:], FISHEYE[4:], fisheye=True) * FISHEYE[:2] + FISHEYE[2:4]
    assert np.allclose(ours, camera.img_from_cam(points), atol=1e-9)


def test_sideways_there_are_no_slopes_but_numbers():
    """An image beyond the widest angle is given the widest: far off, finite."""
    far = undistort(np.array([[1.7, 0.0], [0.0, 40.0]]), np.zeros(4), fisheye=True)
    assert np.isfinite(far).all() and np.allclose(np.linalg.norm(far, axis=1), np.tan(WIDEST))


RADIUS = 1.0
"""Of a painted ball that the cameras are in, m: seen from there a plane would fade into its own horizon."""


@pytest.fixture(scope="module")
def wide_photos(tmp_path_factory):
    """Eight photographs from within a ball, by a lens that sees 148 deg across the diagonal, and their poses."""
    folder = tmp_path_factory.mktemp("fisheye") / "images"
    folder.mkdir()
    paint = gaussian_filter(np.random.default_rng(0).normal(size=(160, 160, 160)), 1.2)
    paint = (paint - paint.min()) / np.ptp(paint)
    uv = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5), -1).reshape(-1, 2)
    rays = np.c_[undistort((uv - FISHEYE[2:4]) / FISHEYE[:2], FISHEYE[4:], fisheye=True), np.ones(len(uv))]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    truth = {}
    for k in range(8):
        p = np.array([0.12 * (k % 4 - 1.5), 0.2 * (k // 4 - 0.5), 0.02 * (k % 3)])
        R_WC = cv2.Rodrigues(np.array([0.05 * (-1) ** k, 0.04 * (k % 3 - 1), 0.1 * (k % 2)]))[0]
        ways = rays @ R_WC.T
        along = ways @ p
        hit = p + (np.sqrt(along**2 + RADIUS**2 - p @ p) - along)[:, None] * ways
        grey = map_coordinates(paint, 79.5 * (1.0 + hit.T), order=1).reshape(240, 320)
        cv2.imwrite(str(folder / f"{k}.png"), np.repeat((30 + 200 * grey).astype(np.uint8)[..., None], 3, axis=2))
        truth[f"{k}.png"] = p
    return folder, truth


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_photographs_of_a_fisheye_become_a_model(wide_photos, tmp_path, known):
    """Cameras within 1 % of their spread and points on the ball, with the lens known and with its kind alone."""
    folder, truth = wide_photos
    lens = Lens(width=320, height=240, params=FISHEYE, fisheye=True) if known else None
    asked = ReconstructionSettings(
        detector="opencv", max_features=2500, lens="fisheye", mesh=False, check_shared_intrinsics=False
    )
    model = reconstruct(folder, tmp_path, asked, lens=lens, reference_positions=truth, progress=no_progress)
    assert model.registered_images == 8
    sparse = pycolmap.Reconstruction(tmp_path / "sparse")
    assert all("FISHEYE" in camera.model.name for camera in sparse.cameras.values())
    a = np.array([image.projection_center() for image in sparse.images.values()])
    b = np.array([truth[image.name] for image in sparse.images.values()])
    spread = np.sqrt(((b - b.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert np.sqrt((np.linalg.norm(umeyama(a, b).apply(a) - b, axis=1) ** 2).mean()) < 0.01 * spread
    points = read_cloud(tmp_path / "dense.ply").points_m
    off = np.linalg.norm(points, axis=1) - RADIUS
    assert len(points) > 5_000 and np.median(np.abs(off)) < 0.005

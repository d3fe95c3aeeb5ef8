"""No ray that meets target or stones is left out, and most of the others are."""

import numpy as np
import pytest
from imaging_helpers import coral_scene, view

from wakewise.vision.imaging import FlatPort, LensCamera, PinholeCamera
from wakewise.vision.imaging.scene import TILE_PX, BoundingSpheres, tile_sphere_overlap


def test_spheres_hold_all_faces():
    """Every corner of target and stones is in a sphere, and the spheres are about the size of a piece."""
    scene = coral_scene()[0]
    for first, last in ((0, scene.first_face[1]), (scene.first_face[2], len(scene.faces))):
        corners = scene.vertices_F_m[np.unique(scene.faces[first:last])]
        away = np.linalg.norm(corners[:, None] - scene.spheres_F_m[None, :, :3], axis=2) - scene.spheres_F_m[None, :, 3]
        assert away.min(axis=1).max() < 1e-6
    assert np.median(scene.spheres_F_m[:, 3]) < 0.03
    assert BoundingSpheres.of(np.zeros((0, 3)), np.zeros((0, 3), int)).spheres(np.zeros((0, 3))).shape == (0, 4)


def test_pieces_of_a_surface_at_rest_hold_it_when_it_has_moved():
    """Moved and bent, every corner of each piece is in that piece's sphere, which is as small as about it can be."""
    scene = coral_scene()[0]
    rest = scene.vertices_F_m[: scene.first_bed_vertex].astype(float)
    pieces = BoundingSpheres.of(rest, scene.faces[: scene.first_face[1]])
    assert sorted(map(tuple, pieces.faces)) == sorted(map(tuple, scene.faces[: scene.first_face[1]]))
    moved = rest + np.column_stack([2.0 * rest[:, 2] ** 2, 0.1 - 0.3 * rest[:, 2], 0.2 * rest[:, 0]])
    spheres = pieces.spheres(moved)
    for sphere, first, last in zip(spheres, pieces.firsts[:-1], pieces.firsts[1:], strict=True):
        corners = moved[pieces.faces[first:last].ravel()]
        away = np.linalg.norm(corners - sphere[:3], axis=1).max()
        assert away <= sphere[3] <= away + 2e-6
        np.testing.assert_allclose(sphere[:3], 0.5 * (corners.min(axis=0) + corners.max(axis=0)), atol=1e-12)


@pytest.mark.parametrize(
    "camera",
    [
        PinholeCamera(322, 243, np.deg2rad(90)),
        LensCamera(322, 243, np.deg2rad(100), (-0.11, 0.05, 0.002, 0.001)),
        LensCamera(322, 243, np.deg2rad(80), port=FlatPort(air_m=0.02)),
    ],
    ids=["ideal", "distorted", "port"],
)
@pytest.mark.parametrize("elevation", [20, 60])
def test_every_ray_that_meets_a_solid_is_in_a_tile(camera, elevation):
    """Of rays cast through corners and centres of all pixels, those that hit lie in marked tiles; few tiles are."""
    scene = coral_scene()[0]
    X_WC = view(elevation, 70, 0.35)
    origin = X_WC.p_m - scene.foot_W_m
    tiles = np.empty((-(-243 // TILE_PX), -(-322 // TILE_PX)), np.bool_)
    spheres_C = np.column_stack([(scene.spheres_F_m[:, :3] - origin) @ X_WC.R, scene.spheres_F_m[:, 3]])
    tile_sphere_overlap(camera.row, 322, 243, spheres_C, tiles)
    half = np.stack(np.meshgrid(np.arange(0.01, 322, 0.499), np.arange(0.01, 243, 0.499)), axis=-1).reshape(-1, 2)
    near, far = (camera.unproject(half, np.full(len(half), d)) for d in (0.03, 1.03))
    hit = scene.solids.run(
        (near @ X_WC.R.T + origin).astype(np.float32), ((far - near) @ X_WC.R.T).astype(np.float32), query="INTERSECT"
    )
    met = half[np.asarray(hit) >= 0].astype(int) // TILE_PX
    assert len(met) > 2000
    assert tiles[met[:, 1], met[:, 0]].all()
    assert tiles.mean() < 0.5

"""Depth maps to points: a sphere in closed form comes back, and what one map alone claims does not."""

import dataclasses

import numpy as np
import pytest
from analytic_sphere import DISTANCE, FOCAL, RADIUS, REGION, look, photograph, sphere_colours

from wakewise.core.errors import StageError
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.geometry import depth_camera, depth_map, fuse_depth
from wakewise_nerf.field.posed import read_model, read_posed

BALL = RegionOfInterest(centre_W_m=REGION[0], radius_m=REGION[1])


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """Depth of the sphere from 24 sides above the bed, in closed form."""
    folder = photograph(tmp_path_factory.mktemp("sphere") / "model", over=1)
    made = []
    for index, photo in enumerate(read_posed(read_model(folder / "sparse"), folder / "images", BALL, 960)):
        camera = depth_camera(photo, 1.0)
        colours, distance = look(camera.p_WC_m, camera.directions_C() @ camera.R_CW)
        made.append(depth_map(index, camera, distance, np.rint(255 * colours).astype(np.uint8), BALL))
    return made


def silent(*_):
    """Say nothing."""


def test_camera_frames_all_that_the_photo_saw(tmp_path):
    """Every ray of the photo lies in the picture, the middle one near its middle; half the pixels, half the size."""
    folder = photograph(tmp_path / "few", rings=((30.0, 6),), over=1)
    photo = read_posed(read_model(folder / "sparse"), folder / "images", BALL, 960)[0]
    for size in (1.0, 2.0):
        camera = depth_camera(photo, size)
        rays = photo.directions_W.reshape(-1, 3) @ camera.R_CW.T
        flat = camera.focal_px * rays[:, :2] / rays[:, 2:] + camera.centre_px
        assert flat.min() >= -1e-6
        assert (flat.max(axis=0) <= np.array([camera.width, camera.height])).all()
        assert camera.width == pytest.approx(photo.colours.shape[1] / size, rel=0.15, abs=3)
        np.testing.assert_allclose(np.linalg.norm(camera.directions_C(), axis=2), 1.0)
        np.testing.assert_allclose(camera.R_CW @ camera.R_CW.T, np.eye(3), atol=1e-12)


def test_sphere_comes_back(maps):
    """Points lie on it, all round its upper half, with its normals and its colours, about a footprint apart."""
    cloud, spacing = fuse_depth(maps, 2, silent)
    radius = np.linalg.norm(cloud.points_m, axis=1)
    assert spacing == pytest.approx((DISTANCE - RADIUS) / FOCAL, rel=0.2)
    assert np.abs(radius - RADIUS).max() < spacing
    assert np.median(np.abs(radius - RADIUS)) < 0.1 * spacing
    out = cloud.points_m / radius[:, None]
    assert np.median(np.einsum("ij,ij->i", out, cloud.normals)) > 0.98
    assert np.median(np.abs(cloud.colours - sphere_colours(cloud.points_m))) < 0.03
    assert len(np.unique((out[out[:, 2] < 0] > 0) @ [1, 2, 4])) == 4
    # As many points as footprints fit on the surface, within what cells of a grid make of it.
    assert 0.7 < len(radius) * spacing**2 / (2 * np.pi * RADIUS**2) < 3.0


def test_what_one_map_alone_claims_is_left_out(maps):
    """A wall put into one map, in the water before the sphere, makes no point."""
    false = maps[0].depth_m.copy()
    false[:6] = false[false > 0].min() - 0.2
    wrong = dataclasses.replace(maps[0], depth_m=false, wanted=false > 0)
    cloud, spacing = fuse_depth([wrong, *maps[1:]], 2, silent)
    assert np.abs(np.linalg.norm(cloud.points_m, axis=1) - RADIUS).max() < 1.5 * spacing


def test_empty_maps_are_a_failure(maps):
    """Nothing opaque, or nothing confirmed, is said and makes no cloud."""
    nothing = [dataclasses.replace(m, depth_m=0 * m.depth_m, wanted=np.zeros_like(m.wanted)) for m in maps]
    with pytest.raises(StageError, match="nothing in the region is opaque"):
        fuse_depth(nothing, 2, silent)
    with pytest.raises(StageError, match="points are confirmed by 2 other views"):
        fuse_depth([maps[0], *nothing[1:]], 2, silent)

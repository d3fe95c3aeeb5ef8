"""Rays of posed photos: the camera model's own, through the pixels' centres, cut to the region."""

import cv2
import numpy as np
import pycolmap
import pytest
from analytic_sphere import FOCAL, REGION, SIZE, look, photograph

from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.posed import pixel_rays, read_model, read_posed, sees, surroundings, window

BALL = RegionOfInterest(centre_W_m=REGION[0], radius_m=REGION[1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return photograph(tmp_path_factory.mktemp("sphere") / "model", rings=((50.0, 8),))


def test_rays_project_back_to_pixel_centres():
    """A camera with strong distortion, at its own size and at half: image of ray (i, j) is (j + 0.5, i + 0.5)."""
    camera = pycolmap.Camera(
        model="OPENCV", width=80, height=60, params=[70.0, 72.0, 41.0, 29.0, -0.15, 0.03, 0.004, -0.006]
    )
    for size, scale in (((80, 60), 1.0), ((40, 30), 2.0)):
        rays = pixel_rays(camera, *size)
        assert rays.shape == (size[1], size[0], 3)
        np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1.0, atol=1e-12)
        u, v = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
        back = np.asarray(camera.img_from_cam(rays.reshape(-1, 3))).reshape(size[1], size[0], 2)
        np.testing.assert_allclose(back, scale * np.stack([u, v], axis=2), atol=1e-5)


def test_photos_and_rays_belong_together(folder):
    """Following the rays into the scene in closed form gives the photos' own colours, but for edges within a pixel."""
    photos = read_posed(read_model(folder / "sparse"), folder / "images", BALL, 960)
    assert [p.name for p in photos] == sorted(p.name for p in photos) and len(photos) == 8
    for photo in photos:
        colours, distance = look(photo.p_WC_m, photo.directions_W.astype(np.float64))
        error = np.abs(colours - photo.colours / 255.0).max(axis=2)
        assert np.median(error) < 0.01
        assert (error < 0.03).mean() > 0.9
        assert (distance > 0).any()
        # The rectangle is that of the region, so the sphere of 0.6 radii is well inside it.
        assert photo.colours.shape[0] < SIZE
        assert not distance[0].any() and not distance[:, 0].any()
        assert photo.focal_px == FOCAL


def test_smaller_photos_keep_their_rays(folder):
    """Averaged down to half, focal length and window halve and the middle ray stays."""
    model = read_model(folder / "sparse")
    whole = read_posed(model, folder / "images", BALL, 960)[0]
    half = read_posed(model, folder / "images", BALL, SIZE // 2)[0]
    assert half.focal_px == pytest.approx(whole.focal_px / 2)
    assert half.colours.shape[0] == pytest.approx(whole.colours.shape[0] / 2, abs=1)
    a, b = (p.directions_W.reshape(-1, 3).mean(axis=0) for p in (whole, half))
    assert float(a @ b / np.linalg.norm(a) / np.linalg.norm(b)) == pytest.approx(1.0, abs=2e-4)


def test_a_ball_is_seen_by_the_cone_about_it():
    """Rays within the angle asin(r / d) of the centre, none behind; all from inside."""
    angle = np.linspace(0.0, np.pi, 400)
    rays = np.stack([np.sin(angle), np.zeros(400), np.cos(angle)], axis=1)
    seen = sees(rays, np.array([0.0, 0.0, 2.0]), 1.0)
    np.testing.assert_array_equal(seen, angle < np.arcsin(0.5))
    assert sees(rays, np.array([0.0, 0.0, 0.5]), 1.0).all()
    assert not sees(np.full((1, 3), np.nan), np.array([0.0, 0.0, 0.5]), 1.0).any()


def test_window_is_the_smallest_rectangle():
    wanted = np.zeros((6, 8), dtype=bool)
    assert window(wanted) == (slice(0, 0), slice(0, 0))
    wanted[2, 5] = wanted[4, 1] = True
    assert window(wanted) == (slice(2, 5), slice(1, 6))


def test_surroundings_hold_the_points(folder):
    """Where no region is given: 9 in 10 sparse points lie in the ball, and it is no larger than it must be."""
    model = read_model(folder / "sparse")
    points = np.array([p.xyz for p in model.points3D.values()])
    ball = surroundings(model)
    inside = np.linalg.norm(points - ball.centre_W_m, axis=1) < ball.radius_m
    assert inside.mean() >= 0.9
    assert ball.radius_m < 1.2 * np.abs(points).max() * np.sqrt(3)


def test_what_is_missing_is_named(folder, tmp_path):
    """No model, a photo gone, a photo of another size, a region nobody saw: one line that says which."""
    with pytest.raises(InputError, match=r"holds no model \(sparse/images.bin is missing\)"):
        read_model(tmp_path / "sparse")
    broken = tmp_path / "sparse"
    broken.mkdir()
    (broken / "images.bin").write_bytes(b"no images")
    with pytest.raises(InputError, match="no sparse model that can be read"):
        read_model(broken)
    model = read_model(folder / "sparse")
    with pytest.raises(InputError, match=r"does not exist; --photos must name the folder"):
        read_posed(model, tmp_path, BALL, 960)
    for file in (folder / "images").iterdir():
        cv2.imwrite(str(tmp_path / file.name), np.zeros((10, 12, 3), dtype=np.uint8))
    with pytest.raises(InputError, match=r"has 12 x 10 pixels, the model was made from 56 x 56"):
        read_posed(model, tmp_path, BALL, 960)
    with pytest.raises(StageError, match="0 registered photos see the region, at least 5 must"):
        read_posed(model, folder / "images", RegionOfInterest(centre_W_m=np.array([90.0, 0, 0]), radius_m=0.1), 960)

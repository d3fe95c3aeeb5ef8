"""Pixels and rays of the calibrated camera: inverse to each other, as OpenCV has them, at every picture size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.perception.calibrated_camera import CalibratedCamera

PINHOLE = CalibratedCamera(width=640, height=480, fx=400.0, fy=410.0, cx=320.3, cy=238.1)
CORNERS = np.array([[0.0, 0.0], [639.0, 0.0], [0.0, 479.0], [639.0, 479.0]])


def lenses(k1: float, k2: float, p: float) -> st.SearchStrategy[tuple[float, float, float, float]]:
    """Distortions up to these coefficients."""
    return st.tuples(st.floats(-k1, k1), st.floats(-k2, k2), st.floats(-p, p), st.floats(-p, p))


def cameras(
    lens: st.SearchStrategy[tuple[float, float, float, float]], least_focal_px: float = 350.0
) -> st.SearchStrategy[CalibratedCamera]:
    """Cameras of 640 x 480 px with such lenses."""
    focal = st.floats(least_focal_px, 900.0)
    return st.builds(
        lambda fx, share, cx, cy, distortion: CalibratedCamera(
            width=640, height=480, fx=fx, fy=share * fx, cx=cx, cy=cy, distortion=distortion
        ),
        focal,
        st.floats(0.95, 1.05),
        st.floats(300.0, 340.0),
        st.floats(220.0, 260.0),
        lens,
    )


def ahead(slopes: Array, distance_m: float = 1.0) -> Array:
    """Points of rays at a distance along z."""
    return distance_m * np.column_stack([slopes, np.ones(len(slopes))])


@given(cameras(st.just((0.0, 0.0, 0.0, 0.0))), st.floats(0.05, 30.0))
@settings(max_examples=40, deadline=None)
def test_without_distortion_slopes_and_pixels_are_inverse(camera: CalibratedCamera, distance_m: float) -> None:
    """A pixel's ray meets that pixel at every distance, to rounding."""
    pixels = np.concatenate([CORNERS, [[camera.cx, camera.cy]]])
    slopes = camera.slopes(pixels)
    np.testing.assert_allclose(camera.pixels(ahead(slopes, distance_m)), pixels, atol=1e-9)
    np.testing.assert_allclose(slopes[-1], 0.0, atol=1e-15)


@given(cameras(lenses(0.05, 0.02, 0.001), 500.0))
@settings(max_examples=40, deadline=None)
def test_with_distortion_slopes_and_pixels_are_inverse(camera: CalibratedCamera) -> None:
    """A pixel's ray meets that pixel to 0.02 px, in the corners too."""
    grid = np.stack(np.meshgrid(np.linspace(0, 639, 9), np.linspace(0, 479, 7)), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(camera.pixels(ahead(camera.slopes(grid))), grid, atol=0.02)


@given(cameras(lenses(0.4, 0.2, 0.01)), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_pixels_are_those_of_opencv(camera: CalibratedCamera, seed: int) -> None:
    """Points before the camera lie where `cv2.projectPoints` puts them; beyond the lens's fold they lie nowhere."""
    points = np.random.default_rng(seed).uniform([-0.5, -0.5, 0.3], [0.5, 0.5, 3.0], (20, 3))
    K = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    wanted = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(camera.distortion))[0].reshape(-1, 2)
    k1, k2 = camera.distortion[:2]
    r2 = np.sum((points[:, :2] / points[:, 2:]) ** 2, axis=1)
    rising = 1.0 + r2 * (3.0 * k1 + 5.0 * r2 * k2) > 0.0
    np.testing.assert_allclose(camera.pixels(points)[rising], wanted[rising], rtol=1e-9, atol=1e-9)
    assert np.isnan(camera.pixels(points)[~rising]).all()


@given(cameras(lenses(0.05, 0.02, 0.001), 500.0), st.sampled_from([2, 4, 5, 8]))
@settings(max_examples=30, deadline=None)
def test_a_reduced_camera_sees_the_same_ray_at_the_corresponding_pixel(camera: CalibratedCamera, block: int) -> None:
    """A pixel of a reduced picture is centred on the block of pixels that it covers; its ray goes through there."""
    small = camera.scaled(640 // block)
    pixels = np.array([[0.0, 0.0], [17.0, 40.0], [small.width - 1.0, small.height - 1.0]])
    middles = block * pixels + 0.5 * (block - 1)
    assert (small.width, small.height) == (640 // block, 480 // block)
    np.testing.assert_allclose(small.slopes(pixels), camera.slopes(middles), atol=1e-12)


def test_scaling_there_and_back_changes_nothing() -> None:
    """Twice the width and half of it again is the same camera; the focal length goes with the width."""
    camera = replace(PINHOLE, distortion=(-0.2, 0.05, 0.001, -0.002), readout_s=0.016)
    back = camera.scaled(1280).scaled(640)
    assert (back.width, back.height, back.distortion) == (640, 480, camera.distortion)
    assert camera.scaled(320).readout_s == camera.readout_s
    for name in ("fx", "fy", "cx", "cy", "focal_px"):
        assert getattr(back, name) == pytest.approx(getattr(camera, name), abs=1e-12)
    assert camera.scaled(320).focal_px == pytest.approx(0.5 * camera.focal_px)


@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.2, 0.05, 0.001, -0.002)])
def test_a_straightened_picture_shows_each_ray_where_a_lens_without_distortion_does(
    distortion: tuple[float, float, float, float],
) -> None:
    """The pixel from which it is taken is the one that the camera has of the straight lens's ray."""
    camera, pixels = replace(PINHOLE, distortion=distortion), np.array([[320, 240], [20, 30], [600, 450], [100, 400]])
    x, y = camera.straightening
    assert x.shape == y.shape == (480, 640)
    u, v = pixels.T
    np.testing.assert_allclose(
        np.column_stack([x[v, u], y[v, u]]), camera.pixels(ahead(PINHOLE.slopes(pixels))), atol=1e-3
    )


def test_a_shutter_is_global_if_nothing_else_is_said() -> None:
    """The readout takes no time."""
    assert PINHOLE.readout_s == 0.0


def test_the_focal_length_is_the_mean_of_both() -> None:
    """`focal_px` lies midway between fx and fy."""
    assert PINHOLE.focal_px == 405.0


@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.2, 0.05, 0.001, -0.002)])
def test_points_that_are_not_before_the_camera_have_no_pixel(distortion: tuple[float, float, float, float]) -> None:
    """Behind, beside and at the camera the pixel is NaN; others keep theirs."""
    camera = replace(PINHOLE, distortion=distortion)
    points = np.array([[0.1, 0.2, 1.0], [0.1, 0.2, -1.0], [0.1, 0.2, 0.0], [0.0, 0.0, 0.0]])
    found = camera.pixels(points)
    assert np.isnan(found[1:]).all()
    np.testing.assert_array_equal(found[0], camera.pixels(points[:1])[0])


@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.2, 0.05, 0.001, -0.002)])
def test_no_pixels_are_no_rays(distortion: tuple[float, float, float, float]) -> None:
    """Empty arrays keep their shapes."""
    camera = replace(PINHOLE, distortion=distortion)
    assert camera.slopes(np.zeros((0, 2))).shape == (0, 2)
    assert camera.pixels(np.zeros((0, 3))).shape == (0, 2)


def test_the_picture_ends_at_the_centres_of_its_outermost_pixels() -> None:
    """`inside` holds up to these and a margin less; NaN and infinity lie outside."""
    beyond = CORNERS + np.array([[-0.01, 0.0], [0.01, 0.0], [0.0, 0.01], [0.01, 0.01]])
    assert PINHOLE.inside(CORNERS).all()
    assert not PINHOLE.inside(beyond).any()
    assert not PINHOLE.inside(CORNERS, 5.0).any()
    assert PINHOLE.inside(np.array([[5.0, 5.0], [634.0, 474.0]]), 5.0).all()
    assert not PINHOLE.inside(np.array([[np.nan, 5.0], [5.0, np.nan], [np.inf, 5.0], [5.0, -np.inf]])).any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 0},
        {"height": -3},
        {"fx": 0.0},
        {"fy": -400.0},
        {"fx": np.nan},
        {"cx": np.inf},
        {"cy": np.nan},
        {"distortion": (0.0, np.nan, 0.0, 0.0)},
        {"readout_s": np.nan},
        {"readout_s": np.inf},
    ],
)
def test_numbers_that_no_camera_has_are_refused(wrong: dict[str, Any]) -> None:
    """The message gives the camera and says what it needs."""
    with pytest.raises(InputError, match=r"camera: .* needs a size and focal lengths above 0 and finite numbers"):
        replace(PINHOLE, **wrong)

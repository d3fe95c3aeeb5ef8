"""Lenses: OpenCV's distortion, Snell's law at a flat port, and there and back again."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from wakewise.core.errors import InputError
from wakewise.vision.imaging import FlatPort, LensCamera, PinholeCamera

WIDE = LensCamera(960, 720, np.deg2rad(90), (-0.11, 0.10, 0.0014, 0.0005))  # near an action camera's, as calibrated
PORT = LensCamera(960, 720, np.deg2rad(75), port=FlatPort(air_m=0.02, glass_m=0.006))
BOTH = LensCamera(640, 480, np.deg2rad(60), (-0.03, 0.01, 0.001, -0.002), FlatPort(air_m=0.01))


@pytest.mark.parametrize("camera", [WIDE, PORT, BOTH])
@settings(deadline=None, max_examples=60)
@given(x=st.floats(0.0, 1.0), y=st.floats(0.0, 1.0), depth=st.floats(0.1, 20.0))
def test_projection_undoes_the_ray(camera, x, y, depth):
    """Any pixel's point at any depth projects back to that pixel, within 1e-6 px."""
    pixel = np.array([[x * camera.width, y * camera.height]])
    point = camera.unproject(pixel, [depth])
    assert point[0, 2] == depth
    assert np.abs(camera.project(point) - pixel).max() < 1e-6


def test_distortion_is_opencvs():
    """Without a port the pixels are those of OpenCV, whose pixel centres are half a pixel lower."""
    points = np.random.default_rng(0).uniform([-0.8, -0.6, 0.8], [0.8, 0.6, 2.0], (200, 3))
    f = WIDE.focal_px
    K = np.array([[f, 0, 479.5], [0, f, 359.5], [0, 0, 1.0]])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(WIDE.distortion))[0].reshape(-1, 2)
    assert np.abs(WIDE.project(points) - expected - 0.5).max() < 1e-9


@pytest.mark.parametrize("camera", [WIDE, PORT, BOTH])
def test_field_of_view_is_that_in_water(camera):
    """The rays of the middles of the left and right edge are the field of view apart (tangential distortion aside)."""
    plain = LensCamera(camera.width, camera.height, camera.fov_rad, (*camera.distortion[:2], 0.0, 0.0), camera.port)
    edges = np.array([[0.0, 0.5 * camera.height], [camera.width, 0.5 * camera.height]])
    way = plain.unproject(edges, [2.0, 2.0]) - plain.unproject(edges, [1.0, 1.0])
    angle = np.arccos(way[0] @ way[1] / np.linalg.norm(way[0]) / np.linalg.norm(way[1]))
    assert angle == pytest.approx(camera.fov_rad, abs=1e-9)


def test_light_takes_the_quickest_way():
    """Fermat: of all ways from the pupil through the pane, the pixel's has a stationary, least travel time."""
    port, camera = PORT.port, PORT
    for x, y, z in ((0.1, 0.05, 0.4), (-0.3, 0.2, 0.5), (0.02, -0.01, 1.5)):
        aside = np.hypot(x, y)

        def time(places, aside=aside, z=z):
            inner, outer = places
            start = port.air_m + port.glass_m
            return (
                np.hypot(inner, port.air_m)
                + port.glass_index * np.hypot(outer - inner, port.glass_m)
                + port.water_index * np.hypot(aside - outer, z - start)
            )

        way = minimize(time, [0.01, 0.012], method="Nelder-Mead", options={"xatol": 1e-12, "fatol": 1e-16}).x
        slope = way[0] / port.air_m
        pixel = camera.project(np.array([[x, y, z]]))[0] - [480, 360]
        assert np.hypot(*pixel) == pytest.approx(camera.lens_focal_px * slope, abs=2e-3)
        assert pixel[0] / pixel[1] == pytest.approx(x / y)


def test_near_the_axis_water_magnifies():
    """Paraxial limit: a point x off the axis shows at f x / (air + glass / n_g + water / n_w)."""
    port, z = PORT.port, 0.5
    reduced = port.air_m + port.glass_m / port.glass_index + (z - port.air_m - port.glass_m) / port.water_index
    pixel = PORT.project(np.array([[1e-6, 0.0, z]]))[0, 0] - 480
    assert pixel == pytest.approx(PORT.lens_focal_px * 1e-6 / reduced, rel=1e-6)
    assert PORT.project(np.array([[0.0, 0.0, z]]))[0] == pytest.approx([480, 360])
    assert PORT.unproject(np.array([[480.0, 360.0]]), [z])[0] == pytest.approx([0, 0, z])


def test_a_lens_without_distortion_is_the_pinhole():
    """With zero coefficients a lens is the ideal camera; points behind it or inside the port have no pixel."""
    points = np.random.default_rng(1).uniform([-1, -1, 0.2], [1, 1, 3], (50, 3))
    ideal = PinholeCamera(960, 720, np.deg2rad(90))
    plain = LensCamera(960, 720, np.deg2rad(90))
    assert np.allclose(plain.project(points), ideal.project(points))
    pixels = plain.project(points)
    assert np.allclose(plain.unproject(pixels, points[:, 2]), ideal.unproject(pixels, points[:, 2]))
    assert np.isnan(PORT.project(np.array([[0.0, 0.0, 0.01], [0.0, 0.0, -1.0]]))).all()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: LensCamera(960, 720, np.deg2rad(100), port=FlatPort()), "at most 97"),
        (lambda: LensCamera(960, 720, np.deg2rad(90), (-0.5, 0.0, 0.0, 0.0)), "folds"),
        (lambda: LensCamera(960, 720, 1.0, (np.nan, 0.0, 0.0, 0.0)), "finite"),
        (lambda: LensCamera(0, 720, 1.0), "at least 1"),
        (lambda: FlatPort(air_m=-0.1), "negative"),
        (lambda: FlatPort(water_index=0.9), "indices"),
    ],
)
def test_impossible_lenses_are_refused(make, says):
    """More than Snell's window, a distortion that folds the image, no numbers, negative sizes: InputError."""
    with pytest.raises(InputError, match=says):
        make()

"""The pinhole camera: projection and rays undo each other, and the conventions are COLMAP's."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.vision.imaging import PinholeCamera


@given(
    st.integers(1, 4000),
    st.integers(1, 4000),
    st.floats(0.1, 3.0),
    st.floats(-1e4, 1e4),
    st.floats(-1e4, 1e4),
    st.floats(1e-3, 1e3),
)
def test_projection_undoes_rays(width, height, fov, x, y, depth):
    """Any pixel's ray, at any depth, projects to that pixel."""
    camera = PinholeCamera(width, height, fov)
    pixel = np.array([[x, y]])
    assert np.allclose(camera.project(depth * camera.rays(pixel)), pixel, atol=1e-6)


def test_field_of_view_spans_the_width():
    """The rays through the left and right edge of the image are the field of view apart; K says the same as project."""
    camera = PinholeCamera(960, 720, math.radians(90))
    left, right = camera.rays(np.array([[0.0, 360.0], [960.0, 360.0]]))
    assert math.isclose(math.atan2(right[0], right[2]) - math.atan2(left[0], left[2]), math.radians(90))
    point = np.array([0.1, -0.2, 0.7])
    homogeneous = camera.K @ point
    assert np.allclose(camera.project(point[None])[0], homogeneous[:2] / homogeneous[2])
    assert camera.focal_px == pytest.approx(480.0)


def test_points_behind_have_no_pixel():
    """A point in or behind the camera's plane gives NaN."""
    pixels = PinholeCamera(64, 48, 1.0).project(np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(pixels[:2]).all()
    assert np.allclose(pixels[2], [32.0, 24.0])


@pytest.mark.parametrize("arguments", [(0, 10, 1.0), (10, -1, 1.0), (10, 10, 0.0), (10, 10, 3.2)])
def test_bad_cameras_are_refused(arguments):
    """An image without pixels and an impossible field of view raise InputError."""
    with pytest.raises(InputError, match="camera"):
        PinholeCamera(*arguments)

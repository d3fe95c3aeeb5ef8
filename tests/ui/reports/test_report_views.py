"""Laws of the rendered views: orientation, cover, colours."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from wakewise.ui.reports.svg_style import NOT_COVERED, OVER_LIMIT, error_colours, rgb
from wakewise.ui.reports.trial import TrialMesh
from wakewise.ui.reports.views import SIDES, ViewBounds, Viewpoint, coverage_colours, draw_cloud, draw_surface

PIXELS = 64


def _decoded(uri: str) -> np.ndarray:
    raw = np.frombuffer(base64.b64decode(uri.split(",")[1]), np.uint8)
    return cv2.imdecode(raw, cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]].astype(float) / 255


def _plate(centre: np.ndarray, along: np.ndarray, up: np.ndarray) -> TrialMesh:
    corners = centre + np.array([-along - up, along - up, along + up, up - along])
    return TrialMesh(vertices_m=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize("view", SIDES, ids=lambda v: v.name)
def test_axes_of_a_view_are_right_handed(view: Viewpoint) -> None:
    """Right, up and toward the viewer are orthonormal and turn the right way round."""
    frame = np.stack(view.axes)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_east_is_on_the_left_when_seen_from_the_north() -> None:
    """Facing south, east is on the left hand; from above with north up it is on the right; up is up from any side."""
    north, east, south, west, above = (v.axes for v in SIDES)
    east_W, north_W = np.array([0.0, 1, 0]), np.array([1.0, 0, 0])
    assert north[0] @ east_W == pytest.approx(-1)
    assert south[0] @ east_W == pytest.approx(1)
    assert east[0] @ north_W == pytest.approx(1)
    assert west[0] @ north_W == pytest.approx(-1)
    assert above[0] @ east_W == pytest.approx(1)
    assert above[1] @ north_W == pytest.approx(1, abs=1e-3)
    assert all(axes[1][2] < 0 for axes in (north, east, south, west))


def test_a_square_facing_the_viewer_fills_its_share_of_the_picture() -> None:
    """A plate of half the frame's width covers a quarter of the pixels, in its own colour, whichever way it faces."""
    view = Viewpoint(name="level", azimuth_deg=180, elevation_deg=0)
    plate = _plate(np.zeros(3), np.array([0, 0.5, 0]), np.array([0, 0, 0.5]))
    frame = ViewBounds(centre_m=np.zeros(3), radius_m=1.0)
    red = np.tile([1.0, 0.0, 0.0], (4, 1))
    for faces in (plate.faces, plate.faces[:, ::-1]):
        turned = TrialMesh(vertices_m=plate.vertices_m, faces=faces)
        image = _decoded(draw_surface(turned, red, (view,), frame, PIXELS)[0])
        assert image[..., 3].mean() == pytest.approx(0.25, abs=0.01)
        seen = image[image[..., 3] > 0.99]
        assert (seen[:, 0] > 0.5).all()
        assert (seen[:, 1:3] < 1e-6).all()


def test_the_nearer_point_hides_the_farther() -> None:
    """In a cloud, as on a surface."""
    view = Viewpoint(name="from the south", azimuth_deg=180, elevation_deg=0)
    points = np.array([[-0.5, 0, 0], [0.5, 0, 0]])
    colours = np.array([[0, 1.0, 0], [1.0, 0, 0]])
    for order in ([0, 1], [1, 0]):
        frame = ViewBounds(centre_m=np.zeros(3), radius_m=1.0)
        image = _decoded(draw_cloud(points[order], colours[order], (view,), frame, PIXELS)[0])
        middle = image[PIXELS // 2, PIXELS // 2]
        assert middle[1] > 0.5 > middle[0]


def test_colours_tell_errors_apart() -> None:
    """Beyond the limit a colour of its own; uncovered truth another; what does not count a third."""
    errors = np.array([0.0, 0.0015, 0.003, 0.0031, 1.0])
    colours = error_colours(errors)
    assert len(np.unique(colours.round(6), axis=0)) == 4
    np.testing.assert_allclose(colours[3:], np.tile(rgb(OVER_LIMIT), (2, 1)))
    covered = coverage_colours(errors, np.array([True, True, True, True, False]))
    np.testing.assert_allclose(covered[3], rgb(NOT_COVERED))
    assert not np.allclose(covered[4], rgb(NOT_COVERED))

"""The bed drawn triangle by triangle is the bed that each pixel's own ray walks to."""

import numpy as np
import pytest
from imaging_helpers import BED_Z, box_scene, view

from wakewise.core.geometry import Pose, look_at
from wakewise.vision.imaging import PinholeCamera
from wakewise.vision.imaging.bed_view import draw_bed, project_bed
from wakewise.vision.imaging.camera import DISTORTED

CAMERA = PinholeCamera(240, 180, np.deg2rad(90))
R_BC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def drawn(X_WC, row, bands=((0, 100), (100, 180))):
    """Kind, depth, radiance and lamps' part of the box scene's bed."""
    scene = box_scene()
    n, R, origin = len(scene.bed.lines_m), X_WC.R, X_WC.p_m - scene.foot_W_m
    of_bed = slice(scene.first_bed_vertex, scene.first_bed_vertex + n * n)
    attributes = np.concatenate([scene.normals[of_bed], scene.daylight[of_bed, :1]], axis=1)
    crossings, boxes = np.empty((n, n, 5)), np.empty((*scene.bed.tops_m.shape, 4))
    project_bed(scene.bed, row, R, origin, crossings, boxes)
    kind, depth = np.full((180, 240), -1, np.int8), np.full((180, 240), np.inf, np.float32)
    radiance, lamp = np.zeros((180, 240, 3), np.float32), np.zeros((180, 240, 3), np.float32)
    lamps = origin + np.array([[0.2, 0.0, 0.0]])
    for first, last in bands:
        draw_bed(
            first, last, row, R, origin, scene.bed, crossings, boxes, attributes, scene.bed_maps, 0.1, lamps, kind,
            depth, radiance, lamp, 1,
        )  # fmt: skip
    return kind, depth, radiance, lamp


def along_the_ground(height_m, azimuth):
    """A camera low over the relief, looking level: triangles reach from before it to behind it."""
    eye = np.array([0.9, 0.3, BED_Z - height_m])
    way = np.array([np.cos(azimuth), np.sin(azimuth), 0.02])
    return Pose.from_matrix(look_at(eye, eye + way) @ R_BC, eye)


@pytest.mark.parametrize(
    "X_WC",
    [view(70), view(25, 200), along_the_ground(0.04, 0.4), along_the_ground(0.06, 3.9)],
    ids=["down", "slanting", "low", "lower"],
)
def test_drawn_triangles_are_those_that_rays_walk_to(X_WC):
    """Drawing and walking give the same pixels the same depth, to 1 um a metre, and the same colour.

    A row that says "distorted", by nothing, sends every pixel's ray walking.
    """
    walking = CAMERA.row.copy()
    walking[0] = DISTORTED
    fast, slow = drawn(X_WC, CAMERA.row), drawn(X_WC, walking)
    assert (fast[0] == 1).mean() > 0.3
    assert np.array_equal(fast[0], slow[0])
    seen = fast[0] == 1
    assert np.allclose(fast[1][seen], slow[1][seen], rtol=1e-6)
    for k in (2, 3):
        assert np.allclose(fast[k], slow[k], rtol=1e-3, atol=1e-4)


def test_bands_do_not_matter():
    """The image is the same bytes in one band as in many."""
    one, many = (
        drawn(view(30), CAMERA.row, [(0, 180)]),
        drawn(view(30), CAMERA.row, [(k, k + 20) for k in range(0, 180, 20)]),
    )
    for a, b in zip(one, many, strict=True):
        assert a.tobytes() == b.tobytes()

"""Area and volume of what stands clear of the bed."""

import numpy as np
import pytest

from wakewise.scene.targets import Mesh, coral
from wakewise.vision.evaluation.cloud_to_surface import Crop, area_and_volume


def _box(low, high):
    x0, y0, z0 = low
    x1, y1, z1 = high
    corners = np.array([[x, y, z] for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def test_a_box_has_its_area_and_volume():
    """Whole, without a bed."""
    area, volume = area_and_volume(_box((0.0, 0.0, 0.0), (0.1, 0.2, 0.3)), Crop())
    assert area == pytest.approx(2.0 * (0.02 + 0.03 + 0.06))
    assert volume == pytest.approx(0.006)


def test_an_open_bottom_needs_no_lid():
    """Without the faces that lie on the cut the volume is the same, and the area less by them."""
    box = _box((0.0, 0.0, 1.0), (0.1, 0.1, 1.2))
    bottom = np.all(box.vertices_m[box.faces][:, :, 2] > 1.2 - 1e-9, axis=1)
    assert bottom.sum() == 2
    crop = Crop(bed_z_m=1.21)  # clear of the bed by the clearance: cut at the bottom itself
    whole = area_and_volume(_box((0.0, 0.0, 1.0), (0.1, 0.1, 1.2 - 1e-9)), crop)
    open_area, open_volume = area_and_volume(Mesh(box.vertices_m, box.faces[~bottom]), crop)
    assert open_volume == pytest.approx(0.002)
    assert whole[0] - open_area == pytest.approx(0.01, rel=1e-6)


def test_turning_faces_round_changes_nothing_and_nothing_is_zero():
    """Orientation is a convention of files; of a mesh below the bed nothing counts."""
    box = _box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
    turned = Mesh(box.vertices_m, box.faces[:, ::-1])
    assert area_and_volume(turned, Crop()) == pytest.approx(area_and_volume(box, Crop()))
    assert area_and_volume(box, Crop(bed_z_m=0.0)) == (0.0, 0.0)


def test_a_ball_half_in_the_bed_is_half_a_ball():
    """Faces on the cut are whole or left out, which is a per cent of the area and less of the volume."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    mesh = Mesh(np.add(ball.vertices, [0.3, -0.2, 1.0]), np.asarray(ball.faces))
    area, volume = area_and_volume(mesh, Crop(bed_z_m=1.0 + 0.010))
    assert area == pytest.approx(2.0 * np.pi * 0.1**2, rel=0.015)
    assert volume == pytest.approx(2.0 / 3.0 * np.pi * 0.1**3, rel=0.005)


def test_of_a_closed_coral_it_is_what_a_mesh_library_says():
    """Uncut, against trimesh."""
    trimesh = pytest.importorskip("trimesh")
    mesh = coral("brain", 0)
    whole = trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False)
    area, volume = area_and_volume(mesh, Crop())
    assert (area, volume) == (pytest.approx(float(whole.area)), pytest.approx(abs(float(whole.volume))))

"""Level sections against shapes whose moments are known."""

import numpy as np
import pytest
from rods import rod_mesh, together

from wakewise.scene.targets.elasticity import sections

HEIGHTS = np.array([0.013, 0.05, 0.2])


def test_an_ellipse_has_the_moments_of_the_textbook():
    """Area pi a b, second moments pi a^3 b / 4, displaced water pi b^2 across b, reach a^2; nothing above its end."""
    a, b = 0.004, 0.002
    mesh = rod_mesh(a, b, 0.1, around=256)
    found = sections(mesh.vertices_m, mesh.faces, HEIGHTS)
    expected = np.pi / 4 * a * b * np.diag([a**2, b**2])
    for k in (0, 1):
        assert found.area_m2[k] == pytest.approx(np.pi * a * b, rel=1e-3)
        np.testing.assert_allclose(found.second_m4[k], expected, rtol=2e-3, atol=1e-5 * expected.max())
        np.testing.assert_allclose(found.displaced_m2[k], np.pi * np.diag([b**2, a**2]), rtol=2e-3, atol=1e-10)
        np.testing.assert_allclose(found.reach_m2[k], np.diag([a**2, b**2]), rtol=2e-3, atol=1e-10)
    assert found.area_m2[2] == 0.0
    assert not found.second_m4[2].any()


def test_branches_side_by_side_add_their_own_moments():
    """Two rods apart are twice as stiff as one, not as stiff as a pair that is joined."""
    one = rod_mesh(0.003, 0.003, 0.1)
    two = together(rod_mesh(0.003, 0.003, 0.1, at=(0.05, 0.0)), rod_mesh(0.003, 0.003, 0.1, at=(-0.03, 0.02)))
    single, pair = (sections(mesh.vertices_m, mesh.faces, HEIGHTS[:2]) for mesh in (one, two))
    np.testing.assert_allclose(pair.area_m2, 2 * single.area_m2, rtol=1e-9)
    np.testing.assert_allclose(pair.second_m4, 2 * single.second_m4, rtol=1e-6, atol=1e-16)
    np.testing.assert_allclose(pair.reach_m2, single.reach_m2, rtol=1e-6, atol=1e-12)


def test_a_cavity_is_taken_away():
    """A tube has the area and the second moment of the rod less those of its bore."""
    outer, bore = rod_mesh(0.010, 0.010, 0.1, around=128), rod_mesh(0.008, 0.008, 0.1, around=128)
    tube = together(outer, type(bore)(bore.vertices_m, bore.faces[:, ::-1]))
    found = sections(tube.vertices_m, tube.faces, HEIGHTS[:1])
    assert found.area_m2[0] == pytest.approx(np.pi * (0.010**2 - 0.008**2), rel=2e-3)
    assert found.second_m4[0, 0, 0] == pytest.approx(np.pi / 4 * (0.010**4 - 0.008**4), rel=2e-3)
    assert found.displaced_m2[0, 0, 0] == pytest.approx(np.pi * 0.010**2, rel=2e-3)


def test_the_mesh_may_be_turned_inside_out():
    """What is cut does not depend on which way all the faces look."""
    mesh = rod_mesh(0.004, 0.002, 0.1)
    there, back = (sections(mesh.vertices_m, faces, HEIGHTS) for faces in (mesh.faces, mesh.faces[:, ::-1]))
    np.testing.assert_allclose(there.second_m4, back.second_m4, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(there.area_m2, back.area_m2, rtol=1e-9)

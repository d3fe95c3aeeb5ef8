"""Bending by the modes against beam theory."""

import numpy as np
import pytest
from rods import BED_Z, rod, rod_mesh, together

from wakewise.core.errors import InputError
from wakewise.scene.targets import BendingModes, Mesh, TissueProperties, place_on_bed, turned_normals

WATER = 1000.0
E = 1e6
FLESH = TissueProperties(stiffness_Pa=E, density_kg_m3=WATER, drag=1.2, damping=0.1)


def test_an_even_rod_bends_as_beam_theory_says():
    """The stiffness against an even load is that of w L^4 / 8 EI; the frequency 3.516 sqrt(EI / m L^4), within 1 %."""
    r, length = 0.0025, 0.1
    sway = BendingModes.of(rod(r, r, length), FLESH, WATER)
    second = np.pi / 4 * r**4
    per_tip = np.trapezoid(sway.shape[0], dx=length / (sway.shape.shape[2] - 1), axis=1)
    np.testing.assert_allclose(per_tip / sway.stiffness_N_m[0], length**4 / (8 * E * second), rtol=0.01)
    mass_per_m = 2 * WATER * np.pi * r**2  # its own and as much water
    lowest = 3.516 / (2 * np.pi) * np.sqrt(E * second / (mass_per_m * length**4))
    np.testing.assert_allclose(sway.frequency_Hz[0], lowest, rtol=0.01)
    # Under an even load the moment at the foot is w L^2 / 2, so the stress there is 4 E r / L^2 per metre of the tip.
    np.testing.assert_allclose(sway.stress_Pa_m[0], 4 * E * r / length**2, rtol=0.04)


def test_a_strip_is_softest_across():
    """The first mode of a flat blade goes across it; stiffnesses are as the squares of the widths."""
    sway = BendingModes.of(rod(0.006, 0.002), FLESH, WATER)
    np.testing.assert_allclose(np.abs(sway.axes_W[0, 0]), [0.0, 1.0], atol=1e-6)
    assert sway.stiffness_N_m[0, 1] / sway.stiffness_N_m[0, 0] == pytest.approx(9.0, rel=0.01)
    # Water moves along as in a circle over the width: pi a^2 across, pi b^2 along.
    mass = sway.mass_kg[0] / np.trapezoid(sway.shape[0] ** 2, dx=0.1 / (sway.shape.shape[2] - 1), axis=1)
    own = np.pi * 0.006 * 0.002
    np.testing.assert_allclose(mass, WATER * (own + np.pi * np.array([0.006**2, 0.002**2])), rtol=0.01)


def test_pieces_that_stand_alone_are_stems_of_their_own():
    """Two rods are two stems, a stump is none, and each vertex knows its own."""
    mesh = together(
        rod_mesh(0.003, 0.003, 0.1),
        rod_mesh(0.003, 0.003, 0.08, at=(0.05, 0)),
        rod_mesh(0.01, 0.01, 0.01, at=(-0.05, 0)),
    )
    target = place_on_bed("rods", mesh, BED_Z)
    sway = BendingModes.of(target, FLESH, WATER)
    np.testing.assert_allclose(sway.height_m, [0.1, 0.08], atol=1e-9)
    tips = np.array([[0.01, 0.0], [0.0, 0.02]])
    moved = sway.moved(sway.stem, target.mesh.vertices_m, tips)
    top = target.mesh.vertices_m[:, 2] < BED_Z - 0.0799
    x = target.mesh.vertices_m[:, 0]
    assert np.linalg.norm(moved[top & (np.abs(x) < 0.01), :2], axis=1).max() == pytest.approx(0.01, rel=1e-6)
    assert np.linalg.norm(moved[top & (x > 0.04), :2], axis=1).max() == pytest.approx(0.02, rel=1e-6)
    assert not moved[x < -0.03].any()
    assert not moved[target.mesh.vertices_m[:, 2] > BED_Z].any()


def test_bending_keeps_the_length_of_the_axis():
    """To second order in the tip's way the axis is as long as at rest, and the foot stays where it is."""
    sway = BendingModes.of(rod(), FLESH, WATER)
    z = BED_Z - np.linspace(0.0, 0.1, 400)
    points = np.column_stack([np.zeros(400), np.zeros(400), z])
    stem = np.zeros(400, dtype=np.int64)
    for tip in (0.01, 0.03):
        axis = points + sway.moved(stem, points, np.array([[tip, 0.0]]))
        length = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
        assert abs(length - 0.1) < 0.5 * 0.1 * (tip / 0.1) ** 4 + 1e-5
        np.testing.assert_allclose(axis[0], points[0], atol=1e-12)


def test_the_turned_normals_are_those_of_the_moved_surface():
    """Normals by the slope agree with those of the moved mesh's faces."""
    target = rod(0.004, 0.004)
    sway = BendingModes.of(target, FLESH, WATER)
    tips = np.array([[0.012, -0.006]])
    moved, tilt = sway.bent(tips)
    corners = (target.mesh.vertices_m + moved)[target.mesh.faces]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = BED_Z - target.mesh.vertices_m[target.mesh.faces, 2]
    side = (height.min(axis=1) > 0.005) & (np.ptp(height, axis=1) > 0.0)
    rest = target.mesh.triangles_m
    flat = np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0])
    turned = turned_normals(flat / np.linalg.norm(flat, axis=1, keepdims=True), tilt[target.mesh.faces].mean(axis=1))
    agree = np.sum(turned * faces / np.linalg.norm(faces, axis=1, keepdims=True), axis=1)
    assert agree[side].min() > 0.9995


def test_what_floats_stands_stiffer_and_what_is_heavy_falls():
    """Buoyancy adds to the stiffness; a limp and heavy one is refused in a line that says so."""
    light, even = (
        BendingModes.of(rod(), TissueProperties(stiffness_Pa=1e5, density_kg_m3=d, drag=1.2, damping=0.1), WATER)
        for d in (700.0, 1000.0)
    )
    assert light.stiffness_N_m[0, 0] > 1.01 * even.stiffness_N_m[0, 0]
    with pytest.raises(InputError, match="cannot stand upright"):
        BendingModes.of(rod(), TissueProperties(stiffness_Pa=1e3, density_kg_m3=2000.0, drag=1.2, damping=0.1), WATER)


def test_an_open_mesh_is_refused():
    """It has no sections."""
    mesh = rod_mesh(0.003, 0.003, 0.1)
    with pytest.raises(InputError, match="closed"):
        BendingModes.of(place_on_bed("open", Mesh(mesh.vertices_m, mesh.faces[:-3]), BED_Z), FLESH, WATER)

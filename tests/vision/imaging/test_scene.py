"""The scene: what is refused, what stands where, and how daylight falls."""

import numpy as np
import pytest
from imaging_helpers import BED_Z, box, box_scene

from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh
from wakewise.vision.imaging import Scene
from wakewise.vision.imaging.daylight import sky_radiance
from wakewise.vision.imaging.scene import _icosphere, outward_oriented, vertex_normals
from wakewise.vision.imaging.texture import bake_bed


@pytest.mark.parametrize("wrong", [{"seed": -1}, {"seed": 0, "bed_half_m": 0.0}, {"seed": 0, "stones": -1}])
def test_numbers_out_of_range_are_refused(wrong):
    """A negative seed or number of stones and a bed without width raise InputError."""
    with pytest.raises(InputError, match="scene"):
        Scene.build(box(), **wrong)


def test_target_stays_where_it_is_and_stones_keep_away():
    """The target's vertices are untouched, and no stone's vertex is nearer than 2 cm to its bounding circle."""
    scene, target = box_scene(), box()
    n = len(target.mesh.vertices_m)
    assert np.allclose(scene.vertices_F_m[:n] + scene.foot_W_m, target.mesh.vertices_m, atol=1e-7)
    stones = scene.vertices_F_m[np.unique(scene.faces[scene.first_face[2] :])]
    corner = np.hypot(0.06, 0.05)
    assert len(stones) == 20 * 162
    assert np.hypot(stones[:, 0], stones[:, 1]).min() > corner + 0.02
    assert np.allclose(scene.foot_W_m, [0.0, 0.0, BED_Z])


def test_normals_point_out_whatever_the_winding():
    """Box normals lead away from its centre, a mesh that is inside out is turned, and the bed's normals lead up."""
    scene, target = box_scene(), box()
    away = scene.vertices_F_m[:8] + scene.foot_W_m - target.centre_W_m
    assert (np.sum(scene.normals[:8] * away, axis=1) > 0).all()
    turned = outward_oriented(Mesh(target.mesh.vertices_m, target.mesh.faces[:, ::-1]))
    assert np.allclose(vertex_normals(turned.vertices_m, turned.faces), scene.normals[:8], atol=1e-6)
    bed = slice(8, int(scene.faces[scene.first_face[1] : scene.first_face[2]].max()) + 1)
    assert (scene.normals[bed, 2] < -0.5).all()


def test_normals_of_a_sphere_are_radial():
    """Area-weighted vertex normals of a fine sphere are its radii, within a degree."""
    points, faces = _icosphere(3)
    assert np.sum(vertex_normals(points, faces) * points, axis=1).min() > np.cos(np.deg2rad(1.0))


def test_daylight_is_one_on_the_open_bed_and_less_in_shade():
    """Sky radiance integrates to 1 over a level surface; the open bed gets 1, the bed beside the box clearly less."""
    k = np.arange(20000)
    up = np.sqrt(1.0 - (k + 0.5) / len(k))
    assert sky_radiance(up).mean() == pytest.approx(1.0, abs=1e-3)
    scene = box_scene()
    bed = np.unique(scene.faces[scene.first_face[1] : scene.first_face[2]])
    x, y, light = *scene.vertices_F_m[bed, :2].T, scene.daylight[bed, 0]
    assert abs(light[np.hypot(x, y) > 3.0].mean() - 1.0) < 0.02
    beside = (np.abs(x) < 0.075) & (np.abs(y) < 0.065) & ((np.abs(x) > 0.062) | (np.abs(y) > 0.052))
    assert 0.2 < light[beside].mean() < 0.8


def test_same_seed_same_scene():
    """The seed alone decides sand, stones and light."""
    again = Scene.build(box(), 3, stones=20)
    for name in ("vertices_F_m", "faces", "daylight", "bed_maps"):
        assert np.array_equal(getattr(again, name), getattr(box_scene(), name))
    assert not np.array_equal(bake_bed(64, 1, 0.001, 3000), bake_bed(64, 1, 0.001, 4000))

"""The procedural corals are closed, of the stated size, and the same for the same seed."""

import numba
import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.errors import InputError
from wakewise.scene.targets import coral, coral_kinds, soft_kinds, stony_kinds
from wakewise.scene.targets.fields import add_cones, labyrinth, noise


def surface_samples(mesh, count):
    faces = np.random.default_rng(0).choice(len(mesh.faces), count, p=mesh.face_areas_m2 / mesh.face_areas_m2.sum())
    points = mesh.triangles_m[faces].mean(axis=1)
    normals = mesh.area_vectors_m2[faces] / mesh.face_areas_m2[faces, None]
    return points[points[:, 2] > 0.001], normals[points[:, 2] > 0.001]


def test_the_kinds_are_those_promised():
    """Branching, brain and plate are stony; four are soft."""
    assert stony_kinds() == ["brain", "branching", "plate"]
    assert soft_kinds() == ["anemone", "gorgonian", "seagrass", "soft-coral"]
    assert coral_kinds() == stony_kinds() + soft_kinds()


@pytest.mark.parametrize("kind", stony_kinds())
def test_a_coral_is_one_closed_piece_of_the_stated_size(kind):
    """Closed, in one piece, outward, 12 to 18 cm, standing through z = 0, fine enough and not too fine."""
    mesh = coral(kind)
    assert mesh.is_closed
    assert mesh.volume_m3 > 1e-4
    assert 60_000 <= len(mesh.faces) <= 200_000
    n = len(mesh.vertices_m)
    edges = coo_array((np.ones(len(mesh.faces) * 2), (mesh.faces[:, :2].ravel(), mesh.faces[:, 1:].ravel())), (n, n))
    assert connected_components(edges, directed=False)[0] == 1
    above = mesh.vertices_m[mesh.vertices_m[:, 2] > 0]
    assert np.append(np.ptp(above[:, :2], axis=0), above[:, 2].max()).max() == pytest.approx(0.15, abs=1e-6)
    assert 0.12 <= mesh.extent_m.max() <= 0.18
    assert -0.02 < mesh.vertices_m[:, 2].min() < -0.005


@pytest.mark.parametrize("kind", stony_kinds())
def test_most_of_a_coral_can_be_seen_from_the_orbits(kind):
    """At least 90 % of the surface above the bed faces three or more of 36 views at 20, 40 and 60 degrees."""
    mesh = coral(kind)
    points, normals = surface_samples(mesh, 1500)
    scene = EmbreeScene()
    keep = TriangleMesh(scene, mesh.triangles_m.astype(np.float32))
    views = np.zeros(len(points))
    for elevation in np.deg2rad([20, 40, 60]):
        for azimuth in np.arange(12) * np.pi / 6:
            eye = 0.5 * np.array(
                [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
            )
            sight = eye - points
            sight /= np.linalg.norm(sight, axis=1)[:, None]
            facing = np.sum(sight * normals, axis=1) > np.cos(np.deg2rad(78))
            hidden = scene.run((points + 5e-5 * normals).astype(np.float32), sight.astype(np.float32)) >= 0
            views += facing & ~hidden
    assert keep is not None
    assert np.mean(views >= 3) >= 0.90


def test_plates_are_at_least_five_millimetres_thick():
    """Measured inward from the faces of the plate coral, all but the rounded rims are at least 5 mm through."""
    mesh = coral("plate")
    points, normals = surface_samples(mesh, 2000)
    scene = EmbreeScene()
    keep = TriangleMesh(scene, mesh.triangles_m.astype(np.float32))
    hit = scene.run((points - 1e-5 * normals).astype(np.float32), (-normals).astype(np.float32), output=True)
    assert keep is not None
    assert np.quantile(hit["tfar"], 0.05) >= 0.005


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_colony():
    """A coral is a function of kind and seed; asking twice costs nothing."""
    first = coral("plate")
    assert coral("plate") is first
    again = coral.__wrapped__("plate", 0)
    assert again.vertices_m.tobytes() == first.vertices_m.tobytes()
    assert again.faces.tobytes() == first.faces.tobytes()
    assert len(coral("plate", 1).faces) != len(first.faces)


def test_the_field_does_not_depend_on_the_number_of_threads():
    """One thread and all threads give the same bytes."""
    start, end = np.zeros((2, 3)), np.array([[0.03, 0.0, 0.02], [-0.02, 0.03, 0.01]])
    fields = []
    for threads in (1, numba.config.NUMBA_NUM_THREADS):
        before = numba.get_num_threads()
        numba.set_num_threads(threads)
        values = np.full((40, 40, 40), 1.0, dtype=np.float32)
        add_cones(values, np.full(3, -0.04), 0.002, start, end, np.full(2, 0.01), np.full(2, 0.008), 0.005)
        numba.set_num_threads(before)
        fields.append(values.tobytes())
    assert fields[0] == fields[1]


def test_a_cone_of_equal_radii_is_a_capsule():
    """The field of one cone is the distance to its axis less the radius, near it."""
    values = np.full((30, 30, 30), 1.0, dtype=np.float32)
    origin, spacing, radius = np.full(3, -0.03), 0.002, 0.01
    start, end = np.array([[-0.01, 0.0, 0.0]]), np.array([[0.01, 0.0, 0.0]])
    add_cones(values, origin, spacing, start, end, np.array([radius]), np.array([radius]), 0.004)
    places = origin + spacing * np.argwhere(values < 0.5)
    aside = places - np.stack([np.clip(places[:, 0], -0.01, 0.01), *np.zeros((2, len(places)))], axis=1)
    np.testing.assert_allclose(values[values < 0.5], np.linalg.norm(aside, axis=1) - radius, atol=1e-7)


def test_noise_is_continuous_and_bounded():
    """Value noise stays within [-1, 1] and changes little over a short step, across lattice planes too."""
    rng = np.random.default_rng(1)
    places = np.concatenate([rng.uniform(-5, 5, (300, 3)), np.round(rng.uniform(-5, 5, (300, 3)))])
    here = np.array([noise(*p, 4) for p in places])
    there = np.array([noise(*(p - 1e-6), 4) for p in places])
    assert np.abs(here).max() <= 1.0
    assert here.std() > 0.2
    np.testing.assert_allclose(here, there, atol=2e-5)


def test_the_labyrinth_has_the_wavelength_asked_for():
    """The spectrum of the pattern peaks at the wavelength given in cells."""
    pattern = labyrinth(128, 10.0, np.random.default_rng(0))
    power = np.abs(np.fft.fft2(pattern)) ** 2
    k = np.fft.fftfreq(128)
    radius = np.hypot(k[:, None], k[None, :])
    assert 1 / np.average(radius, weights=power * (radius < 0.2)) == pytest.approx(10.0, rel=0.15)


@pytest.mark.parametrize(("kind", "seed"), [("sponge", 0), ("brain", -1)])
def test_an_unknown_kind_or_seed_is_refused(kind, seed):
    """The message says what is allowed."""
    with pytest.raises(InputError, match=r"branching|allowed 0 to"):
        coral(kind, seed)

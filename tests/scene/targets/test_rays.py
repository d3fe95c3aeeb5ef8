"""Rays meet the first face on their way: as a plain search over all faces does, and as Embree does."""

import numpy as np
import pytest
import trimesh

from wakewise.scene.targets import Mesh, coral
from wakewise.scene.targets.rays import Rays


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def plain(mesh: Mesh, start, way):
    """The readable twin: the plane of every face, and whether the point on it is inside (Cramer's rule)."""
    best, met = np.inf, -1
    for number, (a, b, c) in enumerate(mesh.triangles_m):
        matrix = np.stack([b - a, c - a, -way], axis=1)
        if abs(np.linalg.det(matrix)) < 1e-30:
            continue
        u, v, t = np.linalg.solve(matrix, start - a)
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and 0.0 < t < best:
            best, met = t, number
    return met, best


def test_the_first_face_is_that_of_a_plain_search(rng):
    """Rays from inside, outside and past a small mesh of faces in no order."""
    mesh = Mesh(rng.normal(size=(60, 3)), rng.integers(0, 60, (90, 3)))
    starts, ways = rng.normal(size=(200, 3)) * 1.5, rng.normal(size=(200, 3))
    ways[:20, 0], ways[20:40, 1:] = 0.0, 0.0
    face, distance = Rays(mesh).first(starts, ways)
    wanted = [plain(mesh, start, way) for start, way in zip(starts, ways, strict=True)]
    np.testing.assert_array_equal(face, [number for number, _ in wanted])
    np.testing.assert_allclose(distance, [way for _, way in wanted], rtol=1e-9)
    assert 20 < np.sum(face >= 0) < 190


@pytest.mark.parametrize("count", [1, 2, 4, 5, 17])
def test_a_mesh_may_have_any_number_of_faces(count, rng):
    """The tree's last leaves may be part full or empty."""
    vertices = np.array([[0.0, 0, k] for k in range(count)] + [[1.0, 0, 0], [0, 1.0, 0]])
    mesh = Mesh(vertices, np.array([[k, count, count + 1] for k in range(count)]))
    face, distance = Rays(mesh).first(np.array([[0.2, 0.2, -1.0], [5.0, 5.0, -1.0]]), np.array([0.0, 0.0, 2.0]))
    assert face.tolist() == [0, -1]
    assert distance[0] == pytest.approx(0.5)
    assert np.isinf(distance[1])
    assert len(Rays(mesh).first(np.zeros((0, 3)), np.array([0.0, 0.0, 1.0]))[0]) == 0


def test_no_ray_slips_through_an_edge_or_a_corner():
    """From the middle of a closed ball every ray is stopped, also those that aim at a vertex or along an edge."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh(np.array(ball.vertices), np.array(ball.faces))
    edges = 0.37 * mesh.vertices_m[mesh.faces[:, 0]] + 0.63 * mesh.vertices_m[mesh.faces[:, 1]]
    ways = np.concatenate([mesh.vertices_m, edges])
    face, distance = Rays(mesh).first(np.zeros_like(ways), ways)
    assert np.all(face >= 0)
    np.testing.assert_allclose(distance, 1.0, atol=1e-12)


@pytest.mark.parametrize("kind", ["branching", "brain", "plate"])
def test_embree_meets_the_same_faces(kind, rng):
    """Of 20,000 rays about a coral no more than one in a thousand differs, by Embree's single precision: 1 um."""
    construction = pytest.importorskip("embreex.mesh_construction")
    from embreex.rtcore_scene import EmbreeScene

    mesh = coral(kind)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    starts = low - 0.02 + (high - low + 0.04) * rng.random((20_000, 3))
    ways = rng.normal(size=starts.shape)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways[:5000] = [0.0, 0.0, 1.0]
    face, distance = Rays(mesh).first(starts, ways)
    scene = EmbreeScene()
    held = construction.TriangleMesh(scene, mesh.triangles_m.astype(np.float32))
    hit = scene.run(starts.astype(np.float32), ways.astype(np.float32), output=True)
    del held
    same = face == hit["primID"]
    assert np.mean(~same) <= 1e-3
    met = same & (face >= 0)
    assert met.sum() > 2000
    assert np.abs(distance[met] - hit["tfar"][met]).max() < 1e-6


def test_the_answer_is_the_same_bytes_on_one_thread():
    """Each ray is cast by one thread, in one order."""
    import numba

    mesh = coral("plate")
    starts = mesh.vertices_m + np.array([0.0, 0.0, 0.5])
    most, down = numba.get_num_threads(), np.array([0.01, 0.02, -1.0])
    many = Rays(mesh).first(starts, down)
    numba.set_num_threads(1)
    try:
        one = Rays(mesh).first(starts, down)
    finally:
        numba.set_num_threads(most)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(many, one, strict=True))

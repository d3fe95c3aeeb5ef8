"""The tree gives the same distance as trying every triangle, and known distances to known shapes."""

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.scene.targets import MeshDistance


def slow_distance(point, corners):
    """Distance to one triangle by least squares over its plane and its three edges: the readable twin."""
    a, b, c = corners
    best = np.inf
    for p, q in ((a, b), (b, c), (c, a)):
        share = np.clip((point - p) @ (q - p) / max((q - p) @ (q - p), 1e-300), 0, 1)
        best = min(best, np.linalg.norm(point - p - share * (q - p)))
    edges = np.stack([b - a, c - a], axis=1)
    s, t = np.linalg.lstsq(edges, point - a, rcond=None)[0]
    if s >= 0 and t >= 0 and s + t <= 1:
        best = min(best, np.linalg.norm(point - a - edges @ [s, t]))
    return best


def test_tree_equals_trying_every_triangle():
    """For random triangles and points the fast distance is the twin's, flat triangles included."""
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(60, 3))
    faces = rng.integers(0, 60, (50, 3))
    faces[0] = [1, 1, 2]
    faces[1] = [3, 3, 3]
    points = rng.normal(size=(80, 3)) * 2
    twin = [min(slow_distance(p, vertices[f]) for f in faces) for p in points]
    assert np.allclose(MeshDistance(vertices, faces)(points), twin, atol=1e-9)


def test_distance_to_a_box():
    """Outside, inside, at a corner and on the surface of a unit cube."""
    box = trimesh.creation.box((1, 1, 1))
    distance = MeshDistance(np.asarray(box.vertices), np.asarray(box.faces))
    points = np.array([[2.0, 0, 0], [0.2, 0, 0], [1.5, 1.5, 1.5], [0.5, 0.1, 0.2]])
    assert np.allclose(distance(points), [1.5, 0.3, np.sqrt(3), 0.0])


def test_no_faces_is_refused():
    """A mesh without faces has no distance."""
    with pytest.raises(InputError, match="no faces"):
        MeshDistance(np.zeros((3, 3)), np.zeros((0, 3), dtype=np.int64))

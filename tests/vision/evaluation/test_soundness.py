"""Faults of meshes are counted, and a sound one has none."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from wakewise.vision.evaluation import mesh_faults


def mesh(faces, vertices=None):
    ball = trimesh.creation.icosphere(2, 0.05)
    return SimpleNamespace(vertices_m=np.asarray(ball.vertices if vertices is None else vertices), faces=faces)


BALL = np.asarray(trimesh.creation.icosphere(2, 0.05).faces)


def test_a_closed_ball_has_no_faults_and_no_rim_even_as_loose_triangles():
    """Corners that are written once per face, as STL does, are one."""
    assert mesh_faults(mesh(BALL)).words() == []
    ball = mesh(BALL)
    loose = mesh(np.arange(3 * len(BALL)).reshape(-1, 3), ball.vertices_m[BALL].reshape(-1, 3))
    assert mesh_faults(loose) == mesh_faults(ball)
    assert mesh_faults(ball).open_edges == 0


def test_each_fault_is_counted_and_said():
    """A face again the other way round, a fin on an edge, a face that is a line, a hole."""
    a, b, c = BALL[0]
    assert mesh_faults(mesh(np.concatenate([BALL, [[c, b, a]]]))).duplicate_faces == 1
    far = next(v for v in BALL.ravel() if v not in (a, b, c))
    fin = mesh_faults(mesh(np.concatenate([BALL, [[a, b, far]]])))
    assert fin.crowded_edges >= 1 and fin.duplicate_faces == 0 and "non-manifold" in fin.words()[0]
    assert mesh_faults(mesh(np.concatenate([BALL, [[a, b, b]]]))).flat_faces == 1
    assert mesh_faults(mesh(BALL[1:])).open_edges == 3 and mesh_faults(mesh(BALL[1:])).words() == []


@pytest.mark.parametrize("face", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0), (1, 1, 1)])
def test_a_face_with_two_corners_in_one_place_is_flat(face):
    """Whichever two they are: it is counted as flat, and neither as double nor for its edges."""
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    found = mesh_faults(SimpleNamespace(vertices_m=square, faces=np.array([[0, 1, 2], face])))
    assert (found.flat_faces, found.duplicate_faces, found.crowded_edges, found.open_edges) == (1, 0, 0, 3)

"""Meshing: crumbs go, pieces stay."""

import numpy as np
import trimesh

from wakewise.reconstruction.meshing import without_crumbs


def test_crumbs_go_and_everything_worth_showing_stays():
    """Of two balls and a lone tetrahedron the tetrahedron goes; the balls keep every face."""
    large, small = trimesh.creation.icosphere(subdivisions=4), trimesh.creation.icosphere(subdivisions=1)
    crumb = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    balls = np.concatenate([large.faces, small.faces + len(large.vertices)])
    vertices = len(large.vertices) + len(small.vertices) + 4
    faces = np.concatenate([balls, crumb + vertices - 4])
    kept = without_crumbs(faces, vertices)
    assert np.array_equal(kept, balls)

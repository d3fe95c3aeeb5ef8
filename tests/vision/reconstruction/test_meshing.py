"""Meshing: crumbs go, pieces stay."""

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import EnvironmentFailure
from wakewise.vision.reconstruction import ReconstructionSettings, stages
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, write_cloud
from wakewise.vision.reconstruction.outputs.meshing import (
    drop_small_components,
    mesh_points,
    near_subject,
    octree_depth,
)


def test_crumbs_go_and_everything_worth_showing_stays():
    """Of two balls and a lone tetrahedron the tetrahedron goes; the balls keep every face."""
    large, small = trimesh.creation.icosphere(subdivisions=4), trimesh.creation.icosphere(subdivisions=1)
    crumb = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    balls = np.concatenate([large.faces, small.faces + len(large.vertices)])
    vertices = len(large.vertices) + len(small.vertices) + 4
    faces = np.concatenate([balls, crumb + vertices - 4])
    kept = drop_small_components(faces, vertices)
    assert np.array_equal(kept, balls)


def test_a_surface_that_a_full_disk_cut_short_is_not_taken(tmp_path, monkeypatch):
    """What the mesher wrote on a disk without room is no surface, and no failure of the points either."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    points, normals = np.asarray(ball.vertices), np.asarray(ball.vertex_normals)
    write_cloud(
        tmp_path / "dense.ply", OrientedPointCloud(points_m=points, normals=normals, colours=np.full_like(points, 0.5))
    )
    monkeypatch.setattr(stages, "RESERVE_MB", 1e15)
    with pytest.raises(EnvironmentFailure, match="mesh: the disk of"):
        mesh_points(
            tmp_path / "dense.ply",
            tmp_path / "mesh.ply",
            ReconstructionSettings(),
            spacing_m=0.02,
            progress=lambda *_: None,
        )
    assert [path.name for path in tmp_path.iterdir()] == ["dense.ply"]


@pytest.mark.parametrize("reach", [1.2, 10.0, 1000.0])
def test_far_points_do_not_make_the_mesh_coarse(reach):
    """A subject of 512 cells keeps its cell when one point in fifty lies far off, however far: what is meshed ends."""
    rng = np.random.default_rng(0)
    subject = rng.uniform(0.0, 1.0, (20_000, 3))
    far = rng.uniform(-0.5 * reach, 0.5 * reach, (400, 3))
    every = np.concatenate([subject, far])
    kept = every[near_subject(every)]
    assert len(subject) <= len(kept) and (len(kept) < len(every)) == (reach > 4.0)
    for spacing in (0.01, 0.0002):
        cell = np.ptp(subject, axis=0).max() / 2 ** octree_depth(subject, spacing, 9)
        with_far = np.ptp(kept, axis=0).max() / 2 ** octree_depth(kept, spacing, 9)
        assert with_far <= 1.5 * cell


def test_the_octree_is_as_deep_as_the_points_are_dense():
    """Cells of about a point spacing, and never more of them than were asked for."""
    subject = np.random.default_rng(0).uniform(0.0, 1.0, (20_000, 3))
    assert octree_depth(subject, 0.01, 9) == 6 and octree_depth(subject, 0.0002, 9) == 9
    assert octree_depth(subject, 0.0002, 7) == 7

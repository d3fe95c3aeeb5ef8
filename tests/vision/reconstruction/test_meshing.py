"""Meshing: small clusters and components go, what is linked stays, and what is missing is told."""

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import EnvironmentFailure
from wakewise.vision.reconstruction import ReconstructionSettings, stages
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, write_cloud
from wakewise.vision.reconstruction.outputs.meshing import (
    drop_small_components,
    in_large_cluster,
    mesh_points,
    mesh_warnings,
    near_subject,
    octree_depth,
)


def test_components_shorter_than_asked_go_and_the_others_keep_every_face():
    """Of a ball, a bar and a tetrahedron, a lone tetrahedron goes: extent decides, not the number of faces."""
    ball, bar = trimesh.creation.icosphere(subdivisions=4), trimesh.creation.box(extents=(0.01, 0.01, 0.5))
    speck = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    vertices = np.concatenate([ball.vertices, bar.vertices, speck.vertices])
    kept = np.concatenate([ball.faces, bar.faces + len(ball.vertices)])
    faces = np.concatenate([kept, speck.faces + len(ball.vertices) + len(bar.vertices)])
    assert len(speck.faces) > len(bar.faces)
    assert np.array_equal(drop_small_components(faces, vertices, 0.1), kept)


def test_a_small_cluster_goes_and_what_points_link_to_the_rest_stays():
    """A twig stays that a chain of points links to a plane; a speck of as many points above it goes."""
    side = np.arange(0.0, 1.0, 0.005)
    plane = np.stack([*np.meshgrid(side, side), np.zeros((len(side), len(side)))], axis=2).reshape(-1, 3)
    twig = np.stack([np.full(100, 0.5), np.full(100, 0.5), np.linspace(0.0, 0.3, 100)], axis=1)
    speck = np.array([0.5, 0.5, 0.8]) + 0.01 * np.random.default_rng(0).standard_normal((100, 3))
    mask = in_large_cluster(np.concatenate([plane, twig, speck]), 0.03)
    assert mask[: len(plane) + len(twig)].all() and not mask[-len(speck) :].any()


def test_a_thin_twig_on_a_wide_bed_is_meshed_or_the_figures_tell(tmp_path):
    """A twig thinner than the octree's cell stays in the surface as far as that goes; points without it are counted."""
    rng = np.random.default_rng(0)
    bed = np.concatenate([rng.uniform(-1.0, 1.0, (60_000, 2)), rng.normal(0.0, 2e-4, (60_000, 1))], axis=1)
    around, up = rng.uniform(0.0, 2.0 * np.pi, 2000), rng.uniform(0.0, 0.25, 2000)
    side = np.stack([np.cos(around), np.sin(around), np.zeros(2000)], axis=1)
    twig = 0.02 * side + up[:, None] * np.array([0.0, 0.0, 1.0])
    points, normals = np.concatenate([bed, twig]), np.concatenate([np.tile([0.0, 0.0, 1.0], (60_000, 1)), side])
    cloud = OrientedPointCloud(points_m=points, normals=normals, colours=np.full_like(points, 0.5))
    write_cloud(tmp_path / "dense.ply", cloud)
    settings = ReconstructionSettings(mesh_depth=7)
    found = mesh_points(
        tmp_path / "dense.ply", tmp_path / "mesh.ply", settings, spacing_m=0.006, progress=lambda *_: None
    )
    assert found["mesh_points_left_out"] == 0 and found["mesh_bare_pct"] < 0.5
    assert found["mesh_cell_mm"] == pytest.approx(2200.0 / 128, rel=0.02)
    assert trimesh.load(tmp_path / "mesh.ply").vertices[:, 2].max() > 0.24
    assert mesh_warnings(found) == []


def test_a_surface_that_leaves_points_out_is_in_doubt():
    """More than 1 % of the points without surface is a reason against a model; no mesh is none."""
    assert mesh_warnings({"mesh_bare_pct": 1.01})[0].startswith("1.0 % of the dense points have no surface")
    assert mesh_warnings({"mesh_bare_pct": 1.0}) == mesh_warnings({"mesh_bare_pct": None}) == []


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

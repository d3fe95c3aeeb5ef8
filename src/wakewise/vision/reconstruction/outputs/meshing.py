"""Coloured surface of dense points by screened Poisson reconstruction: dense.ply to mesh.ply."""

from __future__ import annotations

import tempfile
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.run_lock import exclusive_run, temporary_prefix
from wakewise.vision.reconstruction.outputs.clouds import read_cloud, write_cloud, write_mesh
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import call_in_process, pycolmap
from wakewise.vision.reconstruction.stages import StageResult, need_room, read_stamp, run_stage, stage_key

FIGURES = ("mesh_vertices", "mesh_faces", "mesh_points_left_out", "mesh_cell_mm", "mesh_bare_pct")
SUBJECT_PCT = (5.0, 95.0)
"""Percentiles of the points along each axis between which the subject lies."""
REGION = 3.0
"""Extent of what is meshed, in extents of the subject. A few points far away would else take the octree's depth."""
LEAST_DEPTH, MOST_DEPTH = 6, 11
"""Of the whole octree: 2.1 million points took 6 s of processor time and 0.3 GB at 9, 51 s and 0.6 GB at 11."""
REACH = 6.0
"""Point spacings to the nearest point beyond which the surface is cut off, and a point has no surface."""
CLUSTER_SHARE = 0.005
"""Share of the largest cluster's points that a cluster must have."""
LEAST_EXTENT = 10.0
"""Extent of a component of the surface, in point spacings, below which it is noise."""
FINER = "give --region about the subject, or --crop where no cameras are known"
MOST_BARE_PCT = 1.0
"""Share of the points without surface above which the surface is in doubt."""


def mesh_points(
    dense: Path, out: Path, settings: ReconstructionSettings, *, spacing_m: float, progress: Progress
) -> dict[str, Any]:
    """Screened Poisson surface, cut back to where there are points, coloured from them.

    M. Kazhdan and H. Hoppe, Screened Poisson surface reconstruction, ACM TOG 32(3), 2013, doi 10.1145/2487228.2487237.
    The surface closes every hole; parts farther than 6 point spacings from a point are cut off, and so are components
    shorter than 10. Points farther from the subject than its length are left out, and so are small clusters of them.

    Returns mesh_vertices, mesh_faces, mesh_points_left_out; mesh_cell_mm, the octree's finest cell; mesh_bare_pct, the
    share of the points given to it that have no surface. Raises StageError if no surface comes out; EnvironmentFailure
    if the disk is full.
    """
    whole = read_cloud(dense)
    kept = near_subject(whole.points_m)
    kept[kept] = in_large_cluster(whole.points_m[kept], REACH * spacing_m)
    cloud = whole if kept.all() else whole.only(kept)
    options = pycolmap.PoissonMeshingOptions()
    options.depth = octree_depth(cloud.points_m, spacing_m, settings.mesh_depth)
    options.trim = 0.0
    options.color = False
    # Its threads wait for each other by spinning: two took 8 times as long as one (measured, 430,000 points, depth 8).
    options.num_threads = 1
    with tempfile.TemporaryDirectory(prefix=temporary_prefix("mesh"), dir=out.parent) as scratch:
        raw, points = Path(scratch) / "poisson.ply", dense
        if len(cloud.points_m) < len(whole.points_m):
            points = Path(scratch) / "points.ply"
            write_cloud(points, cloud)
        call_in_process("mesh", "poisson_meshing", points, raw, options, watch=lambda: progress(0, 1, "mesh"))
        need_room(out.parent, 0.0, "mesh")  # on a full disk the surface is cut short without an error
        if not raw.is_file() or raw.stat().st_size == 0:
            raise StageError("mesh: no surface came out of the dense points")
        loaded = trimesh.load(raw, process=False)
        vertices, faces = np.asarray(loaded.vertices, dtype=np.float64), np.asarray(getattr(loaded, "faces", ()))
    if len(faces) == 0:
        raise StageError("mesh: no surface came out of the dense points")
    distance, nearest = (np.asarray(found) for found in KDTree(cloud.points_m).query(vertices, k=4, workers=-1))
    near = distance[:, 0] <= REACH * spacing_m
    faces = faces[near[faces].all(axis=1)]
    if len(faces) == 0:
        raise StageError("mesh: none of the surface lies near the dense points")
    faces = drop_small_components(faces, vertices, LEAST_EXTENT * spacing_m)
    if len(faces) == 0:
        raise StageError("mesh: all of the surface is in small pieces")
    used, index = np.unique(faces, return_inverse=True)
    colours = cloud.colours[nearest[used]].mean(axis=1)
    write_mesh(out, vertices[used], index.reshape(faces.shape), colours)
    progress(1, 1, "mesh")
    left_out = len(whole.points_m) - len(cloud.points_m)
    bare = np.asarray(KDTree(vertices[used]).query(cloud.points_m, workers=-1)[0]) > REACH * spacing_m
    cell_mm = 1e3 * 1.1 * float(np.ptp(cloud.points_m, axis=0).max()) / 2.0**options.depth
    return dict(zip(FIGURES, (len(used), len(faces), left_out, cell_mm, 100.0 * float(bare.mean())), strict=True))


def mesh_warnings(figures: dict[str, Any]) -> list[str]:
    """Reasons against a surface, by the figures of `mesh_points`; none where there is none."""
    bare = figures["mesh_bare_pct"]
    if bare is None or bare <= MOST_BARE_PCT:
        return []
    return [f"{bare:.1f} % of the dense points have no surface, parts of the subject may be missing: {FINER}"]


def mesh_model(
    out: Path, settings: ReconstructionSettings, progress: Progress = no_progress, *, held: bool = False
) -> StageResult:
    """Make mesh.ply of a model whose dense points are there, unless it was made of them already.

    No figure of a model needs its surface, so this may come after all that does. `held`: the process that started this
    one keeps others out of the folder.

    Raises InputError if there are no dense points of a reconstruction; StageError if no surface comes out of them;
    EnvironmentFailure if the disk is full, or a file cannot be read or written.
    """
    dense, mesh = out / "dense.ply", out / "mesh.ply"
    known = read_stamp(out, "dense")
    if not known or not dense.is_file():
        raise InputError(f"{out}: holds no dense points of a reconstruction (dense.ply, stages/dense.json)")
    spacing = 1e-3 * known["figures"]["point_spacing_mm"]
    with nullcontext() if held else exclusive_run(out):
        return run_stage(
            out,
            "mesh",
            stage_key(settings, "mesh", known["key"]),
            (mesh,),
            lambda: mesh_points(dense, mesh, settings, spacing_m=spacing, progress=progress),
        )


def in_large_cluster(points_m: Array, reach_m: float) -> BoolArray:
    """Mask of the points, shape (n,), in clusters of at least 0.5 % of the largest one's points.

    A cluster is linked over neighbouring cubes of `reach_m` that hold points. Unlike a component of the surface, it
    does not break where a part is thinner than the octree's cell.
    """
    cubes, of_point, count = np.unique(
        np.floor(points_m / reach_m).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    pairs = KDTree(cubes).query_pairs(1.8, output_type="ndarray")  # corners touch at 3**.5
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(cubes), len(cubes)))
    label = connected_components(graph, directed=False)[1]
    size = np.bincount(label, count)
    return np.asarray((size >= CLUSTER_SHARE * size.max())[label][of_point.ravel()])


def drop_small_components(faces: IntArray, vertices_m: Array, extent_m: float) -> IntArray:
    """Faces, shape (m, 3), less those of components that extend less than this along each axis."""
    edges, n = np.concatenate([faces[:, :2], faces[:, 1:]]), len(vertices_m)
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    low, high = np.full((label.max() + 1, 3), np.inf), np.full((label.max() + 1, 3), -np.inf)
    used = np.unique(faces)
    np.minimum.at(low, label[used], vertices_m[used])
    np.maximum.at(high, label[used], vertices_m[used])
    kept: IntArray = faces[((high - low).max(axis=1) >= extent_m)[label[faces[:, 0]]]]
    return kept


def near_subject(points_m: Array) -> BoolArray:
    """Mask of the points within the subject's box grown about its middle, shape (n,). One long axis rules all three."""
    low, high = np.percentile(points_m, SUBJECT_PCT, axis=0)
    half = 0.5 * REGION * float((high - low).max())
    inside: BoolArray = (np.abs(points_m - 0.5 * (low + high)) <= half).all(axis=1)
    return inside


def octree_depth(points_m: Array, spacing_m: float, most: int) -> int:
    """Octree depth whose finest cell is nearest to one and a half point spacings, from 1.06 to 2.1 of them.

    Finer cells would only mesh the noise, and each depth more takes twice as long or longer. `most` bounds the cells
    across the subject, not across all points: a few far ones would else make the cells of everything coarse, the more
    of them the more photographs there are.
    """
    subject = float(np.ptp(np.percentile(points_m, SUBJECT_PCT, axis=0), axis=0).max())
    cell = max(1.5 * spacing_m, 1.1 * subject / 2.0**most)
    cells = 1.1 * float(np.ptp(points_m, axis=0).max()) / cell
    return int(np.clip(np.rint(np.log2(max(cells, 1.0))), LEAST_DEPTH, MOST_DEPTH))

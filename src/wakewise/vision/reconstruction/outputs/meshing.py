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

FIGURES = ("mesh_vertices", "mesh_faces", "mesh_points_left_out")
SUBJECT_PCT = (5.0, 95.0)
"""Percentiles of the points along each axis between which the subject lies."""
REGION = 3.0
"""Extent of what is meshed, in extents of the subject. A few points far away would else take the octree's depth."""
LEAST_DEPTH, MOST_DEPTH = 6, 11
"""Of the whole octree: 2.1 million points took 6 s of processor time and 0.3 GB at 9, 51 s and 0.6 GB at 11."""


def mesh_points(
    dense: Path, out: Path, settings: ReconstructionSettings, *, spacing_m: float, progress: Progress
) -> dict[str, Any]:
    """Screened Poisson surface, cut back to where there are points, coloured from them.

    M. Kazhdan and H. Hoppe, Screened Poisson surface reconstruction, ACM TOG 32(3), 2013, doi 10.1145/2487228.2487237.
    The surface closes every hole; parts farther than 6 point spacings from a point are cut off, and so are components
    that are small beside the largest. Points farther from the subject than its length are left out.

    Returns mesh_vertices, mesh_faces, mesh_points_left_out. Raises StageError if no surface comes out;
    EnvironmentFailure if the disk is full.
    """
    whole = read_cloud(dense)
    kept = near_subject(whole.points_m)
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
    near = distance[:, 0] <= 6.0 * spacing_m
    faces = faces[near[faces].all(axis=1)]
    if len(faces) == 0:
        raise StageError("mesh: none of the surface lies near the dense points")
    faces = drop_small_components(faces, len(vertices))
    used, index = np.unique(faces, return_inverse=True)
    colours = cloud.colours[nearest[used]].mean(axis=1)
    write_mesh(out, vertices[used], index.reshape(faces.shape), colours)
    progress(1, 1, "mesh")
    left_out = len(whole.points_m) - len(cloud.points_m)
    return dict(zip(FIGURES, (len(used), len(faces), left_out), strict=True))


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


def drop_small_components(faces: IntArray, vertices: int, share: float = 0.005) -> IntArray:
    """Faces, shape (m, 3), less those of pieces with fewer faces than this share of the largest piece's."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(vertices, vertices))
    piece = connected_components(graph, directed=False)[1][faces[:, 0]]
    count = np.bincount(piece)
    kept: IntArray = faces[count[piece] >= share * count.max()]
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

"""A finished model as measuring needs it: mesh, cameras, scale and its uncertainty, noise of the surface."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import KDTree

from wakewise.core.arrays import Array
from wakewise.core.checks import path_of
from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh, read_mesh
from wakewise.scene.targets.mesh import FacelessFileError
from wakewise.vision.reconstruction.outputs.clouds import read_cloud
from wakewise.vision.reconstruction.sfm.mapping import MAPPINGS
from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

NOISE_POINTS, DENSE_POINTS = 20_000, 400_000
MOST_TURNED = 0.01
"""Share of the edges between two faces whose faces may turn opposite ways: normals, and volumes, need one outside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedModel:
    """A mesh in metres and, of a model folder, what says how sure it is.

    sparse: folder of its cameras and tracks, None of a bare mesh; cameras_m: their centres, shape (k, 3), by name;
    fixed: the cameras were given and stayed; scale_sigma_pct: standard deviation of its scale, None with `scale_why`;
    scale_from: what gave the scale; noise_m: standard deviation of dense points about the surface, None without them;
    dense_m: some of these points, shape (n, 3), m.
    """

    name: str
    mesh: Mesh
    sparse: Path | None = None
    unit_m: float = 1.0
    cameras_m: dict[str, Array] | None = None
    fixed: bool = False
    scale_sigma_pct: float | None = None
    scale_why: str | None = "a bare mesh does not say how its scale came about"
    scale_from: str | None = None
    noise_m: float | None = None
    dense_m: Array | None = None

    @property
    def eyes_m(self) -> Array | None:
        """Centres of the cameras, shape (k, 3), m; None of a bare mesh."""
        return np.array(list(self.cameras_m.values())) if self.cameras_m else None


def read_model(path: Path, unit_m: float | None = None) -> FinishedModel:
    """Read the folder of a reconstruction or a trial, or a mesh file (PLY, STL, OBJ, OFF, GLB).

    `unit_m`: metres per unit of the mesh: of a file in other units, or of a model without scale; 1 if not given. Raises
    InputError if there is no mesh, it cannot be read, or a model folder has neither scale nor `unit_m`.
    """
    path = path_of(path, "model")
    if unit_m is not None and not (np.isfinite(unit_m) and unit_m > 0.0):
        raise InputError(f"--unit-m {unit_m:g}: must be above 0")
    if not path.is_dir():
        return FinishedModel(name=str(path), mesh=_scaled(_mesh(path), unit_m or 1.0), unit_m=unit_m or 1.0)
    figures = _figures(path)
    if not (path / "mesh.ply").is_file():
        raise InputError(f"{path}: holds no mesh (mesh.ply); reconstruct without --until and --no-mesh")
    if figures.get("scale") is None and not _metric_by(figures) and unit_m is None:
        raise InputError(
            f"{path}: the model has no scale; reconstruct with --bar, --fixes or --reference-cameras, or give the "
            "length of its unit (--unit-m)"
        )
    unit = unit_m or 1.0
    mesh = _scaled(_mesh(path / "mesh.ply"), unit)
    sparse = path / "sparse"
    cameras = {name: unit * place for name, place in camera_centres(sparse).items()} if sparse.is_dir() else None
    model = FinishedModel(
        name=str(path),
        mesh=mesh,
        sparse=sparse if cameras else None,
        unit_m=unit,
        cameras_m=cameras,
        fixed=figures.get("mapping") == MAPPINGS["known"],
        dense_m=_dense_m(path / "dense.ply", unit),
    )
    if model.dense_m is not None:
        model = replace(model, noise_m=_noise_m(mesh, model.dense_m))
    return replace(model, **_scale_of(figures, cameras, unit_m))


def _mesh(path: Path) -> Mesh:
    """A mesh whose faces share vertices, which files such as STL repeat."""
    try:
        read = read_mesh(path)
    except FacelessFileError:
        raise InputError(f"{path}: holds points without faces; a mesh is needed, such as mesh.ply") from None
    joined = trimesh.Trimesh(read.vertices_m, read.faces, process=False)
    joined.merge_vertices(merge_tex=True, merge_norm=True)
    step = float(np.spacing(np.float32(np.abs(joined.vertices).max())))
    if step > 1e-3 * float(joined.extents.max()) and (joined.vertices == joined.vertices.astype(np.float32)).all():
        raise InputError(
            f"{path}: coordinates to {np.abs(joined.vertices).max():.3g} are stored in single precision, in steps of "
            f"{step:.2g}; subtract an offset before they are written"
        )
    a, b = np.concatenate([joined.faces[:, :2], joined.faces[:, 1:], joined.faces[:, ::-2]]).astype(np.int64).T
    _, edge, count = np.unique(np.minimum(a, b) * len(joined.vertices) + np.maximum(a, b), return_inverse=True,
                               return_counts=True)  # fmt: skip
    turned = (np.bincount(edge, np.sign(b - a)) != 0)[count == 2]
    if turned.sum() > MOST_TURNED * len(turned):
        raise InputError(
            f"{path}: neighbouring faces turn opposite ways at {100 * turned.mean():.0f} % of the edges, so the mesh "
            "has no outside; orient them alike (MeshLab: Re-Orient All Faces Coherently)"
        )
    return Mesh(np.asarray(joined.vertices, dtype=np.float64), np.asarray(joined.faces, dtype=np.int64))


def _scaled(mesh: Mesh, unit: float) -> Mesh:
    return mesh if unit == 1.0 else Mesh(unit * mesh.vertices_m, mesh.faces)


def _figures(folder: Path) -> dict[str, Any]:
    path = folder / "reconstruction.json"
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        value = None
    if not isinstance(value, dict):
        raise InputError(f"{folder}: is no folder of a model, it holds no readable reconstruction.json")
    return value


def _metric_by(figures: dict[str, Any]) -> dict[str, Any] | None:
    """Figures of the bars or fixes that gave the scale."""
    for key in ("scale_bars", "scale_fixes"):
        found = figures.get(key)
        if isinstance(found, dict) and found.get("used"):
            return found
    return None


def _scale_of(figures: dict[str, Any], cameras: dict[str, Array] | None, unit_m: float | None) -> dict[str, Any]:
    """Where the scale is from and its standard deviation, or why that is not known."""
    by = _metric_by(figures)
    if by is not None:
        source = "scale bars" if by is figures.get("scale_bars") else "position fixes"
        sigma = by.get("uncertainty_pct")
        why = None if sigma is not None else f"the {source} do not tell how sure the scale is"
        return {"scale_from": source, "scale_sigma_pct": sigma, "scale_why": why}
    if figures.get("scale") is None or unit_m is not None:
        return {"scale_from": "--unit-m", "scale_why": "the length of the unit was given (--unit-m)"}
    rmse_mm, count = figures.get("cameras_rmse_mm"), figures.get("reference_inliers")
    if rmse_mm is None or not count or not cameras:
        return {"scale_from": "known cameras", "scale_why": "the known cameras give no uncertainty of the scale"}
    return {
        "scale_from": "camera positions",
        "scale_sigma_pct": position_scale_pct(1e-3 * rmse_mm, np.array(list(cameras.values())), count),
        "scale_why": None,
    }


def position_scale_pct(rmse_m: float, centres_m: Array, count: int) -> float:
    """Standard deviation in percent of a scale from `count` camera positions, shape (k, 3), off by `rmse_m` (3D rms).

    That of the least-squares similarity for independent errors: sigma over the root of the summed squared distances
    from the middle, sigma being rmse / sqrt(3), with 7 parameters taken from the 3 k numbers.
    """
    spread = float(np.sqrt(((centres_m - centres_m.mean(axis=0)) ** 2).sum(axis=1).mean()))
    freedom = max(1.0 - 7.0 / (3.0 * count), 0.1)
    return 100.0 * rmse_m / np.sqrt(3.0 * freedom) / (np.sqrt(count) * max(spread, 1e-12))


def _dense_m(dense: Path, unit: float) -> Array | None:
    """Some of the dense points, None without the file."""
    if not dense.is_file():
        return None
    points = unit * read_cloud(dense).points_m
    return np.asarray(points[:: max(1, len(points) // DENSE_POINTS)])


def _noise_m(mesh: Mesh, points: Array) -> float:
    """Robust standard deviation of dense points about the surface, along its normals."""
    points = points[:: max(1, len(points) // NOISE_POINTS)]
    centres, vectors = mesh.triangles_m.mean(axis=1), mesh.area_vectors_m2
    nearest = np.asarray(KDTree(centres).query(points)[1])
    normals = vectors[nearest] / np.maximum(np.linalg.norm(vectors[nearest], axis=1, keepdims=True), 1e-300)
    off = np.einsum("ij,ij->i", points - centres[nearest], normals)
    return 1.4826 * float(np.median(np.abs(off - np.median(off))))

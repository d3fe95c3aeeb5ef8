"""Area, volume and rugosity of a model above its ground plane, and their repeatability over halves of the photographs.

Each half is reconstructed from its photographs and aligned with the model by its cameras. The figures are those of
shape; an error of the scale is the same in all three.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import write_json
from wakewise.vision.reconstruction.outputs.clouds import read_cloud, read_surface
from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

ROUNDS, FAR = 12, 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPlane:
    """A plane in the model's frame: a point of it, and axes as rows: across, along, up (towards the cameras)."""

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        freeze(self, origin=(3,), axes=(3, 3))

    def to_plane(self, points: Array) -> Array:
        """Across, along and above, shape (n, 3)."""
        return np.asarray((np.asarray(points) - self.origin) @ self.axes.T)

    def to_model(self, in_plane: Array) -> Array:
        """Points of the model, shape (n, 3)."""
        return np.asarray(np.asarray(in_plane) @ self.axes + self.origin)


def fit_ground_plane(points: Array, eyes: Array) -> GroundPlane:
    """Robust plane of least squares of points: those far above or below it, the relief, are left out.

    `points` has shape (n, 3). `eyes`, shape (k, 3): cameras: they are above. Raises StageError if the points lie on a
    line.
    """
    kept = points
    for _ in range(ROUNDS):
        middle = kept.mean(axis=0)
        _, spread, axes = np.linalg.svd(kept - middle, full_matrices=False)
        if spread[1] < 1e-6 * max(spread[0], 1e-300):
            raise StageError("level: the points lie on a line, a subject that is flat spans a plane")
        height = (points - middle) @ axes[2]
        far = FAR * 1.4826 * float(np.median(np.abs(height - np.median(height))))
        kept = points[np.abs(height - np.median(height)) <= max(far, 1e-9)]
    up = axes[2] * (1.0 if float((eyes.mean(axis=0) - middle) @ axes[2]) >= 0.0 else -1.0)
    across = axes[0] * (1.0 if axes[0][np.argmax(np.abs(axes[0]))] > 0.0 else -1.0)
    return GroundPlane(origin=middle, axes=np.stack([across, np.cross(up, across), up]))


def heights(in_plane: Array, cell: float) -> tuple[Array, Array]:
    """Mean height of points in square cells, shape (rows, columns), NaN where none is, and the corner of the first.

    Rows run along, columns across, both growing; the corner is (across, along).
    """
    low = np.floor(in_plane[:, :2].min(axis=0) / cell) * cell
    place: IntArray = np.floor((in_plane[:, :2] - low) / cell).astype(np.int64)
    columns, rows = place.max(axis=0) + 1
    flat = place[:, 1] * columns + place[:, 0]
    count = np.bincount(flat, minlength=rows * columns)
    total = np.bincount(flat, in_plane[:, 2], minlength=rows * columns)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean.reshape(rows, columns), low


FIGURES = ("area", "plan_area", "rugosity", "volume")
CELL_SPACINGS = 4.0
LEAST_PHOTOS = 12
"""Least photographs: fewer have halves too small for a model."""


@dataclass(frozen=True, kw_only=True)
class SurfaceExtent:
    """Area of the surface and of what it covers of its plane, their ratio, and volume above the plane.

    The ratio is the surface index of A. L. Dahl, Ecology 54(2), 1973, doi 10.2307/1934335, which divers call rugosity.
    """

    area: float
    plan_area: float
    rugosity: float
    volume: float


def cells_of(vertices: Array, faces: IntArray, level: GroundPlane, cell: float) -> set[tuple[int, int]]:
    """Cells of the plane that middles of triangles lie over."""
    place = np.floor(level.to_plane(vertices[faces].mean(axis=1))[:, :2] / cell).astype(np.int64)
    return {(int(i), int(j)) for i, j in np.unique(place, axis=0)}


def extent_over(
    vertices: Array, faces: IntArray, level: GroundPlane, cell: float, wanted: set[tuple[int, int]]
) -> SurfaceExtent:
    """Extent of the part of a surface over these cells.

    Volume is the flux of (0, 0, height) through the surface: volume above the plane less volume below it.
    """
    corners = level.to_plane(vertices)[faces]
    place = np.floor(corners.mean(axis=1)[:, :2] / cell).astype(np.int64)
    kept = np.array([(int(i), int(j)) in wanted for i, j in place], dtype=np.bool_)
    corners = corners[kept]
    normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(normal, axis=1).sum())
    plan = len(wanted) * cell**2
    volume = float((corners[:, :, 2].mean(axis=1) * normal[:, 2]).sum())
    return SurfaceExtent(area=area, plan_area=plan, rugosity=area / plan, volume=volume)


def measure_halves(
    model: Path,
    names: list[str],
    make: Callable[[list[str], Path, Mapping[str, Array]], None],
    *,
    metric: bool,
) -> dict[str, Any]:
    """Measure a model and two made of half its photographs each; extent.json in its folder.

    `names`: photographs with a place, in order; every other one is of a half. `make`: makes a model of these
    photographs in a folder, in the frame of these camera places (m or units). `metric`: whether the model's unit is the
    metre. Returns for each of area, plan_area, rugosity and volume: whole, halves, repeat_pct (difference of the halves
    over their mean); unit, shared_pct (of the whole's plan that both halves have too, over which all is measured).
    Raises InputError if there are too few photographs; StageError if a half gives no model, or the halves share
    nothing.
    """
    if len(names) < LEAST_PHOTOS:
        raise InputError(f"halves: {len(names)} photos have a place, two models need at least {LEAST_PHOTOS} together")
    centres = camera_centres(model / "sparse")
    surfaces = [read_surface(model / "mesh.ply")]
    for k in (0, 1):
        folder = model / "halves" / "ab"[k]
        make(names[k::2], folder, {name: centres[name] for name in names[k::2]})
        surfaces.append(read_surface(folder / "mesh.ply"))
    cloud = read_cloud(model / "dense.ply").points_m
    level = fit_ground_plane(cloud, np.array(list(centres.values())))
    plan = level.to_plane(cloud)[:, :2]
    extent = np.subtract(*np.quantile(plan, (0.99, 0.01), axis=0))  # strays aside
    cell = CELL_SPACINGS * float(np.sqrt(extent.prod() / len(plan)))
    covered = [cells_of(*surface, level, cell) for surface in surfaces]
    shared = covered[0] & covered[1] & covered[2]
    if not shared:
        raise StageError("halves: the two models share no part of the subject")
    extents = [extent_over(*surface, level, cell, shared) for surface in surfaces]
    out: dict[str, Any] = {
        "unit": "m" if metric else "model units",
        "shared_pct": 100.0 * len(shared) / len(covered[0]),
        "plane_origin": level.origin.tolist(),
        "plane_up": level.axes[2].tolist(),
    }
    for figure in FIGURES:
        whole, *halves = (float(getattr(extent, figure)) for extent in extents)
        mean = 0.5 * (halves[0] + halves[1])
        off = abs(halves[0] - halves[1])
        out[figure] = {"whole": whole, "halves": halves, "repeat_pct": 100.0 * off / abs(mean) if mean else None}
    write_json(model / "extent.json", out)
    return out

"""Delicate features that a person marked: balls listed in a CSV file, or a property of a PLY file's vertices."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.scene.targets.mesh import Mesh, read_mesh

COLUMNS = ("x_m", "y_m", "z_m", "radius_m", "weight")
PLY_PROPERTY = "delicate"
LARGEST_M = 10.0
"""No coordinate or radius of a mark lies beyond: targets have 2 m at most."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FragilityMarks:
    """Balls inside which the surface is delicate.

    Parameters
    ----------
    centres_m : ndarray, shape (k, 3)
        In the frame of the mesh that `load_mesh` and `coral` give: z up, bed at z = 0, metres.
    radii_m : ndarray, shape (k,)
    weights : ndarray, shape (k,)
        Score inside the ball, 0 to 1.
    """

    centres_m: Array
    radii_m: Array
    weights: Array

    def __post_init__(self) -> None:
        k = len(self.centres_m)
        freeze(self, centres_m=(k, 3), radii_m=(k,), weights=(k,))
        if k == 0:
            raise InputError("marks: none given, needs at least one")
        if not self.radii_m.min() > 0.0:
            raise InputError(f"marks: radius {self.radii_m.min():g} m, must be more than 0")
        if self.weights.min() < 0.0 or self.weights.max() > 1.0:
            raise InputError(f"marks: weights {self.weights.min():g} to {self.weights.max():g}, allowed 0 to 1")

    def scores(self, mesh: Mesh) -> Array:
        """Score of every vertex of a mesh in the same frame, shape (n,): of balls that overlap, the highest."""
        scores = np.zeros(len(mesh.vertices_m))
        tree = KDTree(mesh.vertices_m)
        for centre, radius, weight in zip(self.centres_m, self.radii_m, self.weights, strict=True):
            inside = tree.query_ball_point(centre, radius)
            scores[inside] = np.maximum(scores[inside], weight)
        return scores


def read_marks(path: Path | str) -> FragilityMarks:
    """Read marks from a CSV file with the columns x_m, y_m, z_m, radius_m and weight (1 where left out).

    Raises
    ------
    InputError
        If the file is missing or empty, a column is missing or unknown, or a value is no number, not finite or out of
        range; the message names the line.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file, give a CSV file with the columns {', '.join(COLUMNS)}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text, give a CSV file with {', '.join(COLUMNS)}") from error
    try:
        rows = list(csv.reader(text.splitlines(), strict=True))
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error}), the columns are {', '.join(COLUMNS)}") from error
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in COLUMNS[:4] if name not in header]
    if missing:
        how = other_separator(header)
        raise InputError(f"{path}: no column {', '.join(missing)}, the columns are {', '.join(COLUMNS)}{how}")
    if unknown := [name for name in header if name not in COLUMNS]:
        raise InputError(f"{path}: unknown column '{unknown[0]}', the columns are {', '.join(COLUMNS)}")
    place = {name: header.index(name) for name in COLUMNS if name in header}
    values = [
        [_value(path, line, name, row, place) for name in COLUMNS]
        for line, row in enumerate(rows[1:], start=2)
        if any(cell.strip() for cell in row)
    ]
    if not values:
        raise InputError(f"{path}: no marks below the header, needs at least one")
    table = np.array(values)
    return FragilityMarks(centres_m=table[:, :3], radii_m=table[:, 3], weights=table[:, 4])


def _value(path: Path, line: int, name: str, row: list[str], place: dict[str, int]) -> float:
    if name not in place:
        return 1.0  # only the weight may be left out
    cell = row[place[name]].strip() if place[name] < len(row) else ""
    low, high = (0.0, 1.0) if name == "weight" else (-LARGEST_M, LARGEST_M)
    allowed = f"a number above 0, at most {high:g}" if name == "radius_m" else f"a number from {low:g} to {high:g}"
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high or (name == "radius_m" and value <= 0.0):
        raise InputError(f"{path}, line {line}: {name} '{cell[:40]}', allowed {allowed}")
    return value


def read_vertex_scores(path: Path | str, mesh: Mesh) -> Array | None:
    """Scores of a mesh's vertices from the property `delicate` of the PLY file that the mesh was loaded from.

    Parameters
    ----------
    path : Path or str
    mesh : Mesh
        As `load_mesh` gave it: moved, scaled and merged, so that each vertex takes the score of the file's nearest.

    Returns
    -------
    ndarray, shape (n,), or None
        None if the file has no such property.

    Raises
    ------
    InputError
        If the file is unreadable, or a score is not finite or outside 0 to 1.
    """
    path = Path(path)
    if path.suffix.lower() != ".ply":
        return None
    import trimesh

    read = read_mesh(path)
    loaded = trimesh.load(path, file_type="ply", force="mesh", process=False)
    vertex = loaded.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    names = getattr(getattr(vertex, "dtype", None), "names", None) or (vertex if isinstance(vertex, dict) else ())
    if vertex is None or PLY_PROPERTY not in names:
        return None
    scores = np.asarray(vertex[PLY_PROPERTY], dtype=np.float64).reshape(-1)
    if len(scores) != len(read.vertices_m) or not np.all((scores >= 0.0) & (scores <= 1.0)):
        raise InputError(f"{path}: vertex property '{PLY_PROPERTY}', allowed one number from 0 to 1 for every vertex")
    used = np.unique(read.faces)
    vertices = read.vertices_m[used]
    low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0).max()
    moved = (vertices - low) * (mesh.extent_m.max() / extent) + mesh.vertices_m.min(axis=0)
    return np.asarray(scores[used][KDTree(moved).query(mesh.vertices_m)[1]], dtype=np.float64)

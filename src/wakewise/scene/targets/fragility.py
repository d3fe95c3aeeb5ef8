"""Delicate features of a target: thin parts, tips and sharp edges found from its mesh, or marked by a person.

Thickness at a vertex is the diameter of the largest inscribed ball that touches there, by the shrinking-ball method (J.
Ma, S. W. Bae and S. Choi, Vis. Comput. 28 (2012) 7, doi 10.1007/s00371-011-0594-7). Curvature is the mean curvature,
positive where convex, from the cotangent Laplacian (M. Meyer et al., Visualization and Mathematics III, 2003, 35, doi
10.1007/978-3-662-05105-4_2), averaged over 3 mm.

The score runs from 0 (robust) to 1 (delicate): thin is linear between `THIN_M`, sharp is linear between `SHARP_PER_M`,
score = 1 - (1 - thin)(1 - sharp). These bounds are a choice, not biology: they separate twigs and rims of a hand-sized
coral from its trunk. Marks are balls in a CSV file, or a property of a PLY file's vertices.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.scene.targets.mesh import Mesh, read_mesh
from wakewise.scene.targets.rays import Rays

THIN_M = (0.004, 0.012)
"""Thickness at or below which a part is as thin as can be, and from which on it is not thin."""
SHARP_PER_M = (100.0, 300.0)
"""Mean curvature up to which nothing is sharp (a ball of 10 mm radius, a rod of 5), and from which on all is (3.3)."""
SMOOTHED_OVER_M = 0.003
MOST_STEPS = 1000
FRAGILE_FROM = 0.5
"""Least score of a delicate place in reported shares of the surface."""
ROUGH_RAD = np.deg2rad(60.0)
SHRINKS = 20
COARSE = 3000


@dataclass(frozen=True, kw_only=True, eq=False)
class Fragility:
    """How delicate a mesh is, vertex by vertex."""

    # Shape (n,): of the flesh under each vertex; at most the mesh's diameter, which it is where no ray leaves again.
    thickness_m: Array
    # Shape (n,): mean curvature, positive where convex; 0 at the rim of an open mesh, where it has no value.
    curvature_per_m: Array
    score: Array  # shape (n,): 0 robust to 1 delicate

    def __post_init__(self) -> None:
        n = len(self.score)
        freeze(self, thickness_m=(n,), curvature_per_m=(n,), score=(n,))
        if n and (self.score.min() < 0.0 or self.score.max() > 1.0):
            raise InputError(f"delicacy: scores {self.score.min():g} to {self.score.max():g}, allowed 0 to 1")

    def share(self, mesh: Mesh) -> float:
        """Share of a mesh's area, from 0 to 1, whose score is at least `FRAGILE_FROM`."""
        area = mesh.face_areas_m2
        return float(area @ np.mean(self.score[mesh.faces] >= FRAGILE_FROM, axis=1) / area.sum())


def find_fragility(mesh: Mesh, marked: Array | None = None) -> Fragility:
    """Find the delicate features of a mesh.

    `mesh`: in any frame; outward faces. `marked`, shape (n,): scores of what a person marked; the higher of found and
    marked counts. Raises InputError if the marks are not one per vertex or outside 0 to 1, or the mesh has no area.
    """
    n = len(mesh.vertices_m)
    if not mesh.face_areas_m2.sum() > 0.0:
        raise InputError("delicacy: every face has zero area, a target needs triangles that span a surface")
    if marked is not None and (
        np.shape(marked) != (n,) or not np.all(np.isfinite(marked)) or np.min(marked) < 0.0 or np.max(marked) > 1.0
    ):
        raise InputError(f"marks: shape {np.shape(marked)}, allowed one score from 0 to 1 for each of {n} vertices")
    thickness, curvature = thickness_m(mesh), curvature_per_m(mesh)
    thin = np.clip((THIN_M[1] - thickness) / (THIN_M[1] - THIN_M[0]), 0.0, 1.0)
    sharp = np.clip((curvature - SHARP_PER_M[0]) / (SHARP_PER_M[1] - SHARP_PER_M[0]), 0.0, 1.0)
    score = 1.0 - (1.0 - thin) * (1.0 - sharp)
    score = score if marked is None else np.maximum(score, marked)
    return Fragility(thickness_m=thickness, curvature_per_m=curvature, score=score)


def vertex_normals(mesh: Mesh) -> Array:
    """Unit normals, shape (n, 3), each the mean of its faces' by area; zero at a vertex without faces."""
    total = np.zeros((len(mesh.vertices_m), 3))
    for corner in range(3):
        for k in range(3):
            total[:, k] += np.bincount(mesh.faces[:, corner], mesh.area_vectors_m2[:, k], len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(np.divide(total, length, out=np.zeros_like(total), where=length > 0.0), dtype=np.float64)


def thickness_m(mesh: Mesh) -> Array:
    """Thickness of the flesh at every vertex, shape (n,): diameter of the largest ball inside that touches there.

    A ray straight inward says how large the ball may be; it shrinks until no vertex lies within. A vertex seen from the
    ball's middle within `ROUGH_RAD` of where it touches is roughness of the same side and does not count. The result is
    the diameter of a ball or a rod and the thickness of a plate, at its rim too; at most the mesh's own diameter, which
    it is where a ray never leaves an open mesh.
    """
    normals = vertex_normals(mesh)
    diameter = float(np.linalg.norm(mesh.extent_m))
    radius = 0.5 * _seen_through(mesh, normals, diameter)
    whole = np.arange(len(radius))
    # A few vertices shrink most balls nearly all the way; with all of them the last percent is not worth its time.
    for among in (whole[:: max(1, len(whole) // COARSE)], whole):
        _shrink(radius, mesh.vertices_m, normals, mesh.vertices_m[among])
    return np.asarray(np.minimum(2.0 * radius, diameter), dtype=np.float64)


def _shrink(radius: Array, vertices: Array, normals: Array, obstacles: Array) -> None:
    """Shrink, in place, the radii of balls that touch at the vertices from inside until they hold no obstacle."""
    tree = KDTree(obstacles)
    active = np.flatnonzero(np.linalg.norm(normals, axis=1) > 0.5)
    for _ in range(SHRINKS):
        middle = vertices[active] - radius[active, None] * normals[active]
        gap, touched = tree.query(middle, eps=0.01)
        away = vertices[active] - obstacles[touched]
        along = np.einsum("nk,nk->n", away, normals[active])
        distance2 = np.einsum("nk,nk->n", away, away)
        smaller = 0.5 * distance2 / np.maximum(along, 1e-12) + 1e-12
        # The chord between the two places the ball would touch subtends this angle at its middle.
        angle = 2.0 * np.arcsin(np.clip(np.sqrt(distance2) / (2.0 * smaller), 0.0, 1.0))
        shrinks = (gap < 0.99 * radius[active]) & (along > 0.0) & (smaller < radius[active]) & (angle > ROUGH_RAD)
        active, smaller = active[shrinks], smaller[shrinks]
        if len(active) == 0:
            break
        radius[active] = smaller


def _seen_through(mesh: Mesh, normals: Array, farthest_m: float) -> Array:
    """How far a ray straight inward from every vertex goes before it leaves the flesh, shape (n,)."""
    # A ray must start just inside, or it would hit the faces of its own vertex.
    inside_m = 2e-5 * farthest_m
    face, length = Rays(mesh).first(mesh.vertices_m - inside_m * normals, -normals)
    leaves = (face >= 0) & (np.einsum("nk,nk->n", normals, mesh.area_vectors_m2[face]) < 0.0)
    return np.where(leaves, np.minimum(length + inside_m, farthest_m), farthest_m)


def curvature_per_m(mesh: Mesh) -> Array:
    """Mean curvature at every vertex, shape (n,), positive where convex: 1/R on a ball, 1/(2 R) on a rod.

    The bare curvature of a vertex is as rough as the mesh. It is averaged by a random walk along edges, each as likely
    as its faces are large, which keeps the integral, and goes `SMOOTHED_OVER_M` in the root mean square.
    """
    n, faces = len(mesh.vertices_m), mesh.faces
    area = np.bincount(faces.ravel(), np.repeat(mesh.face_areas_m2 / 3.0, 3), n)
    mean = 0.5 * np.einsum("nk,nk->n", _cotangent_sums(mesh), vertex_normals(mesh))
    mean = np.divide(mean, area, out=np.zeros(n), where=area > 0.0)
    rim = _on_rim(mesh)
    mean[rim] = 0.0
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    share = np.repeat(mesh.face_areas_m2, 3)
    along = coo_array((np.tile(share, 2), (np.concatenate([start, end]), np.concatenate([end, start]))), (n, n))
    leaving = np.asarray(along.sum(axis=1)).ravel()
    walk = csr_array(diags_array(1.0 / np.where(leaving > 0.0, leaving, 1.0)) @ along)
    step2 = share @ np.sum((mesh.vertices_m[end] - mesh.vertices_m[start]) ** 2, axis=1) / share.sum()
    for _ in range(min(MOST_STEPS, round(SMOOTHED_OVER_M**2 / step2))):
        mean = walk @ mean
    mean[rim] = 0.0
    return np.asarray(mean, dtype=np.float64)


def _cotangent_sums(mesh: Mesh) -> Array:
    """Sum over a vertex's edges of half their cotangents times the way back along them, shape (n, 3): 2 H n area."""
    n = len(mesh.vertices_m)
    # A sliver's cotangent is beyond bounds, and its area is nothing.
    twice_area = np.maximum(2.0 * mesh.face_areas_m2, 1e-4 * mesh.face_areas_m2.mean())
    total = np.zeros((n, 3))
    for corner in range(3):
        at, one, two = (mesh.faces[:, (corner + k) % 3] for k in range(3))
        a = mesh.vertices_m[one] - mesh.vertices_m[at]
        b = mesh.vertices_m[two] - mesh.vertices_m[at]
        pull = (0.5 * np.einsum("nk,nk->n", a, b) / twice_area)[:, None] * (a - b)
        for k in range(3):
            total[:, k] += np.bincount(one, pull[:, k], n) - np.bincount(two, pull[:, k], n)
    return total


def _on_rim(mesh: Mesh) -> BoolArray:
    """Vertices of edges that belong to one face only."""
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    rim = np.zeros(len(mesh.vertices_m), dtype=np.bool_)
    rim[unique[count == 1].ravel()] = True
    return rim


COLUMNS = ("x_m", "y_m", "z_m", "radius_m", "weight")
PLY_PROPERTY = "delicate"
LARGEST_M = 10.0
"""No coordinate or radius of a mark lies beyond: targets have 2 m at most."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FragilityMarks:
    """Balls inside which the surface is delicate."""

    # Shape (k, 3): in the frame of the mesh that `load_mesh` and `coral` give: z up, bed at z = 0, metres.
    centres_m: Array
    radii_m: Array  # shape (k,)
    weights: Array  # shape (k,): score inside the ball, 0 to 1

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

    Raises InputError if the file is missing or empty, a column is missing or unknown, or a value is no number, not
    finite or out of range; the message names the line.
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

    `mesh`: as `load_mesh` gave it: moved, scaled and merged, so that each vertex takes the score of the file's nearest.
    Shape (n,): none if the file has no such property. Raises InputError if the file is unreadable, or a score is not
    finite or outside 0 to 1.
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

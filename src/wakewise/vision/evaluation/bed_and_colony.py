"""Bed and colony of a mesh: a robust plane, and the connected surface that stands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation.cloud_to_surface import Crop, sample_surface

SAMPLES = 6000
REACH_SHARE = 0.02
"""Farthest that a point of the bed lies from its plane, of the diagonal of the model's box."""
FEW_PCT, MOST_LARGER, WILD = 1.0, 1.5, 10.0
"""Vertices at either end that do not set the size of a model's box, where it is so much larger with them; those that
lie so many diagonals outside it are wild."""
LEAST_BED_PCT, MOST_BELOW_PCT = 15.0, 10.0
TRIALS = math.ceil(math.log(1e-3) / math.log(1.0 - (0.01 * LEAST_BED_PCT) ** 3))
"""With so many, three points of a bed of the least share are drawn once with a chance of 99.9 %."""
CUT_SIGMAS, CUT_EDGES = 3.0, 4.0
"""A surface from photographs rounds the corner between colony and bed: by up to four edges of its mesh."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BedFit:
    """Plane of the bed: a point of it, m, and axes as rows (across, along, up), in the model's frame.

    sigma_m: standard deviation of the bed about it; share_pct: share of the model's area that is bed. Both are 0 for a
    plane that was given.
    """

    origin_m: Array
    axes: Array
    sigma_m: float
    share_pct: float

    def __post_init__(self) -> None:
        freeze(self, origin_m=(3,), axes=(3, 3))

    def to_plane(self, points_m: Array) -> Array:
        """Across, along and height above the bed, m, shape (n, 3)."""
        return np.asarray((np.asarray(points_m) - self.origin_m) @ self.axes.T)

    def figures(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "origin_m": self.origin_m.tolist(),
            "up": self.axes[2].tolist(),
            "sigma_mm": 1e3 * self.sigma_m,
            "share_pct": self.share_pct,
        }


def given_bed(normal: Array, offset_m: float) -> BedFit:
    """Bed plane n.x = offset from its upward normal, shape (3,), in any length, and its offset along it, m.

    Raises InputError if the normal has no length or a value is not finite.
    """
    length = float(np.linalg.norm(normal))
    if not (np.isfinite(length) and np.isfinite(offset_m) and length > 0.0):
        raise InputError(f"--bed: normal {np.asarray(normal).tolist()} at {offset_m}, it must be finite and not 0 0 0")
    up = np.asarray(normal) / length
    return BedFit(origin_m=offset_m * up, axes=_axes(up), sigma_m=0.0, share_pct=0.0)


def fit_bed(mesh: Mesh, rng: np.random.Generator, eyes_m: Array | None = None) -> BedFit:
    """Plane of the bed by random sample consensus (RANSAC) over an even sample of the surface, then least squares.

    M. A. Fischler and R. C. Bolles, Random sample consensus, Communications of the ACM 24(6), 1981, doi
    10.1145/358669.358692; scored by the capped squared distance (P. H. S. Torr and A. Zisserman, MLESAC, CVIU 78(1),
    2000, doi 10.1006/cviu.1999.0832). What lies below a plane counts against it, since a colony stands on its bed.

    `eyes_m`, shape (k, 3): cameras, which are above the bed; without them the side that most of the model is on is
    above. Raises InputError if less than 15 % of the surface lies on one plane with the rest above it.
    """
    points = sample_surface(without_wild(mesh), Crop(), rng, SAMPLES).points_m
    most = MOST_LARGER * _middle_box(mesh.vertices_m)[2]
    reach = REACH_SHARE * min(float(np.linalg.norm(np.ptp(points, axis=0))), most)
    best, least = None, np.inf
    for _ in range(TRIALS):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length < 1e-3 * reach**2:
            continue
        height = (points - a) @ (normal / length)
        far = np.minimum((height / reach) ** 2, 1.0)
        below = min(float((height < -reach).mean()), float((height > reach).mean()))
        score = float(far.mean()) + 2.0 * below
        if score < least:
            best, least = (a, normal / length), score
    if best is None:
        raise InputError("bed: the surface lies on a line, no plane can be fitted")
    origin, up = best
    height, near = (points - origin) @ up, np.zeros(len(points), dtype=np.bool_)
    sigma = 0.5 * reach
    for _ in range(20):
        again = np.abs(height) <= np.clip(CUT_SIGMAS * sigma, 1e-6 * reach, reach)
        if again.sum() < 10 or np.array_equal(again, near):
            break
        near = again
        origin = points[near].mean(axis=0)
        turned = np.linalg.svd(points[near] - origin, full_matrices=False)[2][2]
        up = turned if turned @ up > 0.0 else -turned
        height = (points - origin) @ up
        sigma = 1.4826 * float(np.median(np.abs(height[near])))
    if _towards(height, reach, None if eyes_m is None else (eyes_m - origin) @ up) < 0.0:
        up, height = -up, -height
    share_pct = 100.0 * float(near.mean())
    below_pct = 100.0 * float((height < -reach).mean())
    if share_pct < LEAST_BED_PCT or below_pct > MOST_BELOW_PCT:
        raise InputError(
            f"bed: {share_pct:.0f} % of the surface lies on the flattest plane and {below_pct:.0f} % below it, needed "
            f"are {LEAST_BED_PCT:g} % or more and {MOST_BELOW_PCT:g} % or less; give it: --bed NX NY NZ D"
        )
    return BedFit(origin_m=origin, axes=_axes(up), sigma_m=float(height[near].std()), share_pct=share_pct)


def _middle_box(vertices_m: Array) -> tuple[Array, Array, float]:
    """Corners and diagonal, m, of the box of vertices, shape (n, 3), but for a few at each end."""
    low, high = np.percentile(vertices_m, (FEW_PCT, 100.0 - FEW_PCT), axis=0)
    return low, high, float(np.linalg.norm(high - low))


def without_wild(mesh: Mesh) -> Mesh:
    """The mesh less its faces with a vertex far outside the rest, which is wrong and outweighs it by area."""
    low, high, diagonal = _middle_box(mesh.vertices_m)
    beyond = np.maximum(low - mesh.vertices_m, mesh.vertices_m - high).max(axis=1)
    tame = beyond <= WILD * diagonal
    if bool(tame.all()):
        return mesh
    number = np.cumsum(tame) - 1
    return Mesh(mesh.vertices_m[tame], number[mesh.faces[tame[mesh.faces].all(axis=1)]])


def _towards(height: Array, reach: float, eyes: Array | None) -> float:
    """Above 0 where up is on the side of the cameras, or else of most of what is off the plane."""
    if eyes is not None and len(eyes):
        return float(np.median(eyes))
    return float((height > reach).sum()) - float((height < -reach).sum())


def _axes(up: Array) -> Array:
    """Right-handed axes as rows, the third given; the first is the model's x or y, as far as it lies in the plane."""
    first = np.eye(3)[0 if abs(up[0]) < 0.8 else 1]
    across = first - (first @ up) * up
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(up, across), up])


def in_box(mesh: Mesh, low_m: Array, high_m: Array) -> Mesh:
    """The part of a mesh in a box of its frame, corners of shape (3,), cut at its sides.

    Raises InputError if the box is empty or nothing of the mesh lies in it.
    """
    if not (np.isfinite([low_m, high_m]).all() and (np.asarray(low_m) < np.asarray(high_m)).all()):
        corners = f"from {np.array(low_m).tolist()} to {np.array(high_m).tolist()}"
        raise InputError(f"--box: {corners}, each of X0 Y0 Z0 must be below X1 Y1 Z1")
    cut = mesh
    for k in range(3):
        for side, at in ((1.0, low_m), (-1.0, high_m)):
            cut_or_none = cut_above(cut, side * np.eye(3)[k], np.asarray(at, dtype=np.float64))
            if cut_or_none is None:
                low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
                raise InputError(
                    f"--box: nothing of the model lies in it; the model lies from {np.round(low, 3).tolist()} to "
                    f"{np.round(high, 3).tolist()} m"
                )
            cut = cut_or_none
    return cut


def cut_above(mesh: Mesh, up: Array, origin_m: Array) -> Mesh | None:
    """The part of a mesh on the side of a plane that `up`, shape (3,), points to, open at the cut; None if none is."""
    import trimesh

    height = (mesh.vertices_m - origin_m) @ up
    if (height >= 0.0).all():
        return mesh
    if (height <= 0.0).all():
        return None
    vertices, faces = trimesh.intersections.slice_faces_plane(mesh.vertices_m, mesh.faces, up, origin_m)[:2]
    return Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64)) if len(faces) else None


def colony_faces(mesh: Mesh, bed: BedFit, cut_m: float, middle_m: Array | None = None) -> BoolArray:
    """Faces of the colony, shape (m,): the connected surface above `cut_m` nearest the middle.

    `middle_m`, shape (3,): the middle of the colony; that of the model's surface if not given. Pieces of less than
    1 % of the largest one's area, or no higher than twice `cut_m`, are passed over. Raises InputError if nothing stands
    above the bed.
    """
    in_plane = bed.to_plane(mesh.vertices_m)
    above = (in_plane[:, 2] > cut_m)[mesh.faces].any(axis=1)
    if not (in_plane[mesh.faces[above], 2] > 2.0 * cut_m).any():
        below = -float(in_plane[:, 2].min())
        turned = (
            f"; {1e3 * below:.0f} mm lie below it, its normal (--bed) may point down" if below > 2.0 * cut_m else ""
        )
        raise InputError(f"colony: nothing stands more than {2e3 * cut_m:.1f} mm above the bed{turned}")
    piece = pieces(mesh.faces[above], len(mesh.vertices_m))
    area = mesh.face_areas_m2[above]
    place = in_plane[mesh.faces[above]].mean(axis=1)[:, :2]
    if middle_m is None:
        everywhere = in_plane[mesh.faces].mean(axis=1)[:, :2]
        target = np.average(everywhere, axis=0, weights=np.maximum(mesh.face_areas_m2, 1e-300))
    else:
        target = bed.to_plane(np.asarray(middle_m)[None])[0, :2]
    size = np.bincount(piece, area)
    away = np.full(len(size), np.inf)
    np.minimum.at(away, piece, np.linalg.norm(place - target, axis=1))
    peak = np.zeros(len(size))
    np.maximum.at(peak, piece, in_plane[mesh.faces[above], 2].max(axis=1))
    away[(size < 0.01 * size.max()) | (peak <= 2.0 * cut_m)] = np.inf
    # Of pieces about as near the largest is the colony: a twig over the middle may be loose.
    extent = float(np.linalg.norm(np.ptp(in_plane[:, :2], axis=0)))
    chosen = int(np.argmax(np.where(away <= away.min() + 0.05 * extent, size, -1.0)))
    out = np.zeros(len(mesh.faces), dtype=np.bool_)
    out[np.flatnonzero(above)[piece == chosen]] = True
    return out


def pieces(faces: IntArray, vertices: int) -> IntArray:
    """Number of the connected piece of each face, shape (m,); faces of a piece share vertices."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(vertices, vertices))
    return np.unique(connected_components(graph, directed=False)[1][faces[:, 0]], return_inverse=True)[1]


def open_edges_m(mesh: Mesh, bed: BedFit, above_m: float, faces: BoolArray) -> float:
    """Length of the edges of a colony, whose faces are marked, shape (m,), where the mesh ends above a height, m."""
    some = mesh.faces[faces]
    edges = np.sort(np.concatenate([some[:, :2], some[:, 1:], some[:, ::2]]), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    high = (bed.to_plane(mesh.vertices_m)[:, 2] > above_m)[edges].any(axis=1)
    a, b = np.moveaxis(mesh.vertices_m[edges[high & (count == 1)]], 1, 0)
    return float(np.linalg.norm(b - a, axis=1).sum())


def bed_clearance_m(mesh: Mesh, bed: BedFit) -> float:
    """Height above the bed, m, from which on the shape of the colony's flank is that of the colony.

    Four of its edges, a sixth of its height if that is less (`is_coarse`), but three standard deviations of the bed.
    """
    rounded_m, most_m = _rounded_and_most_m(mesh, bed)
    return max(min(rounded_m, most_m), CUT_SIGMAS * bed.sigma_m)


def is_coarse(mesh: Mesh, bed: BedFit) -> bool:
    """Whether four edges of the colony are more than a sixth of its height."""
    rounded_m, most_m = _rounded_and_most_m(mesh, bed)
    return rounded_m > most_m


def _rounded_and_most_m(mesh: Mesh, bed: BedFit) -> tuple[float, float]:
    """Four edges of what stands above a sixth of the greatest height, and that sixth: the bed may be coarser."""
    height = bed.to_plane(mesh.vertices_m)[:, 2]
    most_m = float(height.max()) / 6.0
    high = height[mesh.faces].max(axis=1) > most_m
    return CUT_EDGES * median_edge_m(Mesh(mesh.vertices_m, mesh.faces[high]) if high.any() else mesh), most_m


def median_edge_m(mesh: Mesh) -> float:
    """Median length of the edges of a mesh, m: its resolution."""
    a, b, _ = np.moveaxis(mesh.triangles_m[:: max(1, len(mesh.faces) // 20_000)], 1, 0)
    return float(np.median(np.linalg.norm(b - a, axis=1)))

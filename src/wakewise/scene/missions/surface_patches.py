"""A target's surface in patches, each held by a few samples: what a coverage guide keeps account of.

The surface is the one that the crew believes in, where it is believed to be: the target that mission and controller
are given, or a model that photographs have made so far. Nothing true is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError

PATCHES, SAMPLES_PER_PATCH = 800, 10
"""A patch of a coral of 15 cm is then a square of 1 cm, with samples 3.5 mm apart."""
CLEARANCE_M = 0.010
"""What stands less than this above the bed does not count, as in evaluations: sand touches it."""
REACH_M = 0.003
"""A place counts as in the model when the model comes as near as this: what `completeness_pct` is defined by."""
NORMAL_SHARE = 0.15
"""Two samples that face opposite ways are as far apart as this share of the target's radius twice: the two sides of a
branch become two patches."""
SHIELD_CELLS = 80
"""What hides is kept in cells of this share of the target's largest extent: 2 mm of 15 cm, finer than a branch."""
ROUNDS = 6
SEED = 0


class TriangleSurface(Protocol):
    """Triangles: vertices, shape (n, 3), in m, and faces, shape (m, 3), counter-clockwise seen from outside."""

    @property
    def vertices_m(self) -> Array:
        """Corners, shape (n, 3)."""
        ...

    @property
    def faces(self) -> IntArray:
        """Indices of corners, shape (m, 3)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfacePatches:
    """Samples spread evenly over a surface, the patch that each belongs to, and the surface itself, which hides.

    Parameters
    ----------
    points_W_m, normals : ndarray, shape (n, 3)
        Samples, each standing for the same area, and unit outward normals.
    patch : ndarray of int64, shape (n,)
        Number of the patch of each sample; every one from 0 on has at least one.
    area_m2 : float
        Of the surface that counts.
    shield_W_m : ndarray, shape (m, 3, 3)
        Corners of the triangles that hide what lies behind them: the surface, a little coarser.
    shield_off_m : float
        How far they may lie off the surface.

    Attributes
    ----------
    neighbours : ndarray of int64, shape (p, 2)
        Samples within `REACH_M` of each other.
    """

    points_W_m: Array
    normals: Array
    patch: IntArray
    area_m2: float
    shield_W_m: Array
    shield_off_m: float = 0.0
    neighbours: IntArray = field(init=False)

    def __post_init__(self) -> None:
        freeze(self, points_W_m=(None, 3), normals=(None, 3), shield_W_m=(None, 3, 3))
        patch = np.array(self.patch, dtype=np.int64)
        if patch.shape != (len(self.points_W_m),) or len(patch) == 0:
            raise InputError(f"patch: shape {patch.shape}, allowed ({len(self.points_W_m)},) with at least one sample")
        patch.setflags(write=False)
        object.__setattr__(self, "patch", patch)
        pairs = KDTree(self.points_W_m).query_pairs(REACH_M, output_type="ndarray").astype(np.int64)
        pairs.setflags(write=False)
        object.__setattr__(self, "neighbours", pairs)

    @property
    def count(self) -> int:
        """How many patches there are."""
        return int(self.patch.max()) + 1

    @property
    def samples(self) -> IntArray:
        """How many samples each patch has, which is its share of the area; shape (patches,)."""
        return np.bincount(self.patch, minlength=self.count)

    @property
    def middles_W_m(self) -> Array:
        """Mean of each patch's samples, shape (patches, 3)."""
        return self.mean(self.points_W_m)

    def spread(self, found: BoolArray) -> BoolArray:
        """What lies within `REACH_M` of what was found, and that itself, shape (n,)."""
        reached = found.copy()
        one, other = self.neighbours.T
        reached[one[found[other]]] = True
        reached[other[found[one]]] = True
        return reached

    def mean(self, values: Array | BoolArray) -> Array:
        """Mean over each patch of values of its samples, shape (n,) or (n, d)."""
        columns = values.reshape(len(values), -1)
        sums = [np.bincount(self.patch, column, self.count) for column in columns.T.astype(np.float64)]
        return (np.stack(sums, axis=1) / self.samples[:, None]).reshape(self.count, *values.shape[1:])


def patches_of(
    surface: TriangleSurface, bed_z_m: float | None = None, count: int = PATCHES, per_patch: int = SAMPLES_PER_PATCH
) -> SurfacePatches:
    """Cut the part of a surface that counts in evaluations into patches of about the same area.

    Parameters
    ----------
    surface : TriangleSurface
        In the world: a target's mesh where it is believed to be, or a model's.
    bed_z_m : float, optional
        Depth of the bed; what stands less than `CLEARANCE_M` above it does not count. None: all counts.
    count, per_patch : int
        Patches, and samples of each in the mean; where the surface lies patchily there are somewhat fewer.

    Raises
    ------
    InputError
        If nothing of it counts, or `count` or `per_patch` is below 1.
    """
    if count < 1 or per_patch < 1:
        raise InputError(f"coverage: {count} patches of {per_patch} samples, both must be at least 1")
    rng = np.random.default_rng(SEED)
    corners = np.asarray(surface.vertices_m, dtype=np.float64)[np.asarray(surface.faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    counts = 1.0 if bed_z_m is None else corners[:, :, 2].mean(axis=1) < bed_z_m - CLEARANCE_M
    total = np.cumsum(twice_area * counts)
    if len(corners) == 0 or not total[-1] > 0.0:
        raise InputError(
            f"coverage: nothing of the target is {CLEARANCE_M:g} m or more above the bed, nothing to photograph"
        )
    n = count * per_patch
    face = np.searchsorted(total, (np.arange(n) + rng.random(n)) / n * total[-1], side="right")
    root, v = np.sqrt(rng.random(n)), rng.random(n)
    a, b, c = corners[np.minimum(face, len(corners) - 1)].transpose(1, 0, 2)
    points = a + (b - a) * (root * (1.0 - v))[:, None] + (c - a) * (root * v)[:, None]
    normals = cross[face] / twice_area[face, None]
    shield, off_m = _shield(np.asarray(surface.vertices_m), np.asarray(surface.faces))
    return SurfacePatches(
        points_W_m=points,
        normals=normals,
        patch=_clustered(points, normals, count, rng),
        area_m2=0.5 * float(total[-1]),
        shield_W_m=shield,
        shield_off_m=off_m,
    )


def _clustered(points: Array, normals: Array, count: int, rng: np.random.Generator) -> IntArray:
    """Patch of each sample, shape (n,): neighbours in place and facing, by Lloyd's iteration from a random few."""
    reach = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    places = np.concatenate([points, NORMAL_SHARE * max(reach, 1e-12) * normals], axis=1)
    middles = places[rng.choice(len(places), size=min(count, len(places)), replace=False)]
    for _ in range(ROUNDS):
        nearest = np.asarray(KDTree(middles).query(places)[1], dtype=np.int64)
        held = np.bincount(nearest, minlength=len(middles))
        sums = np.stack([np.bincount(nearest, column, len(middles)) for column in places.T], axis=1)
        middles = sums[held > 0] / held[held > 0, None]
    nearest = np.asarray(KDTree(middles).query(places)[1], dtype=np.int64)
    return np.asarray(np.unique(nearest, return_inverse=True)[1], dtype=np.int64).reshape(-1)


def _shield(vertices: Array, faces: IntArray) -> tuple[Array, float]:
    """Triangles that hide, shape (m, 3, 3), and how far they may lie off: vertices gathered in the cells of a grid."""
    cell = float(np.ptp(vertices, axis=0).max()) / SHIELD_CELLS
    keys = np.floor((vertices - vertices.min(axis=0)) / max(cell, 1e-12)).astype(np.int64)
    _, member, held = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    member = member.reshape(-1)
    middles = np.stack([np.bincount(member, column, len(held)) for column in vertices.T], axis=1) / held[:, None]
    # Faces of a coarse mesh keep their corners; of a fine one those within one cell fall together.
    coarse = np.sort(member[faces], axis=1)
    whole = (coarse[:, 0] != coarse[:, 1]) & (coarse[:, 1] != coarse[:, 2])
    off_m = float(np.linalg.norm(vertices - middles[member], axis=1).max())
    return middles[np.unique(coarse[whole], axis=0)], off_m

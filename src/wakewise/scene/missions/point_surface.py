"""Patches of a surface that is known by points: normals from neighbours, and a small triangle about each that hides."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.scene.missions.visibility import CLEARANCE_M, SEED, SurfacePatches, VisibilityCriteria, clustered

NEIGHBOURS, DENSITY = 24, 12
SLACK = 6.0
"""Points hide what lies half so many spacings behind them: places and normals have errors, and triangles overlap."""
MAPPED_CRITERIA = VisibilityCriteria(support=0.0)
"""As for a surface that is known, less strict: normals of mapped points are 10 degrees unsure, and on three scans the
condition on pairs made the guide worse (docs/research-log/0097)."""
LEAST_POINTS = 30
CORNERS = 3
COVERS = math.sqrt(2.0)
"""Distance of a triangle's corners in spacings: the circle in it then holds the square, so that no hole is left."""
SAMPLES = 10


def normals_of(points_W_m: Array, towards_W: Array) -> Array:
    """Unit normals, shape (n, 3): of the plane through each point's neighbours, towards where it was seen from.

    `towards_W`, shape (n, 3): directions to the cameras. Least squares by the covariance of the neighbours (H. Hoppe et
    al. 1992, doi 10.1145/133994.134011).
    """
    near = np.asarray(KDTree(points_W_m).query(points_W_m, k=min(NEIGHBOURS, len(points_W_m)))[1])
    spread = points_W_m[near] - points_W_m[near].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))[1][:, :, 0]
    away = np.einsum("ni,ni->n", normals, towards_W) < 0.0
    return np.where(away[:, None], -normals, normals)


def patches_of_points(
    points_W_m: Array, towards_W: Array, spacing_m: float, bed_z_m: float | None = None
) -> SurfacePatches:
    """Patches of a surface that is known by points, about so far from each other.

    - `points_W_m`, `towards_W`, shapes (n, 3): the points, and directions to where they were seen from.
    - `bed_z_m`: as of `patches_of`; what stands less above the bed does not count, but hides.

    Raises InputError if too few points count.
    """
    counts = np.ones(len(points_W_m), np.bool_) if bed_z_m is None else points_W_m[:, 2] < bed_z_m - CLEARANCE_M
    if int(counts.sum()) < LEAST_POINTS:
        raise InputError(
            f"coverage: {int(counts.sum())} points of the target are known, at least {LEAST_POINTS} needed"
        )
    normals = normals_of(points_W_m, towards_W)
    own, facing = points_W_m[counts], normals[counts]
    count = max(1, len(own) // SAMPLES)
    return SurfacePatches(
        points_W_m=own,
        normals=facing,
        patch=clustered(own, facing, count, np.random.default_rng(SEED)),
        area_m2=float(_areas_m2(points_W_m)[counts].sum()),
        shield_W_m=_triangles(points_W_m, normals, spacing_m),
        shield_off_m=SLACK * spacing_m,
    )


def _areas_m2(points_W_m: Array) -> Array:
    """Area that each point stands for, from how far its `DENSITY`-th neighbour is, shape (n,)."""
    k = min(DENSITY, len(points_W_m) - 1)
    away = np.asarray(KDTree(points_W_m).query(points_W_m, k=k + 1)[0])[:, k]
    return np.asarray(math.pi * away**2 / (k + 0.5))


def _triangles(points_W_m: Array, normals: Array, spacing_m: float) -> Array:
    """A triangle about each point, square to its normal, that covers the square it stands for; shape (n, 3, 3)."""
    aside = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    one = np.cross(normals, aside)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(normals, one)
    radius = COVERS * spacing_m
    angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
    ring = np.cos(angles)[None, :, None] * one[:, None] + np.sin(angles)[None, :, None] * other[:, None]
    return np.asarray(points_W_m[:, None] + radius * ring)

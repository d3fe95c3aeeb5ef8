"""Fixed places at which a trial's water is judged: the target's surface, the bed beside it, the water round it."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.scene.targets import Target

_BED_HEIGHTS_M = (0.010, 0.015, 0.020)
_BED_POINTS = 90
_WATER_SPACING_M = 0.05


def surface_points(target: Target, count: int, rng: np.random.Generator) -> Array:
    """Points spread over the part of the target above the bed, evenly by area and stratified, shape (count, 3).

    One point is drawn in each of `count` equal shares of the area, faces in the order of the mesh.
    """
    return surface_samples(target, count, rng)[0]


def surface_samples(target: Target, count: int, rng: np.random.Generator) -> tuple[Array, Array, IntArray]:
    """As `surface_points`, with the area vector that each point stands for, outward, (count, 3), and its face."""
    corners = target.mesh.vertices_m[target.mesh.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    # Faces with their middle in the bed are buried, or the foot that stands on it: no water passes there.
    area = np.where(corners.mean(axis=1)[:, 2] < target.bed_z_m - 1e-4, area, 0.0)
    sums = np.cumsum(area)
    picks = (np.arange(count) + rng.uniform(size=count)) / count * sums[-1]
    face = np.minimum(np.searchsorted(sums, picks, side="right"), len(area) - 1)
    a, b = rng.uniform(size=(2, count))
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a), np.where(fold, 1 - b, b)
    one, two, three = (corners[face, k] for k in range(3))
    points: Array = one + a[:, None] * (two - one) + b[:, None] * (three - one)
    points[:, 2] = np.minimum(points[:, 2], target.bed_z_m)
    normals = np.cross(two - one, three - one)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points, float(sums[-1]) / count * normals, face


def bed_points(centre_W_m: Array, bed_z_m: float, radius_m: float) -> Array:
    """Points 1 to 2 cm above the bed, evenly over a disk about the target's foot (sunflower spiral), shape (n, 3)."""
    k = np.arange(_BED_POINTS) + 0.5
    r, turn = radius_m * np.sqrt(k / _BED_POINTS), k * math.pi * (3 - math.sqrt(5))
    height = np.resize(np.array(_BED_HEIGHTS_M), _BED_POINTS)
    return np.stack([centre_W_m[0] + r * np.cos(turn), centre_W_m[1] + r * np.sin(turn), bed_z_m - height], axis=1)


def water_points(target: Target, radius_m: float) -> Array:
    """Nodes of a cubic lattice in the water within a radius of the target's centre, shape (n, 3)."""
    steps = np.arange(-math.floor(radius_m / _WATER_SPACING_M), math.floor(radius_m / _WATER_SPACING_M) + 1)
    x, y = steps * _WATER_SPACING_M, steps * _WATER_SPACING_M
    up = np.arange(math.ceil((radius_m + target.radius_m) / _WATER_SPACING_M)) * _WATER_SPACING_M
    grid = np.stack(np.meshgrid(x, y, up, indexing="ij"), axis=-1).reshape(-1, 3)
    foot = np.array([target.centre_W_m[0], target.centre_W_m[1], target.bed_z_m])
    points = foot + grid * np.array([1.0, 1.0, -1.0])
    near = np.linalg.norm(points - target.centre_W_m, axis=1) <= radius_m
    inside: Array = points[near & (points[:, 2] >= 0.0)]
    return inside

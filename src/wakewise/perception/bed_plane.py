"""Plane of the bed through mapped points: random sample consensus (RANSAC), with gravity known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze

TRIALS = 200
"""Of beds that hold a third of the points, one in 1500 is missed."""
WITHIN_M = 0.015
"""Distance from the plane up to which a point is of the bed: sand ripples and the points' own errors."""
STEEPEST_RAD = math.radians(30.0)
"""Largest slope of a bed; a wall or the target's side is none."""
SCORED = 400
"""So many of the points, drawn evenly, say how good a plane is."""
LEAST_SHARE, LEAST_POINTS = 0.25, 15


@dataclass(frozen=True, kw_only=True, eq=False)
class BedPlane:
    """Plane of the bed: unit normal upwards (z < 0 in NED), shape (3,), and a point on it, shape (3,)."""

    up_W: Array
    at_W_m: Array

    def __post_init__(self) -> None:
        freeze(self, up_W=(3,), at_W_m=(3,))

    def height_m(self, points_W_m: Array) -> Array:
        """Height above the plane, shape (n,), of points, shape (n, 3)."""
        return np.asarray((points_W_m - self.at_W_m) @ self.up_W)

    def below(self, point_W_m: Array) -> Array:
        """The point of the bed straight below or above a place, shape (3,)."""
        drop = float((point_W_m - self.at_W_m) @ self.up_W) / float(self.up_W[2])
        return point_W_m - np.array([0.0, 0.0, drop])

    def hit(self, start_W_m: Array, direction_W: Array) -> Array | None:
        """Where a ray meets the bed, shape (3,); None if it does not."""
        towards = float(direction_W @ self.up_W)
        if towards > -1e-6:
            return None
        away = float((self.at_W_m - start_W_m) @ self.up_W) / towards
        return np.asarray(start_W_m + away * direction_W) if away > 0.0 else None


def near_bed(bed: BedPlane, points_W_m: Array, about_W_m: Array, reach_m: float) -> BedPlane:
    """The plane moved up or down to where its points about a place are, within a reach; the same if they are few."""
    near = np.linalg.norm(points_W_m[:, :2] - about_W_m[:2], axis=1) < reach_m
    height = bed.height_m(points_W_m[near])
    height = height[np.abs(height) < WITHIN_M]
    if len(height) < LEAST_POINTS:
        return bed
    return BedPlane(up_W=bed.up_W, at_W_m=bed.at_W_m + float(np.median(height)) * bed.up_W)


def fit_bed(points_W_m: Array, rng: np.random.Generator) -> BedPlane | None:
    """The lowest plane, not steeper than `STEEPEST_RAD`, that many points lie on; None if there is none.

    Points, shape (n, 3). A plane counts its points, less those farther below it: nothing lies below the bed.
    """
    n = len(points_W_m)
    if n < LEAST_POINTS:
        return None
    steep = math.cos(STEEPEST_RAD)
    few = points_W_m[rng.choice(n, min(n, SCORED), replace=False)]
    a, b, c = few[rng.integers(0, len(few), (3, TRIALS))]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    up = normal / np.maximum(length, 1e-12)[:, None] * np.where(normal[:, 2] < 0.0, 1.0, -1.0)[:, None]
    height = few @ up.T - np.einsum("ti,ti->t", a, up)
    score = np.sum(np.abs(height) < WITHIN_M, axis=0) - 2 * np.sum(height < -2.0 * WITHIN_M, axis=0)
    score[(length < 1e-9) | (-up[:, 2] < steep)] = -n
    k = int(np.argmax(score))
    if score[k] < LEAST_SHARE * len(few):
        return None
    near = points_W_m[np.abs((points_W_m - a[k]) @ up[k]) < WITHIN_M]
    if len(near) < LEAST_POINTS:
        return None
    middle = near.mean(axis=0)
    normal = np.linalg.eigh((near - middle).T @ (near - middle))[1][:, 0]
    up = normal if normal[2] < 0.0 else -normal
    return BedPlane(up_W=up, at_W_m=middle) if -up[2] >= steep else None

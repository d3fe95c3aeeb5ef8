"""Procedural patch of reef, 2 x 2 m: boulders and ridges on a height map that falls to the bed at its edge."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.settings import seed_number
from wakewise.scene.targets.fields import BURIED_M
from wakewise.scene.targets.mesh import Mesh

REEF = "reef"
SIDE_M, CELL_M = 2.0, 0.01
EDGE_M = 0.12
"""Border over which the relief falls to the bed."""
BOULDERS, HEIGHT_M, RADIUS_M = 5, (0.12, 0.3), (0.12, 0.24)
BASE_M = 0.05
WAVES_M = ((0.02, 0.25), (0.01, 0.1), (0.0035, 0.03))
"""Standard deviation and length of the ground's waves."""
STEEP = 5.0
"""Exponent of a boulder's section: 2 is an ellipse, more has steeper sides and a flatter top."""


@lru_cache(maxsize=2, typed=True)
def reef_patch(seed: int = 0) -> Mesh:
    """A patch of reef with z up and its bed at z = 0, open below; `seed`: which one."""
    rng = np.random.default_rng([seed_number(seed, "reef seed"), 2])
    n = round(SIDE_M / CELL_M) + 1
    x = np.linspace(-0.5 * SIDE_M, 0.5 * SIDE_M, n)
    X, Y = np.meshgrid(x, x, indexing="ij")
    height = np.full((n, n), BASE_M)
    for std, length in WAVES_M:
        waves = gaussian_filter(rng.normal(size=(n, n)), 0.35 * length / CELL_M, mode="wrap")
        height += std * waves / waves.std()
    for centre in _apart(rng, BOULDERS, 0.5 * SIDE_M - EDGE_M - RADIUS_M[1]):
        tall, wide, aspect = rng.uniform(*HEIGHT_M), rng.uniform(*RADIUS_M), rng.uniform(0.7, 1.0)
        turn = rng.uniform(0.0, np.pi)
        a = (np.cos(turn) * (X - centre[0]) + np.sin(turn) * (Y - centre[1])) / wide
        b = (np.cos(turn) * (Y - centre[1]) - np.sin(turn) * (X - centre[0])) / (aspect * wide)
        # The outline is not round: its radius waves with the azimuth.
        azimuth, bumps = np.arctan2(b, a), rng.uniform(0.0, 2.0 * np.pi, 2)
        reach = np.hypot(a, b) / (
            1.0 + 0.1 * np.sin(3.0 * azimuth + bumps[0]) + 0.05 * np.sin(7.0 * azimuth + bumps[1])
        )
        height += tall * np.maximum(1.0 - reach**STEEP, 0.0) ** (1.0 / STEEP)
    return height_map_mesh(np.maximum(height, 0.02), CELL_M)


def height_map_mesh(height_m: Array, cell_m: float, edge_m: float = EDGE_M) -> Mesh:
    """Mesh of a height map, shape (n, k), z up and centred, that falls to below its bed at z = 0 over its edge.

    Raises InputError if the map is no grid of finite numbers of two rows and columns at least.
    """
    z = np.array(height_m, dtype=np.float64)
    if z.ndim != 2 or min(z.shape) < 2 or not np.isfinite(z).all():
        raise InputError(f"height map: shape {z.shape}, must be a grid of finite numbers, 2 x 2 at least")
    rows, columns = z.shape
    i, j = np.arange(rows), np.arange(columns)
    inside = np.minimum.outer(np.minimum(i, rows - 1 - i), np.minimum(j, columns - 1 - j)) * cell_m
    share = np.clip(inside / edge_m, 0.0, 1.0)
    z = (z + BURIED_M) * share * share * (3.0 - 2.0 * share) - BURIED_M
    X, Y = np.meshgrid((i - 0.5 * (rows - 1)) * cell_m, (j - 0.5 * (columns - 1)) * cell_m, indexing="ij")
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return Mesh(np.stack([X, Y, z], axis=-1).reshape(-1, 3), faces)


def _apart(rng: np.random.Generator, count: int, reach_m: float) -> Array:
    """Places, shape (count, 2), each the farthest from those before of some drawn ones."""
    places = rng.uniform(-reach_m, reach_m, (1, 2))
    while len(places) < count:
        drawn = rng.uniform(-reach_m, reach_m, (12, 2))
        away = np.linalg.norm(drawn[:, None] - places, axis=2).min(axis=1)
        places = np.vstack([places, drawn[np.argmax(away)]])
    return places

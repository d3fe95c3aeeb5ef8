"""The tank's LED panels: flat lamps at the water surface that shine down, and what they give every vertex.

A panel radiates evenly from each spot of its face by Lambert's law, so that a spot's light falls off with the squared
distance and the cosines at both ends. The water's colour on the way from a panel, nearly the same for all that the
camera sees, is counted in the reference irradiance and not here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit

SPOTS = 8
"""Spots on each panel that stand for its face."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LedPanels:
    """Rectangular panels that face straight down: middles in the world, shape (k, 3), and size along x and y."""

    centres_W_m: Array
    size_m: tuple[float, float] = (0.6, 0.3)

    def __post_init__(self) -> None:
        freeze(self, centres_W_m=(None, 3))
        if not min(self.size_m) > 0.0:
            raise InputError(f"panels: size {self.size_m} m, both must be above 0")

    @classmethod
    def over_tank(cls, length_m: float, width_m: float) -> LedPanels:
        """Four panels at the surface, z = 0, each over the middle of a quarter of the tank; its middle is x = y = 0."""
        x, y = 0.25 * length_m, 0.25 * width_m
        return cls(centres_W_m=np.array([[x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0], [-x, y, 0.0]]))

    def spots_W_m(self, along: int) -> Array:
        """Middles of equal parts of all panels' faces, `along` in x and SPOTS / along in y, shape (k * SPOTS, 3)."""
        across = SPOTS // along
        x = ((np.arange(along) + 0.5) / along - 0.5) * self.size_m[0]
        y = ((np.arange(across) + 0.5) / across - 0.5) * self.size_m[1]
        offsets = np.stack([*np.meshgrid(x, y), np.zeros((across, along))], axis=-1).reshape(-1, 3)
        return (self.centres_W_m[:, None, :] + offsets[None]).reshape(-1, 3)

    def irradiance(
        self, points_W_m: Array, normals: Array, occluder: EmbreeScene | None = None, origin_W_m: Array | None = None
    ) -> NDArray[np.float64]:
        """Irradiance at points of surfaces with unit normals, relative to pi times the panels' radiance, shape (n,).

        Parameters
        ----------
        points_W_m, normals : ndarray, shape (n, 3)
        occluder : EmbreeScene, optional
            What casts shadows, in a frame with the world's axes and the origin `origin_W_m`.
        """
        n = len(points_W_m)
        total = np.zeros(n)
        area = self.size_m[0] * self.size_m[1] / SPOTS
        points, normals = np.ascontiguousarray(points_W_m), np.ascontiguousarray(normals)
        origin = np.zeros(3) if origin_W_m is None else np.array(origin_W_m, np.float64)
        starts, ways = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
        which, shares = np.empty(n, np.int64), np.empty(n)
        # Two patterns take turns among the vertices, so that penumbras show no steps; smoothing evens them out.
        for group, along in enumerate((4, 2)):
            for spot in self.spots_W_m(along):
                k = _aim(points, normals, group, spot, origin, starts, ways, which, shares)
                if occluder is not None:
                    hit = occluder.run(starts[:k], ways[:k], query="OCCLUDED") >= 0
                    shares[:k][hit] = 0.0
                total[which[:k]] += shares[:k] * (area / math.pi)
        return total


@njit(nogil=True)
def _aim(
    points: Any, normals: Any, group: int, spot: Any, origin: Any, starts: Any, ways: Any, which: Any, shares: Any
) -> int:
    """Of every second point, from `group` on, those that face the spot and that it faces: how many there are.

    Written are rays to the spot from 0.3 mm over the surface, in a frame whose origin is given, which points they
    start at, and the cosines at both ends over the squared way.
    """
    count = 0
    for i in range(group, points.shape[0], 2):
        x, y, z = spot[0] - points[i, 0], spot[1] - points[i, 1], spot[2] - points[i, 2]
        facing = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
        if facing > 0.0 and z < 0.0:
            r2 = max(x * x + y * y + z * z, 1e-6)
            which[count], shares[count] = i, facing * -z / r2 / r2
            ways[count, 0], ways[count, 1], ways[count, 2] = x, y, z
            for j in range(3):
                starts[count, j] = points[i, j] + 3e-4 * normals[i, j] - origin[j]
            count += 1
    return count

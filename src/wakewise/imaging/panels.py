"""The tank's LED panels: flat lamps at the water surface that shine down, and what they give every vertex.

A panel radiates evenly from each spot of its face by Lambert's law, so that a spot's light falls off with the squared
distance and the cosines at both ends. The water's colour on the way from a panel, nearly the same for all that the
camera sees, is counted in the reference irradiance and not here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError

SPOTS = 8
"""Spots on each panel that stand for its face."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panels:
    """Rectangular panels that face straight down: middles in the world, shape (k, 3), and size along x and y."""

    centres_W_m: Array
    size_m: tuple[float, float] = (0.6, 0.3)

    def __post_init__(self) -> None:
        freeze(self, centres_W_m=(None, 3))
        if not min(self.size_m) > 0.0:
            raise InputError(f"panels: size {self.size_m} m, both must be above 0")

    @classmethod
    def over_tank(cls, length_m: float, width_m: float) -> Panels:
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
        total = np.zeros(len(points_W_m))
        if not len(self.centres_W_m):
            return total
        area = self.size_m[0] * self.size_m[1] / SPOTS
        # Two patterns take turns among the vertices, so that penumbras show no steps; smoothing evens them out.
        for group, along in enumerate((4, 2)):
            points, normal = points_W_m[group::2], normals[group::2]
            for spot in self.spots_W_m(along):
                way = spot - points
                r2 = np.maximum(np.sum(way**2, axis=1), 1e-6)
                cosines = np.clip(np.sum(way * normal, axis=1), 0.0, None) * np.clip(-way[:, 2], 0.0, None) / r2
                if occluder is not None:
                    start = points + 3e-4 * normal - (0.0 if origin_W_m is None else origin_W_m)
                    lit = cosines > 0.0
                    hit = np.zeros(len(points), np.bool_)
                    rays = np.ascontiguousarray(way[lit], np.float32)
                    hit[lit] = occluder.run(np.ascontiguousarray(start[lit], np.float32), rays, query="OCCLUDED") >= 0
                    cosines = np.where(hit, 0.0, cosines)
                total[group::2] += cosines / r2 * (area / math.pi)
        return total

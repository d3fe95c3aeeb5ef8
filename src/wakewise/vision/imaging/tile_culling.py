"""Which pixels may see target or stones: spheres round their pieces, tested against cones round tiles of the image.

Casting rays through the others would be in vain, and most of a photograph shows nothing but bed. A tile's cone is that
of its own rays, whatever the lens.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.lens import ray_at

PIECE_M = 0.03
"""Width of the cells by which surfaces are cut into pieces."""
TILE_PX, COARSE = 8, 8
"""Pixels along a tile's side, and tiles along the side of a coarse one."""
SLACK = 1.02
"""Widening of a cone whose angle is that of its corners: a lens may bulge the sides between them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundingSpheres:
    """A surface cut into pieces, for spheres round them however it is moved; make it with `BoundingSpheres.of`.

    `faces` (m, 3) are vertex indices, those of a piece one after the other; `firsts` (k + 1,) says where each begins.
    """

    faces: IntArray
    firsts: IntArray

    @classmethod
    def of(cls, vertices: Array, faces: IntArray) -> BoundingSpheres:
        """Cut a surface into cells of `PIECE_M`."""
        if not len(faces):
            return cls(faces=np.zeros((0, 3), np.int64), firsts=np.zeros(1, np.int64))
        cells = np.floor(vertices[faces].mean(axis=1) / PIECE_M).astype(np.int64)
        cells -= cells.min(axis=0)
        _, rows, columns = cells.max(axis=0) + 1
        # One number a cell sorts as its three do, in a tenth of the time.
        number = (cells[:, 0] * rows + cells[:, 1]) * columns + cells[:, 2]
        order = np.argsort(number, kind="stable")
        begins = np.flatnonzero(np.diff(number[order], prepend=-1))
        return cls(faces=faces[order].astype(np.int64), firsts=np.append(begins, len(faces)))

    def spheres(self, vertices: Array) -> Array:
        """Spheres (x, y, z, radius), shape (k, 4), that hold the pieces where the vertices are now, shape (n, 3)."""
        out = np.empty((len(self.firsts) - 1, 4))
        _spheres(np.ascontiguousarray(vertices, np.float64), self.faces, self.firsts, out)
        return out


@njit(nogil=True)
def _spheres(vertices: Any, faces: Any, firsts: Any, out: Any) -> None:
    low, high = np.empty(3), np.empty(3)
    for k in range(out.shape[0]):
        low[:], high[:] = np.inf, -np.inf
        for m in range(firsts[k], firsts[k + 1]):
            for corner in range(3):
                for j in range(3):
                    low[j] = min(low[j], vertices[faces[m, corner], j])
                    high[j] = max(high[j], vertices[faces[m, corner], j])
        furthest = 0.0
        for j in range(3):
            out[k, j] = 0.5 * (low[j] + high[j])
        for m in range(firsts[k], firsts[k + 1]):
            for corner in range(3):
                away = 0.0
                for j in range(3):
                    away += (vertices[faces[m, corner], j] - out[k, j]) ** 2
                furthest = max(furthest, away)
        out[k, 3] = math.sqrt(furthest) + 1e-6


@njit(nogil=True)
def _cone(row: Any, x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float, float, float, float]:
    """Cone round the rays of a rectangle of pixels: unit axis, apex on the optical axis, half angle, apex's spread."""
    sx, sy, apex = ray_at(row, 0.5 * (x0 + x1), 0.5 * (y0 + y1))
    length = math.sqrt(sx * sx + sy * sy + 1.0)
    ax, ay, az = sx / length, sy / length, 1.0 / length
    least, spread = 1.0, 0.0
    for k in range(4):
        sx, sy, z0 = ray_at(row, x0 if k % 2 == 0 else x1, y0 if k < 2 else y1)
        cosine = (ax * sx + ay * sy + az) / math.sqrt(sx * sx + sy * sy + 1.0)
        least, spread = min(least, cosine), max(spread, abs(z0 - apex))
    return ax, ay, az, apex, SLACK * math.acos(max(min(least, 1.0), -1.0)) + 1e-6, SLACK * spread


@njit(nogil=True)
def _meets(
    ax: float, ay: float, az: float, apex: float, cosine: float, sine: float, spread: float, x: float, y: float,
    z: float, radius: float,
) -> bool:  # fmt: skip
    """Whether a cone may meet a sphere: the distance to the cone's side is never more than to the cone."""
    z -= apex
    along = ax * x + ay * y + az * z
    aside = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    return bool(aside * cosine - along * sine <= radius + spread)


@njit(nogil=True)
def tile_sphere_overlap(row: Any, width: int, height: int, spheres_C: Any, out: Any) -> None:
    """Write, for each tile of 8 x 8 pixels, whether a ray through it may meet a sphere.

    `spheres_C` (k, 4) in the camera frame; `out` (ceil(height / 8), ceil(width / 8)) of bool.
    """
    rows, columns = out.shape
    some = np.empty(spheres_C.shape[0], np.int64)
    for big_j in range(0, rows, COARSE):
        for big_i in range(0, columns, COARSE):
            end_j, end_i = min(big_j + COARSE, rows), min(big_i + COARSE, columns)
            ax, ay, az, apex, angle, spread = _cone(
                row, big_i * TILE_PX, big_j * TILE_PX, min(end_i * TILE_PX, width), min(end_j * TILE_PX, height)
            )
            cosine, sine = math.cos(angle), math.sin(angle)
            count = 0
            for k in range(spheres_C.shape[0]):
                x, y, z, r = spheres_C[k, 0], spheres_C[k, 1], spheres_C[k, 2], spheres_C[k, 3]
                if _meets(ax, ay, az, apex, cosine, sine, spread, x, y, z, r):
                    some[count] = k
                    count += 1
            for j in range(big_j, end_j):
                for i in range(big_i, end_i):
                    hit = False
                    if count > 0:
                        ax, ay, az, apex, angle, spread = _cone(
                            row, i * TILE_PX, j * TILE_PX, min((i + 1) * TILE_PX, width), min((j + 1) * TILE_PX, height)
                        )
                        cosine, sine = math.cos(angle), math.sin(angle)
                        for m in range(count):
                            k = some[m]
                            x, y, z, r = spheres_C[k, 0], spheres_C[k, 1], spheres_C[k, 2], spheres_C[k, 3]
                            if _meets(ax, ay, az, apex, cosine, sine, spread, x, y, z, r):
                                hit = True
                                break
                    out[j, i] = hit

"""From a scene and a pose to linear radiance, depth and the target's share of every pixel.

Two passes. The first casts one ray through each pixel's centre: it gives the depth, exactly, and the bed's colour from
maps already filtered to the pixel's footprint. The second casts `samples` x `samples` rays where one is not enough: on
target and stones, whose colour is computed rather than filtered, and where neighbouring pixels see different things.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.imaging.camera import PinholeCamera
from wakewise.imaging.scene import BED, TARGET, Scene
from wakewise.imaging.texture import BED_TEXEL_M, baked_albedo, coral_albedo, stone_albedo

Image = NDArray[np.float32]
MISS_M = 1e30
"""Embree gives rays that meet nothing a larger distance."""
LAMP_REFERENCE_M = 0.5
"""Where the lamps' irradiance is stated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lights:
    """Light on the scene, relative to the down-welling irradiance on a level open surface.

    `ambient` scales the down-welling light. `lamps_C_m`, shape (k, 3), are the vehicle's lamps in the camera frame,
    pointing along the optical axis; together they give the irradiance `lamp` on a card facing them from 0.5 m.
    """

    ambient: float = 1.0
    lamp: float = 0.35
    lamps_C_m: Array

    def __post_init__(self) -> None:
        freeze(self, lamps_C_m=(None, 3))
        if self.ambient < 0.0 or self.lamp < 0.0:
            raise InputError(f"lights: ambient {self.ambient:g}, lamp {self.lamp:g}, neither may be negative")


@dataclass(frozen=True, kw_only=True, eq=False)
class Render:
    """What reaches the camera in perfectly clear water.

    `radiance` (h, w, 3) linear RGB relative to a white level card under the down-welling light; `lamp_radiance`
    (h, w, 3), the part of it that the lamps gave; `depth_m` (h, w) along the optical axis at the pixel's centre,
    infinite where nothing is hit; `target_fraction` (h, w), the target's share of the pixel's samples.
    """

    radiance: Image
    lamp_radiance: Image
    depth_m: Image
    target_fraction: Image


def render(scene: Scene, camera: PinholeCamera, X_WC: Pose, lights: Lights, samples: int = 2) -> Render:
    """Render one view without any water between.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    X_WC : Pose
    lights : Lights
    samples : int
        Rays across a pixel, squared in all, where one ray is not enough; 1 to 8.

    Raises
    ------
    InputError
        If `samples` is out of range.
    """
    if not 1 <= samples <= 8:
        raise InputError(f"render: samples {samples}, allowed 1 to 8")
    R, origin = X_WC.R, X_WC.p_m - scene.foot_W_m
    h, w, f = camera.height, camera.width, camera.focal_px
    lamps = lights.lamps_C_m @ R.T + origin
    # Each lamp's share, so that all together give `lamp` at the reference distance.
    power = lights.lamp * LAMP_REFERENCE_M**2 / max(1, len(lamps))
    colours = np.zeros((h * w, 2, 3), np.float32)
    fraction = np.zeros(h * w, np.float32)

    def shade(pixels: NDArray[np.int64], first_ray: NDArray[np.int64], across: int, hits: _Hits) -> None:
        _shade(
            pixels, first_ray, across, hits.kind, hits.triangle, hits.u, hits.v, hits.distance, scene.faces,
            scene.first_face, scene.normals, scene.daylight, scene.bed_maps, scene.seed, R, origin, f, w, h,
            lights.ambient, power, lamps, colours, fraction,
        )  # fmt: skip

    hits = _cast(scene, _directions(np.arange(h * w), 1, w, h, f, R), origin)
    depth = np.where(hits.distance < MISS_M, hits.distance, np.inf).astype(np.float32).reshape(h, w)
    again = _needs_more(hits.kind.reshape(h, w), depth).ravel() if samples > 1 else np.zeros(h * w, np.bool_)
    once, more = np.nonzero(~again)[0], np.nonzero(again)[0]
    shade(once, once, 1, hits)
    if len(more):
        fine = _cast(scene, _directions(more, samples, w, h, f, R), origin)
        shade(more, np.arange(len(more)) * samples**2, samples, fine)
    image = colours.reshape(h, w, 2, 3)
    return Render(
        radiance=image[:, :, 0] + image[:, :, 1],
        lamp_radiance=np.ascontiguousarray(image[:, :, 1]),
        depth_m=depth,
        target_fraction=fraction.reshape(h, w),
    )


@dataclass(frozen=True, eq=False)
class _Hits:
    """What each ray met first: kind of surface (-1 none), its triangle, barycentrics, and distance in ray lengths."""

    kind: NDArray[np.int32]
    triangle: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    distance: NDArray[np.float32]


def _cast(scene: Scene, directions: NDArray[np.float32], origin: Array) -> _Hits:
    """Cast rays from one origin on as many threads as numba uses; Embree releases the interpreter's lock."""
    origins = np.broadcast_to(origin.astype(np.float32), (1, 3))
    parts = np.array_split(directions, max(1, min(numba.get_num_threads(), len(directions) // 4096)))

    def run(part: NDArray[np.float32]) -> dict[str, Any]:
        return scene.embree.run(np.ascontiguousarray(np.broadcast_to(origins, part.shape)), part, output=True)

    with ThreadPoolExecutor(len(parts)) as pool:
        found = list(pool.map(run, parts))
    columns = [np.concatenate([part[name] for part in found]) for name in ("geomID", "primID", "u", "v", "tfar")]
    return _Hits(*columns)


@njit(cache=True, parallel=True)
def _directions(pixels: Any, across: int, width: int, height: int, focal_px: float, R_WC: Any) -> Any:
    """Rays through the samples of each pixel, in world axes, one unit of depth long: distance is then depth."""
    n = across * across
    out = np.empty((pixels.shape[0] * n, 3), np.float32)
    for k in prange(pixels.shape[0]):
        row, column = pixels[k] // width, pixels[k] % width
        for s in range(n):
            x = (column + (s % across + 0.5) / across - 0.5 * width) / focal_px
            y = (row + (s // across + 0.5) / across - 0.5 * height) / focal_px
            for c in range(3):
                out[k * n + s, c] = R_WC[c, 0] * x + R_WC[c, 1] * y + R_WC[c, 2]
    return out


@njit(cache=True, parallel=True)
def _needs_more(kind: Any, depth_m: Any) -> Any:
    """Where one ray is not enough: not bed and not open water, or beside another kind or a step of 4 % in depth."""
    h, w = kind.shape
    out = np.zeros((h, w), np.bool_)
    for y in prange(h):
        for x in range(w):
            own, d = kind[y, x], depth_m[y, x]
            more = own >= 0 and own != BED
            for yy in range(max(0, y - 1), min(h, y + 2)):
                for xx in range(max(0, x - 1), min(w, x + 2)):
                    other = kind[yy, xx]
                    more |= other != own
                    if own >= 0 and other >= 0:
                        more |= abs(depth_m[yy, xx] - d) > 0.04 * d
            out[y, x] = more
    return out


@njit(cache=True, parallel=True)
def _shade(
    pixels: Any, first_ray: Any, across: int, kind: Any, triangle: Any, u: Any, v: Any, distance: Any, faces: Any,
    first_face: Any, normals: Any, daylight: Any, maps: Any, seed: int, R_WC: Any, origin: Any, focal_px: float,
    width: int, height: int, ambient: float, power: float, lamps: Any, colours: Any, fraction: Any,
) -> None:  # fmt: skip
    """Shade the samples of each pixel and write their mean: colours[pixel, 0] by daylight, [pixel, 1] by the lamps.

    Surfaces are matt (Lambert). A lamp's light falls off with the squared distance and with the cosine from its axis.
    """
    n = across * across
    for k in prange(pixels.shape[0]):
        pixel = pixels[k]
        row, column = pixel // width, pixel % width
        for s in range(n):
            i = first_ray[k] + s
            what, t = kind[i], distance[i]
            if what < 0:
                continue
            dx = (column + (s % across + 0.5) / across - 0.5 * width) / focal_px
            dy = (row + (s // across + 0.5) / across - 0.5 * height) / focal_px
            wx = R_WC[0, 0] * dx + R_WC[0, 1] * dy + R_WC[0, 2]
            wy = R_WC[1, 0] * dx + R_WC[1, 1] * dy + R_WC[1, 2]
            wz = R_WC[2, 0] * dx + R_WC[2, 1] * dy + R_WC[2, 2]
            x, y, z = origin[0] + t * wx, origin[1] + t * wy, origin[2] + t * wz
            face = first_face[what] + triangle[i]
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            wb, wc = u[i], v[i]
            wa = 1.0 - wb - wc
            nx = wa * normals[a, 0] + wb * normals[b, 0] + wc * normals[c, 0]
            ny = wa * normals[a, 1] + wb * normals[b, 1] + wc * normals[c, 1]
            nz = wa * normals[a, 2] + wb * normals[b, 2] + wc * normals[c, 2]
            length = math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12
            facing = -(nx * wx + ny * wy + nz * wz) / (length * math.sqrt(wx * wx + wy * wy + wz * wz))
            # Open surfaces show their inner side; smooth normals near a rim may lean away and count as the rim.
            inner = 1 if what == TARGET and facing < -0.25 else 0
            sign = -1.0 / length if inner == 1 else 1.0 / length
            nx, ny, nz = sign * nx, sign * ny, sign * nz
            footprint = t / (focal_px * across)
            if what == TARGET:
                red, green, blue = coral_albedo(x, y, z, footprint, seed)
                fraction[pixel] += 1.0 / n
            elif what == BED:
                # A slanting footprint is long and narrow: filter to its geometric mean.
                slant = footprint / math.sqrt(max(abs(facing), 0.02))
                red, green, blue = baked_albedo(maps, BED_TEXEL_M, x, y, slant)
            else:
                red, green, blue = stone_albedo(x, y, z, footprint, seed)
            day = ambient * (wa * daylight[a, inner] + wb * daylight[b, inner] + wc * daylight[c, inner]) / n
            night = 0.0
            for m in range(lamps.shape[0]):
                lx, ly, lz = lamps[m, 0] - x, lamps[m, 1] - y, lamps[m, 2] - z
                r2 = lx * lx + ly * ly + lz * lz + 1e-4
                on_surface = nx * lx + ny * ly + nz * lz
                off_axis = -(R_WC[0, 2] * lx + R_WC[1, 2] * ly + R_WC[2, 2] * lz)
                if on_surface > 0.0 and off_axis > 0.0:
                    night += power * on_surface * off_axis / (r2 * r2 * n)
            colours[pixel, 0, 0] += red * day
            colours[pixel, 0, 1] += green * day
            colours[pixel, 0, 2] += blue * day
            colours[pixel, 1, 0] += red * night
            colours[pixel, 1, 1] += green * night
            colours[pixel, 1, 2] += blue * night

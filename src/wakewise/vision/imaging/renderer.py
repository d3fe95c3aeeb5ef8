"""Renderer: a scene and a pose to linear radiance, depth and the target's share of every pixel.

Two passes over bands of the image. The first casts one ray through each pixel's centre, for the depth and the bed's
colour from maps filtered to the pixel's footprint. The second casts `samples` x `samples` rays on target and stones and
where neighbouring pixels see different things. Kernels run without the interpreter's lock, one band per thread; a band
depends on its own pixels only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.bed_view import FAR_M, bed_colour, draw_bed, lamps_on, meet, project_bed, spread_at
from wakewise.vision.imaging.camera import IDEAL, Camera, ray_at
from wakewise.vision.imaging.scene import BED, STONE, TARGET, TILE_PX, Scene, tile_sphere_overlap
from wakewise.vision.imaging.texture import coral_albedo, stone_albedo


@njit(nogil=True)
def aim(
    pixels: Any, across: int, width: int, row: Any, R_WC: Any, origin: Any, top: float, starts: Any, ways: Any,
    which: Any, spreads: Any,
) -> int:  # fmt: skip
    """Write the rays through `across` x `across` samples of each pixel; return how many there are.

    Rays are one unit of depth long in world axes, so that distance is depth; `which` says the place in `pixels` that
    each belongs to, `spreads` the sample's width at unit depth. A ray that goes up (z < 0) from above `top`, the
    highest point of the scene, can meet nothing and is left out.
    """
    count = 0
    step = 1.0 / across
    for k in range(pixels.shape[0]):
        y = pixels[k] // width
        x = pixels[k] - y * width
        for j in range(across):
            for i in range(across):
                px, py = x + (i + 0.5) * step, y + (j + 0.5) * step
                sx, sy, z0 = ray_at(row, px, py)
                up = R_WC[2, 0] * sx + R_WC[2, 1] * sy + R_WC[2, 2]
                if up <= 0.0 and origin[2] + z0 * R_WC[2, 2] < top:
                    continue
                for c in range(3):
                    starts[count, c] = origin[c] + z0 * R_WC[c, 2]
                ways[count, 0] = R_WC[0, 0] * sx + R_WC[0, 1] * sy + R_WC[0, 2]
                ways[count, 1] = R_WC[1, 0] * sx + R_WC[1, 1] * sy + R_WC[1, 2]
                ways[count, 2] = up
                which[count] = k
                spreads[count] = step * spread_at(row, px, py, sx, sy)
                count += 1
    return count


@njit(nogil=True)
def needs_supersampling(kind: Any, depth_m: Any, first: int, last: int, out: Any) -> None:
    """Where one ray is not enough: not bed and not open water, or beside another kind or a step of 4 % in depth.

    `kind`, `depth_m` and `out` are whole images (h, w); rows first to last - 1 are written.
    """
    h, w = kind.shape
    # Least and greatest over three rows, then over three columns: the eight neighbours without looking at each.
    low_kind, high_kind = np.empty(w + 2, kind.dtype), np.empty(w + 2, kind.dtype)
    near, far = np.empty(w + 2, depth_m.dtype), np.empty(w + 2, depth_m.dtype)
    for y in range(first, last):
        above, below = max(0, y - 1), min(h - 1, y + 1)
        for x in range(w):
            low_kind[x + 1] = min(kind[above, x], kind[y, x], kind[below, x])
            high_kind[x + 1] = max(kind[above, x], kind[y, x], kind[below, x])
            near[x + 1] = min(depth_m[above, x], depth_m[y, x], depth_m[below, x])
            far[x + 1] = max(depth_m[above, x], depth_m[y, x], depth_m[below, x])
        low_kind[0], high_kind[0], near[0], far[0] = low_kind[1], high_kind[1], near[1], far[1]
        low_kind[w + 1], high_kind[w + 1], near[w + 1], far[w + 1] = low_kind[w], high_kind[w], near[w], far[w]
        for x in range(w):
            own, d = kind[y, x], depth_m[y, x]
            other = min(low_kind[x], low_kind[x + 1], low_kind[x + 2]) != own
            other |= max(high_kind[x], high_kind[x + 1], high_kind[x + 2]) != own
            # Open water is infinitely deep, and so is its own neighbour.
            step = min(near[x], near[x + 1], near[x + 2]) < np.float32(0.96) * d
            step |= max(far[x], far[x + 1], far[x + 2]) > np.float32(1.04) * d
            out[y, x] = other | ((own >= 0) & (step | (own != BED)))


@njit(nogil=True)
def _solid_colour(
    what: int, triangle: int, u: float, v: float, x: float, y: float, z: float, wx: float, wy: float, wz: float,
    footprint: float, faces: Any, first_face: Any, normals: Any, light: Any, moved: Any, seed: int, ax: float,
    ay: float, az: float, power: float, lamps: Any,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Albedo (r, g, b), irradiance from above, and from the lamps, where a ray meets the target or a stone.

    (x, y, z) is the place, (wx, wy, wz) the ray's direction, (ax, ay, az) the lamps'. Surfaces are matt (Lambert).
    `moved` is how far the target's vertices are from their places at rest, where its colours are, shape (n, 3); of a
    target at rest it is empty.
    """
    face = np.uint64(first_face[what] + triangle)
    # Unsigned: an index that may be negative costs a check at every use.
    a, b, c = np.uint64(faces[face, 0]), np.uint64(faces[face, 1]), np.uint64(faces[face, 2])
    wa = 1.0 - u - v
    nx = wa * normals[a, 0] + u * normals[b, 0] + v * normals[c, 0]
    ny = wa * normals[a, 1] + u * normals[b, 1] + v * normals[c, 1]
    nz = wa * normals[a, 2] + u * normals[b, 2] + v * normals[c, 2]
    scale = 1.0 / (math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12)
    facing = -(nx * wx + ny * wy + nz * wz) * scale / math.sqrt(wx * wx + wy * wy + wz * wz)
    # Open surfaces show their inner side; smooth normals near a rim may lean away and count as the rim.
    inner = 1 if what == TARGET and facing < -0.25 else 0
    if inner == 1:
        scale = -scale
    if what == TARGET:
        rx, ry, rz = x, y, z
        if moved.shape[0] > 0:
            rx -= wa * moved[a, 0] + u * moved[b, 0] + v * moved[c, 0]
            ry -= wa * moved[a, 1] + u * moved[b, 1] + v * moved[c, 1]
            rz -= wa * moved[a, 2] + u * moved[b, 2] + v * moved[c, 2]
        red, green, blue = coral_albedo(rx, ry, rz, footprint, seed)
    else:
        red, green, blue = stone_albedo(x, y, z, footprint, seed)
    day = wa * light[a, inner] + u * light[b, inner] + v * light[c, inner]
    night = lamps_on(x, y, z, scale * nx, scale * ny, scale * nz, ax, ay, az, power, lamps)
    return red, green, blue, day, night


@njit(nogil=True)
def overlay(
    pixels: Any, row: Any, width: int, which: Any, starts: Any, ways: Any, spreads: Any, solids: Any, triangle: Any,
    u: Any, v: Any, distance: Any, faces: Any, first_face: Any, normals: Any, light: Any, moved: Any, seed: int,
    R_WC: Any, power: float, lamps: Any, coloured: bool, kind: Any, depth_m: Any, radiance: Any,
    lamp_radiance: Any, fraction: Any,
) -> None:  # fmt: skip
    """Lay what the centres' rays met of target and stones over the image of the bed, where it is nearer.

    The rays are those of `aim`, one a pixel; depth is from the lens's pupil. Without `coloured` only kind and depth
    are written: more rays will give the colour.
    """
    ax, ay, az = R_WC[0, 2], R_WC[1, 2], R_WC[2, 2]
    for i in range(solids.shape[0]):
        if solids[i] < 0:
            continue
        pixel = pixels[which[i]]
        t = distance[i]
        _, _, z0 = ray_at(row, pixel % width + 0.5, pixel // width + 0.5)
        if t + z0 >= depth_m[pixel]:
            continue
        what = TARGET if solids[i] == 0 else STONE
        kind[pixel], depth_m[pixel] = what, t + z0
        if not coloured:
            continue
        wx, wy, wz = ways[i, 0], ways[i, 1], ways[i, 2]
        red, green, blue, day, night = _solid_colour(
            what, triangle[i], u[i], v[i], starts[i, 0] + t * wx, starts[i, 1] + t * wy, starts[i, 2] + t * wz,
            wx, wy, wz, t * spreads[i], faces, first_face, normals, light, moved, seed, ax, ay, az, power, lamps,
        )  # fmt: skip
        fraction[pixel] = 1.0 if what == TARGET else 0.0
        radiance[pixel, 0], lamp_radiance[pixel, 0] = red * (day + night), red * night
        radiance[pixel, 1], lamp_radiance[pixel, 1] = green * (day + night), green * night
        radiance[pixel, 2], lamp_radiance[pixel, 2] = blue * (day + night), blue * night


@njit(nogil=True)
def average(
    pixels: Any, across: int, which: Any, starts: Any, ways: Any, spreads: Any, solids: Any, triangle: Any, u: Any,
    v: Any, distance: Any, faces: Any, first_face: Any, normals: Any, light: Any, moved: Any, seed: int, bed: Any,
    attributes: Any, maps: Any, R_WC: Any, power: float, lamps: Any, radiance: Any, lamp_radiance: Any,
    fraction: Any,
) -> None:  # fmt: skip
    """Write each pixel's mean over its samples: radiance, the lamps' part of it, and the target's share.

    The rays are those of `aim`; `solids` and what follows is what they met of target and stones, and the bed is met
    here.
    """
    lines, per_cell, cell_at, z, tops = bed.lines_m, bed.per_cell, bed.cell_at, bed.z_m, bed.tops_m
    per_bin, top, bottom = 1.0 / bed.bin_m, bed.range_m[0], bed.range_m[1]
    n = lines.shape[0]
    ax, ay, az = R_WC[0, 2], R_WC[1, 2], R_WC[2, 2]
    share = 1.0 / (across * across)
    for k in range(pixels.shape[0]):
        pixel = pixels[k]
        fraction[pixel] = 0.0
        for c in range(3):
            radiance[pixel, c] = 0.0
            lamp_radiance[pixel, c] = 0.0
    for i in range(solids.shape[0]):
        pixel = pixels[which[i]]
        wx, wy, wz = float(ways[i, 0]), float(ways[i, 1]), float(ways[i, 2])
        ox, oy, oz = float(starts[i, 0]), float(starts[i, 1]), float(starts[i, 2])
        solid = solids[i] >= 0
        most = float(distance[i]) if solid else FAR_M
        t, ci, cj, cu, cv = meet(lines, per_cell, cell_at, z, tops, per_bin, top, bottom, ox, oy, oz, wx, wy, wz, most)
        if t < most:
            red, green, blue, day, night = bed_colour(
                ox + t * wx, oy + t * wy, oz + t * wz, wx, wy, wz, t * spreads[i], n, ci, cj, cu, cv, attributes, maps,
                ax, ay, az, power, lamps,
            )  # fmt: skip
        elif solid:
            what = TARGET if solids[i] == 0 else STONE
            t = most
            red, green, blue, day, night = _solid_colour(
                what, triangle[i], u[i], v[i], ox + t * wx, oy + t * wy, oz + t * wz,
                wx, wy, wz, t * spreads[i], faces, first_face, normals, light, moved, seed, ax, ay, az, power, lamps,
            )  # fmt: skip
            if what == TARGET:
                fraction[pixel] += share
        else:
            continue
        night *= share
        both = share * day + night
        radiance[pixel, 0] += red * both
        radiance[pixel, 1] += green * both
        radiance[pixel, 2] += blue * both
        lamp_radiance[pixel, 0] += red * night
        lamp_radiance[pixel, 1] += green * night
        lamp_radiance[pixel, 2] += blue * night


Image = NDArray[np.float32]
LAMP_REFERENCE_M = 0.5
"""Where the lamps' irradiance is stated."""
BAND_RAYS = 32768
"""Rays cast at a time."""
BAND_ROWS = 32
"""Rows of an image that a thread takes at a time; those of the noise are part of what a seed gives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lights:
    """Light on the scene, relative to a reference irradiance on a level open surface at the target.

    `ambient` is what the sky gives there and `panels` what the tank's LED panels give. `lamps_C_m`, shape (k, 3), are
    the vehicle's lamps in the camera frame, pointing along the optical axis; together they give the irradiance `lamp`
    on a card facing them from 0.5 m.
    """

    ambient: float = 1.0
    panels: float = 0.0
    lamp: float = 0.35
    lamps_C_m: Array

    def __post_init__(self) -> None:
        freeze(self, lamps_C_m=(None, 3))
        if not min(self.ambient, self.panels, self.lamp) >= 0.0:
            raise InputError(
                f"lights: ambient {self.ambient:g}, panels {self.panels:g}, lamp {self.lamp:g}, none may be negative"
            )

    @property
    def from_above(self) -> float:
        """Irradiance of sky and panels together."""
        return self.ambient + self.panels


@dataclass(frozen=True, kw_only=True, eq=False)
class Render:
    """What reaches the camera in perfectly clear water.

    `radiance` (h, w, 3) linear RGB relative to a white level card under the reference light; `lamp_radiance`
    (h, w, 3), the part of it that the lamps gave; `depth_m` (h, w) along the optical axis at the pixel's centre,
    infinite where nothing is hit; `target_fraction` (h, w), the target's share of the pixel's samples.
    """

    radiance: Image
    lamp_radiance: Image
    depth_m: Image
    target_fraction: Image


def render(scene: Scene, camera: Camera, X_WC: Pose, lights: Lights, samples: int = 2) -> Render:
    """Render one view without any water between.

    `samples`: rays across a pixel, squared in all, where one ray is not enough; 1 to 8. Raises InputError if `samples`
    is out of range.
    """
    if not 1 <= samples <= 8:
        raise InputError(f"render: samples {samples}, allowed 1 to 8")
    R, origin = X_WC.R, X_WC.p_m - scene.foot_W_m
    h, w, row = camera.height, camera.width, camera.row
    lamps = lights.lamps_C_m @ R.T + origin
    # Each lamp's share, so that all together give `lamp` at the reference distance.
    power = lights.lamp * LAMP_REFERENCE_M**2 / max(1, len(lamps))
    light = np.float32(lights.ambient) * scene.daylight + np.float32(lights.panels) * scene.panel_light
    radiance, lamp_radiance = np.zeros((h, w, 3), np.float32), np.zeros((h, w, 3), np.float32)
    fraction, depth = np.zeros((h, w), np.float32), np.full((h, w), np.inf, np.float32)
    kind = np.full((h, w), -1, np.int8)
    flat = (radiance.reshape(-1, 3), lamp_radiance.reshape(-1, 3), fraction.reshape(-1))

    n = len(scene.bed.lines_m)
    of_bed = slice(scene.first_bed_vertex, scene.first_bed_vertex + n * n)
    attributes = np.concatenate([scene.normals[of_bed], light[of_bed, :1]], axis=1)
    crossings, boxes = np.empty((n, n, 5)), np.empty((*scene.bed.tops_m.shape, 4))
    if row[0] == IDEAL:
        project_bed(scene.bed, row, R, origin, crossings, boxes)
    tiles = np.empty((-(-h // TILE_PX), -(-w // TILE_PX)), np.bool_)
    spheres_C = np.column_stack([(scene.spheres_F_m[:, :3] - origin) @ R, scene.spheres_F_m[:, 3]])
    tile_sphere_overlap(row, w, h, spheres_C, tiles)

    def cast(pixels: NDArray[np.int64], across: int) -> tuple[Any, ...]:
        most = len(pixels) * across**2
        starts, ways = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32)
        which, spreads = np.empty(most, np.int64), np.empty(most, np.float32)
        count = aim(pixels, across, w, row, R, origin, scene.top_m, starts, ways, which, spreads)
        hits = scene.solids.run(starts[:count], ways[:count], output=True)
        return (
            which, starts, ways, spreads, hits["geomID"], hits["primID"], hits["u"], hits["v"], hits["tfar"],
            scene.faces, scene.first_face, scene.normals, light, scene.moved_m, scene.seed,
        )  # fmt: skip

    rows = max(TILE_PX, BAND_RAYS // w // TILE_PX * TILE_PX)

    def first(begin: int) -> None:
        end = min(begin + rows, h)
        draw_bed(
            begin, end, row, R, origin, scene.bed, crossings, boxes, attributes, scene.bed_maps, power, lamps, kind,
            depth, radiance, lamp_radiance, BED,
        )  # fmt: skip
        near = np.repeat(np.repeat(tiles[begin // TILE_PX : -(-end // TILE_PX)], TILE_PX, axis=0), TILE_PX, axis=1)
        pixels = np.flatnonzero(near[: end - begin, :w]) + begin * w
        if len(pixels):
            which, *met = cast(pixels, 1)
            overlay(
                pixels, row, w, which, *met, R, power, lamps, samples == 1, kind.reshape(-1), depth.reshape(-1), *flat
            )

    in_threads(first, range(0, h, rows))
    if samples > 1:
        again = np.empty((h, w), np.bool_)
        in_threads(lambda y: needs_supersampling(kind, depth, y, min(y + rows, h), again), range(0, h, rows))
        more = np.flatnonzero(again)
        step = max(1, BAND_RAYS // samples**2)

        def second(begin: int) -> None:
            pixels = more[begin : begin + step]
            average(
                pixels, samples, *cast(pixels, samples), scene.bed, attributes, scene.bed_maps, R, power, lamps, *flat
            )

        in_threads(second, range(0, len(more), step))
    return Render(radiance=radiance, lamp_radiance=lamp_radiance, depth_m=depth, target_fraction=fraction)


def in_threads(work: Callable[[int], Any], items: Iterable[int]) -> None:
    """Do the work on as many threads as numba uses; Embree and the kernels release the interpreter's lock."""
    items = list(items)
    threads = min(numba.get_num_threads(), len(items))
    if threads <= 1:
        for item in items:
            work(item)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, items):
            pass

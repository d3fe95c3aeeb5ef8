"""Compiled parts of the renderer: rays through samples, which pixels need more of them, the colour of what they hit.

Kernels run outside of the interpreter's lock on one band of the image each, so that bands go to threads; what a band
writes depends on nothing but its own pixels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wakewise.imaging.lens import IDEAL, ray_at
from wakewise.imaging.scene import BED, TARGET
from wakewise.imaging.texture import BED_TEXEL_M, baked_albedo, coral_albedo, stone_albedo


@njit(cache=True, nogil=True, error_model="numpy")
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
                spreads[count] = step * _spread(row, px, py, sx, sy)
                count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(row: Any, x: float, y: float, sx: float, sy: float) -> float:
    """Width of a pixel at unit depth: how fast the ray turns from pixel to pixel."""
    if row[0] == IDEAL:
        return float(1.0 / row[1])
    ax, ay, _ = ray_at(row, x + 0.5, y)
    bx, by, _ = ray_at(row, x, y + 0.5)
    return 2.0 * math.sqrt(abs((ax - sx) * (by - sy) - (ay - sy) * (bx - sx)))


@njit(cache=True, nogil=True, error_model="numpy")
def needs_more(kind: Any, depth_m: Any, first: int, last: int, out: Any) -> None:
    """Where one ray is not enough: not bed and not open water, or beside another kind or a step of 4 % in depth.

    `kind`, `depth_m` and `out` are whole images (h, w); rows first to last - 1 are written.
    """
    h, w = kind.shape
    for y in range(first, last):
        for x in range(w):
            own, d = kind[y, x], depth_m[y, x]
            if own >= 0 and own != BED:
                out[y, x] = True
                continue
            near, far = 0.96 * d, 1.04 * d
            more = False
            for yy in range(max(0, y - 1), min(h, y + 2)):
                for xx in range(max(0, x - 1), min(w, x + 2)):
                    other = depth_m[yy, xx]
                    # Open water is infinitely deep, and so is its own neighbour.
                    more |= kind[yy, xx] != own or (own >= 0 and (other < near or other > far))
            out[y, x] = more


@njit(cache=True, nogil=True, error_model="numpy")
def _colour(
    what: int, triangle: int, u: float, v: float, x: float, y: float, z: float, wx: float, wy: float, wz: float,
    footprint: float, faces: Any, first_face: Any, normals: Any, light: Any, maps: Any, seed: int, axis: Any,
    power: float, lamps: Any,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Albedo (r, g, b), irradiance from sky and panels, and from the vehicle's lamps, where a ray meets a surface.

    (x, y, z) is the place, (wx, wy, wz) the ray's direction, `axis` the lamps'. Surfaces are matt (Lambert). A lamp's
    light falls off with the squared distance and with the cosine from its axis.
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
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    if what == TARGET:
        red, green, blue = coral_albedo(x, y, z, footprint, seed)
    elif what == BED:
        # A slanting footprint is long and narrow: filter to its geometric mean.
        red, green, blue = baked_albedo(maps, BED_TEXEL_M, x, y, footprint / math.sqrt(max(abs(facing), 0.02)))
    else:
        red, green, blue = stone_albedo(x, y, z, footprint, seed)
    day = wa * light[a, inner] + u * light[b, inner] + v * light[c, inner]
    night = 0.0
    for m in range(lamps.shape[0]):
        lx, ly, lz = lamps[m, 0] - x, lamps[m, 1] - y, lamps[m, 2] - z
        r2 = lx * lx + ly * ly + lz * lz + 1e-4
        on_surface = nx * lx + ny * ly + nz * lz
        off_axis = -(axis[0] * lx + axis[1] * ly + axis[2] * lz)
        if on_surface > 0.0 and off_axis > 0.0:
            night += power * on_surface * off_axis / (r2 * r2)
    return red, green, blue, day, night


@njit(cache=True, nogil=True, error_model="numpy")
def shade(
    pixels: Any, across: int, which: Any, starts: Any, ways: Any, spreads: Any, kinds: Any, triangle: Any, u: Any,
    v: Any, distance: Any, faces: Any, first_face: Any, normals: Any, light: Any, maps: Any, seed: int, axis: Any,
    power: float, lamps: Any, only_bed: bool, radiance: Any, lamp_radiance: Any, fraction: Any,
) -> None:  # fmt: skip
    """Write each pixel's mean over its samples: radiance, the lamps' part of it, and the target's share.

    The rays are those of `aim`. With `only_bed`, pixels whose ray met something else keep what they have.
    """
    share = 1.0 / (across * across)
    if not only_bed:
        for k in range(pixels.shape[0]):
            pixel = pixels[k]
            fraction[pixel] = 0.0
            for c in range(3):
                radiance[pixel, c] = 0.0
                lamp_radiance[pixel, c] = 0.0
    for i in range(kinds.shape[0]):
        what = kinds[i]
        if what < 0 or (only_bed and what != BED):
            continue
        pixel = pixels[which[i]]
        t = distance[i]
        wx, wy, wz = ways[i, 0], ways[i, 1], ways[i, 2]
        red, green, blue, day, night = _colour(
            what, triangle[i], u[i], v[i], starts[i, 0] + t * wx, starts[i, 1] + t * wy, starts[i, 2] + t * wz,
            wx, wy, wz, t * spreads[i], faces, first_face, normals, light, maps, seed, axis, power, lamps,
        )  # fmt: skip
        night *= share
        both = share * day + night
        if what == TARGET:
            fraction[pixel] += share
        radiance[pixel, 0] += red * both
        radiance[pixel, 1] += green * both
        radiance[pixel, 2] += blue * both
        lamp_radiance[pixel, 0] += red * night
        lamp_radiance[pixel, 1] += green * night
        lamp_radiance[pixel, 2] += blue * night


@njit(cache=True, nogil=True, error_model="numpy")
def keep_first(
    first_pixel: int, row: Any, width: int, which: Any, kinds: Any, distance: Any, kind: Any, depth_m: Any
) -> None:
    """Write what the ray through each pixel's centre met: its kind, and its depth from the lens's pupil."""
    for i in range(kinds.shape[0]):
        if kinds[i] >= 0:
            pixel = first_pixel + which[i]
            kind[pixel] = kinds[i]
            depth_m[pixel] = distance[i]
            if row[0] != IDEAL:
                _, _, z0 = ray_at(row, pixel % width + 0.5, pixel // width + 0.5)
                depth_m[pixel] = distance[i] + z0

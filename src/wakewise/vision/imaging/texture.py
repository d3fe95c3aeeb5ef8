"""Albedo fixed in the world: value noise for coral and stones, and baked maps for the bed.

A point has one colour whatever the view; octaves whose cells are smaller than the pixel's footprint fade to their mean.
The bed is baked into nested square maps, each twice as wide and half as fine. Value noise: Ebert et al., Texturing and
Modeling, 3rd ed., Morgan Kaufmann 2003, ch. 2; the integer hash is the 32-bit finaliser of MurmurHash3 (Appleby, public
domain) over products with large odd constants.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wakewise.core.jit.njit import njit, prange

FINEST_CELL_M = 0.0015
BED_TEXEL_M = 0.00075
BED_MAP_SIZE = 1024
BED_MAP_LEVELS = 6

Maps = NDArray[np.uint16]


@njit(inline="always")
def _finalise(h: int) -> float:
    """Scramble 32 bits and map them to [0, 1)."""
    h &= 0xFFFFFFFF
    h ^= h >> 16
    h = (h * 0x85EBCA6B) & 0xFFFFFFFF
    h ^= h >> 13
    h = (h * 0xC2B2AE35) & 0xFFFFFFFF
    h ^= h >> 16
    return h * (1.0 / 4294967296.0)


@njit
def value_noise(x: float, y: float, z: float, seed: int) -> float:
    """Smooth noise in [0, 1] with mean 1/2 on the unit lattice."""
    xi, yi, zi = math.floor(x), math.floor(y), math.floor(z)
    fx, fy, fz = x - xi, y - yi, z - zi
    u, v, w = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy), fz * fz * (3 - 2 * fz)
    i, j, k = int(xi), int(yi), int(zi)
    hx0, hy0, hz0 = i * 374761393, j * 668265263, k * 2147483629 + seed * 974634777
    hx1, hy1, hz1 = hx0 + 374761393, hy0 + 668265263, hz0 + 2147483629
    n000, n100 = _finalise(hx0 + hy0 + hz0), _finalise(hx1 + hy0 + hz0)
    n010, n110 = _finalise(hx0 + hy1 + hz0), _finalise(hx1 + hy1 + hz0)
    n001, n101 = _finalise(hx0 + hy0 + hz1), _finalise(hx1 + hy0 + hz1)
    n011, n111 = _finalise(hx0 + hy1 + hz1), _finalise(hx1 + hy1 + hz1)
    a = (n000 + u * (n100 - n000)) * (1 - v) + (n010 + u * (n110 - n010)) * v
    b = (n001 + u * (n101 - n001)) * (1 - v) + (n011 + u * (n111 - n011)) * v
    return a + w * (b - a)


@njit
def octaves(
    x: float, y: float, z: float, coarsest_m: float, finest_m: float, gain: float, footprint_m: float, seed: int
) -> float:
    """Sum of value noise in [-1/2, 1/2], cells halving from `coarsest_m` to `finest_m`, amplitudes times `gain`.

    An octave counts in full while its cell is at least two footprints wide and not at all below one.
    """
    total, weight, amplitude, cell = 0.0, 0.0, 1.0, coarsest_m
    while cell > 0.99 * finest_m:
        keep = min(1.0, max(0.0, cell / max(footprint_m, 1e-9) - 1.0))
        if keep > 0.0:
            total += keep * amplitude * (value_noise(x / cell, y / cell, z / cell, seed) - 0.5)
        weight += amplitude
        amplitude *= gain
        cell *= 0.5
        seed += 1
    return total / weight


@njit
def coral_albedo(x: float, y: float, z: float, footprint_m: float, seed: int) -> tuple[float, float, float]:
    """Reflectance (r, g, b) of a coral at a point of the world.

    Brown living tissue reflects about 5-30 % from blue to red, and pale patches more: Hochberg, Atkinson & Andrefouet
    2003, doi 10.1016/S0034-4257(02)00201-8.
    """
    body = octaves(x, y, z, 0.012, FINEST_CELL_M, 1.0, footprint_m, seed + 11)
    hue = octaves(x, y, z, 0.05, 0.025, 0.6, footprint_m, seed + 57)
    # Polyps: pale dots where a 3 mm noise peaks.
    dot = octaves(x, y, z, 0.003, 0.003, 1.0, footprint_m, seed + 83)
    q = min(2.0, max(0.3, 0.9 + 3.4 * body + 3.0 * max(0.0, dot - 0.12)))
    return q * (0.33 + 0.18 * hue), q * (0.225 + 0.22 * hue), q * (0.135 + 0.02 * hue)


@njit
def stone_albedo(x: float, y: float, z: float, footprint_m: float, seed: int) -> tuple[float, float, float]:
    """Reflectance (r, g, b) of a stone at a point of the world; coarse noise gives each its own grey."""
    grain = octaves(x, y, z, 0.012, FINEST_CELL_M, 0.8, footprint_m, seed + 201)
    tone = octaves(x, y, z, 0.09, 0.045, 0.7, footprint_m, seed + 231)
    q = min(1.7, max(0.15, 1.0 + 1.7 * grain + 1.3 * tone))
    return q * 0.25, q * (0.235 - 0.03 * tone), q * (0.205 - 0.06 * tone)


@njit
def sand_albedo(x: float, y: float, footprint_m: float, seed: int) -> tuple[float, float, float]:
    """Reflectance (r, g, b) of carbonate sand above or below a point: about 0.3-0.45 (Hochberg et al. 2003)."""
    stain = octaves(x, y, 0.0, 0.32, 0.04, 0.75, footprint_m, seed + 301)
    grain = octaves(x, y, 0.0, 0.006, FINEST_CELL_M, 1.0, footprint_m, seed + 331)
    # Dark and pale bits of shell and rubble where a 5 mm noise peaks.
    bit = octaves(x, y, 0.0, 0.005, 0.005, 1.0, footprint_m, seed + 361)
    q = 1.0 + 0.75 * stain + 1.9 * grain
    q *= 1.0 - 2.6 * max(0.0, bit - 0.27) + 1.6 * max(0.0, -bit - 0.30)
    q = min(1.9, max(0.15, q))
    return q * 0.40, q * (0.365 - 0.03 * stain), q * (0.295 - 0.06 * stain)


@njit
def bed_height(x: float, y: float, clear_m: float, seed: int) -> float:
    """Height in m of the sand above the nominal bed, at a point relative to the target's foot.

    Within `clear_m` of the foot the relief is 1 mm, and grows to 25 mm another 0.6 m out; wind-ripple-like
    octaves of 0.5 m to 6 cm.
    """
    r = math.sqrt(x * x + y * y)
    s = min(1.0, max(0.0, (r - clear_m) / 0.6))
    amplitude = 0.001 + 0.024 * s * s * (3 - 2 * s)
    return 2.0 * amplitude * octaves(x, y, 0.0, 0.5, 0.06, 0.55, 0.0, seed + 401)


@njit(parallel=True)
def bed_heights(xy_m: Any, clear_m: float, seed: int) -> Any:
    """`bed_height` at points, shape (n, 2) to (n,)."""
    out = np.empty(xy_m.shape[0])
    for i in prange(xy_m.shape[0]):
        out[i] = bed_height(xy_m[i, 0], xy_m[i, 1], clear_m, seed)
    return out


@njit(parallel=True)
def bake_bed(size: int, levels: int, texel_m: float, seed: int) -> Any:
    """Bake the sand's albedo into nested maps centred on the target's foot.

    Returns uint16, shape (levels, size, size, 4): red, green, blue albedo times 65535, and nothing; first
    axis x. Texels of level k are `texel_m * 2**k` wide and hold no finer detail. With four numbers a texel is read at
    once.
    """
    maps = np.zeros((levels, size, size, 4), np.uint16)
    for row in prange(levels * size):
        level, i = row // size, row % size
        texel = texel_m * 2.0**level
        x = (i + 0.5 - 0.5 * size) * texel
        for j in range(size):
            y = (j + 0.5 - 0.5 * size) * texel
            r, g, b = sand_albedo(x, y, texel, seed)
            maps[level, i, j, 0] = int(65535.0 * min(1.0, r))
            maps[level, i, j, 1] = int(65535.0 * min(1.0, g))
            maps[level, i, j, 2] = int(65535.0 * min(1.0, b))
    return maps


@njit
def _bilinear(maps: Any, level: int, texel_m: float, x: float, y: float) -> tuple[float, float, float]:
    size = maps.shape[1]
    per_texel, middle = 1.0 / texel_m, 0.5 * size - 0.5
    u = min(max(x * per_texel + middle, 0.0), size - 1.001)
    v = min(max(y * per_texel + middle, 0.0), size - 1.001)
    i, j, k = np.uint64(u), np.uint64(v), np.uint64(level)
    a, b = u - i, v - j
    scale = 1.0 / 65535.0
    p, q, r, s = scale * (1 - a) * (1 - b), scale * a * (1 - b), scale * (1 - a) * b, scale * a * b
    m, n = i + np.uint64(1), j + np.uint64(1)
    return (
        p * maps[k, i, j, 0] + q * maps[k, m, j, 0] + r * maps[k, i, n, 0] + s * maps[k, m, n, 0],
        p * maps[k, i, j, 1] + q * maps[k, m, j, 1] + r * maps[k, i, n, 1] + s * maps[k, m, n, 1],
        p * maps[k, i, j, 2] + q * maps[k, m, j, 2] + r * maps[k, i, n, 2] + s * maps[k, m, n, 2],
    )


@njit(inline="always")
def whole_log2(x: float) -> tuple[int, float]:
    """Logarithm to base 2 of x >= 1 as whole number and rest, from the bits; the rest is within 0.01.

    On 1 to 2 the parabola m (4 - m) / 3 stands for log2(1 + m): what mixes two maps needs no more.
    """
    bits = int(np.float32(x).view(np.int32))
    m = (bits & 0x7FFFFF) * (1.0 / 8388608.0)
    return (bits >> 23) - 127, m * (4.0 - m) * (1.0 / 3.0)


@njit
def baked_albedo(maps: Any, texel_m: float, x: float, y: float, footprint_m: float) -> tuple[float, float, float]:
    """Look the bed's albedo up at (x, y) from the target's foot, between the two levels that suit the footprint."""
    levels, size = maps.shape[0], maps.shape[1]
    low, t = whole_log2(max(footprint_m / texel_m, 1.0))
    reach = max(abs(x), abs(y)) / (0.5 * texel_m * (size - 2))
    if reach > 1.0:
        # Of the first level that reaches (x, y) alone, if the footprint does not ask for a coarser one.
        out, rest = whole_log2(reach)
        out += 1 if rest > 0.0 else 0
        if low < out:
            low, t = out, 0.0
    if low >= levels - 1:
        low, t = levels - 2, 1.0
    r, g, b = _bilinear(maps, low, texel_m * (1 << low), x, y)
    r1, g1, b1 = _bilinear(maps, low + 1, texel_m * (2 << low), x, y)
    return r + t * (r1 - r), g + t * (g1 - g), b + t * (b1 - b)

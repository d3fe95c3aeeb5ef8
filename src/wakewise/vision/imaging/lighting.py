"""What bed and solids share in shading: the vehicle's lamps, and how wide a pixel is at unit depth."""

from __future__ import annotations

import math
from typing import Any

from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.lens import IDEAL, ray_at


@njit(nogil=True)
def lamps_on(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, ax: float, ay: float, az: float, power: float,
    lamps: Any,
) -> float:  # fmt: skip
    """Irradiance by lamps that point along (ax, ay, az), at (x, y, z) on a surface with unit normal (nx, ny, nz).

    Light falls off with the squared distance and with the cosine from a lamp's axis.
    """
    total = 0.0
    for m in range(lamps.shape[0]):
        lx, ly, lz = lamps[m, 0] - x, lamps[m, 1] - y, lamps[m, 2] - z
        r2 = lx * lx + ly * ly + lz * lz + 1e-4
        on_surface = nx * lx + ny * ly + nz * lz
        off_axis = -(ax * lx + ay * ly + az * lz)
        if on_surface > 0.0 and off_axis > 0.0:
            total += power * on_surface * off_axis / (r2 * r2)
    return total


@njit(nogil=True)
def spread_at(row: Any, x: float, y: float, sx: float, sy: float) -> float:
    """Width of a pixel at unit depth: how fast the ray turns from pixel to pixel."""
    if row[0] == IDEAL:
        return float(1.0 / row[1])
    ax, ay, _ = ray_at(row, x + 0.5, y)
    bx, by, _ = ray_at(row, x, y + 0.5)
    return 2.0 * math.sqrt(abs((ax - sx) * (by - sy) - (ay - sy) * (bx - sx)))

"""The bed in an image: a height field on a grid, rasterised in an ideal lens and met by rays elsewhere.

Heights stand on the crossings of lines of uneven spacing. A cell is two triangles, so the surface is a triangle mesh.
In an ideal lens straight edges stay straight: triangles are drawn into a depth buffer, with edges as planes through the
pupil (Olano & Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates", doi 10.1145/258694.258723),
which needs no clipping. Through another lens, and where nothing was drawn, the pixel's ray walks over blocks of cells
and skips those whose highest point stays below it. Position and depth are always those of the pixel's own ray.

The module is long because its kernels call each other for each pixel.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.vision.imaging.camera import IDEAL, ray_at
from wakewise.vision.imaging.texture import BED_TEXEL_M, baked_albedo

BLOCK = 8
"""Cells along a block's side."""


class HeightField(NamedTuple):
    """Heights over a square grid, for compiled kernels.

    `lines_m` (n,) places of the grid's lines along x and y; `per_cell` (n - 1,) one over the spacing; `cell_at` (m,)
    the cell of the start of each bin, `bin_m` wide, no wider than a cell; `z_m` (n, n), downward, first axis x;
    `tops_m` (b, b) least z of each block; `range_m` (2,) least and greatest z. A tuple, which kernels can take apart.
    """

    lines_m: Array
    per_cell: Array
    cell_at: NDArray[np.int32]
    bin_m: float
    z_m: NDArray[np.float32]
    tops_m: NDArray[np.float32]
    range_m: Array


def height_field(lines_m: Array, z_m: NDArray[np.float32]) -> HeightField:
    """A height field from the grid's lines, rising, shape (n,), and z downward at their crossings, shape (n, n)."""
    steps, n = np.diff(lines_m), len(lines_m)
    bin_m = float(steps.min())
    starts = lines_m[0] + bin_m * np.arange(int((lines_m[-1] - lines_m[0]) / bin_m) + 2)
    cell_at = np.clip(np.searchsorted(lines_m, starts, side="right") - 1, 0, n - 2)
    z_m = np.ascontiguousarray(z_m, np.float32)
    cells = np.minimum(np.minimum(z_m[:-1, :-1], z_m[1:, :-1]), np.minimum(z_m[:-1, 1:], z_m[1:, 1:]))
    firsts = np.arange(0, n - 1, BLOCK)
    tops = np.minimum.reduceat(np.minimum.reduceat(cells, firsts, axis=0), firsts, axis=1)
    return HeightField(
        lines_m, 1.0 / steps, cell_at.astype(np.int32), bin_m, z_m, tops, np.array([z_m.min(), z_m.max()], np.float64)
    )


def grid_faces(n: int) -> IntArray:
    """Triangles, shape (2 (n - 1)**2, 3), of a grid of n x n crossings; corners numbered row by row, first axis x.

    Each cell is cut from its corner at least x and y to the opposite one; the halves at higher x come first. Normals
    lead to z < 0.
    """
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])


@njit(nogil=True)
def cell_of(lines: Any, cell_at: Any, per_bin: float, x: float) -> int:
    """Cell along an axis in which x lies, the first or last if it is outside."""
    place = min(max(int((x - lines[0]) * per_bin), 0), cell_at.shape[0] - 1)
    i = cell_at[place]
    while i < lines.shape[0] - 2 and lines[i + 1] <= x:
        i += 1
    return i


@njit(nogil=True)
def meet(
    lines: Any, per_cell: Any, cell_at: Any, z: Any, tops: Any, per_bin: float, top: float, bottom: float,
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, most: float,
) -> tuple[float, int, int, float, float]:  # fmt: skip
    """Where a ray from (ox, oy, oz) along (dx, dy, dz) first comes down through the surface.

    Returns (t, i, j, u, v): distance in lengths of the direction, infinite if the surface is not met before `most`; the
    cell, and the place in it along x and y, 0 to 1 each. From below the surface, at its start or where it comes in from
    the side, a ray meets nothing.
    """
    cells = lines.shape[0] - 1
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    t, last = 0.0, most
    # Only between the planes of the highest and lowest point, slightly farther because of rounding.
    if dz > 0.0:
        t = max(t, (top - oz) * iz - 1e-7)
        last = min(last, (bottom - oz) * iz + 1e-7)
    elif oz < top:
        return np.inf, 0, 0, 0.0, 0.0
    elif dz < 0.0:
        last = min(last, (top - oz) * iz + 1e-7)
    entered = t
    for axis in range(2):
        o, d, inverse = (ox, dx, ix) if axis == 0 else (oy, dy, iy)
        if d == 0.0:
            if not lines[0] <= o <= lines[cells]:
                return np.inf, 0, 0, 0.0, 0.0
        else:
            one, other = (lines[0] - o) * inverse, (lines[cells] - o) * inverse
            t = max(t, min(one, other))
            last = min(last, max(one, other))
    if not t < last:
        return np.inf, 0, 0, 0.0, 0.0
    i, j = cell_of(lines, cell_at, per_bin, ox + t * dx), cell_of(lines, cell_at, per_bin, oy + t * dy)
    if t == 0.0 or t > entered:
        u, v = (ox + t * dx - lines[i]) * per_cell[i], (oy + t * dy - lines[j]) * per_cell[j]
        if oz + t * dz >= _surface(z, i, j, u, v):
            return np.inf, 0, 0, 0.0, 0.0
    east, south = dx > 0.0, dy > 0.0
    while True:
        bi, bj = i // BLOCK, j // BLOCK
        i_low, j_low = bi * BLOCK, bj * BLOCK
        i_high, j_high = min(i_low + BLOCK, cells), min(j_low + BLOCK, cells)
        tx = (lines[i_high if east else i_low] - ox) * ix if dx != 0.0 else np.inf
        ty = (lines[j_high if south else j_low] - oy) * iy if dy != 0.0 else np.inf
        leave = min(tx, ty, last)
        block_top = tops[bi, bj]
        if max(oz + t * dz, oz + leave * dz) >= block_top:
            if dz > 0.0:
                enter = (block_top - oz) * iz - 1e-7
                if enter > t:
                    t = enter
                    i = min(max(cell_of(lines, cell_at, per_bin, ox + t * dx), i_low), i_high - 1)
                    j = min(max(cell_of(lines, cell_at, per_bin, oy + t * dy), j_low), j_high - 1)
            while True:
                cx = (lines[i + 1 if east else i] - ox) * ix if dx != 0.0 else np.inf
                cy = (lines[j + 1 if south else j] - oy) * iy if dy != 0.0 else np.inf
                end = max(min(cx, cy, last), t)
                u0, v0 = (ox + t * dx - lines[i]) * per_cell[i], (oy + t * dy - lines[j]) * per_cell[j]
                u1, v1 = (ox + end * dx - lines[i]) * per_cell[i], (oy + end * dy - lines[j]) * per_cell[j]
                w0, w1 = u0 - v0, u1 - v1
                za, zc = np.float64(z[i, j]), np.float64(z[i + 1, j + 1])
                side = w1 if abs(w1) > abs(w0) else w0
                met = False
                at, gap = end, 0.0
                if w0 * w1 < 0.0:
                    # The cut between the two triangles is crossed on the way.
                    share = w0 / (w0 - w1)
                    at = t + (end - t) * share
                    gap = oz + at * dz - za - (u0 + (u1 - u0) * share) * (zc - za)
                    side = w0
                    met = gap >= 0.0
                    if not met:
                        at, side = end, w1
                if not met:
                    gap = oz + end * dz - _on_triangle(z, i, j, u1, v1, side)
                    met = gap >= 0.0
                if met:
                    if side > 0.0:
                        along_u, along_v = np.float64(z[i + 1, j]) - za, zc - np.float64(z[i + 1, j])
                    else:
                        along_u, along_v = zc - np.float64(z[i, j + 1]), np.float64(z[i, j + 1]) - za
                    closing = dz - along_u * dx * per_cell[i] - along_v * dy * per_cell[j]
                    if closing > 0.0:
                        at -= gap / closing
                    if at > most:
                        return np.inf, 0, 0, 0.0, 0.0
                    u, v = (ox + at * dx - lines[i]) * per_cell[i], (oy + at * dy - lines[j]) * per_cell[j]
                    # Slightly beyond the cut is the other triangle.
                    if side > 0.0:
                        u = max(u, v)
                    else:
                        v = max(u, v)
                    return at, i, j, u, v
                t = end
                if end >= leave:
                    break
                if cx < cy:
                    i += 1 if east else -1
                else:
                    j += 1 if south else -1
        t = leave
        if leave >= last:
            return np.inf, 0, 0, 0.0, 0.0
        if tx < ty:
            i = i_high if east else i_low - 1
            j = min(max(cell_of(lines, cell_at, per_bin, oy + t * dy), j_low), j_high - 1)
        else:
            j = j_high if south else j_low - 1
            i = min(max(cell_of(lines, cell_at, per_bin, ox + t * dx), i_low), i_high - 1)
        if not (0 <= i < cells and 0 <= j < cells):
            return np.inf, 0, 0, 0.0, 0.0


@njit(nogil=True, inline="always")
def _on_triangle(z: Any, i: int, j: int, u: float, v: float, side: float) -> float:
    """Height at (u, v) of a cell's triangle at higher u (side > 0) or at higher v, extended beyond its borders."""
    a, c = np.float64(z[i, j]), np.float64(z[i + 1, j + 1])
    if side > 0.0:
        b = np.float64(z[i + 1, j])
        return a + u * (b - a) + v * (c - b)
    d = np.float64(z[i, j + 1])
    return a + v * (d - a) + u * (c - d)


@njit(nogil=True, inline="always")
def _surface(z: Any, i: int, j: int, u: float, v: float) -> float:
    """Height at (u, v) of a cell."""
    return _on_triangle(z, i, j, u, v, u - v)


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


FAR_M = 1e4
"""Rays end here; the bed reaches 12 m."""
RUN = 128
"""Pixels shaded together."""


@njit(nogil=True)
def project_bed(bed: Any, row: Any, R_WC: Any, origin: Any, crossings: Any, boxes: Any) -> None:
    """Write the bed's crossings in the camera frame and their pixels, and the box of pixels of each block of cells.

    `crossings` (n, n, 5): x, y, z, and the pixel, NaN where z is not above 0. `boxes` (b, b, 4): least and greatest x,
    least and greatest y; endless where a crossing has no pixel, empty (least above greatest) where none has.
    """
    lines, z = bed.lines_m, bed.z_m
    n = lines.shape[0]
    for i in range(n):
        for j in range(n):
            x, y, down = lines[i] - origin[0], lines[j] - origin[1], z[i, j] - origin[2]
            for c in range(3):
                crossings[i, j, c] = R_WC[0, c] * x + R_WC[1, c] * y + R_WC[2, c] * down
            depth = crossings[i, j, 2]
            before = depth > 1e-6
            crossings[i, j, 3] = row[3] + row[1] * crossings[i, j, 0] / depth if before else np.nan
            crossings[i, j, 4] = row[4] + row[2] * crossings[i, j, 1] / depth if before else np.nan
    for bi in range(boxes.shape[0]):
        for bj in range(boxes.shape[1]):
            u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
            hidden, count = 0, 0
            for i in range(bi * BLOCK, min((bi + 1) * BLOCK, n - 1) + 1):
                for j in range(bj * BLOCK, min((bj + 1) * BLOCK, n - 1) + 1):
                    u, v = crossings[i, j, 3], crossings[i, j, 4]
                    count += 1
                    if not math.isnan(u):
                        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
                    else:
                        hidden += 1
            if 0 < hidden < count:
                u0, u1, v0, v1 = -np.inf, np.inf, -np.inf, np.inf
            boxes[bi, bj, 0], boxes[bi, bj, 1], boxes[bi, bj, 2], boxes[bi, bj, 3] = u0, u1, v0, v1


@njit(nogil=True)
def _beside(crossings: Any, i: int, j: int, left: float, right: float, up: float, down: float) -> bool:
    """Whether a cell's crossings are all beyond one side of the pyramid between four slopes."""
    beyond_left = beyond_right = beyond_up = beyond_down = True
    for k in range(4):
        p = crossings[i + (k & 1), j + (k >> 1)]
        beyond_left &= p[0] < left * p[2]
        beyond_right &= p[0] > right * p[2]
        beyond_up &= p[1] < up * p[2]
        beyond_down &= p[1] > down * p[2]
    return bool(beyond_left or beyond_right or beyond_up or beyond_down)


@njit(nogil=True)
def _draw_triangle(
    crossings: Any, ai: int, aj: int, bi: int, bj: int, ci: int, cj: int, name: int, x0: int, x1: int, y0: int, y1: int,
    first: int, row: Any, nearness: Any, names: Any,
) -> None:  # fmt: skip
    """Draw a triangle, whose corners turn clockwise in the image, into pixels x0..x1-1 and rows y0..y1-1.

    A ray d meets it if d . (a x b), d . (b x c) and d . (c x a) are all positive; their sum over a . (b x c) is 1 over
    the depth.
    """
    ax, ay, az = crossings[ai, aj, 0], crossings[ai, aj, 1], crossings[ai, aj, 2]
    bx, by, bz = crossings[bi, bj, 0], crossings[bi, bj, 1], crossings[bi, bj, 2]
    cx, cy, cz = crossings[ci, cj, 0], crossings[ci, cj, 1], crossings[ci, cj, 2]
    px, py, pz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    qx, qy, qz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    rx, ry, rz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    volume = ax * qx + ay * qy + az * qz
    if volume <= 0.0:
        return
    per_volume = 1.0 / volume
    step = 1.0 / row[1]
    for y in range(y0, y1):
        sy = (y + 0.5 - row[4]) / row[2]
        p0, q0, r0 = py * sy + pz, qy * sy + qz, ry * sy + rz
        into = y - first
        for x in range(x0, x1):
            sx = (x + 0.5 - row[3]) * step
            p, q, r = px * sx + p0, qx * sx + q0, rx * sx + r0
            if p >= 0.0 and q >= 0.0 and r >= 0.0:
                near = (p + q + r) * per_volume
                if near > nearness[into, x]:
                    nearness[into, x] = near
                    names[into, x] = name


@njit(nogil=True)
def _draw_cells(
    crossings: Any, boxes: Any, row: Any, width: int, first: int, last: int, nearness: Any, names: Any
) -> None:
    """Draw all cells of the bed into rows first..last-1.

    Names hold i in the upper 16 bits, j in the next 15, and 1 for the half at higher x.
    """
    n = crossings.shape[0]
    left, right = (0.5 - row[3]) / row[1], (width - 0.5 - row[3]) / row[1]
    up, down = (first + 0.5 - row[4]) / row[2], (last - 0.5 - row[4]) / row[2]
    for block_i in range(boxes.shape[0]):
        for block_j in range(boxes.shape[1]):
            box = boxes[block_i, block_j]
            if not (box[0] < width and box[1] > 0.0 and box[2] < last and box[3] > first):
                continue
            for i in range(block_i * BLOCK, min((block_i + 1) * BLOCK, n - 1)):
                for j in range(block_j * BLOCK, min((block_j + 1) * BLOCK, n - 1)):
                    u0, u1, v0, v1 = np.inf, -np.inf, np.inf, -np.inf
                    whole = True
                    for k in range(4):
                        u, v = crossings[i + (k & 1), j + (k >> 1), 3], crossings[i + (k & 1), j + (k >> 1), 4]
                        whole &= not math.isnan(u)
                        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
                    x0, x1, y0, y1 = 0, width, first, last
                    if whole:
                        if u1 < 0.5 or u0 > width - 0.5 or v1 < first + 0.5 or v0 > last - 0.5:
                            continue
                        # Slightly wider than the pixels whose centres can be inside.
                        x0, x1 = max(0, int(max(u0 - 0.501, 0.0))), int(min(u1 + 0.501, float(width)))
                        y0, y1 = max(first, int(max(v0 - 0.501, 0.0))), int(min(v1 + 0.501, float(last)))
                    elif _beside(crossings, i, j, left, right, up, down):
                        continue
                    name = i << 16 | j << 1
                    _draw_triangle(
                        crossings, i, j, i + 1, j, i + 1, j + 1, name + 1, x0, x1, y0, y1, first, row, nearness, names
                    )
                    _draw_triangle(
                        crossings, i, j, i + 1, j + 1, i, j + 1, name, x0, x1, y0, y1, first, row, nearness, names
                    )


@njit(nogil=True)
def draw_bed(
    first: int, last: int, row: Any, R_WC: Any, origin: Any, bed: Any, crossings: Any, boxes: Any, attributes: Any,
    maps: Any, power: float, lamps: Any, kind: Any, depth_m: Any, radiance: Any, lamp_radiance: Any, bed_kind: int,
) -> None:  # fmt: skip
    """Write rows first..last-1 of an image of the bed alone: kind, depth, radiance, and the lamps' part of it.

    `attributes` (n * n, 4) of the crossings: normal and irradiance from above; images are (h, w) and (h, w, 3). Where
    the bed is not seen they keep what they have.
    """
    lines, per_cell, cell_at, z, tops = bed.lines_m, bed.per_cell, bed.cell_at, bed.z_m, bed.tops_m
    per_bin, top, bottom = 1.0 / bed.bin_m, bed.range_m[0], bed.range_m[1]
    n, width = lines.shape[0], depth_m.shape[1]
    ax, ay, az = R_WC[0, 2], R_WC[1, 2], R_WC[2, 2]
    names = np.full((last - first, width), -1, np.int32)
    nearness = np.zeros((last - first, width))
    if row[0] == IDEAL:
        _draw_cells(crossings, boxes, row, width, first, last, nearness, names)
    # In three steps over short runs of pixels: short loops without branches keep the processor's pipelines full.
    runs = np.empty((14, RUN))
    ideal, per_focal = row[0] == IDEAL, 1.0 / row[1]
    corners = np.empty(RUN, np.int64)
    for y in range(first, last):
        for x_first in range(0, width, RUN):
            count, met = min(RUN, width - x_first), 0
            for k in range(count):
                x = x_first + k
                sx, sy, z0 = (x + 0.5 - row[3]) * per_focal, (y + 0.5 - row[4]) * per_focal, 0.0
                spread = per_focal
                if not ideal:
                    sx, sy, z0 = ray_at(row, x + 0.5, y + 0.5)
                    spread = spread_at(row, x + 0.5, y + 0.5, sx, sy)
                wx = R_WC[0, 0] * sx + R_WC[0, 1] * sy + ax
                wy = R_WC[1, 0] * sx + R_WC[1, 1] * sy + ay
                wz = R_WC[2, 0] * sx + R_WC[2, 1] * sy + az
                ox, oy, oz = origin[0] + z0 * ax, origin[1] + z0 * ay, origin[2] + z0 * az
                name = names[y - first, x]
                if name >= 0:
                    t = 1.0 / nearness[y - first, x]
                    i, j = name >> 16, (name >> 1) & 0x7FFF
                    u, v = (ox + t * wx - lines[i]) * per_cell[i], (oy + t * wy - lines[j]) * per_cell[j]
                    if name & 1:
                        u = max(u, v)
                    else:
                        v = max(u, v)
                else:
                    t, i, j, u, v = np.inf, 0, 0, 0.0, 0.0
                    # Upward from above the highest crest there is only water.
                    if wz > 0.0 or oz >= top:
                        t, i, j, u, v = meet(
                            lines, per_cell, cell_at, z, tops, per_bin, top, bottom, ox, oy, oz, wx, wy, wz, FAR_M
                        )
                met += 1 if t < FAR_M else 0
                runs[0, k], runs[1, k], runs[2, k] = ox + t * wx, oy + t * wy, oz + t * wz
                runs[3, k], runs[4, k], runs[5, k] = wx, wy, wz
                runs[6, k], runs[7, k], runs[8, k], runs[9, k] = t, z0, u, v
                runs[10, k] = spread
                corners[k] = i * n + j
            if met == 0:
                continue
            for k in range(count):
                nx, ny, nz, day = _between(attributes, n, corners[k], runs[8, k], runs[9, k])
                wx, wy, wz, t = runs[3, k], runs[4, k], runs[5, k], runs[6, k]
                scale = 1.0 / (math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12)
                facing = abs(nx * wx + ny * wy + nz * wz) * scale / math.sqrt(wx * wx + wy * wy + wz * wz)
                runs[11, k] = t * runs[10, k] / math.sqrt(max(facing, 0.02))
                runs[12, k] = day
                runs[13, k] = lamps_on(
                    runs[0, k], runs[1, k], runs[2, k], scale * nx, scale * ny, scale * nz, ax, ay, az, power, lamps
                )
            for k in range(count):
                x = x_first + k
                if not runs[6, k] < FAR_M:
                    continue
                red, green, blue = baked_albedo(maps, BED_TEXEL_M, runs[0, k], runs[1, k], runs[11, k])
                night = runs[13, k]
                both = runs[12, k] + night
                kind[y, x] = bed_kind
                depth_m[y, x] = runs[6, k] + runs[7, k]
                radiance[y, x, 0], radiance[y, x, 1], radiance[y, x, 2] = red * both, green * both, blue * both
                lamp_radiance[y, x, 0] = red * night
                lamp_radiance[y, x, 1] = green * night
                lamp_radiance[y, x, 2] = blue * night


@njit(nogil=True)
def _between(attributes: Any, n: int, corner: int, u: float, v: float) -> tuple[float, float, float, float]:
    """Attributes at the place (u, v) of the cell whose least corner is `corner`."""
    a = np.uint64(corner)
    c = a + np.uint64(n + 1)
    # The third corner is at higher x or at higher y.
    b = a + np.uint64(n if u >= v else 1)
    wa, wb, wc = 1.0 - max(u, v), abs(u - v), min(u, v)
    return (
        wa * attributes[a, 0] + wb * attributes[b, 0] + wc * attributes[c, 0],
        wa * attributes[a, 1] + wb * attributes[b, 1] + wc * attributes[c, 1],
        wa * attributes[a, 2] + wb * attributes[b, 2] + wc * attributes[c, 2],
        wa * attributes[a, 3] + wb * attributes[b, 3] + wc * attributes[c, 3],
    )


@njit(nogil=True)
def bed_colour(
    x: float, y: float, z: float, wx: float, wy: float, wz: float, footprint: float, n: int, i: int, j: int, u: float,
    v: float, attributes: Any, maps: Any, ax: float, ay: float, az: float, power: float, lamps: Any,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Albedo (r, g, b), irradiance from above, and from the lamps, at a place (u, v) of the bed's cell (i, j)."""
    nx, ny, nz, day = _between(attributes, n, i * n + j, u, v)
    scale = 1.0 / (math.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12)
    facing = (nx * wx + ny * wy + nz * wz) * scale / math.sqrt(wx * wx + wy * wy + wz * wz)
    # A slanting footprint is long and narrow: filter to its geometric mean.
    red, green, blue = baked_albedo(maps, BED_TEXEL_M, x, y, footprint / math.sqrt(max(abs(facing), 0.02)))
    night = lamps_on(x, y, z, scale * nx, scale * ny, scale * nz, ax, ay, az, power, lamps)
    return red, green, blue, day, night

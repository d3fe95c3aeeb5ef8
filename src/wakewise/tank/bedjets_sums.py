"""Compiled sums over the rings of wall jets, and their images in walls; the formulas are told in `bedjets`.

Columns of a packed ring: centre (0, 1), R, A, heading (4, 5), kappa, weight 1/I0(kappa), squares of the least and
greatest distance and the greatest height at which it is felt (8 to 10), least thickness, one over the distance to the
opposite face, and the logarithm of the weight. Points are taken in blocks; of each block the rings that cannot reach it
are left out, and the rest are summed in single precision at all of its points side by side.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from wakewise.arrays import Array, IntArray

WALL_JET_SPREAD = 0.093  # delta over R for which the layer below, entrainment included, is half as fast at 0.09 R
LOG_WIDTH = 0.3  # L: neighbouring rings overlap; it sets how sharp a front is, not how fast
REACH = 3.3 * LOG_WIDTH  # beyond it g is below 5e-3
HIGHEST = 4.0  # radii above the bed: what a ring moves there is below 0.2 % of its crest
_BLOCK = 32  # points that are summed side by side; neighbours in space should be neighbours in the list
_SINGLE = np.float32
_EXPONENT = (_SINGLE(1 / 64), _SINGLE(1 / 2), _SINGLE(1 / 6), _SINGLE(1 / 24))
# erf x = 1 - k (..) exp(-x^2), k = 1 / (1 + 0.3275911 x), to 2e-7: Abramowitz and Stegun 1964, 7.1.26.
_ERF = tuple(_SINGLE(c) for c in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429))
_ERF_SCALE = _SINGLE(0.3275911 / math.sqrt(2))
_ATANH = (_SINGLE(1 / 3), _SINGLE(1 / 5), _SINGLE(1 / 7), _SINGLE(1 / 9))
_LEAST_EXPONENT = _SINGLE(-15.0)
_ZERO, _ONE, _TWO, _HALF, _QUARTER = _SINGLE(0.0), _SINGLE(1.0), _SINGLE(2.0), _SINGLE(0.5), _SINGLE(0.25)
_PER_L2, _PER_SPREAD = _SINGLE(LOG_WIDTH**-2), _SINGLE(1 / WALL_JET_SPREAD)
_THICK, _TINY = _SINGLE(WALL_JET_SPREAD * math.sqrt(math.pi / 2)), _SINGLE(1e-12)
_Z_MIN, _Z_MAX, _H_MAX = _SINGLE(math.exp(-REACH)), _SINGLE(math.exp(REACH)), _SINGLE(HIGHEST)


@njit(inline="always")
def _exp(x: Any) -> Any:
    """e^x to 1e-6 for x from -5 to 1 and to 2e-3 of itself down to -20: the compiler works on several at once."""
    x = max(x, _LEAST_EXPONENT) * _EXPONENT[0]
    e = _ONE + x * (_ONE + x * (_EXPONENT[1] + x * (_EXPONENT[2] + x * _EXPONENT[3])))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def sum_planes(points: Array, planes: Array, starts: IntArray, rings: Array, kind: Array, out: Array) -> None:
    """Sum over rings of several planes; arguments as in `planes_velocity`, `kind` of the precision of the sums."""
    work = np.zeros((6, _BLOCK), kind.dtype)
    X, Y, H, U, V, W = work[0], work[1], work[2], work[3], work[4], work[5]
    flip = np.empty(_BLOCK)
    felt = np.empty(rings.shape[0], np.int64)
    for block in range(0, points.shape[0], _BLOCK):
        n = min(_BLOCK, points.shape[0] - block)
        for i in range(planes.shape[0]):
            o, a, b, c = planes[i, 0:3], planes[i, 3:6], planes[i, 6:9], planes[i, 9:12]
            low, high = np.full(3, 1e9), np.full(3, -1e9)
            for p in range(n):
                x, y, z = points[block + p, 0] - o[0], points[block + p, 1] - o[1], points[block + p, 2] - o[2]
                px, py = a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z
                height = planes[i, 12] - (c[0] * x + c[1] * y + c[2] * z)
                flip[p] = -1.0 if planes[i, 13] > 0.0 and height < 0.0 else 1.0
                height = max(flip[p] * height, 0.0)
                X[p], Y[p], H[p] = px, py, height
                low[0], high[0] = min(low[0], px), max(high[0], px)
                low[1], high[1] = min(low[1], py), max(high[1], py)
                low[2] = min(low[2], height)
            count = _felt(rings, starts[i], starts[i + 1], low, high, felt)
            if count == 0:
                continue
            U[:], V[:], W[:] = _ZERO, _ZERO, _ZERO
            for q in range(count):
                _add_ring(rings[felt[q]], X, Y, H, U, V, W)
            for p in range(n):
                u, v, up = U[p], V[p], W[p] * flip[p]
                out[block + p, 0] += u * a[0] + v * b[0] - up * c[0]
                out[block + p, 1] += u * a[1] + v * b[1] - up * c[1]
                out[block + p, 2] += u * a[2] + v * b[2] - up * c[2]


# Written into its caller, as every helper of a fast sum: a compiled copy of its own may differ in the last bit.
@njit(inline="always")
def _add_ring(ring: Array, X: Array, Y: Array, H: Array, U: Array, V: Array, W: Array) -> None:
    """Add one ring's velocity at a block of points, without branches, in single precision."""
    x, y, per_R, ends = _SINGLE(ring[0]), _SINGLE(ring[1]), _SINGLE(1.0 / ring[2]), _SINGLE(ring[12])
    ahead_x, ahead_y = _SINGLE(ring[4] * ring[6]), _SINGLE(ring[5] * ring[6])
    log_weight, least = _SINGLE(ring[13]), _SINGLE(ring[11] / WALL_JET_SPREAD)
    # In a sector R becomes R w^(1/4) and A becomes A w^(1/2), so that A/R^2 stays.
    strength = _SINGLE(ring[3] / (ring[2] * ring[2]))
    for p in range(_BLOCK):
        dx, dy = X[p] - x, Y[p] - y
        r = math.sqrt(dx * dx + dy * dy + _TINY)
        shrunk = _exp(-min(_QUARTER * (log_weight + (dx * ahead_x + dy * ahead_y) / r), _ONE))
        z, h = r * shrunk * per_R, H[p] * shrunk * per_R
        # ln z by its series in (z - 1) / (z + 1), good to 2e-5 in the ring's reach.
        inverse = _ONE / (z * z * (z + _ONE))
        f = (z - _ONE) * z * z * inverse
        f2 = f * f
        t = _TWO * f * (_ONE + f2 * (_ATANH[0] + f2 * (_ATANH[1] + f2 * (_ATANH[2] + f2 * _ATANH[3]))))
        R = r * z * (z + _ONE) * inverse
        # Thickness of the law over that of the layer.
        stretch = math.sqrt(_ONE + least * least * shrunk * shrunk * per_R * per_R)
        above = h * _PER_SPREAD / stretch
        slope = _exp(-_HALF * above * above)
        k = _ONE / (_ONE + _ERF_SCALE * above)
        poly = k * (_ERF[0] + k * (_ERF[1] + k * (_ERF[2] + k * (_ERF[3] + k * _ERF[4]))))
        thick = _THICK * stretch * (_ONE - poly * slope) if H[p] > _ZERO else _ZERO
        left = max(_ONE - H[p] * ends, _ZERO)
        g = strength * _exp(-_HALF * _PER_L2 * t * t - h) * (z + _ONE) * inverse / math.sqrt(stretch)
        g = g if z > _Z_MIN and z < _Z_MAX and h < _H_MAX else _ZERO
        radial = g * ((slope - thick) * left - thick * R * ends)
        U[p] += dx * radial
        V[p] += dy * radial
        W[p] += g * t * _PER_L2 * thick * R * left


@njit(cache=True, nogil=True, error_model="numpy")
def _felt(rings: Array, first: int, last: int, low: Array, high: Array, felt: IntArray) -> int:
    """List rings that reach a box, `low` to `high` in the plane and from `low[2]` up; what is left out is nothing."""
    x, y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    about = 0.5 * math.hypot(high[0] - low[0], high[1] - low[1]) + 1e-9
    height = max(low[2], 0.0)
    count = 0
    for j in range(first, last):
        dx, dy = x - rings[j, 0], y - rings[j, 1]
        r = math.sqrt(dx * dx + dy * dy)
        near, far = max(r - about, 0.0), r + about
        if near * near > rings[j, 9] or far * far < rings[j, 8] or height > rings[j, 10]:
            continue
        if rings[j, 6] > 0.0 and r > about:
            # The box is seen from the ring's centre within +- spread of the angle from its heading.
            angle = math.acos(min(max((dx * rings[j, 4] + dy * rings[j, 5]) / r, -1.0), 1.0))
            spread = math.asin(about / r) + 1e-6
            most = math.cos(max(angle - spread, 0.0))
            least = math.cos(min(angle + spread, math.pi))
            wide = rings[j, 2] * math.exp(0.25 * (rings[j, 13] + rings[j, 6] * most))
            narrow = rings[j, 2] * math.exp(0.25 * (rings[j, 13] + rings[j, 6] * least))
            reach = math.exp(REACH) * (1.0 + 1e-6)
            if near > reach * wide or far * reach < narrow or height > HIGHEST * wide * (1.0 + 1e-6):
                continue
        felt[count] = j
        count += 1
    return count


@njit(cache=True)
def with_images(packed: Array, walls: Array, least_m_s: float) -> Array:
    """Append images in one wall after another, so that corners hold too; rows as packed by `packed_rings`."""
    n = packed.shape[0]
    out = np.empty((n << walls.shape[0], packed.shape[1]))
    out[:n] = packed
    count = n
    for i in range(walls.shape[0]):
        axis, at, side = int(walls[i, 0]), walls[i, 1], walls[i, 2]
        for j in range(count):
            ahead = side * out[j, 4 + axis]
            # Of the half of all directions that lead to the wall, the one nearest to the heading gets most.
            w = out[j, 7] * math.exp(out[j, 6] * (1.0 if ahead >= 0.0 else math.sqrt(max(1.0 - ahead * ahead, 0.0))))
            radius = out[j, 2] * w**0.25
            r = max(side * (at - out[j, axis]), radius)
            t = math.log(r / radius) / LOG_WIDTH
            if out[j, 3] * math.sqrt(w) * math.exp(-0.5 * t * t) / r > least_m_s:
                out[count] = out[j]
                out[count, axis] = 2 * at - out[j, axis]
                out[count, 4 + axis] = -out[j, 4 + axis]
                count += 1
    return out[:count]

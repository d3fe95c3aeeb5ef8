"""Compiled velocity sums over the rings of wall jets (`bedjets`) and their images in walls.

Columns of a packed ring: centre (0, 1), R, A, heading (4, 5), kappa, weight 1/I0(kappa), squares of the least and
greatest distance and the greatest height of its influence (8 to 10), least thickness, one over the distance to the
opposite face, logarithm of the weight, logarithm of the greatest speed over the least that counts. Points are processed
in blocks; rings out of reach of a block are left out, the others are summed in single precision.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign_rows, njit

WALL_JET_SPREAD = 0.093  # delta over R for which the layer below, entrainment included, is half as fast at 0.09 R
LOG_WIDTH = 0.3  # L: neighbouring rings overlap; it sets how sharp a front is, not how fast
REACH = 3.3 * LOG_WIDTH  # beyond it g is below 5e-3
COLUMNS = 15
LEAST_M_S = 5e-5  # a ring that is felt less than this at a block of points is left out there
HIGHEST = 4.0  # radii above the bed: what a ring moves there is below 0.2 % of its crest
_BLOCK = 32  # points that are summed side by side; neighbours in space should be neighbours in the list
_GROUP = 512  # points, a whole number of blocks, for which rings out of reach are left out together
_SINGLE = np.float32
_EXPONENT = (_SINGLE(1 / 16), _SINGLE(1 / 2), _SINGLE(1 / 6), _SINGLE(1 / 24))
# erf x = 1 - k (..) exp(-x^2), k = 1 / (1 + 0.3275911 x), to 2e-7: Abramowitz and Stegun 1964, 7.1.26.
_ERF = tuple(_SINGLE(c) for c in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429))
_ERF_SCALE = _SINGLE(0.3275911 / math.sqrt(2))
_ATANH = (_SINGLE(1 / 3), _SINGLE(1 / 5), _SINGLE(1 / 7), _SINGLE(1 / 9))
_LEAST_EXPONENT = _SINGLE(-15.0)
_ZERO, _ONE, _TWO, _HALF = _SINGLE(0.0), _SINGLE(1.0), _SINGLE(2.0), _SINGLE(0.5)
_PER_L2, _PER_SPREAD = _SINGLE(LOG_WIDTH**-2), _SINGLE(1 / WALL_JET_SPREAD)
_THICK, _TINY = _SINGLE(WALL_JET_SPREAD * math.sqrt(math.pi / 2)), _SINGLE(1e-12)
_REACH, _LOG_WIDTH = _SINGLE(REACH), _SINGLE(LOG_WIDTH)
_Z_MIN, _Z_MAX, _H_MAX = _SINGLE(math.exp(-REACH)), _SINGLE(math.exp(REACH)), _SINGLE(HIGHEST)


@njit(inline="always")
def _exp(x: Any) -> Any:
    """e^x to 4e-6 for x from -15 to 1, and to 1e-6 of itself from -1.5 on: the compiler works on several at once."""
    x = max(x, _LEAST_EXPONENT) * _EXPONENT[0]
    e = _ONE + x * (_ONE + x * (_EXPONENT[1] + x * (_EXPONENT[2] + x * _EXPONENT[3])))
    e = e * e
    e = e * e
    e = e * e
    return e * e


@njit(apart=True, nogil=True, fastmath=True)
def sum_planes(points: Array, planes: Array, starts: IntArray, rings: Array, kind: Array, out: Array) -> None:
    """Sum over rings of several planes; arguments as in `planes_velocity`, `kind` of the precision of the sums."""
    work = np.zeros((6, _BLOCK), kind.dtype)
    X, Y, H, U, V, W = work[0], work[1], work[2], work[3], work[4], work[5]
    flip, local = np.empty(_BLOCK), np.empty((3, _GROUP))
    PX, PY, PH = local[0], local[1], local[2]
    reaches, some = _reaches(rings), np.empty((10, rings.shape[0]), np.float32)
    near, seen = np.empty(rings.shape[0], np.int64), np.empty(rings.shape[0], np.float32)
    low, high = np.empty(3), np.empty(3)
    for group in range(0, points.shape[0], _GROUP):
        end = min(group + _GROUP, points.shape[0])
        for i in range(planes.shape[0]):
            first, many = starts[i], starts[i + 1] - starts[i]
            if many == 0:
                continue
            o, a, b, c = planes[i, 0:3], planes[i, 3:6], planes[i, 6:9], planes[i, 9:12]
            stretch = planes[i, 13] if planes[i, 13] > 0.0 else 1.0
            low[:], high[:] = 1e9, -1e9
            for p in range(group, end):
                x, y, z = points[p, 0] - o[0], points[p, 1] - o[1], points[p, 2] - o[2]
                px, py = a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z
                height = planes[i, 12] - (c[0] * x + c[1] * y + c[2] * z)
                PX[p - group], PY[p - group], PH[p - group] = px, py, height
                height = abs(height) / planes[i, 13] if planes[i, 13] > 0.0 else height
                low[0], high[0] = min(low[0], px), max(high[0], px)
                low[1], high[1] = min(low[1], py), max(high[1], py)
                low[2] = min(low[2], height)
            # The group must never leave out what one of its blocks feels, not even by rounding. A circle round a block
            # in a corner of the group's box reaches beyond the circle round the box, but never by half as much again.
            _feel(reaches, first, many, low, high, 1.42, 1e-4, seen)
            nears = 0
            for j in range(many):
                if seen[j] > _ZERO:
                    near[nears] = first + j
                    for k in range(10):
                        some[k, nears] = reaches[k, first + j]
                    nears += 1
            if nears == 0:
                continue
            for block in range(group, end, _BLOCK):
                n = min(_BLOCK, end - block)
                lanes = (n + 7) // 8 * 8  # the compiler works on eight at once
                low[:], high[:] = 1e9, -1e9
                for p in range(n):
                    px, py, height = PX[block - group + p], PY[block - group + p], PH[block - group + p]
                    flip[p] = -1.0 if planes[i, 13] > 0.0 and height < 0.0 else 1.0
                    height = max(flip[p] * height, 0.0) / stretch
                    X[p], Y[p], H[p] = px, py, height
                    low[0], high[0] = min(low[0], px), max(high[0], px)
                    low[1], high[1] = min(low[1], py), max(high[1], py)
                    low[2] = min(low[2], height)
                if _feel(some, 0, nears, low, high, 1.0, 1e-5, seen) == _ZERO:
                    continue
                U[:], V[:], W[:] = _ZERO, _ZERO, _ZERO
                on_plane = True
                for p in range(n):
                    on_plane &= H[p] == _ZERO
                for q in range(nears):
                    if seen[q] > _ZERO and on_plane:
                        _add_ring_on_plane(rings[near[q]], lanes, X, Y, U, V)
                    elif seen[q] > _ZERO:
                        _add_ring(rings[near[q]], lanes, X, Y, H, U, V, W)
                for p in range(n):
                    u, v, up = U[p], V[p], W[p] * flip[p] * stretch
                    out[block + p, 0] += u * a[0] + v * b[0] - up * c[0]
                    out[block + p, 1] += u * a[1] + v * b[1] - up * c[1]
                    out[block + p, 2] += u * a[2] + v * b[2] - up * c[2]


# Written into its caller, as every helper of a fast sum: a compiled copy of its own may differ in the last bit.
@njit(inline="always")
def _add_ring(ring: Array, lanes: int, X: Array, Y: Array, H: Array, U: Array, V: Array, W: Array) -> None:
    """Add one ring's velocity at a block of points, without branches, in single precision."""
    x, y, per_R, ends = _SINGLE(ring[0]), _SINGLE(ring[1]), _SINGLE(1.0 / ring[2]), _SINGLE(ring[12])
    ahead_x, ahead_y = _SINGLE(0.25 * ring[4] * ring[6]), _SINGLE(0.25 * ring[5] * ring[6])
    log_weight, least2 = _SINGLE(0.25 * ring[13]), _SINGLE((ring[11] / (WALL_JET_SPREAD * ring[2])) ** 2)
    # In a sector R becomes R w^(1/4) and A becomes A w^(1/2), so that A/R^2 stays.
    strength = _SINGLE(ring[3] / (ring[2] * ring[2]))
    if ring[11] == 0.0:
        for p in range(lanes):
            dx, dy = X[p] - x, Y[p] - y
            r2 = dx * dx + dy * dy + _TINY
            per_r = _ONE / math.sqrt(r2)
            r = r2 * per_r
            shrunk = _exp(-min(log_weight + (dx * ahead_x + dy * ahead_y) * per_r, _ONE)) * per_R
            z, h = r * shrunk, H[p] * shrunk
            inverse = _ONE / (z * z * (z + _ONE))
            t = _log((z - _ONE) * z * z * inverse)
            above = h * _PER_SPREAD
            slope = _exp(-_HALF * above * above)
            thick = _THICK * (_ONE - _erf_rest(above) * slope) if H[p] > _ZERO else _ZERO
            left = max(_ONE - H[p] * ends, _ZERO)
            g = strength * _exp(-_HALF * _PER_L2 * t * t - h) * (z + _ONE) * inverse
            g = g if z > _Z_MIN and z < _Z_MAX and h < _H_MAX else _ZERO
            R = r * z * (z + _ONE) * inverse
            radial = g * ((slope - thick) * left - thick * R * ends)
            U[p] += dx * radial
            V[p] += dy * radial
            W[p] += g * t * _PER_L2 * thick * R * left
        return
    for p in range(lanes):
        dx, dy = X[p] - x, Y[p] - y
        r2 = dx * dx + dy * dy + _TINY
        per_r = _ONE / math.sqrt(r2)
        r = r2 * per_r
        shrunk = _exp(-min(log_weight + (dx * ahead_x + dy * ahead_y) * per_r, _ONE))
        z, h = r * shrunk * per_R, H[p] * shrunk * per_R
        inverse = _ONE / (z * z * (z + _ONE))
        t = _log((z - _ONE) * z * z * inverse)
        # Thickness of the layer over that of the law.
        stretch = math.sqrt(_ONE + least2 * shrunk * shrunk)
        above = h * _PER_SPREAD / stretch
        slope = _exp(-_HALF * above * above)
        thick = _THICK * stretch * (_ONE - _erf_rest(above) * slope) if H[p] > _ZERO else _ZERO
        g = strength * _exp(-_HALF * _PER_L2 * t * t - h) * (z + _ONE) * inverse / stretch
        g = g if z > _Z_MIN and z < _Z_MAX and h < _H_MAX else _ZERO
        radial = g * (slope - thick)
        U[p] += dx * radial
        V[p] += dy * radial
        W[p] += g * t * _PER_L2 * thick * r * z * (z + _ONE) * inverse


@njit(inline="always")
def _add_ring_on_plane(ring: Array, lanes: int, X: Array, Y: Array, U: Array, V: Array) -> None:
    """`_add_ring` for points on the plane itself, where the water only runs along it."""
    x, y, per_R = _SINGLE(ring[0]), _SINGLE(ring[1]), _SINGLE(1.0 / ring[2])
    ahead_x, ahead_y = _SINGLE(0.25 * ring[4] * ring[6]), _SINGLE(0.25 * ring[5] * ring[6])
    log_weight, least2 = _SINGLE(0.25 * ring[13]), _SINGLE((ring[11] / (WALL_JET_SPREAD * ring[2])) ** 2)
    strength = _SINGLE(ring[3] / (ring[2] * ring[2]))
    for p in range(lanes):
        dx, dy = X[p] - x, Y[p] - y
        r2 = dx * dx + dy * dy + _TINY
        per_r = _ONE / math.sqrt(r2)
        shrunk = _exp(-min(log_weight + (dx * ahead_x + dy * ahead_y) * per_r, _ONE))
        z = r2 * per_r * shrunk * per_R
        inverse = _ONE / (z * z * (z + _ONE))
        t = _log((z - _ONE) * z * z * inverse)
        slower = _ONE / math.sqrt(_ONE + least2 * shrunk * shrunk)
        g = strength * slower * _exp(-_HALF * _PER_L2 * t * t) * (z + _ONE) * inverse
        g = g if z > _Z_MIN and z < _Z_MAX else _ZERO
        U[p] += dx * g
        V[p] += dy * g


@njit(inline="always")
def _log(f: Any) -> Any:
    """Logarithm of z from f = (z - 1) / (z + 1) by its series, good to 2e-5 in a ring's reach."""
    f2 = f * f
    return _TWO * f * (_ONE + f2 * (_ATANH[0] + f2 * (_ATANH[1] + f2 * (_ATANH[2] + f2 * _ATANH[3]))))


@njit(inline="always")
def _erf_rest(x: Any) -> Any:
    """(1 - erf(x / sqrt 2)) exp(x^2 / 2)."""
    k = _ONE / (_ONE + _ERF_SCALE * x)
    return k * (_ERF[0] + k * (_ERF[1] + k * (_ERF[2] + k * (_ERF[3] + k * _ERF[4]))))


@njit(inline="always")
def _reaches(rings: Array) -> np.ndarray:
    """Constants of each ring for `_feel`, shape (10, n): one row for each quantity, for vector instructions."""
    out = np.empty((10, rings.shape[0]), np.float32)
    for j in range(rings.shape[0]):
        kappa = 0.25 * rings[j, 6]
        out[0, j], out[1, j], out[2, j], out[3, j] = rings[j, 0], rings[j, 1], rings[j, 4], rings[j, 5]
        out[4, j], out[5, j], out[6, j] = kappa, math.log(rings[j, 2]) + 0.25 * rings[j, 13], rings[j, 14]
        out[7, j], out[8, j], out[9, j] = rings[j, 8], rings[j, 9], rings[j, 10]
    return out


@njit(inline="always")
def _feel(
    reaches: np.ndarray,
    first: int,
    many: int,
    low: Array,
    high: Array,
    wider: float,
    margin_m: float,
    seen: np.ndarray,
) -> Any:
    """Mark those of `many` rings, from `first` on, that reach a box at a speed that matters, and count them.

    The box goes from `low` to `high` in the plane and from `low[2]` up, taken as the circle round it, made `wider`,
    with a margin: 1e-5 m is more than single precision loses.
    """
    x, y = _SINGLE(0.5 * (low[0] + high[0])), _SINGLE(0.5 * (low[1] + high[1]))
    about = _SINGLE(0.5 * wider * math.sqrt((high[0] - low[0]) ** 2 + (high[1] - low[1]) ** 2) + margin_m)
    height = _SINGLE(max(low[2] - margin_m, 0.0))
    least_left = -_SINGLE(10.0 * margin_m)
    RX, RY, HX, HY, KAPPA = reaches[0], reaches[1], reaches[2], reaches[3], reaches[4]
    LOG_R, LEFT, INNER2, OUTER2, TOP = reaches[5], reaches[6], reaches[7], reaches[8], reaches[9]
    count = _ZERO
    for q in range(many):
        j = first + q
        dx, dy, kappa = x - RX[j], y - RY[j], KAPPA[j]
        r = math.sqrt(dx * dx + dy * dy)
        near, far = max(r - about, _ZERO), r + about
        # The box is seen from the ring's centre within an angle of its middle, whose sine is s.
        away: Any = max(r, about)
        per_r = _ONE / away
        s = about * per_r
        c = math.sqrt(_ONE - s * s)
        cosine = (dx * HX[j] + dy * HY[j]) * per_r
        sine = math.sqrt(max(_ONE - cosine * cosine, _ZERO))
        most = _ONE if cosine >= c else cosine * c + sine * s
        least = -_ONE if cosine <= -c else cosine * c - sine * s
        most, least = (_ONE, -_ONE) if r <= about else (most, least)
        wide = _exp(LOG_R[j] + kappa * most)
        left = LEFT[j] - kappa * (_ONE - most) - height / wide - least_left
        reach = _exp(min(_REACH, _LOG_WIDTH * math.sqrt(max(_TWO * left, _ZERO))))
        narrow = wide * _exp(-min(kappa * (most - least), _SINGLE(15.0)))
        # The least of what each condition has left: all hold if it is not negative.
        spare = min(left, _H_MAX * wide - height, reach * wide - near, far * reach - narrow)
        spare = min(spare, OUTER2[j] - near * near, far * far - INNER2[j], TOP[j] - height)
        felt = _ONE if spare >= _ZERO else _ZERO
        seen[q] = felt
        count += felt
    return count


@njit(apart=True)
def finish_rows(rows: Array) -> None:
    """Fill in the columns of packed rings that follow from centre, R, A, heading, kappa, thickness and height."""
    for j in range(rows.shape[0]):
        R, kappa = rows[j, 2], rows[j, 6]
        log_weight = -log_i0(kappa)
        widest, narrowest = 0.25 * (log_weight + kappa), 0.25 * (log_weight - kappa)
        speed = rows[j, 3] / R * math.exp(widest)
        left = max(math.log(max(speed, 1e-30) / LEAST_M_S), 0.0)
        reach = min(REACH, LOG_WIDTH * math.sqrt(2.0 * left))
        rows[j, 7], rows[j, 13], rows[j, 14] = math.exp(log_weight), log_weight, left
        # Where a ring can be felt at all, whatever the azimuth: w lies between exp(-kappa)/I0 and exp(kappa)/I0.
        rows[j, 8], rows[j, 9] = (R * math.exp(narrowest - reach)) ** 2, (R * math.exp(widest + reach)) ** 2
        rows[j, 10] = min(HIGHEST, left) * R * math.exp(widest)


@njit
def log_i0(x: float) -> float:
    """Logarithm of the modified Bessel function I0, to 2e-7: Abramowitz and Stegun 1964, 9.8.1 and 9.8.2."""
    if x < 3.75:
        t = (x / 3.75) ** 2
        s = 3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813)))
        return math.log(1.0 + t * (3.5156229 + t * s))
    t = 3.75 / x
    s = -0.02057706 + t * (0.02635537 + t * (-0.01647633 + t * 0.00392377))
    s = 0.39894228 + t * (0.01328592 + t * (0.00225319 + t * (-0.00157565 + t * (0.00916281 + t * s))))
    return x + math.log(s / math.sqrt(x))


@njit(apart=True)
def leaning(lean: Array) -> tuple[Array, Array]:
    """Heading, shape (n, 2), and concentration kappa, shape (n,), of mean direction vectors, shape (n, 2).

    kappa after Best and Fisher 1981 (doi 10.1080/03610918108812225), good to about 1 %; lengths are cut at 0.98.
    """
    heading, kappa = np.empty((lean.shape[0], 2)), np.empty(lean.shape[0])
    for j in range(lean.shape[0]):
        length = math.sqrt(lean[j, 0] ** 2 + lean[j, 1] ** 2)
        heading[j, 0], heading[j, 1] = (lean[j, 0] / length, lean[j, 1] / length) if length > 0.0 else (1.0, 0.0)
        h = min(length, 0.98)
        if h < 0.53:
            kappa[j] = 2 * h + h**3 + 5 * h**5 / 6
        elif h < 0.85:
            kappa[j] = -0.4 + 1.39 * h + 0.43 / (1 - h)
        else:
            kappa[j] = 1 / (h**3 - 4 * h**2 + 3 * h)
    return heading, kappa


@njit
def log_i0s(x: Array) -> Array:
    """`log_i0` of each, shape (n,)."""
    out = np.empty(x.shape[0])
    for j in range(x.shape[0]):
        out[j] = log_i0(x[j])
    return out


@njit
def log_overlap(
    heading_a: Array, kappa_a: float, bessel_a: float, heading_b: Array, kappa_b: float, bessel_b: float
) -> float:
    """Logarithm of what two leaning rings share of their directions: of the integral of sqrt(w_a w_b) / (2 pi).

    0 for like ones; `bessel_a` and `bessel_b` are `log_i0` of their kappa.
    """
    x = kappa_a * heading_a[0] + kappa_b * heading_b[0]
    y = kappa_a * heading_a[1] + kappa_b * heading_b[1]
    return log_i0(0.5 * math.sqrt(x * x + y * y)) - 0.5 * (bessel_a + bessel_b)


@njit(apart=True)
def with_images(packed: Array, walls: Array, least_m_s: float) -> Array:
    """Append images in one wall after another, so that corners hold too; rows as packed by `packed_rings`."""
    n = packed.shape[0]
    out = np.empty((n << walls.shape[0], packed.shape[1]))
    assign_rows(out[:n], packed)
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

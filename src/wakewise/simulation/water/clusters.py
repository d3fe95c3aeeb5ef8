"""Treecode for the velocity of many impulses: near impulses one by one, far clusters by their dipole moment.

Impulses of similar size in one cell of a coarse grid form a cluster. Far away it is one dipole at their weighted
centre (exact to first order in its size over the distance for parallel impulses, as in a jet). A cluster is far from a
group or block of points beyond `_OPENING` of its radii and `_DIPOLE` sigma of its largest impulse (a Gaussian impulse
is a dipole to 1e-3 there). Beyond `_SERIES` radii of the group or block the velocity of dipoles is a local expansion of
second order, free of divergence and curl. The result depends on the points only, not on the number of threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.induction import FEW_POINTS, SINGLE, impulse_velocity, over_points, sorted_keys

_CELL_M = 0.35
_SMALL_M = 0.07  # sigmas below this and above it are never in one cluster
_OPENING = 2.5
_DIPOLE = 4.2
_SERIES = 2.4
_BLOCK = 32
_GROUP = 256
_FEW_SOURCES = 150  # and
_KEYS = 65536  # of two bytes
_COLUMNS = 12
_SINGLE = np.float32
_ONE, _THREE, _FIVE, _SEVEN = _SINGLE(1.0), _SINGLE(3.0), _SINGLE(5.0), _SINGLE(7.0)
_ZERO, _HALF, _PER_4_PI = _SINGLE(0.0), _SINGLE(0.5), _SINGLE(1 / (4 * math.pi))


@dataclass(frozen=True, eq=False)
class ImpulseField:
    """Impulses at one instant, sorted by cluster."""

    # positions_m, impulses_m4_s: shape (k, 3)
    positions_m: Array
    impulses_m4_s: Array
    sigmas_m: Array  # shape (k,)
    # Shape (k + c, 12): as the kernel takes them, impulses by cluster and then the clusters: position, impulse over
    # sigma cubed, one over sigma, impulse, the distance beyond which it is a dipole, and nothing.
    rows: np.ndarray
    # Shape (c + 1,): cluster i has the impulses from starts[i] to starts[i + 1]. Of few impulses there are no clusters.
    starts: IntArray

    @classmethod
    def of(cls, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array) -> ImpulseField:
        """Sort impulses into clusters."""
        return cls(positions_m, impulses_m4_s, sigmas_m, *clustered(positions_m, impulses_m4_s, sigmas_m))

    @property
    def clusters(self) -> int:
        """How many there are."""
        return len(self.starts) - 1

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s, shape (n, 3), at points, shape (n, 3), best in the order of `in_space`."""
        if self.clusters == 0 or len(points_W_m) < FEW_POINTS:
            return impulse_velocity(points_W_m, self.positions_m, self.impulses_m4_s, self.sigmas_m)
        out = np.zeros((len(points_W_m), 3))
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        over_points(self.write, points, out, self.pairs(len(points)))
        return out

    def pairs(self, points: int) -> int:
        """How many pairs of point and impulse take as long as a sum at so many points."""
        return points * len(self.sigmas_m) // 4

    def write(self, points_W_m: Array, out: Array) -> None:
        """Write the velocity at points into `out`, both shape (n, 3), on this thread."""
        sum_field(points_W_m, self.rows, self.starts, SINGLE, out)


@njit(apart=True, nogil=True)
def clustered(X: Array, m: Array, sigma: Array) -> tuple[np.ndarray, IntArray]:
    """Rows of an `ImpulseField`, and where each cluster starts."""
    n = sigma.shape[0]
    few = n < _FEW_SOURCES
    key = np.zeros(n, np.uint16)
    if not few:
        _cells(X, sigma, key)
    order = np.arange(n) if few else sorted_keys(key)
    starts = np.zeros(n + 1, np.int64)
    count = 0
    for i in range(n):
        if not few and (i == 0 or key[order[i]] != key[order[i - 1]]):
            starts[count] = i
            count += 1
    starts[count] = n if count else 0
    rows = np.zeros((n + count, _COLUMNS), np.float32)
    for i in range(n):
        j = order[i]
        inverse = 1.0 / sigma[j]
        cubed = inverse * inverse * inverse
        for k in range(3):
            rows[i, k], rows[i, 3 + k], rows[i, 7 + k] = X[j, k], m[j, k] * cubed, m[j, k]
        rows[i, 6], rows[i, 10] = inverse, _DIPOLE * sigma[j]
    middle, whole = np.empty(3), np.empty(3)
    for c in range(count):
        total, widest, reach2 = 1e-30, 0.0, 0.0
        middle[:], whole[:] = 0.0, 0.0
        for i in range(starts[c], starts[c + 1]):
            j = order[i]
            size = math.sqrt(m[j, 0] ** 2 + m[j, 1] ** 2 + m[j, 2] ** 2) + 1e-30
            total += size
            widest = max(widest, sigma[j])
            for k in range(3):
                middle[k] += size * X[j, k]
                whole[k] += m[j, k]
        for k in range(3):
            middle[k] /= total
            rows[n + c, k], rows[n + c, 7 + k] = middle[k], whole[k]
        for i in range(starts[c], starts[c + 1]):
            away2 = 0.0
            for k in range(3):
                away2 += (X[order[i], k] - middle[k]) ** 2
            reach2 = max(reach2, away2)
        reach = math.sqrt(reach2)
        rows[n + c, 10] = max(_OPENING * reach, reach + _DIPOLE * widest)
    return rows, starts[: count + 1].copy()


@njit(apart=True, nogil=True)
def _cells(X: Array, sigma: Array, key: np.ndarray) -> None:
    """Which cell each impulse is in; cells grow where there would be more than keys."""
    low, high = X[0].copy(), X[0].copy()
    for j in range(X.shape[0]):
        for k in range(3):
            low[k], high[k] = min(low[k], X[j, k]), max(high[k], X[j, k])
    cell = _CELL_M
    while True:
        n0, n1 = int((high[0] - low[0]) / cell) + 1, int((high[1] - low[1]) / cell) + 1
        n2 = int((high[2] - low[2]) / cell) + 1
        if 2.0 * n0 * n1 * n2 <= _KEYS:
            break
        cell *= 1.25
    for j in range(X.shape[0]):
        at = int((X[j, 0] - low[0]) / cell) * n1 + int((X[j, 1] - low[1]) / cell)
        at = at * n2 + int((X[j, 2] - low[2]) / cell)
        key[j] = 2 * at + (1 if sigma[j] > _SMALL_M else 0)


@njit(apart=True, nogil=True, fastmath=True)
def sum_field(points: Array, rows: np.ndarray, starts: IntArray, K: np.ndarray, out: Array) -> None:
    """Write the velocity of clustered impulses at points, shape (n, 3), into `out`; of few, one by one."""
    many = starts.shape[0] - 1
    impulses = rows.shape[0] - many
    lanes, wide, narrow = np.zeros((6, _BLOCK), np.float32), np.empty(16, np.float32), np.empty(16, np.float32)
    left, near = np.empty(many + 1, np.int64), np.arange(impulses + 1)
    far, farther = np.empty(rows.shape[0] + 1, np.int64), np.empty(rows.shape[0] + 1, np.int64)
    beside = np.empty((6, rows.shape[0]), np.float32)
    # Of few, or at few points, each is summed at each.
    plain = many == 0 or points.shape[0] < FEW_POINTS
    middle, centre = np.empty(3, np.float32), np.empty(3, np.float32)
    for group in range(0, points.shape[0], _GROUP):
        end = min(group + _GROUP, points.shape[0])
        about = _ball(points, group, end, middle)
        series2 = (_SINGLE(_SERIES) * about) ** 2
        farthers = lefts = 0
        # Both lists are written to, whichever it is: quicker than a branch that cannot be foreseen.
        for i in range(0 if plain else many):
            j = impulses + i
            away2 = _away2(rows, j, middle)
            gone = away2 > series2 and away2 > (rows[j, 10] + about) ** 2
            farther[farthers], left[lefts] = j, i
            farthers, lefts = farthers + (1 if gone else 0), lefts + (0 if gone else 1)
        _series(rows, farther, farthers, middle, beside, wide)
        for block in range(group, end, _BLOCK):
            n = min(_BLOCK, end - block)
            about = _ball(points, block, block + n, centre)
            if plain:
                middle[:], centre[:] = _ZERO, _ZERO  # then what a point gets depends on no other
            # Lengths are counted from the block's centre: single precision then loses nothing of nearby distances.
            for p in range(n):
                lanes[0, p], lanes[1, p] = points[block + p, 0] - centre[0], points[block + p, 1] - centre[1]
                lanes[2, p] = points[block + p, 2] - centre[2]
            lanes[3:] = _ZERO
            nears, fars, farthers = impulses if plain else 0, 0, 0
            series2 = (_SINGLE(_SERIES) * about) ** 2
            for q in range(lefts):
                j = impulses + left[q]
                away2 = _away2(rows, j, centre)
                if away2 > (rows[j, 10] + about) ** 2:
                    farther[farthers] = far[fars] = j
                    gone = away2 > series2
                    farthers, fars = farthers + (1 if gone else 0), fars + (0 if gone else 1)
                    continue
                for i in range(starts[left[q]], starts[left[q] + 1]):
                    away2 = _away2(rows, i, centre)
                    close, gone = away2 <= (rows[i, 10] + about) ** 2, away2 > series2
                    near[nears] = far[fars] = farther[farthers] = i
                    nears += 1 if close else 0
                    farthers += 1 if gone and not close else 0
                    fars += 0 if gone or close else 1
            _series(rows, farther, farthers, centre, beside, narrow)
            some = (n + 7) // 8 * 8  # the compiler works on eight at once
            X, Y, Z, U, V, W = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4], lanes[5]
            _add_impulses(some, X, Y, Z, rows, near, nears, centre, K, U, V, W)
            _add_dipoles(some, X, Y, Z, rows, far, fars, centre, U, V, W)
            x, y, z = centre[0] - middle[0], centre[1] - middle[1], centre[2] - middle[2]
            _add_series(some, X, Y, Z, narrow, _ZERO, _ZERO, _ZERO, U, V, W)
            _add_series(some, X, Y, Z, wide, x, y, z, U, V, W)
            for p in range(n):
                out[block + p, 0], out[block + p, 1], out[block + p, 2] = U[p], V[p], W[p]


@njit(inline="always")
def _away2(rows: np.ndarray, j: int, centre: np.ndarray) -> Any:
    dx, dy, dz = rows[j, 0] - centre[0], rows[j, 1] - centre[1], rows[j, 2] - centre[2]
    return dx * dx + dy * dy + dz * dz


@njit(inline="always")
def _ball(points: Array, first: int, end: int, centre: np.ndarray) -> Any:
    """Write the middle of the box round some points into `centre`; the radius of the ball round the box."""
    about = 0.0
    for k in range(3):
        low = high = points[first, k]
        for p in range(first, end):
            low, high = min(low, points[p, k]), max(high, points[p, k])
        centre[k] = 0.5 * (low + high)
        about += (0.5 * (high - low)) ** 2
    return _SINGLE(math.sqrt(about) * 1.000001 + 1e-6)


@njit(inline="always")
def _add_impulses(
    n: int,
    X: Array,
    Y: Array,
    Z: Array,
    rows: np.ndarray,
    near: IntArray,
    count: int,
    centre: np.ndarray,
    K: np.ndarray,
    U: Array,
    V: Array,
    W: Array,
) -> None:
    """As `induction.impulse_sums`, for one impulse after another at a block of points side by side."""
    p0, p1, p2, p3, p4, p5, p6, p7, p8, p9 = K[0], K[1], K[2], K[3], K[4], K[5], K[6], K[7], K[8], K[9]
    e0, e1, e2, e3, e4, e5, e6, e7, e8 = K[10], K[11], K[12], K[13], K[14], K[15], K[16], K[17], K[18]
    one, half_more, two, per_scale = K[19], K[20], K[21], K[22]
    for q in range(count):
        j = near[q]
        x, y, z, s = rows[j, 0] - centre[0], rows[j, 1] - centre[1], rows[j, 2] - centre[2], rows[j, 6]
        mx, my, mz = rows[j, 3], rows[j, 4], rows[j, 5]
        for i in range(n):
            dx, dy, dz = (X[i] - x) * s, (Y[i] - y) * s, (Z[i] - z) * s
            w = one / (one + (dx * dx + dy * dy + dz * dz) * per_scale)
            p = ((((((((p9 * w + p8) * w + p7) * w + p6) * w + p5) * w + p4) * w + p3) * w + p2) * w + p1) * w + p0
            slope = (((((((e8 * w + e7) * w + e6) * w + e5) * w + e4) * w + e3) * w + e2) * w + e1) * w + e0
            t = half_more * p + w * slope
            r = two * w * math.sqrt(w)
            across = r * (p - (one - w) * t)
            along = per_scale * r * w * t * (mx * dx + my * dy + mz * dz)
            U[i] += across * mx + along * dx
            V[i] += across * my + along * dy
            W[i] += across * mz + along * dz


@njit(inline="always")
def _add_dipoles(
    n: int,
    X: Array,
    Y: Array,
    Z: Array,
    rows: np.ndarray,
    far: IntArray,
    count: int,
    centre: np.ndarray,
    U: Array,
    V: Array,
    W: Array,
) -> None:
    """Velocity (3 (m.d) d / d^2 - m) / (4 pi d^3) of each dipole."""
    for q in range(count):
        j = far[q]
        x, y, z = rows[j, 0] - centre[0], rows[j, 1] - centre[1], rows[j, 2] - centre[2]
        mx, my, mz = rows[j, 7], rows[j, 8], rows[j, 9]
        for p in range(n):
            dx, dy, dz = X[p] - x, Y[p] - y, Z[p] - z
            per_d2 = _ONE / (dx * dx + dy * dy + dz * dz)
            per_d3 = _PER_4_PI * per_d2 * math.sqrt(per_d2)
            along = _THREE * per_d2 * (mx * dx + my * dy + mz * dz)
            U[p] += per_d3 * (along * dx - mx)
            V[p] += per_d3 * (along * dy - my)
            W[p] += per_d3 * (along * dz - mz)


@njit(inline="always")
def _series(
    rows: np.ndarray, far: IntArray, count: int, centre: np.ndarray, beside: np.ndarray, out: np.ndarray
) -> None:
    """Sum the power series about a centre of dipoles' velocity: their potential's derivatives there up to the fourth.

    With e = -d / |d| towards the dipole at d, and m.e = a, the velocity's derivatives are, over 4 pi |d|^3,
    u = 3 a e - m;  in l: -(15 a e e_l - 3 (m e_l + e m_l + a I_l)) / |d|;  in l and k likewise, over |d|^2.
    """
    X, Y, Z, MX, MY, MZ = beside[0], beside[1], beside[2], beside[3], beside[4], beside[5]
    for q in range(count):
        j = far[q]
        X[q], Y[q], Z[q] = centre[0] - rows[j, 0], centre[1] - rows[j, 1], centre[2] - rows[j, 2]
        MX[q], MY[q], MZ[q] = rows[j, 7], rows[j, 8], rows[j, 9]
    u0 = v0 = w0 = gxx = gyy = gxy = gxz = gyz = _ZERO
    hxxx = hyyy = hzzz = hxxy = hxxz = hxyy = hyyz = hxyz = _ZERO
    for q in range(count):
        x, y, z, mx, my, mz = X[q], Y[q], Z[q], MX[q], MY[q], MZ[q]
        per_d2 = _ONE / (x * x + y * y + z * z)
        per_d = math.sqrt(per_d2)
        ex, ey, ez = x * per_d, y * per_d, z * per_d
        a = mx * ex + my * ey + mz * ez
        s = _PER_4_PI * per_d * per_d2
        u0 += s * (_THREE * a * ex - mx)
        v0 += s * (_THREE * a * ey - my)
        w0 += s * (_THREE * a * ez - mz)
        s *= _THREE * per_d
        b = _FIVE * a
        gxx += s * (mx * ex + mx * ex + a - b * ex * ex)
        gyy += s * (my * ey + my * ey + a - b * ey * ey)
        gxy += s * (mx * ey + my * ex - b * ex * ey)
        gxz += s * (mx * ez + mz * ex - b * ex * ez)
        gyz += s * (my * ez + mz * ey - b * ey * ez)
        s *= per_d
        b = _SEVEN * a
        # 3 [35 a e e e - 5 (m e e + ..) - 5 a (I e + ..) + (m I + ..)], s holds the 3.
        hxxx += s * (_THREE * mx + _FIVE * (ex * ex * (b * ex - _THREE * mx) - _THREE * a * ex))
        hyyy += s * (_THREE * my + _FIVE * (ey * ey * (b * ey - _THREE * my) - _THREE * a * ey))
        hzzz += s * (_THREE * mz + _FIVE * (ez * ez * (b * ez - _THREE * mz) - _THREE * a * ez))
        hxxy += s * (my + _FIVE * (ex * (ex * (b * ey - my) - mx * ey - mx * ey) - a * ey))
        hxxz += s * (mz + _FIVE * (ex * (ex * (b * ez - mz) - mx * ez - mx * ez) - a * ez))
        hxyy += s * (mx + _FIVE * (ey * (ey * (b * ex - mx) - my * ex - my * ex) - a * ex))
        hyyz += s * (mz + _FIVE * (ey * (ey * (b * ez - mz) - my * ez - my * ez) - a * ez))
        hxyz += s * _FIVE * (b * ex * ey * ez - mx * ey * ez - my * ex * ez - mz * ex * ey)
    out[0], out[1], out[2], out[3], out[4], out[5], out[6], out[7] = u0, v0, w0, gxx, gyy, gxy, gxz, gyz
    out[8], out[9], out[10], out[11], out[12], out[13], out[14] = hxxx, hyyy, hzzz, hxxy, hxxz, hxyy, hyyz
    out[15] = hxyz


@njit(inline="always")
def _add_series(
    n: int, X: Array, Y: Array, Z: Array, c: np.ndarray, x0: Any, y0: Any, z0: Any, U: Array, V: Array, W: Array
) -> None:
    """Add a power series; its middle lies at minus (x0, y0, z0)."""
    u0, v0, w0, gxx, gyy, gxy, gxz, gyz = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]
    hxxx, hyyy, hzzz, hxxy, hxxz, hxyy, hyyz, hxyz = c[8], c[9], c[10], c[11], c[12], c[13], c[14], c[15]
    # The potential has no Laplacian: what is left follows.
    gzz = -gxx - gyy
    hxzz, hyzz = -hxxx - hxyy, -hxxy - hyyy
    for p in range(n):
        x, y, z = X[p] + x0, Y[p] + y0, Z[p] + z0
        xx, yy, zz = _HALF * x * x, _HALF * y * y, _HALF * z * z
        xy, xz, yz = x * y, x * z, y * z
        u, v, w = u0 + gxx * x + gxy * y + gxz * z, v0 + gxy * x + gyy * y + gyz * z, w0 + gxz * x + gyz * y + gzz * z
        U[p] += u + hxxx * xx + hxyy * yy + hxzz * zz + hxxy * xy + hxxz * xz + hxyz * yz
        V[p] += v + hxxy * xx + hyyy * yy + hyzz * zz + hxyy * xy + hxyz * xz + hyyz * yz
        W[p] += w + hxxz * xx + hyyz * yy + hzzz * zz + hxyz * xy + hxzz * xz + hyzz * yz

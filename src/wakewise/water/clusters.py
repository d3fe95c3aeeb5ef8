"""Velocity of many impulses at many points at once: near ones one by one, far ones by the cluster.

Impulses in one cell of a coarse grid, alike in size, form a cluster. From far off it acts as one dipole: the sum of its
impulses, at their centre weighted with their sizes, which is right to first order in the cluster's size over the
distance where they are parallel, as along a jet. Points are taken in blocks of neighbours; for each block a cluster is
far if the block lies beyond `_OPENING` of its radii and beyond `_DIPOLE` sigma of its largest impulse (a Gaussian
impulse is a dipole to 1e-3 there). Dipoles that are farther off than `_SERIES` of the block's own radii are not summed
at every point either: their velocity in the block is a power series about its middle, of second order, which has no
divergence and no curl, as the whole has none. What a sum comes to depends on the list of points only, never on the
number of threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit
from wakewise.water.chunks import over_points
from wakewise.water.induction import SINGLE, impulse_sums, impulse_velocity

_CELL_M = 0.35
_SMALL_M = 0.07  # sigmas below this and above it are never in one cluster
_OPENING = 2.5
_DIPOLE = 4.2
_SERIES = 3.0
_BLOCK = 32
_FEW_SOURCES = 150  # and
_FEW_POINTS = 40  # below which clusters are not worth their making
_SIDE = 32  # cells along each side of the cube in which points are put in order
_KEYS = 65536  # keys of two bytes are sorted digit by digit, which is quick


def in_space(points_W_m: Array) -> IntArray:
    """Order, shape (n,), in which points that follow each other are mostly neighbours in space: along Hilbert's curve.

    J. Skilling 2004, Programming the Hilbert curve, AIP Conf. Proc. 707, 381, doi 10.1063/1.1751381.
    """
    if len(points_W_m) < _FEW_POINTS:
        return np.arange(len(points_W_m))
    key = np.empty(len(points_W_m), dtype=np.uint16)
    _hilbert(np.ascontiguousarray(points_W_m, dtype=np.float64), key)
    order: IntArray = np.argsort(key, kind="stable")
    return order


@njit
def _hilbert(points: Array, key: np.ndarray) -> None:
    low, high = points[0].copy(), points[0].copy()
    for p in range(points.shape[0]):
        for k in range(3):
            low[k], high[k] = min(low[k], points[p, k]), max(high[k], points[p, k])
    size = max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9) * (1.0 + 1e-9)
    x = np.zeros(3, np.int64)
    for p in range(points.shape[0]):
        for k in range(3):
            x[k] = int((points[p, k] - low[k]) / size * _SIDE)
        bit = _SIDE // 2
        while bit > 1:
            for k in range(3):
                if x[k] & bit:
                    x[0] ^= bit - 1
                else:
                    t = (x[0] ^ x[k]) & (bit - 1)
                    x[0] ^= t
                    x[k] ^= t
            bit //= 2
        x[1] ^= x[0]
        x[2] ^= x[1]
        t, bit = 0, _SIDE // 2
        while bit > 1:
            if x[2] & bit:
                t ^= bit - 1
            bit //= 2
        at, bit = 0, _SIDE // 2
        while bit > 0:
            for k in range(3):
                at = 2 * at + (1 if (x[k] ^ t) & bit else 0)
            bit //= 2
        key[p] = at


@dataclass(frozen=True, eq=False)
class ImpulseField:
    """Impulses at one instant, sorted by cluster.

    Parameters
    ----------
    positions_m, impulses_m4_s : ndarray, shape (k, 3)
    sigmas_m : ndarray, shape (k,)
    rows : ndarray of float32, shape (7, k)
        As the kernel takes them: position, impulse over sigma cubed, one over sigma; by cluster.
    starts : ndarray of int, shape (c + 1,)
        Cluster i has the rows from starts[i] to starts[i + 1].
    clusters : ndarray, shape (c, 7)
        Centre, impulse, and the distance beyond which it is far.
    """

    positions_m: Array
    impulses_m4_s: Array
    sigmas_m: Array
    rows: np.ndarray
    starts: IntArray
    clusters: Array

    @classmethod
    def of(cls, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array) -> ImpulseField:
        """Sort impulses into clusters."""
        if len(sigmas_m) < _FEW_SOURCES:
            empty = np.zeros((7, 0), np.float32), np.zeros(1, np.int64), np.zeros((0, 7))
            return cls(positions_m, impulses_m4_s, sigmas_m, *empty)
        key = np.empty(len(sigmas_m), np.uint16)
        _cells(positions_m, sigmas_m, key)
        order = np.argsort(key, kind="stable")
        rows, starts, clusters = _clusters(positions_m, impulses_m4_s, sigmas_m, key, order)
        return cls(positions_m, impulses_m4_s, sigmas_m, rows, starts, clusters)

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s, shape (n, 3), at points, shape (n, 3), best in the order of `in_space`."""
        if len(self.clusters) == 0 or len(points_W_m) < _FEW_POINTS:
            return impulse_velocity(points_W_m, self.positions_m, self.impulses_m4_s, self.sigmas_m)
        out = np.zeros((len(points_W_m), 3))
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        over_points(self.write, points, out, self.pairs(len(points)))
        return out

    def pairs(self, points: int) -> int:
        """How many pairs of point and impulse take as long as a sum at so many points; 0 if it is not clustered."""
        return points * len(self.sigmas_m) // 4 if len(self.clusters) and points >= _FEW_POINTS else 0

    def write(self, points_W_m: Array, out: Array) -> None:
        """Write the velocity at points into `out`, both shape (n, 3), on this thread."""
        _sum(points_W_m, self.rows, self.starts, self.clusters, SINGLE, out)


@njit
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


@njit
def _clusters(X: Array, m: Array, sigma: Array, key: np.ndarray, order: IntArray) -> tuple[np.ndarray, IntArray, Array]:
    """Rows and clusters of an `ImpulseField`, and where each cluster starts."""
    n = order.shape[0]
    rows, starts = np.empty((7, n), np.float32), np.empty(n + 1, np.int64)
    count = 0
    for i in range(n):
        j = order[i]
        if i == 0 or key[j] != key[order[i - 1]]:
            starts[count] = i
            count += 1
        inverse = 1.0 / sigma[j]
        cubed = inverse * inverse * inverse
        for k in range(3):
            rows[k, i], rows[3 + k, i] = X[j, k], m[j, k] * cubed
        rows[6, i] = inverse
    starts[count] = n
    out = np.zeros((count, 7))
    for c in range(count):
        total, widest, reach2 = 1e-30, 0.0, 0.0
        for i in range(starts[c], starts[c + 1]):
            j = order[i]
            size = math.sqrt(m[j, 0] ** 2 + m[j, 1] ** 2 + m[j, 2] ** 2) + 1e-30
            total += size
            widest = max(widest, sigma[j])
            for k in range(3):
                out[c, k] += size * X[j, k]
                out[c, 3 + k] += m[j, k]
        for k in range(3):
            out[c, k] /= total
        for i in range(starts[c], starts[c + 1]):
            away2 = 0.0
            for k in range(3):
                away2 += (X[order[i], k] - out[c, k]) ** 2
            reach2 = max(reach2, away2)
        reach = math.sqrt(reach2)
        out[c, 6] = max(_OPENING * reach, reach + _DIPOLE * widest)
    return rows, starts[: count + 1].copy(), out


@njit(nogil=True, fastmath=True)
def _sum(points: Array, rows: np.ndarray, starts: IntArray, clusters: Array, K: np.ndarray, out: Array) -> None:
    near, far = np.empty((7, rows.shape[1]), np.float32), np.empty((6, rows.shape[1]), np.float32)
    farther = np.empty((6, clusters.shape[0]), np.float32)
    some, result = np.empty((_BLOCK, 3), np.float32), np.empty((_BLOCK, 3))
    for block in range(0, points.shape[0], _BLOCK):
        n = min(_BLOCK, points.shape[0] - block)
        centre, about = np.zeros(3), 0.0
        for k in range(3):
            low = high = points[block, k]
            for p in range(n):
                low, high = min(low, points[block + p, k]), max(high, points[block + p, k])
            centre[k] = 0.5 * (low + high)
            about += (0.5 * (high - low)) ** 2
        about = math.sqrt(about)
        # Lengths are counted from the block's centre: single precision then loses nothing of nearby distances.
        for p in range(n):
            for k in range(3):
                some[p, k] = points[block + p, k] - centre[k]
        nears = fars = farthers = 0
        series = _SERIES * about
        for i in range(clusters.shape[0]):
            dx, dy, dz = clusters[i, 0] - centre[0], clusters[i, 1] - centre[1], clusters[i, 2] - centre[2]
            away = math.sqrt(dx * dx + dy * dy + dz * dz)
            if away - about <= clusters[i, 6]:
                for j in range(starts[i], starts[i + 1]):
                    dx, dy, dz = rows[0, j] - centre[0], rows[1, j] - centre[1], rows[2, j] - centre[2]
                    size = 1.0 / rows[6, j]
                    away = math.sqrt(dx * dx + dy * dy + dz * dz)
                    if away - about > _DIPOLE * size:
                        cubed = size * size * size
                        far[0, fars], far[1, fars], far[2, fars] = dx, dy, dz
                        for k in range(3, 6):
                            far[k, fars] = rows[k, j] * cubed
                        fars += 1
                        continue
                    near[0, nears], near[1, nears], near[2, nears] = dx, dy, dz
                    for k in range(3, 7):
                        near[k, nears] = rows[k, j]
                    nears += 1
            elif away > series:
                farther[0, farthers], farther[1, farthers], farther[2, farthers] = dx, dy, dz
                for k in range(3, 6):
                    farther[k, farthers] = clusters[i, k]
                farthers += 1
            else:
                far[0, fars], far[1, fars], far[2, fars] = dx, dy, dz
                for k in range(3, 6):
                    far[k, fars] = clusters[i, k]
                fars += 1
        impulse_sums(
            some[:n],
            near[0, :nears],
            near[1, :nears],
            near[2, :nears],
            near[3, :nears],
            near[4, :nears],
            near[5, :nears],
            near[6, :nears],
            K,
            result[:n],
        )
        _add_dipoles(some[:n], far, fars, result[:n])
        _add_series(some[:n], farther, farthers, result[:n])
        out[block : block + n] = result[:n]


@njit(inline="always")
def _add_dipoles(points: np.ndarray, far: np.ndarray, count: int, out: Array) -> None:
    """Velocity (3 (m.d) d / d^2 - m) / (4 pi d^3) of each dipole."""
    zero = points[0, 0] - points[0, 0]
    one, three, scale = np.float32(1.0), np.float32(3.0), np.float32(1 / (4 * math.pi))
    X, Y, Z, MX, MY, MZ = far[0], far[1], far[2], far[3], far[4], far[5]
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        u = v = w = zero
        for j in range(count):
            dx, dy, dz = x - X[j], y - Y[j], z - Z[j]
            mx, my, mz = MX[j], MY[j], MZ[j]
            per_d2 = one / (dx * dx + dy * dy + dz * dz)
            per_d3 = scale * per_d2 * math.sqrt(per_d2)
            along = three * per_d2 * (mx * dx + my * dy + mz * dz)
            u += per_d3 * (along * dx - mx)
            v += per_d3 * (along * dy - my)
            w += per_d3 * (along * dz - mz)
        out[p, 0] += u
        out[p, 1] += v
        out[p, 2] += w


@njit(inline="always")
def _add_series(points: np.ndarray, far: np.ndarray, count: int, out: Array) -> None:
    """Dipoles' velocity as a power series about 0: their potential's derivatives there up to the fourth.

    With e = -d / |d| towards the dipole at d, and m.e = a, the velocity's derivatives are, over 4 pi |d|^3,
    u = 3 a e - m;  in l: -(15 a e e_l - 3 (m e_l + e m_l + a I_l)) / |d|;  in l and k likewise, over |d|^2.
    """
    zero = points[0, 0] - points[0, 0]
    one, three, five, seven = np.float32(1.0), np.float32(3.0), np.float32(5.0), np.float32(7.0)
    scale, half = np.float32(1 / (4 * math.pi)), np.float32(0.5)
    X, Y, Z, MX, MY, MZ = far[0], far[1], far[2], far[3], far[4], far[5]
    u0 = v0 = w0 = gxx = gyy = gxy = gxz = gyz = zero
    hxxx = hyyy = hzzz = hxxy = hxxz = hxyy = hyyz = hxzz = hyzz = hxyz = zero
    for j in range(count):
        mx, my, mz = MX[j], MY[j], MZ[j]
        per_d2 = one / (X[j] * X[j] + Y[j] * Y[j] + Z[j] * Z[j])
        per_d = math.sqrt(per_d2)
        ex, ey, ez = -X[j] * per_d, -Y[j] * per_d, -Z[j] * per_d
        a = mx * ex + my * ey + mz * ez
        s = scale * per_d * per_d2
        u0 += s * (three * a * ex - mx)
        v0 += s * (three * a * ey - my)
        w0 += s * (three * a * ez - mz)
        s *= three * per_d
        b = five * a
        gxx += s * (mx * ex + mx * ex + a - b * ex * ex)
        gyy += s * (my * ey + my * ey + a - b * ey * ey)
        gxy += s * (mx * ey + my * ex - b * ex * ey)
        gxz += s * (mx * ez + mz * ex - b * ex * ez)
        gyz += s * (my * ez + mz * ey - b * ey * ez)
        s *= per_d
        b = seven * a
        # 3 [35 a e e e - 5 (m e e + ..) - 5 a (I e + ..) + (m I + ..)], s holds the 3.
        hxxx += s * (three * mx + five * (ex * ex * (b * ex - three * mx) - three * a * ex))
        hyyy += s * (three * my + five * (ey * ey * (b * ey - three * my) - three * a * ey))
        hzzz += s * (three * mz + five * (ez * ez * (b * ez - three * mz) - three * a * ez))
        hxxy += s * (my + five * (ex * (ex * (b * ey - my) - mx * ey - mx * ey) - a * ey))
        hxxz += s * (mz + five * (ex * (ex * (b * ez - mz) - mx * ez - mx * ez) - a * ez))
        hxyy += s * (mx + five * (ey * (ey * (b * ex - mx) - my * ex - my * ex) - a * ex))
        hyyz += s * (mz + five * (ey * (ey * (b * ez - mz) - my * ez - my * ez) - a * ez))
        hxyz += s * five * (b * ex * ey * ez - mx * ey * ez - my * ex * ez - mz * ex * ey)
    # The potential has no Laplacian: what is left follows.
    gzz = -gxx - gyy
    hxzz, hyzz = -hxxx - hxyy, -hxxy - hyyy
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        xx, yy, zz = half * x * x, half * y * y, half * z * z
        xy, xz, yz = x * y, x * z, y * z
        u, v, w = u0 + gxx * x + gxy * y + gxz * z, v0 + gxy * x + gyy * y + gyz * z, w0 + gxz * x + gyz * y + gzz * z
        out[p, 0] += u + hxxx * xx + hxyy * yy + hxzz * zz + hxxy * xy + hxxz * xz + hxyz * yz
        out[p, 1] += v + hxxy * xx + hyyy * yy + hyzz * zz + hxyy * xy + hxyz * xz + hyyz * yz
        out[p, 2] += w + hxxz * xx + hyyz * yy + hzzz * zz + hxyz * xy + hxzz * xz + hyzz * yz

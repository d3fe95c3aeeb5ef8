"""Velocity of many impulses at many points at once: near ones one by one, far ones by the cluster.

Impulses in one cell of a coarse grid form a cluster. From far off it acts as one dipole: the sum of its impulses, at
their centre weighted with their sizes, which is right to first order in the cluster's size over the distance where
they are parallel, as along a jet. Points are taken in blocks of neighbours; for each block a cluster is far if the
block lies beyond `_OPENING` of its radii and beyond `_DIPOLE` sigma of its largest impulse (a Gaussian impulse is a
dipole to 1e-4 there). What a sum comes to depends on the list of points only, never on the number of threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from wakewise.arrays import Array, IntArray
from wakewise.tank.chunks import over_points
from wakewise.tank.induction import SINGLE, impulse_sums, impulse_velocity

_CELL_M = 0.35
_OPENING = 2.5
_DIPOLE = 4.5
_BLOCK = 64
_FEW_SOURCES = 150  # and
_FEW_POINTS = 128  # below which clusters are not worth their making
_SORT_M = 0.1


def in_space(points_W_m: Array) -> IntArray:
    """Order, shape (n,), in which points that follow each other are mostly neighbours in space: Morton's."""
    if len(points_W_m) < _FEW_POINTS:
        return np.arange(len(points_W_m))
    key = np.empty(len(points_W_m), dtype=np.int64)
    _morton(np.ascontiguousarray(points_W_m, dtype=np.float64), points_W_m.min(axis=0), key)
    order: IntArray = np.argsort(key, kind="stable")
    return order


@njit(cache=True)
def _morton(points: Array, low: Array, key: IntArray) -> None:
    for p in range(points.shape[0]):
        key[p] = 0
        for k in range(3):
            cell = min(int((points[p, k] - low[k]) / _SORT_M), 1023)
            for bit in range(10):
                key[p] |= ((cell >> bit) & 1) << (3 * bit + k)


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
        cell = np.floor(positions_m * (1 / _CELL_M)).astype(np.int64)
        key = ((cell[:, 0] + 2048) * 4096 + cell[:, 1] + 2048) * 4096 + cell[:, 2] + 2048
        order = np.argsort(key, kind="stable")
        key = key[order]
        first = np.flatnonzero(np.diff(key, prepend=key[0] - 1))
        starts = np.append(first, len(key))
        X, m, inverse = positions_m[order], impulses_m4_s[order], 1.0 / sigmas_m[order]
        rows = np.concatenate([X.T, (m * (inverse**3)[:, None]).T, inverse[None]]).astype(np.float32)
        return cls(positions_m, impulses_m4_s, sigmas_m, rows, starts, _clusters(X, m, sigmas_m[order], starts))

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s, shape (n, 3), at points, shape (n, 3), best in the order of `in_space`."""
        if len(self.clusters) == 0 or len(points_W_m) < _FEW_POINTS:
            return impulse_velocity(points_W_m, self.positions_m, self.impulses_m4_s, self.sigmas_m)
        out = np.zeros((len(points_W_m), 3))
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        cost = len(points) * len(self.sigmas_m) // 3
        over_points(
            lambda some, result: _sum(some, self.rows, self.starts, self.clusters, SINGLE, result), points, out, cost
        )
        return out


@njit(cache=True)
def _clusters(X: Array, m: Array, sigma: Array, starts: IntArray) -> Array:
    out = np.zeros((starts.shape[0] - 1, 7))
    for i in range(starts.shape[0] - 1):
        total, widest, reach2 = 1e-30, 0.0, 0.0
        for j in range(starts[i], starts[i + 1]):
            size = math.sqrt(m[j, 0] ** 2 + m[j, 1] ** 2 + m[j, 2] ** 2) + 1e-30
            total += size
            widest = max(widest, sigma[j])
            for k in range(3):
                out[i, k] += size * X[j, k]
                out[i, 3 + k] += m[j, k]
        for k in range(3):
            out[i, k] /= total
        for j in range(starts[i], starts[i + 1]):
            away2 = 0.0
            for k in range(3):
                away2 += (X[j, k] - out[i, k]) ** 2
            reach2 = max(reach2, away2)
        reach = math.sqrt(reach2)
        out[i, 6] = max(_OPENING * reach, reach + _DIPOLE * widest)
    return out


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _sum(points: Array, rows: np.ndarray, starts: IntArray, clusters: Array, K: np.ndarray, out: Array) -> None:
    near, far = np.empty((7, rows.shape[1]), np.float32), np.empty((6, clusters.shape[0]), np.float32)
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
        nears = fars = 0
        for i in range(clusters.shape[0]):
            away2 = 0.0
            for k in range(3):
                away2 += (clusters[i, k] - centre[k]) ** 2
            if math.sqrt(away2) - about > clusters[i, 6]:
                for k in range(3):
                    far[k, fars] = clusters[i, k] - centre[k]
                    far[3 + k, fars] = clusters[i, 3 + k]
                fars += 1
            else:
                for j in range(starts[i], starts[i + 1]):
                    for k in range(3):
                        near[k, nears] = rows[k, j] - centre[k]
                    for k in range(3, 7):
                        near[k, nears] = rows[k, j]
                    nears += 1
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

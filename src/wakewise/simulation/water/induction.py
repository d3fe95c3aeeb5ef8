"""Induced velocity of many smoothed impulses and sources at many points: the inner loop of the simulated water.

An impulse m (m4/s) spread as a Gaussian of size sigma about X induces, with d = (x - X)/sigma and q = d.d,

    u = [2 (A + q A') m - 2 A' d (m.d)] / sigma^3,        A(q) = P(3/2, q/2) / (4 pi q^(3/2)),   A' = dA/dq,

P the regularised incomplete gamma function: the divergence-free part of the impulse density (impulse, or
"magnetisation", variables: Chorin 1994, Vorticity and Turbulence). u is free of divergence for any A(q), so A is
approximated, with w = 1/(1 + q/12):

    A = w^(3/2) p(w),        p a polynomial of degree 9,

whose first two terms give the dipole's far field. The other coefficients minimise the largest error: 1.2e-4 of the
speed at the parcel's centre, 1.7e-4 of A. A source of strength Q (m3/s) of the same shape induces u = Q A d / sigma^2.

Sums run in single precision over one array per quantity; each point is summed by one thread in one order, so results do
not depend on the number of threads. Points are sorted along Hilbert's curve so that blocks hold neighbours (J. Skilling
2004, Programming the Hilbert curve, AIP Conf. Proc. 707, 381, doi 10.1063/1.1751381).
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import Any, TypeVar

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit

A = TypeVar("A", Array, IntArray)

_CHUNK = 256  # least points of a piece
_BLOCKS = 256
_THREADED_PAIRS = 700_000  # about 0.7 ms of work; below it threads cost more than they save
_MOST = 8  # threads
_PIECES = 4  # per thread: they are not all as long


def over_points(kernel: Callable[[A, A], None], points: A, out: A, pairs: int) -> None:
    """Call `kernel(points, out)` on all points or indices, in pieces on several threads if there are many pairs.

    The kernel must release the interpreter's lock and compute each row of `out` from its own point alone, or from its
    own group of successive points whose length divides 256; then the result does not depend on the pieces. The caller
    takes pieces, too: a thread that only waited would leave its core to the one that it has just woken, and the others
    idle for the milliseconds that all this takes.
    """
    if pairs < _THREADED_PAIRS or len(points) < 2 * _CHUNK or (workers := min(cores(), _MOST)) == 1:
        kernel(points, out)
        return
    # Whole blocks: kernels may look up to `_BLOCKS` successive points up together.
    size = max(_CHUNK, -(-len(points) // (_PIECES * workers * _BLOCKS)) * _BLOCKS)
    starts = deque(range(0, len(points), size))

    def take_pieces() -> None:
        while True:
            try:
                s = starts.popleft()
            except IndexError:
                return
            kernel(points[s : s + size], out[s : s + size])

    others = [_helpers().submit(take_pieces) for _ in range(workers - 1)]
    try:
        take_pieces()
    finally:
        # One that has not begun has nothing left to do.
        begun = [other for other in others if not other.cancel()]
        wait(begun)
    for other in begun:
        other.result()


@cache
def cores() -> int:
    """How many cores this process may use."""
    there = os.cpu_count() or 1
    return min(there, len(os.sched_getaffinity(0))) if hasattr(os, "sched_getaffinity") else there


@cache
def _helpers() -> ThreadPoolExecutor:
    """Threads that sleep until there is work: waiting by spinning would take the cores from other trials."""
    return ThreadPoolExecutor(_MOST - 1, thread_name_prefix="sums")


# Threads do not survive a fork, where there is such a thing; the child starts its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)


_SCALE = 12.0
_FAR = _SCALE**-1.5 / (4 * math.pi)
SHAPE = _FAR * np.array(
    [1.0, 1.5, 2.1430022, -3.8420108, 54.905399, -226.2735, 540.31134, -660.3177, 393.65072, -92.020331]
)
"""Coefficients of p, lowest power first."""

# For the kernels, in the precision of their points: p, then the coefficients of dp/dw, then 1, 3/2, 2, 1/_SCALE.
_CONSTANTS = np.concatenate([SHAPE, SHAPE[1:] * np.arange(1, 10), [1.0, 1.5, 2.0, 1 / _SCALE]])
SINGLE = _CONSTANTS.astype(np.float32)


def impulse_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, *, exact: bool = False
) -> Array:
    """Velocity of impulses (k, 3) of sizes (k,) at positions (k, 3), shape (n, 3), at points (n, 3).

    `exact` sums in double precision, about six times slower.
    """
    inverse = 1.0 / sigmas_m
    strength = impulses_m4_s * (inverse**3)[:, None]
    return _sum(_impulses, points_W_m, [*positions_m.T, *strength.T, inverse], exact)


def smooth_share(q: Array) -> Array:
    """The function A(q) that stands for the Gaussian's, of any shape."""
    w = 1.0 / (1.0 + q / _SCALE)
    A: Array = w**1.5 * np.polynomial.polynomial.polyval(w, SHAPE)
    return A


class FixedSources:
    """Sources that stay where they are: positions (k, 3), sizes (k,); only their strengths change."""

    def __init__(self, positions_m: Array, sigmas_m: Array) -> None:
        self.columns = np.ascontiguousarray(np.vstack([positions_m.T, 1.0 / sigmas_m]), dtype=np.float32)
        self._per_area = 1.0 / sigmas_m**2

    def velocity(self, points_W_m: Array, strengths_m3_s: Array) -> Array:
        """Velocity, shape (n, 3), at points, shape (n, 3)."""
        return _sum(
            sum_sources, points_W_m, [*self.columns[:3], strengths_m3_s * self._per_area, self.columns[3]], exact=False
        )


def _sum(kernel: Any, points_W_m: Array, rows: list[Any], exact: bool) -> Array:
    out = np.zeros((len(points_W_m), 3))
    if len(out) and len(rows[0]):
        kind = np.float64 if exact else np.float32
        points: Any = np.ascontiguousarray(points_W_m, dtype=kind)
        columns = [np.ascontiguousarray(row, dtype=kind) for row in rows]
        constants = _CONSTANTS if exact else SINGLE
        over_points(
            lambda some, result: kernel(some, *columns, constants, result),
            points,
            out,
            len(points) * len(rows[0]),
        )
    return out


@njit(nogil=True, fastmath=True)
def _impulses(
    points: Array, X: Array, Y: Array, Z: Array, MX: Array, MY: Array, MZ: Array, S: Array, K: Array, out: Array
) -> None:
    impulse_sums(points, X, Y, Z, MX, MY, MZ, S, K, out)


# Written into its callers: a compiled copy of its own may differ from another in the last bit.
@njit(inline="always")
def impulse_sums(
    points: Array, X: Array, Y: Array, Z: Array, MX: Array, MY: Array, MZ: Array, S: Array, K: Array, out: Array
) -> None:
    """Write the velocity of impulses over sigma cubed (MX, MY, MZ), of sizes 1 / S, at each point into `out`."""
    p0, p1, p2, p3, p4, p5, p6, p7, p8, p9 = K[0], K[1], K[2], K[3], K[4], K[5], K[6], K[7], K[8], K[9]
    e0, e1, e2, e3, e4, e5, e6, e7, e8 = K[10], K[11], K[12], K[13], K[14], K[15], K[16], K[17], K[18]
    one, half_more, two, per_scale = K[19], K[20], K[21], K[22]
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u = v = up = one - one
        for j in range(S.shape[0]):
            s = S[j]
            dx, dy, dz = (x - X[j]) * s, (y - Y[j]) * s, (z - Z[j]) * s
            w = one / (one + (dx * dx + dy * dy + dz * dz) * per_scale)
            p = ((((((((p9 * w + p8) * w + p7) * w + p6) * w + p5) * w + p4) * w + p3) * w + p2) * w + p1) * w + p0
            slope = (((((((e8 * w + e7) * w + e6) * w + e5) * w + e4) * w + e3) * w + e2) * w + e1) * w + e0
            # dA/dw = sqrt(w) t and dw/dq = -w^2 / scale; q = scale (1 - w) / w.
            t = half_more * p + w * slope
            r = two * w * math.sqrt(w)
            across = r * (p - (one - w) * t)
            mx, my, mz = MX[j], MY[j], MZ[j]
            along = per_scale * r * w * t * (mx * dx + my * dy + mz * dz)
            u += across * mx + along * dx
            v += across * my + along * dy
            up += across * mz + along * dz
        out[i, 0], out[i, 1], out[i, 2] = u, v, up


@njit(apart=True, nogil=True, fastmath=True)
def sum_sources(points: Array, X: Array, Y: Array, Z: Array, Q: Array, S: Array, K: Array, out: Array) -> None:
    """Write the velocity of sources over sigma squared (Q), of sizes 1 / S, at each point into `out`."""
    p0, p1, p2, p3, p4, p5, p6, p7, p8, p9 = K[0], K[1], K[2], K[3], K[4], K[5], K[6], K[7], K[8], K[9]
    one, per_scale = K[19], K[22]
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u = v = up = one - one
        for j in range(S.shape[0]):
            s = S[j]
            dx, dy, dz = (x - X[j]) * s, (y - Y[j]) * s, (z - Z[j]) * s
            w = one / (one + (dx * dx + dy * dy + dz * dz) * per_scale)
            p = ((((((((p9 * w + p8) * w + p7) * w + p6) * w + p5) * w + p4) * w + p3) * w + p2) * w + p1) * w + p0
            a = Q[j] * w * math.sqrt(w) * p
            u += a * dx
            v += a * dy
            up += a * dz
        out[i, 0], out[i, 1], out[i, 2] = u, v, up


FEW_POINTS = 40
"""Fewer are taken as they come."""
_BITS = 5
_SIDE = 2**_BITS  # cells along each side of the cube


def spatial_order(points_W_m: Array) -> IntArray:
    """Order, shape (n,), in which points, shape (n, 3), that follow each other are mostly neighbours in space."""
    if len(points_W_m) < FEW_POINTS:
        return np.arange(len(points_W_m))
    order: IntArray = ordered(np.ascontiguousarray(points_W_m, dtype=np.float64), curve())
    return order


@cache
def curve() -> np.ndarray:
    """Place on the curve of each cell of the cube, shape (32768,), cells counted along z, then y, then x."""
    cells = np.arange(_SIDE)
    x = [axis.ravel() for axis in np.meshgrid(cells, cells, cells, indexing="ij")]
    for bit in (1 << k for k in range(_BITS - 1, 0, -1)):
        for k in range(3):
            flip = (x[k] & bit) != 0
            swapped = np.where(flip, 0, (x[0] ^ x[k]) & (bit - 1))
            x[0] = np.where(flip, x[0] ^ (bit - 1), x[0] ^ swapped)
            if k:
                x[k] = x[k] ^ swapped
    x[1] = x[1] ^ x[0]
    x[2] = x[2] ^ x[1]
    turn = np.zeros_like(x[0])
    for bit in (1 << k for k in range(_BITS - 1, 0, -1)):
        turn ^= np.where((x[2] & bit) != 0, bit - 1, 0)
    place = np.zeros_like(x[0])
    for bit in (1 << k for k in range(_BITS - 1, -1, -1)):
        for k in range(3):
            place = 2 * place + (((x[k] ^ turn) & bit) != 0)
    return place.astype(np.uint16)


@njit(apart=True, nogil=True)
def ordered(points: Array, places: np.ndarray) -> IntArray:
    """Order of points, shape (n, 3), by the places of their cells on the curve."""
    n = points.shape[0]
    low, high = points[0].copy(), points[0].copy()
    for p in range(n):
        for k in range(3):
            low[k], high[k] = min(low[k], points[p, k]), max(high[k], points[p, k])
    size = max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9) * (1.0 + 1e-9)
    per_cell = _SIDE / size
    key = np.empty(n, np.uint16)
    for p in range(n):
        i, j = int((points[p, 0] - low[0]) * per_cell), int((points[p, 1] - low[1]) * per_cell)
        key[p] = places[(i * _SIDE + j) * _SIDE + int((points[p, 2] - low[2]) * per_cell)]
    return sorted_keys(key)


@njit(apart=True, nogil=True)
def sorted_keys(key: np.ndarray) -> IntArray:
    """Order that sorts keys of two bytes, shape (n,): byte by byte, and like ones as they come."""
    n = key.shape[0]
    order, other = np.arange(n), np.empty(n, np.int64)
    for digit in range(2):
        shift = 8 * digit
        starts = np.zeros(257, np.int64)
        for p in range(n):
            starts[((key[p] >> shift) & 255) + 1] += 1
        for v in range(256):
            starts[v + 1] += starts[v]
        for q in range(n):
            v = (key[order[q]] >> shift) & 255
            other[starts[v]] = order[q]
            starts[v] += 1
        order, other = other, order
    return order

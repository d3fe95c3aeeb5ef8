"""Velocity that many smoothed impulses and sources induce at many points: the inner loop of the simulated water.

An impulse m (m4/s) spread as a Gaussian of size sigma about X induces, with d = (x - X)/sigma and q = d.d,

    u = [2 (A + q A') m - 2 A' d (m.d)] / sigma^3,        A(q) = P(3/2, q/2) / (4 pi q^(3/2)),   A' = dA/dq,

P the regularised incomplete gamma function: the divergence-free part of the impulse density (impulse, or
"magnetisation", variables: Chorin 1994, Vorticity and Turbulence). Whatever the function A(q) is, this u has no
divergence, so A may be replaced by something that is quick to compute. Here, with w = 1/(1 + q/12),

    A = w^(3/2) p(w),        p a polynomial of degree 9,

whose first two terms make the far field that of a dipole. The other coefficients were fitted to the Gaussian's A and
A' for least greatest error: 1.2e-4 of the speed at the parcel's centre, and 1.7e-4 of A anywhere. A source of strength
Q (m3/s) of the same shape induces u = Q A d / sigma^2.

The sums run in single precision over one array per quantity, so that the compiler works on several terms at once; each
point is summed by one thread in one order.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.blocked_sums import over_points

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

"""Divergence-free velocity of Gaussian impulse parcels above a flat bed: the free jets of the simulated water.

A parcel of impulse m (m4/s, impulse over density), size sigma and centre X adds

    u(x) = m (G - A) - r_hat (m . r_hat) (G - 3 A),        r = x - X,
    G = exp(-q/2) / ((2 pi)^(3/2) sigma^3),   A = [erf(s/sqrt 2) - sqrt(2/pi) s exp(-q/2)] / (4 pi r^3),

with s = |r| / sigma and q = s^2: the divergence-free part of the Gaussian-smoothed impulse density m G (impulse, or
"magnetisation", variables: Chorin 1994, Vorticity and Turbulence). Mirror parcels below the bed keep
water from flowing through it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import erf

from wakewise.arrays import Array, IntArray
from wakewise.tank.chunks import over_points

_Q_END = 49.0  # beyond seven sigma the Gaussian is below 3e-11 of its centre and A is 1 / (4 pi r^3)
_KNOTS = 4096


def _shape_tables() -> tuple[Array, Array]:
    """G and A for sigma = 1 at equal steps of q; linear interpolation between them is good to 1e-5."""
    q = np.linspace(0.0, _Q_END, _KNOTS)
    s = np.sqrt(q)
    G = np.exp(-q / 2) / (2 * np.pi) ** 1.5
    A = np.empty_like(G)
    A[0] = G[0] / 3
    A[1:] = (erf(s[1:] / math.sqrt(2)) - math.sqrt(2 / math.pi) * s[1:] * np.exp(-q[1:] / 2)) / (4 * np.pi * s[1:] ** 3)
    # The closed form of A loses digits to cancellation near zero; its series there is G(0) (1/3 - q/10 + q^2/56).
    near = q < 0.05
    A[near] = G[0] * (1 / 3 - q[near] / 10 + q[near] ** 2 / 56)
    return G, A


_G_TABLE, _A_TABLE = _shape_tables()


@dataclass(frozen=True, eq=False)
class Parcels:
    """Impulse parcels, oldest first; a plain container whose arrays the water replaces at every step.

    Parameters
    ----------
    position_m : ndarray, shape (n, 3), in the world
    impulse_m4_s : ndarray, shape (n, 3)
        Thrust times time over density, along the jet.
    sigma_m : ndarray, shape (n,)
    diameter_m : ndarray, shape (n,)
        Disk diameter of the thruster that sent it.
    stream : ndarray of int, shape (n,)
        Which jet it belongs to: twice the thruster's index, plus one for reverse thrust.
    gust : ndarray, shape (n, 3)
        Turbulent share of the impulse, a standard normal variable before scaling.
    """

    position_m: Array
    impulse_m4_s: Array
    sigma_m: Array
    diameter_m: Array
    stream: IntArray
    gust: Array

    @classmethod
    def none(cls) -> Parcels:
        """No parcels at all: still water."""
        return cls(
            np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.sigma_m)

    def take(self, keep: np.ndarray) -> Parcels:
        """Those that a mask or an index array picks."""
        return Parcels(
            self.position_m[keep],
            self.impulse_m4_s[keep],
            self.sigma_m[keep],
            self.diameter_m[keep],
            self.stream[keep],
            self.gust[keep],
        )

    def joined(self, later: Parcels) -> Parcels:
        """These followed by the later ones."""
        return Parcels(
            np.concatenate([self.position_m, later.position_m]),
            np.concatenate([self.impulse_m4_s, later.impulse_m4_s]),
            np.concatenate([self.sigma_m, later.sigma_m]),
            np.concatenate([self.diameter_m, later.diameter_m]),
            np.concatenate([self.stream, later.stream]),
            np.concatenate([self.gust, later.gust]),
        )


def parcel_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, bed_z_m: float
) -> Array:
    """Velocity of parcels and of their mirror images in the bed, shape (n, 3), at points, shape (n, 3).

    Parameters
    ----------
    points_W_m : ndarray, shape (n, 3)
    positions_m, impulses_m4_s : ndarray, shape (k, 3)
    sigmas_m : ndarray, shape (k,)
    bed_z_m : float
        The plane z = bed_z_m, through which nothing flows; infinite for water without a bed.
    """
    out = np.zeros((len(points_W_m), 3))
    if len(sigmas_m) and len(points_W_m):
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        # One array per quantity: the inner loop then reads memory in order and the compiler vectorises it.
        rows = [np.ascontiguousarray(row) for row in (*positions_m.T, *impulses_m4_s.T)] + [1.0 / sigmas_m]
        images = math.isfinite(bed_z_m)
        bed = bed_z_m if images else 0.0
        over_points(
            lambda some, result: _sum_parcels(some, *rows, images, bed, _G_TABLE, _A_TABLE, result),
            points,
            out,
            len(points) * len(sigmas_m) * (2 if images else 1),
        )
    return out


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _sum_parcels(
    points: Array,
    X: Array,
    Y: Array,
    Z: Array,
    MX: Array,
    MY: Array,
    MZ: Array,
    S: Array,
    images: bool,
    bed: float,
    G_table: Array,
    A_table: Array,
    out: Array,
) -> None:
    """Sum over parcels; free of branches inside, so that the compiler can work on several parcels at once."""
    knots_per_q = (_KNOTS - 1) / _Q_END
    last_q = _Q_END - 0.02
    four_pi_inverse = 1.0 / (4.0 * math.pi)
    for p in range(points.shape[0]):
        x, y = points[p, 0], points[p, 1]
        # On the bed itself parcel and image agree along it and cancel across it.
        on_bed = images and points[p, 2] == bed
        for side in range(1 if on_bed or not images else 2):
            # The mirror image's velocity at x is the mirrored velocity of the parcel at the mirrored point.
            z = points[p, 2] if side == 0 else 2.0 * bed - points[p, 2]
            u = v = w = 0.0
            for j in range(S.shape[0]):
                dx, dy, dz = x - X[j], y - Y[j], z - Z[j]
                mx, my, mz, s = MX[j], MY[j], MZ[j], S[j]
                r2 = dx * dx + dy * dy + dz * dz + 1e-15
                inverse_r2 = 1.0 / r2
                q = r2 * s * s
                f = min(q, last_q) * knots_per_q
                k = np.int32(f)
                f -= k
                s3 = s * s * s
                G_near = (G_table[k] + (G_table[k + 1] - G_table[k]) * f) * s3
                A_near = (A_table[k] + (A_table[k + 1] - A_table[k]) * f) * s3
                A_far = four_pi_inverse * inverse_r2 * math.sqrt(inverse_r2)
                far = q >= last_q
                G = 0.0 if far else G_near
                A = A_far if far else A_near
                along = (mx * dx + my * dy + mz * dz) * inverse_r2 * (G - 3.0 * A)
                across = G - A
                u += mx * across - dx * along
                v += my * across - dy * along
                w += mz * across - dz * along
            out[p, 0] += u
            out[p, 1] += v
            out[p, 2] += w if side == 0 else -w
        if on_bed:
            out[p, 0] *= 2.0
            out[p, 1] *= 2.0
            out[p, 2] = 0.0

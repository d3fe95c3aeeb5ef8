"""Sums of Fourier modes at points, compiled: the water's turbulence is asked for by all that the water carries."""

from __future__ import annotations

import math

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

_TURN = 2.0 * math.pi
_PER_TURN = 1.0 / _TURN


@njit(apart=True, nogil=True, fastmath=True)
def add_modes(points: Array, waves: Array, turned: Array, cosines: Array, sines: Array, out: Array) -> None:
    """Add sum_j a_j cos(k_j . x + p_j) + b_j sin(k_j . x + p_j) to `out`, shape (n, 3), at points x, shape (n, 3).

    `waves` k, `cosines` a and `sines` b have shape (3, m), `turned` p shape (m,).

    Sine and cosine of half the angle come from their power series about zero, which at a quarter of a turn leave out
    5e-14; so the loop has no branch, and does several modes at once.
    """
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u = v = w = 0.0
        for j in range(turned.shape[0]):
            angle = waves[0, j] * x + waves[1, j] * y + waves[2, j] * z + turned[j]
            turns = angle * _PER_TURN
            h = 0.5 * _TURN * (turns - math.floor(turns + 0.5))
            q = h * h
            s = 1.0 - q / 272.0
            s = 1.0 - q / 210.0 * s
            s = 1.0 - q / 156.0 * s
            s = 1.0 - q / 110.0 * s
            s = 1.0 - q / 72.0 * s
            s = 1.0 - q / 42.0 * s
            s = 1.0 - q / 20.0 * s
            s = h * (1.0 - q / 6.0 * s)
            c = 1.0 - q / 306.0
            c = 1.0 - q / 240.0 * c
            c = 1.0 - q / 182.0 * c
            c = 1.0 - q / 132.0 * c
            c = 1.0 - q / 90.0 * c
            c = 1.0 - q / 56.0 * c
            c = 1.0 - q / 30.0 * c
            c = 1.0 - q / 12.0 * c
            c = 1.0 - q / 2.0 * c
            sine, cosine = 2.0 * s * c, 1.0 - 2.0 * s * s
            u += cosine * cosines[0, j] + sine * sines[0, j]
            v += cosine * cosines[1, j] + sine * sines[1, j]
            w += cosine * cosines[2, j] + sine * sines[2, j]
        out[i, 0] += u
        out[i, 1] += v
        out[i, 2] += w

"""Kernels of the bundle adjustment: normal equations with the points eliminated, and a pixel with its derivatives."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit

LEAST_AHEAD_M = 0.02
"""What is nearer, or behind the camera, is taken to be so far ahead."""


@njit
def normal_equations(
    R: Array,
    origins: Array,
    points: Array,
    starts: IntArray,
    frame_of: IntArray,
    pixels: Array,
    lens: Array,
    limits: Array,
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Normal equations of cameras and lens with the points eliminated, and what gives the points back.

    - `R`, `origins`, shapes (n, 3, 3) and (n, 3): poses X_WC; `lens`: of `lens_numbers`; `limits`: standard deviation
      of a pixel, scale of the weights, damping. `frame_of` ascends within each point: only what is above the
      diagonal is summed.

    Returns the Schur complement (d, d) and right side (d,), d = 6 n + 7; of points V (m, 3, 3) and h (m, 3); W (o, 6,
    3) of each observation's pose by its point and L (m, 7, 3) of the lens by the points; and misfits (m,).
    """
    m, end = len(points), 6 * len(R)
    S, g = np.zeros((end + 7, end + 7)), np.zeros(end + 7)
    V, h, misfit = np.zeros((m, 3, 3)), np.zeros((m, 3)), np.zeros(m)
    W, L = np.zeros((len(frame_of), 6, 3)), np.zeros((m, 7, 3))
    J, row, inverse, lens_gain, gain = (
        np.zeros((2, 16)),
        np.zeros(13, np.int64),
        np.zeros((3, 3)),
        L[0].copy(),
        W[0].copy(),
    )
    for a in range(7):
        row[6 + a] = end + a
    for j in range(m):
        for i in range(starts[j], starts[j + 1]):
            k = frame_of[i]
            u, v = observed(R[k], origins[k], points[j], lens, J)
            u, v = pixels[i, 0] - u, pixels[i, 1] - v
            weight = 1.0 / ((1.0 + (u * u + v * v) / (limits[1] * limits[1])) * limits[0] * limits[0])
            misfit[j] += weight * (u * u + v * v)
            for a in range(6):
                row[a] = 6 * k + a
            for a in range(13):
                g[row[a]] += weight * (J[0, a] * u + J[1, a] * v)
                for b in range(a, 13):
                    S[row[a], row[b]] += weight * (J[0, a] * J[0, b] + J[1, a] * J[1, b])
            for b in range(3):
                h[j, b] += weight * (J[0, 13 + b] * u + J[1, 13 + b] * v)
                for a in range(3):
                    V[j, a, b] += weight * (J[0, 13 + a] * J[0, 13 + b] + J[1, 13 + a] * J[1, 13 + b])
                for a in range(6):
                    W[i, a, b] = weight * (J[0, a] * J[0, 13 + b] + J[1, a] * J[1, 13 + b])
                for a in range(7):
                    L[j, a, b] += weight * (J[0, 6 + a] * J[0, 13 + b] + J[1, 6 + a] * J[1, 13 + b])
        trace = V[j, 0, 0] + V[j, 1, 1] + V[j, 2, 2]
        for a in range(3):
            V[j, a, a] += limits[2] * trace
        invert(V[j], inverse)
        multiply(L[j], inverse, lens_gain)
        for a in range(7):
            g[end + a] -= dot(lens_gain[a], h[j])
            for b in range(a, 7):
                S[end + a, end + b] -= dot(lens_gain[a], L[j, b])
        for i in range(starts[j], starts[j + 1]):
            first = 6 * frame_of[i]
            multiply(W[i], inverse, gain)
            for a in range(6):
                g[first + a] -= dot(gain[a], h[j])
                for b in range(7):
                    S[first + a, end + b] -= dot(gain[a], L[j, b])
                for other in range(i, starts[j + 1]):
                    second = 6 * frame_of[other]
                    for b in range(6):
                        S[first + a, second + b] -= dot(gain[a], W[other, b])
    for a in range(len(S)):
        for b in range(a):
            S[a, b] = S[b, a]
    return S, g, V, h, W, L, misfit


@njit
def observed(R: Array, origin: Array, point: Array, lens: Array, J: Array) -> tuple[float, float]:
    """Pixel of a point, and its derivatives in `J`, shape (2, 16).

    Columns: position of the camera in W and its rotation vector in C, lens as `LENS_STD`, point in W.
    """
    fx, fy, k1, k2, p1, p2 = lens[0], lens[1], lens[4], lens[5], lens[6], lens[7]
    d0, d1, d2 = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    px = R[0, 0] * d0 + R[1, 0] * d1 + R[2, 0] * d2
    py = R[0, 1] * d0 + R[1, 1] * d1 + R[2, 1] * d2
    pz = max(R[0, 2] * d0 + R[1, 2] * d1 + R[2, 2] * d2, LEAST_AHEAD_M)
    x, y = px / pz, py / pz
    r2 = x * x + y * y
    radial, slope = 1.0 + r2 * (k1 + r2 * k2), k1 + 2.0 * k2 * r2
    u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    across = 2.0 * (x * y * slope + p1 * x + p2 * y)
    for a in range(2):
        focal = fx if a == 0 else fy
        by_x = radial + 2.0 * (x * x * slope + p1 * y) + 6.0 * p2 * x if a == 0 else across
        by_y = across if a == 0 else radial + 2.0 * (y * y * slope + p2 * x) + 6.0 * p1 * y
        A0, A1 = focal * by_x / pz, focal * by_y / pz
        A2 = -(A0 * x + A1 * y)
        for b in range(3):
            J[a, 13 + b] = A0 * R[b, 0] + A1 * R[b, 1] + A2 * R[b, 2]
            J[a, b] = -J[a, 13 + b]
        # A turn w of the camera moves a point in its frame by p x w.
        J[a, 3], J[a, 4], J[a, 5] = A1 * pz - A2 * py, A2 * px - A0 * pz, A0 * py - A1 * px
    J[0, 6], J[1, 6] = fx * u, fy * v
    J[0, 7], J[1, 8] = lens[8], lens[8]
    J[0, 9], J[1, 9] = fx * x * r2, fy * y * r2
    J[0, 10], J[1, 10] = fx * x * r2 * r2, fy * y * r2 * r2
    J[0, 11], J[1, 11] = 2.0 * fx * x * y, fy * (r2 + 2.0 * y * y)
    J[0, 12], J[1, 12] = fx * (r2 + 2.0 * x * x), 2.0 * fy * x * y
    return fx * u + lens[2], fy * v + lens[3]


@njit(inline="always")
def dot(a: Array, b: Array) -> float:
    """Scalar product of two vectors, shape (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@njit
def multiply(A: Array, B: Array, product: Array) -> None:
    """Product of matrices, shapes (n, 3) and symmetric (3, 3), into `product`, shape (n, 3)."""
    for a in range(len(A)):
        for b in range(3):
            product[a, b] = dot(A[a], B[b])


@njit
def invert(A: Array, inverse: Array) -> None:
    """Inverse of a symmetric matrix, shape (3, 3), by its cofactors."""
    for a in range(3):
        for b in range(3):
            r, s, t, u = (a + 1) % 3, (a + 2) % 3, (b + 1) % 3, (b + 2) % 3
            inverse[b, a] = A[r, t] * A[s, u] - A[r, u] * A[s, t]
    determinant = A[0, 0] * inverse[0, 0] + A[0, 1] * inverse[1, 0] + A[0, 2] * inverse[2, 0]
    for a in range(3):
        for b in range(3):
            inverse[a, b] /= determinant

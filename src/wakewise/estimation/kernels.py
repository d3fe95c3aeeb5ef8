"""Compiled steps of the error-state filter; see `error_state` for what they mean.

`mean`, shape (25,): position in W (0:3), quaternion q_WB (3:7), twist in B (7:13), unmodelled force in W (13:16),
unmodelled moment in B (16:19), gyro bias (19:22), accelerometer bias (22:25).
`P`, shape (24, 24), is the covariance of the error: position in W (0:3), turn, a rotation vector in B (3:6), twist
(6:12), force (12:15), moment (15:18), gyro bias (18:21), accelerometer bias (21:24).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from wakewise.arrays import Array
from wakewise.vehicles.runge_kutta import rk4_jacobian_kernel

STATES, ERRORS, MOVING = 25, 24, 12
"""Entries of `mean`, of its error, and of the part of the error that the equations of motion move."""


@njit(cache=True)
def turn(q: Array, v: Array, sign: float) -> Array:
    """Vector R(q) v for sign = 1, R(q)' v for sign = -1."""
    w, x, y, z = q[0], sign * q[1], sign * q[2], sign * q[3]
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array([v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx])


@njit(cache=True)
def turned_by(q: Array, rotvec: Array) -> Array:
    """Unit quaternion q exp(rotvec): a further turn, expressed in the body."""
    angle = np.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    c = np.cos(0.5 * angle)
    s = np.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    x, y, z = s * rotvec[0], s * rotvec[1], s * rotvec[2]
    result = np.array(
        [
            q[0] * c - q[1] * x - q[2] * y - q[3] * z,
            q[0] * x + q[1] * c + q[2] * z - q[3] * y,
            q[0] * y - q[1] * z + q[2] * c + q[3] * x,
            q[0] * z + q[1] * y - q[2] * x + q[3] * c,
        ]
    )
    return result / np.sqrt(np.dot(result, result))


@njit(cache=True)
def turn_between(q: Array, other: Array) -> Array:
    """Rotation vector, shorter way, that turns q into `other`, expressed in the body of q."""
    w = q[0] * other[0] + q[1] * other[1] + q[2] * other[2] + q[3] * other[3]
    x = q[0] * other[1] - q[1] * other[0] - q[2] * other[3] + q[3] * other[2]
    y = q[0] * other[2] + q[1] * other[3] - q[2] * other[0] - q[3] * other[1]
    z = q[0] * other[3] - q[1] * other[2] + q[2] * other[1] - q[3] * other[0]
    half = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 * np.arctan2(half, abs(w)) / half if half > 1e-12 else 2.0
    if w < 0.0:
        factor = -factor
    return np.array([factor * x, factor * y, factor * z])


@njit(cache=True)
def _inputs(mean: Array, wrench_B: Array, inputs: Array) -> Array:
    """Fill what the equations of motion are given, and return the unmodelled force as seen from B, shape (3,)."""
    load_B = turn(mean[3:7], mean[13:16], -1.0)
    for i in range(3):
        inputs[i] = wrench_B[i] + load_B[i]
        inputs[3 + i] = wrench_B[3 + i] + mean[16 + i]
        inputs[6 + i] = 0.0
    return load_B


@njit(cache=True)
def predict(packed: Array, mean: Array, P: Array, wrench_B: Array, dt_s: float, noise: Array) -> None:
    """Advance mean and covariance in place by dt_s.

    `noise`, shape (6,), are spectral densities (amplitudes) of the errors of the modelled linear and angular
    acceleration, and of the random walks of force, moment, gyro bias and accelerometer bias.
    """
    inputs = np.empty(9)
    load_B = _inputs(mean, wrench_B, inputs)
    q = mean[3:7].copy()
    A, B = np.empty((MOVING, MOVING)), np.empty((MOVING, 6))
    rk4_jacobian_kernel(packed, mean[:13], inputs, dt_s, A, B)
    # F = [[A + dB, E], [0, 1]]: E takes force (from W to B) and moment to the motion; a turn of the body turns the
    # force that it sees by S(load_B).
    F = np.zeros((MOVING, 18))
    for i in range(MOVING):
        for j in range(MOVING):
            F[i, j] = A[i, j]
        b0, b1, b2 = B[i, 0], B[i, 1], B[i, 2]
        F[i, 3] += b1 * load_B[2] - b2 * load_B[1]
        F[i, 4] += b2 * load_B[0] - b0 * load_B[2]
        F[i, 5] += b0 * load_B[1] - b1 * load_B[0]
        row = turn(q, B[i, :3].copy(), 1.0)
        for j in range(3):
            F[i, 12 + j] = row[j]
            F[i, 15 + j] = B[i, 3 + j]
    top = np.zeros((MOVING, ERRORS))
    for i in range(MOVING):
        for k in range(18):
            f = F[i, k]
            if f != 0.0:
                for j in range(ERRORS):
                    top[i, j] += f * P[k, j]
    for i in range(MOVING):
        for j in range(i + 1):
            total = 0.0
            for k in range(18):
                total += top[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total
        for j in range(MOVING, ERRORS):
            P[i, j] = top[i, j]
            P[j, i] = top[i, j]
    _add_noise(P, q, dt_s, noise)


@njit(cache=True)
def _add_noise(P: Array, q: Array, dt_s: float, noise: Array) -> None:
    linear, angular = noise[0] ** 2, noise[1] ** 2
    for i in range(3):
        P[i, i] += linear * dt_s**3 / 3.0
        P[6 + i, 6 + i] += linear * dt_s
        P[3 + i, 3 + i] += angular * dt_s**3 / 3.0
        P[9 + i, 9 + i] += angular * dt_s
        P[3 + i, 9 + i] += angular * dt_s**2 / 2.0
        P[9 + i, 3 + i] += angular * dt_s**2 / 2.0
        axis = np.zeros(3)
        axis[i] = 1.0
        column = turn(q, axis, 1.0)  # the body's axis i, as the world sees it
        for j in range(3):
            P[j, 6 + i] += column[j] * linear * dt_s**2 / 2.0
            P[6 + i, j] += column[j] * linear * dt_s**2 / 2.0
    for block in range(4):
        for i in range(3):
            k = 12 + 3 * block + i
            P[k, k] += noise[2 + block] ** 2 * dt_s


@njit(cache=True)
def correct(mean: Array, P: Array, H: Array, residual: Array, R: Array, gate: float) -> float:
    """Kalman update in place by a measurement with rows H (m, 24), residual (m,) and covariance R (m, m).

    Returns the squared Mahalanobis distance of the residual; where it exceeds `gate` nothing is changed.
    """
    PH = P @ H.T
    S = H @ PH + R
    weighted = np.linalg.solve(S, residual)
    distance = np.dot(residual, weighted)
    if distance > gate:
        return distance
    change = PH @ weighted
    P -= PH @ np.linalg.solve(S, np.ascontiguousarray(PH.T))
    for i in range(ERRORS):
        for j in range(i):
            P[i, j] = 0.5 * (P[i, j] + P[j, i])
            P[j, i] = P[i, j]
    for i in range(3):
        mean[i] += change[i]
    mean[3:7] = turned_by(mean[3:7], change[3:6])
    for i in range(6):
        mean[7 + i] += change[6 + i]
    for i in range(12):
        mean[13 + i] += change[12 + i]
    return distance

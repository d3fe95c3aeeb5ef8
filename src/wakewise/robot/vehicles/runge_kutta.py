"""Compiled Runge-Kutta step of the motion, alone and with its derivatives.

Derivatives are by the error state (position, rotation vector, twist) and by the wrench: 12 + 6 columns, of which those
of position are known beforehand. They are carried through the stages side by side in a block of sixteen columns
(rotation vector 0-2, twist 3-8, wrench 9-14, the last one spare) by the exact chain rule of the step as coded.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.robot.vehicles.kernels import INVERSE, rate_jacobian_kernel, rate_kernel

COLUMNS = 16


@njit(apart=True)
def rk4_kernel(packed: Array, state: Array, inputs: Array, dt_s: float) -> None:
    """Advance `state`, shape (13,), in place by one classical Runge-Kutta step."""
    rk4_stages(packed, state, inputs, dt_s, np.empty((5, 13)))


@njit
def rk4_stages(packed: Array, state: Array, inputs: Array, dt_s: float, k: Array) -> None:
    """`rk4_kernel` with its work space, shape (5, 13), given: what steps many vehicles makes one for all of them."""
    rate_kernel(packed, state, inputs, k[0])
    for stage in range(1, 4):
        reach = dt_s if stage == 3 else 0.5 * dt_s
        for i in range(13):
            k[4, i] = state[i] + reach * k[stage - 1, i]
        rate_kernel(packed, k[4], inputs, k[stage])
    for i in range(13):
        state[i] += dt_s / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    normalise(state)


@njit(error_model="python")  # a quaternion of no length is an error, not NaN
def normalise(state: Array) -> float:
    """Give the quaternion of a state unit length and return the length that it had."""
    length = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2 + state[6] ** 2)
    for i in range(3, 7):
        state[i] /= length
    return length


@njit(apart=True)
def rk4_jacobian_kernel(packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array) -> None:
    """Advance `state` as `rk4_kernel` does; write the derivatives by state, A (12, 12), and by wrench, B (12, 6)."""
    k = np.empty((5, 13))
    F, W = np.zeros((13, 12)), np.zeros((6, 12))
    X, K = np.zeros((2, 10, COLUMNS)), np.empty((4, 13, COLUMNS))
    start, moved = X[0], X[1]
    w, x, y, z = 0.5 * state[3], 0.5 * state[4], 0.5 * state[5], 0.5 * state[6]
    # A turn by the rotation vector delta, expressed in B, changes q by q (0, delta) / 2.
    start[0, 0], start[0, 1], start[0, 2] = -x, -y, -z
    start[1, 0], start[1, 1], start[1, 2] = w, -z, y
    start[2, 0], start[2, 1], start[2, 2] = z, w, -x
    start[3, 0], start[3, 1], start[3, 2] = -y, x, w
    for i in range(6):
        start[4 + i, 3 + i] = 1.0

    rate_kernel(packed, state, inputs, k[0])
    rate_jacobian_kernel(packed, state, inputs, F, W)
    _propagate(packed, F, start, K[0])
    for stage in range(1, 4):
        reach = dt_s if stage == 3 else 0.5 * dt_s
        for i in range(13):
            k[4, i] = state[i] + reach * k[stage - 1, i]
        _move(start, reach, K[stage - 1], moved)
        rate_kernel(packed, k[4], inputs, k[stage])
        rate_jacobian_kernel(packed, k[4], inputs, F, W)
        _propagate(packed, F, moved, K[stage])

    for i in range(13):
        state[i] += dt_s / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    total = K[0]
    _combine(K[0], K[1], K[2], K[3], dt_s / 6.0, total)
    for i in range(10):
        for c in range(COLUMNS):
            total[3 + i, c] += start[i, c]
    _to_error_state(state, total, normalise(state), K[1], A, B)


@njit(apart=True)
def _propagate(packed: Array, F: Array, X: Array, K: Array) -> None:
    # Ten products written out: the compiler then works on neighbouring columns together, in a fixed order of sums.
    for i in range(13):
        f0, f1, f2, f3, f4 = F[i, 0], F[i, 1], F[i, 2], F[i, 3], F[i, 4]
        f5, f6, f7, f8, f9 = F[i, 5], F[i, 6], F[i, 7], F[i, 8], F[i, 9]
        for c in range(COLUMNS):
            K[i, c] = (
                f0 * X[0, c]
                + f1 * X[1, c]
                + f2 * X[2, c]
                + f3 * X[3, c]
                + f4 * X[4, c]
                + f5 * X[5, c]
                + f6 * X[6, c]
                + f7 * X[7, c]
                + f8 * X[8, c]
                + f9 * X[9, c]
            )
    for i in range(6):
        for j in range(6):
            K[7 + i, 9 + j] += packed[INVERSE + i, j]


@njit(inline="always")
def _move(start: Array, reach: float, K: Array, moved: Array) -> None:
    for i in range(10):
        for c in range(COLUMNS):
            moved[i, c] = start[i, c] + reach * K[3 + i, c]


@njit(inline="always")
def _combine(a: Array, b: Array, c: Array, d: Array, sixth: float, total: Array) -> None:
    for i in range(13):
        for k in range(COLUMNS):
            total[i, k] = sixth * (a[i, k] + 2.0 * b[i, k] + 2.0 * c[i, k] + d[i, k])


@njit(inline="always")
def _to_error_state(state: Array, total: Array, length: float, turn: Array, A: Array, B: Array) -> None:
    # A change dq of the quaternion before it was normalised turns the body by 2 vec(q^-1 dq) / |q|.
    scale = 2.0 / length
    w, x, y, z = scale * state[3], scale * state[4], scale * state[5], scale * state[6]
    for c in range(COLUMNS):
        a, b, d, e = total[3, c], total[4, c], total[5, c], total[6, c]
        turn[0, c] = w * b - x * a - y * e + z * d
        turn[1, c] = w * d + x * e - y * a - z * b
        turn[2, c] = w * e - x * d + y * b - z * a
    for i in range(12):
        source = total[i] if i < 3 else turn[i - 3] if i < 6 else total[i + 1]
        for c in range(3):
            A[i, c] = 1.0 if i == c else 0.0
        for c in range(9):
            A[i, 3 + c] = source[c]
        for c in range(6):
            B[i, c] = source[9 + c]

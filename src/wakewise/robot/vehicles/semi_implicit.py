"""Compiled semi-implicit step of the motion: damping and Coriolis implicit, attitude and weight explicit.

With nu_r the velocity relative to the water, Fossen's equations are quasi-linear,
M dnu_r/dt + N(nu_r) nu_r = tau - g(q) with N = C + D, and the current enters nowhere else. One step of length h, with
gamma = 1 - 1/sqrt(2):

1. half step by the linearly implicit Euler method: (M + h/2 N(nu_0)) nu_m = M nu_0 + h/2 (tau - g(q_0)), which gives
   the velocity nu_m and the attitude q_m at mid-step to first order;
2. full step of the linear equation with N(nu_m) and g(q_m) held, by the two-stage, stiffly accurate, L-stable
   diagonally implicit method of second order (Alexander 1977, doi 10.1137/0714068), both stages with one matrix;
3. position and attitude by that method's own mean of the velocity; the attitude by Cayley's map.

What is held at mid-step errs by odd powers of time only, so the step is of second order. C is skew and D has a
positive semidefinite symmetric part, so by von Neumann's theorem an A-stable method contracts the kinetic energy
nu_r' M nu_r where nothing else acts, whatever the length of the step; L-stable: a stiff motion dies within a step or
two instead of ringing. For the same reason M + h N can be factorised without pivoting (Golub and Van Loan, Matrix
Computations, 4th ed., section 4.3).
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.robot.vehicles.kernels import (
    COLUMNS,
    Six,
    Three,
    add_quasi_linear_change,
    quasi_linear,
    restoring,
    rotate,
    times,
)

GAMMA = 1.0 - np.sqrt(0.5)


@njit
def semi_implicit_kernel(
    packed: Array, state: Array, inputs: Array, dt_s: float, factors: Array, velocities: Array, turns: Array
) -> None:
    """Advance `state`, shape (13,), in place, and leave what the derivatives need.

    `factors`, shape (2, 6, 6): LU factors of half step and full step. `velocities`, shape (4, 6, 1): nu_r at the start,
    at mid-step, at the first stage and at the end. `turns`, shape (2, 4): quaternion at the start and at mid-step.
    """
    cx, cy, cz = inputs[6], inputs[7], inputs[8]
    w, x, y, z = state[3], state[4], state[5], state[6]
    turns[0, 0], turns[0, 1], turns[0, 2], turns[0, 3] = w, x, y, z
    b = rotate(-w, x, y, z, cx, cy, cz)
    n0 = (state[7] - b[0], state[8] - b[1], state[9] - b[2], state[10], state[11], state[12])
    start, middle, first, last = velocities[0], velocities[1], velocities[2], velocities[3]
    for i in range(6):
        start[i, 0] = n0[i]

    half, share = 0.5 * dt_s, GAMMA * dt_s
    _factorise(packed, n0, half, factors[0])
    h = times(packed, 0, n0)
    g = restoring(packed, rotate(-w, x, y, z, 0.0, 0.0, 1.0))
    for i in range(6):
        middle[i, 0] = h[i] + half * (inputs[i] + g[i])
    _solve(factors[0], middle)
    _turn(turns[0], half, middle[3, 0], middle[4, 0], middle[5, 0], turns[1])

    wm, xm, ym, zm = turns[1, 0], turns[1, 1], turns[1, 2], turns[1, 3]
    _factorise(packed, _six(middle), share, factors[1])
    g = restoring(packed, rotate(-wm, xm, ym, zm, 0.0, 0.0, 1.0))
    for i in range(6):
        first[i, 0] = h[i] + share * (inputs[i] + g[i])
    _solve(factors[1], first)
    for i in range(6):
        # nu_0 + (1 - gamma) h k_1, since the first stage is nu_0 + gamma h k_1 and (1 - gamma) / gamma = 1 + sqrt(2).
        last[i, 0] = start[i, 0] + (1.0 / GAMMA - 1.0) * (first[i, 0] - start[i, 0])
    h = times(packed, 0, _six(last))
    for i in range(6):
        last[i, 0] = h[i] + share * (inputs[i] + g[i])
    _solve(factors[1], last)

    m = _mean(first, last)
    dx, dy, dz = rotate(wm, xm, ym, zm, m[0], m[1], m[2])
    state[0] += dt_s * (dx + cx)
    state[1] += dt_s * (dy + cy)
    state[2] += dt_s * (dz + cz)
    _turn(turns[0], dt_s, m[3], m[4], m[5], state[3:7])
    b = rotate(-state[3], state[4], state[5], state[6], cx, cy, cz)
    for i in range(6):
        state[7 + i] = last[i, 0]
    for i in range(3):
        state[7 + i] += b[i]


@njit
def semi_implicit_jacobian_kernel(packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array) -> None:
    """Advance `state`; write the derivatives by error state, A (12, 12), and by wrench, B (12, 6).

    Columns as in `kernels.rk4_jacobian_kernel`: rotation vector 0-2, twist 3-8, wrench 9-14, one spare.
    """
    factors, velocities, turns = np.empty((2, 6, 6)), np.empty((4, 6, 1)), np.empty((2, 4))
    c0 = rotate(-state[3], state[4], state[5], state[6], inputs[6], inputs[7], inputs[8])
    semi_implicit_kernel(packed, state, inputs, dt_s, factors, velocities, turns)
    start, middle, first, last = _six(velocities[0]), _six(velocities[1]), _six(velocities[2]), _six(velocities[3])
    half, share = 0.5 * dt_s, GAMMA * dt_s

    blocks = np.zeros((5, 6, COLUMNS))
    d_start, d_middle, d_first, d_last, force = blocks[0], blocks[1], blocks[2], blocks[3], blocks[4]
    d_turn = np.zeros((3, 3, COLUMNS))
    turn_start, turn_middle, turn_end = d_turn[0], d_turn[1], d_turn[2]
    change = np.empty((6, 6))
    for i in range(6):
        d_start[i, 3 + i] = 1.0
    for i in range(3):
        turn_start[i, i] = 1.0
    _add_cross(d_start, -1.0, c0, turn_start)

    _force_change(packed, turns[0], turn_start, force)
    _add_product(packed[:6], d_start, 1.0, d_middle)
    _add_scaled(force, half, d_middle)
    change[:] = 0.0
    add_quasi_linear_change(packed, start, middle, half, change, 0)
    _add_product(change, d_start, -1.0, d_middle)
    _solve(factors[0], d_middle)
    _turn_change(half, middle, turn_start, d_middle, turn_middle)

    _force_change(packed, turns[1], turn_middle, force)
    _add_product(packed[:6], d_start, 1.0, d_first)
    _add_scaled(force, share, d_first)
    change[:] = 0.0
    add_quasi_linear_change(packed, middle, first, share, change, 0)
    _add_product(change, d_middle, -1.0, d_first)
    _solve(factors[1], d_first)

    outer = 1.0 / GAMMA - 1.0
    _add_product(packed[:6], d_start, 1.0 - outer, d_last)
    _add_product(packed[:6], d_first, outer, d_last)
    _add_scaled(force, share, d_last)
    change[:] = 0.0
    add_quasi_linear_change(packed, middle, last, share, change, 0)
    _add_product(change, d_middle, -1.0, d_last)
    _solve(factors[1], d_last)

    m = _mean(velocities[2], velocities[3])
    d_mean, moved = d_first, force
    for i in range(6):
        for k in range(COLUMNS):
            d_mean[i, k] = (1.0 - GAMMA) * d_first[i, k] + GAMMA * d_last[i, k]
            moved[i, k] = d_mean[i, k]
    _turn_change(dt_s, m, turn_start, d_mean, turn_end)
    _add_cross(moved, 1.0, (-m[0], -m[1], -m[2]), turn_middle)
    c1 = rotate(-state[3], state[4], state[5], state[6], inputs[6], inputs[7], inputs[8])
    _add_cross(d_last, 1.0, c1, turn_end)

    A[:] = 0.0
    w, x, y, z = turns[1, 0], turns[1, 1], turns[1, 2], turns[1, 3]
    for k in range(15):
        dx, dy, dz = rotate(w, x, y, z, moved[0, k], moved[1, k], moved[2, k])
        into, column = (A, 3 + k) if k < 9 else (B, k - 9)
        into[0, column], into[1, column], into[2, column] = dt_s * dx, dt_s * dy, dt_s * dz
        for i in range(3):
            into[3 + i, column] = turn_end[i, k]
        for i in range(6):
            into[6 + i, column] = d_last[i, k]
    for i in range(3):
        A[i, i] = 1.0


@njit
def _six(column: Array) -> Six:
    return column[0, 0], column[1, 0], column[2, 0], column[3, 0], column[4, 0], column[5, 0]


@njit
def _mean(first: Array, last: Array) -> Six:
    # The integral of the velocity over the step as the two stages give it, divided by the step.
    a, b = 1.0 - GAMMA, GAMMA
    return (
        a * first[0, 0] + b * last[0, 0],
        a * first[1, 0] + b * last[1, 0],
        a * first[2, 0] + b * last[2, 0],
        a * first[3, 0] + b * last[3, 0],
        a * first[4, 0] + b * last[4, 0],
        a * first[5, 0] + b * last[5, 0],
    )


@njit
def _factorise(packed: Array, n: Six, reach: float, LU: Array) -> None:
    # LU factors of M + reach N(n), in place.
    quasi_linear(packed, n, reach, LU, 0)
    for i in range(6):
        for j in range(6):
            LU[i, j] += packed[i, j]
    for k in range(6):
        for i in range(k + 1, 6):
            LU[i, k] /= LU[k, k]
            for j in range(k + 1, 6):
                LU[i, j] -= LU[i, k] * LU[k, j]


@njit
def _solve(LU: Array, X: Array) -> None:
    for i in range(6):
        for j in range(i):
            for k in range(X.shape[1]):
                X[i, k] -= LU[i, j] * X[j, k]
    for i in range(5, -1, -1):
        for j in range(i + 1, 6):
            for k in range(X.shape[1]):
                X[i, k] -= LU[i, j] * X[j, k]
        for k in range(X.shape[1]):
            X[i, k] /= LU[i, i]


@njit
def _turn(q: Array, dt_s: float, p: float, s: float, r: float, turned: Array) -> None:
    # Cayley's map: q (1, omega dt / 2), normalised; equal to the exponential map to second order.
    w, x, y, z = q[0], q[1], q[2], q[3]
    a, b, c = 0.5 * dt_s * p, 0.5 * dt_s * s, 0.5 * dt_s * r
    dw, dx = w - x * a - y * b - z * c, x + w * a + y * c - z * b
    dy, dz = y + w * b - x * c + z * a, z + w * c + x * b - y * a
    length = np.sqrt(dw * dw + dx * dx + dy * dy + dz * dz)
    turned[0], turned[1], turned[2], turned[3] = dw / length, dx / length, dy / length, dz / length


@njit
def _turn_change(dt_s: float, n: Six, before: Array, d_velocity: Array, after: Array) -> None:
    # With a = omega dt / 2: R(a)' delta + 2 / (1 + a'a) (I - S(a)) da, all expressed in the body.
    a, b, c = 0.5 * dt_s * n[3], 0.5 * dt_s * n[4], 0.5 * dt_s * n[5]
    square = 1.0 + a * a + b * b + c * c
    length, scale = np.sqrt(square), dt_s / square
    w, x, y, z = 1.0 / length, a / length, b / length, c / length
    for k in range(COLUMNS):
        rx, ry, rz = rotate(-w, x, y, z, before[0, k], before[1, k], before[2, k])
        dx, dy, dz = d_velocity[3, k], d_velocity[4, k], d_velocity[5, k]
        after[0, k] = rx + scale * (dx - b * dz + c * dy)
        after[1, k] = ry + scale * (dy - c * dx + a * dz)
        after[2, k] = rz + scale * (dz - a * dy + b * dx)


@njit
def _force_change(packed: Array, q: Array, turn: Array, force: Array) -> None:
    # Wrench and restoring wrench; the world's down axis in B changes by down x delta.
    x, y, z = rotate(-q[0], q[1], q[2], q[3], 0.0, 0.0, 1.0)
    for k in range(COLUMNS):
        a, b, c = turn[0, k], turn[1, k], turn[2, k]
        g = restoring(packed, (y * c - z * b, z * a - x * c, x * b - y * a))
        for i in range(6):
            force[i, k] = g[i]
    for i in range(6):
        force[i, 9 + i] += 1.0


@njit
def _add_cross(block: Array, scale: float, v: Three, turn: Array) -> None:
    x, y, z = v
    for k in range(COLUMNS):
        a, b, c = turn[0, k], turn[1, k], turn[2, k]
        block[0, k] += scale * (y * c - z * b)
        block[1, k] += scale * (z * a - x * c)
        block[2, k] += scale * (x * b - y * a)


@njit
def _add_product(matrix: Array, X: Array, scale: float, Y: Array) -> None:
    for i in range(6):
        for j in range(6):
            for k in range(COLUMNS):
                Y[i, k] += scale * matrix[i, j] * X[j, k]


@njit
def _add_scaled(X: Array, scale: float, Y: Array) -> None:
    for i in range(6):
        for k in range(COLUMNS):
            Y[i, k] += scale * X[i, k]

"""Compiled: D at given thrusts and pose, with its gradient and its Gauss-Newton matrix, for `gradients`.

A planner asks `plan_disturbance`, which is held against this in the tests.

Variables, in this order: position of the body in W, shape (3,), its rotation vector on the body's side
(R_WB exp([theta])), shape (3,), and the m thrusts. With residuals r = sqrt(w) v (coherent: three components of the
summed velocity at every point; incoherent: the speed of every jet at every point), D = r'r, its gradient is 2 J'r and
the Gauss-Newton matrix 2 J'J.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.jit.njit import njit
from wakewise.wake.gram import BLOCK, FAST, check_jets, dot, fill_rows, load_block, place, pose_slopes
from wakewise.wake.kernels import as_tuple, own_constants


@njit
def smooth_root(thrust, smooth):  # type: ignore[no-untyped-def]
    """Root of the part of a thrust above zero, and its derivative: see `wakewise.wake.disturbance_derivatives`."""
    if smooth == 0.0:
        if thrust <= 0.0:
            return 0.0, 0.0
        root = np.sqrt(thrust)
        return root, 0.5 / root
    half = 0.5 * smooth
    length = np.sqrt(thrust * thrust + half * half)
    # For thrust << 0, (T + |T|) / 2 would cancel; this form of the same does not.
    above = 0.5 * (thrust + length) if thrust > 0.0 else 0.5 * half * half / (length - thrust)
    square = thrust * thrust + smooth * smooth
    quarter = np.sqrt(np.sqrt(square))
    root = above / quarter
    return root, (above / length) / quarter - 0.5 * root * thrust / square


@njit(apart=True)
def thrust_roots(thrusts, smooth):  # type: ignore[no-untyped-def]
    """Roots s of the 2 m split thrusts, and the derivative of each by its own signed thrust."""
    m = thrusts.shape[0]
    root, slope = np.empty(2 * m), np.empty(2 * m)
    for i in range(m):
        root[i], slope[i] = smooth_root(thrusts[i], smooth)
        root[m + i], against = smooth_root(-thrusts[i], smooth)
        slope[m + i] = -against
    return root, slope


@njit(fastmath=FAST)
def stage_sum(  # type: ignore[no-untyped-def]
    points, weights, p, q, positions_B, axes_B, areas, kind, parameters, thrusts, smooth, coherent, hessian
):
    """D, gradient (6 + m,), Gauss-Newton matrix (6 + m, 6 + m) (zeros unless `hessian`), and the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    root, root_slope = thrust_roots(thrusts, smooth)
    D, check = 0.0, check_jets(p, q, origins, axes, areas)
    gradient, H = np.zeros(6 + m), np.zeros((6 + m, 6 + m))
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    # Rows 0 to 5 pose, then thrusts, last the residual itself; three components for the coherent sum.
    J = np.empty((7 + m, 3, BLOCK))
    active = np.empty(7 + m, np.bool_)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        filled = fill_rows(block, count, origins, axes, own, kind, numbers, True, scratch, hits, rows, column)
        if coherent:
            active[:] = False
            active[:6] = True
            active[6 + m] = True
            J[:6, :, :count] = 0.0
            J[6 + m, :, :count] = 0.0
        for c in range(filled):
            k = column[c]
            i = k if k < m else k - m
            s, ds = root[k], root_slope[k]
            if s == 0.0 and ds == 0.0:
                continue
            sign = 1.0 if k >= m else -1.0
            pose_slopes(block, count, p, origins[i], axes[i], sign, rows[1, c], rows[2, c], slope)
            speed = rows[0, c]
            if coherent:
                if not active[6 + i]:
                    active[6 + i] = True
                    J[6 + i, :, :count] = 0.0
                for x in range(3):
                    d = sign * axes[i, x]
                    for r in range(6):
                        for j in range(count):
                            J[r, x, j] += s * d * slope[r, j]
                    for j in range(count):
                        J[6 + i, x, j] += ds * d * speed[j]
                        J[6 + m, x, j] += s * d * speed[j]
            else:
                own_square = dot(speed, speed, count)
                D += s * s * own_square
                gradient[6 + i] += 2.0 * s * ds * own_square
                H[6 + i, 6 + i] += 2.0 * ds * ds * own_square
                for r in range(6):
                    mixed = dot(slope[r], speed, count)
                    gradient[r] += 2.0 * s * s * mixed
                    if hessian:
                        H[6 + i, r] += 2.0 * s * ds * mixed
                        for t in range(r + 1):
                            H[r, t] += 2.0 * s * s * dot(slope[r], slope[t], count)
        if coherent:
            last = J[6 + m]
            for x in range(3):
                D += dot(last[x], last[x], count)
            for r in range(6 + m):
                if active[r]:
                    for x in range(3):
                        gradient[r] += 2.0 * dot(J[r, x], last[x], count)
                        if hessian:
                            for t in range(r + 1):
                                if active[t]:
                                    H[r, t] += 2.0 * dot(J[r, x], J[t, x], count)
    if hessian:
        turn_hessian(R, H)
    turn_gradient(R, gradient)
    return D, gradient, H, check


@njit(apart=True)
def turn_gradient(R, gradient):  # type: ignore[no-untyped-def]
    """Take elements 3 to 5 from W to B axes."""
    a, b, c = gradient[3], gradient[4], gradient[5]
    for r in range(3):
        gradient[3 + r] = R[0, r] * a + R[1, r] * b + R[2, r] * c


@njit(apart=True)
def turn_hessian(R, H):  # type: ignore[no-untyped-def]
    """Fill the upper triangle of H from the lower, and take rows and columns 3 to 5 from W to B axes."""
    size = H.shape[0]
    for r in range(size):
        for t in range(r):
            H[t, r] = H[r, t]
    for r in range(size):
        a, b, c = H[r, 3], H[r, 4], H[r, 5]
        for t in range(3):
            H[r, 3 + t] = a * R[0, t] + b * R[1, t] + c * R[2, t]
    for r in range(size):
        a, b, c = H[3, r], H[4, r], H[5, r]
        for t in range(3):
            H[3 + t, r] = a * R[0, t] + b * R[1, t] + c * R[2, t]
    for r in range(size):
        for t in range(r):
            H[t, r] = H[r, t]

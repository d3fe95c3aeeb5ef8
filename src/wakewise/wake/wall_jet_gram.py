"""Compiled sums over a region's points with wall jets: `sums` and `stage` again, for velocities of any direction."""

from __future__ import annotations

import numpy as np

from wakewise.core.jit.njit import assign, njit
from wakewise.wake.gram import BLOCK, FAST, check_jets, dot, load_block, place
from wakewise.wake.kernels import as_tuple, own_constants
from wakewise.wake.stage_cost import thrust_roots, turn_gradient, turn_hessian
from wakewise.wake.wall_jet import fill_velocities


@njit(fastmath=FAST)
def floor_gram_sum(points, weights, p, q, positions_B, axes_B, areas, kind, parameters, floor, slopes):  # type: ignore[no-untyped-def]
    """G, (2 m, 2 m), dG by position in W and rotation vector in B, (6, 2 m, 2 m) (zeros unless `slopes`), the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    V, dV = np.empty((2 * m, 3, BLOCK)), np.empty((2 * m, 6, 3, BLOCK))
    G, dG = np.zeros((2 * m, 2 * m)), np.zeros((6, 2 * m, 2 * m))
    check = check_jets(p, q, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        fill_velocities(
            block, count, p, origins, axes, areas, own, kind, numbers, floor, scratch, hits, rows, column, slope, V, dV
        )
        for a in range(2 * m):
            for c in range(a + 1):
                for x in range(3):
                    G[a, c] += dot(V[a, x], V[c, x], count)
                    if slopes:
                        for r in range(6):
                            dG[r, a, c] += dot(dV[a, r, x], V[c, x], count) + dot(V[a, x], dV[c, r, x], count)
    for a in range(2 * m):
        for c in range(a + 1):
            turn = np.zeros(3)
            for r in range(3):
                for row in range(3):
                    turn[r] += R[row, r] * dG[3 + row, a, c]
            assign(dG[3:, a, c], turn)
            G[c, a] = G[a, c]
            assign(dG[:, c, a], dG[:, a, c])
    return G, dG, check


@njit(apart=True, fastmath=FAST)
def floor_stage_sum(  # type: ignore[no-untyped-def]
    points, weights, p, q, positions_B, axes_B, areas, kind, parameters, floor, thrusts, smooth, coherent, hessian
):
    """D, gradient (6 + m,), Gauss-Newton matrix (6 + m, 6 + m) (zeros unless `hessian`), and the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    root, root_slope = thrust_roots(thrusts, smooth)
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    V, dV = np.empty((2 * m, 3, BLOCK)), np.empty((2 * m, 6, 3, BLOCK))
    # One residual vector for the coherent sum, one for every jet for the incoherent.
    J = np.empty((7 + m, 3, BLOCK))
    D, gradient, H = 0.0, np.zeros(6 + m), np.zeros((6 + m, 6 + m))
    check = check_jets(p, q, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        fill_velocities(
            block, count, p, origins, axes, areas, own, kind, numbers, floor, scratch, hits, rows, column, slope, V, dV
        )
        J[:, :, :count] = 0.0
        for k in range(2 * m):
            i = k if k < m else k - m
            s, ds = root[k], root_slope[k]
            if s == 0.0 and ds == 0.0:
                continue
            if not coherent:
                J[:, :, :count] = 0.0
            for x in range(3):
                for j in range(count):
                    J[6 + m, x, j] += s * V[k, x, j]
                    J[6 + i, x, j] += ds * V[k, x, j]
                for r in range(6):
                    for j in range(count):
                        J[r, x, j] += s * dV[k, r, x, j]
            if not coherent:
                D += _add_products(J, m, count, gradient, H, hessian)
        if coherent:
            D += _add_products(J, m, count, gradient, H, hessian)
    if hessian:
        turn_hessian(R, H)
    turn_gradient(R, gradient)
    return D, gradient, H, check


@njit(apart=True, fastmath=FAST)
def _add_products(J, m, count, gradient, H, hessian):  # type: ignore[no-untyped-def]
    """Add 2 J'r to the gradient and 2 J'J to the lower triangle of H, r being the last row of J; returns r'r."""
    square = 0.0
    for x in range(3):
        square += dot(J[6 + m, x], J[6 + m, x], count)
        for r in range(6 + m):
            gradient[r] += 2.0 * dot(J[r, x], J[6 + m, x], count)
            if hessian:
                for t in range(r + 1):
                    H[r, t] += 2.0 * dot(J[r, x], J[t, x], count)
    return square

"""Compiled: from derivatives stage by stage to one gradient and one Hessian by the commands, shape (N n, N n).

The Hessian is that of the stage blocks carried through the linearised motion and the thrusters' lag, lower triangle
only: rows of stage k need columns of stages up to k, so W_k = d(gradient by x_k)/du is carried backwards for these
columns alone. Every inner loop runs along a contiguous row. About 0.65 million multiplications for 20 stages and 8
thrusters. The position columns of A are those of the identity, and the cost's blocks are dense in pose and thrust only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, njit
from wakewise.planning.kernels import RATE_N, RHO, W_CHANGE, W_EFFORT, W_TWIST

FAST = {"reassoc", "contract", "nsz", "arcp"}


class Condensed(NamedTuple):
    """H : (N n, N n), lower triangle (and the blocks on the diagonal); g : (N n,); the rest is room to work in."""

    H: Array
    g: Array
    G: Array
    W: Array
    next_W: Array
    V: Array
    lag: Array


def condensed_room(stages: int, thrusters: int) -> Condensed:
    """Room for a condensed problem."""
    size = stages * thrusters
    return Condensed(
        H=np.zeros((size, size)),
        g=np.zeros(size),
        G=np.zeros((stages + 1, 12, size)),
        W=np.zeros((12, size)),
        next_W=np.zeros((12, size)),
        V=np.zeros((thrusters, size)),
        lag=np.zeros((thrusters, size)),
    )


@njit(apart=True, fastmath=FAST)
def _mix6(out, c0, c1, c2, c3, c4, c5, X, first, count):  # type: ignore[no-untyped-def]
    """Add six multiples of rows of X, from row `first` on, to `out`."""
    a, b, c = X[first], X[first + 1], X[first + 2]
    d, e, f = X[first + 3], X[first + 4], X[first + 5]
    for j in range(count):
        out[j] += c0 * a[j] + c1 * b[j] + c2 * c[j] + c3 * d[j] + c4 * e[j] + c5 * f[j]


@njit(apart=True, fastmath=FAST)
def _mix3(out, c0, c1, c2, X, first, count):  # type: ignore[no-untyped-def]
    a, b, c = X[first], X[first + 1], X[first + 2]
    for j in range(count):
        out[j] += c0 * a[j] + c1 * b[j] + c2 * c[j]


@njit(fastmath=FAST)
def condense(table, work, room):  # type: ignore[no-untyped-def]
    """Fill room.H (lower) and room.g from the stage blocks of `work`; commands' own cost is added by `add_commands`."""
    N, n = work.T.shape
    G, W, fresh, V, lag = room.G, room.W, room.next_W, room.V, room.lag
    A, B, M = work.A, work.B, table.mean_map
    for k in range(N):
        done = n * k
        for r in range(12):
            row = G[k + 1, r]
            for j in range(done):
                row[j] = G[k, r, j] if r < 3 else 0.0
            for j in range(done, done + n):
                row[j] = 0.0
            a = A[k, r]
            if done:
                _mix3(row, a[3], a[4], a[5], G[k], 3, done)
                _mix6(row, a[6], a[7], a[8], a[9], a[10], a[11], G[k], 6, done)
            b = B[k, r]
            for s in range(k + 1):
                for i in range(n):
                    row[s * n + i] += b[i] * M[k, s * n + i]
    twist = 2.0 * table.stage_s * table.weights[W_TWIST]
    lag[:, :] = 0.0
    for k in range(N, -1, -1):
        # fresh = W_k for columns of stages before k, with W = W_k+1 for columns up to k.
        if k < N:
            count = n * (k + 1)
            b = B[k]
            for i in range(n):
                row = V[i]
                for j in range(count):
                    row[j] = 0.0
                _mix6(row, b[0, i], b[1, i], b[2, i], b[3, i], b[4, i], b[5, i], W, 0, count)
                _mix6(row, b[6, i], b[7, i], b[8, i], b[9, i], b[10, i], b[11, i], W, 6, count)
                s = work.S[k, i]
                if k:
                    _mix6(row, s[0], s[1], s[2], s[3], s[4], s[5], G[k], 0, n * k)
                curved = work.R[k, i]
                for t in range(k + 1):
                    for c in range(n):
                        row[t * n + c] += curved[c] * M[k, t * n + c]
                mean, keep = table.mean[i], table.keep[i]
                out, memory = room.H[n * k + i], lag[i]
                for j in range(count):
                    out[j] = (1.0 - mean) * row[j] + (1.0 - keep) * memory[j]
                    memory[j] = keep * memory[j] + mean * row[j]
        if k == 0:
            break
        count = n * k
        for r in range(12):
            row = fresh[r]
            if r < 6:
                q = work.Q[k, r]
                for j in range(count):
                    row[j] = 0.0
                _mix6(row, q[0], q[1], q[2], q[3], q[4], q[5], G[k], 0, count)
                if k < N:
                    for t in range(k):
                        for i in range(n):
                            row[t * n + i] += work.S[k, i, r] * M[k, t * n + i]
            else:
                for j in range(count):
                    row[j] = twist * G[k, r, j]
            if k < N:
                a = A[k]
                if r < 3:
                    for j in range(count):
                        row[j] += W[r, j]
                else:
                    _mix6(row, a[0, r], a[1, r], a[2, r], a[3, r], a[4, r], a[5, r], W, 0, count)
                    _mix6(row, a[6, r], a[7, r], a[8, r], a[9, r], a[10, r], a[11, r], W, 6, count)
        for r in range(12):
            for j in range(count):
                W[r, j] = fresh[r, j]
    motion_gradient(table, work, room.g)


@njit(apart=True)
def motion_gradient(table, work, g):  # type: ignore[no-untyped-def]
    """Exact gradient by the commands, backwards through motion and lag."""
    N, n = work.T.shape
    costate, fresh, memory = work.gx[N].copy(), np.empty(12), np.zeros(n)
    for k in range(N - 1, -1, -1):
        for i in range(n):
            by_thrust = work.gT[k, i]
            for r in range(12):
                by_thrust += work.B[k, r, i] * costate[r]
            g[k * n + i] = (1.0 - table.mean[i]) * by_thrust + (1.0 - table.keep[i]) * memory[i]
            memory[i] = table.keep[i] * memory[i] + table.mean[i] * by_thrust
        for c in range(12):
            fresh[c] = work.gx[k, c]
            for r in range(12):
                fresh[c] += work.A[k, r, c] * costate[r]
        assign(costate, fresh)


@njit
def add_commands(table, before, U, room, steps):  # type: ignore[no-untyped-def]
    """Add effort and change to the condensed problem; `steps`, (N n,), takes u_k - u_k-1.

    The excess of rate is left to the quadratic problem (`qp`): a hinge that is slack at U may not be slack after the
    step.
    """
    N, n = U.shape
    H, g, weights = room.H, room.g, table.weights
    effort = 2.0 * table.stage_s * weights[W_EFFORT]
    curvature = 2.0 * weights[W_CHANGE]
    for k in range(N):
        for i in range(n):
            here = k * n + i
            step = U[k, i] - (before[i] if k == 0 else U[k - 1, i])
            steps[here] = step
            g[here] += effort * U[k, i] + curvature * step
            H[here, here] += effort + curvature + 1e-9
            if k > 0 and curvature > 0.0:
                g[here - n] -= curvature * step
                H[here - n, here - n] += curvature
                H[here, here - n] -= curvature


@njit
def add_rate_gradient(table, steps, n, g):  # type: ignore[no-untyped-def]
    """Add the gradient of the excess of rate."""
    for here in range(steps.shape[0]):
        over = abs(steps[here]) - table.weights[RATE_N]
        if over > 0.0:
            slope = 2.0 * table.weights[RHO] * (over if steps[here] > 0.0 else -over)
            g[here] += slope
            if here >= n:
                g[here - n] -= slope

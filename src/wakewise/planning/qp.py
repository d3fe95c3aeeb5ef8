"""The quadratic program (QP) of one MPC iteration, condensed and solved: min 1/2 z'Hz + g'z + rho sum max(0, |s + E z|
- r)^2 within bounds, dense.

s are the changes of the commands from stage to stage, E takes their differences, r is the soft limit of rate. Given
which of its hinges are open the problem is quadratic; they are found by solving again until none changes (a
semismooth Newton method: L. Qi and J. Sun, Mathematical Programming 58 (1993) 353, doi 10.1007/BF01581275), two or
three times as a rule.

Thrust limits of tens of newtons are rarely met while hovering near a coral, so the unconstrained minimum is tried
first: where it lies within bounds it is the answer. Otherwise DAQP (D. Arnstrom, A. Bemporad, D. Axehill, IEEE
Trans. Automatic Control 67 (2022) 4362, doi 10.1109/TAC.2022.3176430), a dual active-set method, starts from the
active set of the last problem; its time grows with the number of active bounds, so with many of them, or when it
fails, PIQP's interior point method answers (R. Schwan et al., CDC 2023, doi 10.1109/CDC49753.2023.10383915).

Condensing turns derivatives stage by stage into one gradient and one Hessian by the commands, shape (N n, N n). The
Hessian is that of the stage blocks carried through the linearised motion and the thrusters' lag, lower triangle
only: rows of stage k need columns of stages up to k, so W_k = d(gradient by x_k)/du is carried backwards for these
columns alone. Every inner loop runs along a contiguous row. About 0.65 million multiplications for 20 stages and 8
thrusters. The position columns of A are those of the identity, and the cost's blocks are dense in pose and thrust only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import daqp
import numpy as np
import piqp

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, njit
from wakewise.planning.kernels import RATE_N, RHO, W_CHANGE, W_EFFORT, W_TWIST, PlanTable, PlanWork

FAST = {"reassoc", "contract", "nsz", "arcp"}
MANY_ACTIVE = 60
"""Active bounds of the last problem above which the interior-point method goes first."""
_PANEL = 8
HINGE_ROUNDS = 8
"""Most quadratic problems per answer; the line search on the true cost takes care of what is left."""


@njit(fastmath=FAST)
def factor(H: Array, L: Array) -> bool:
    """L, lower triangular, with H = L'L, from the lower triangle of H; False if H is not positive definite.

    Variables are eliminated from the last to the first, so that all work runs along rows of the lower triangle.
    """
    size = H.shape[0]
    for i in range(size):
        for j in range(i + 1):
            L[i, j] = H[i, j]
    end = size
    while end > 0:
        start = max(end - _PANEL, 0)
        for m in range(end - 1, start - 1, -1):
            if not L[m, m] > 0.0:
                return False
            pivot = np.sqrt(L[m, m])
            row = L[m]
            inverse = 1.0 / pivot
            for j in range(m):
                row[j] *= inverse
            row[m] = pivot
            for i in range(start, m):
                share, target = row[i], L[i]
                for j in range(i + 1):
                    target[j] -= share * row[j]
        if end - start == _PANEL:
            a, b, c, d = L[start], L[start + 1], L[start + 2], L[start + 3]
            e, f, g, h = L[start + 4], L[start + 5], L[start + 6], L[start + 7]
            for i in range(start):
                s0, s1, s2, s3, s4, s5, s6, s7 = a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]
                target = L[i]
                for j in range(i + 1):
                    target[j] -= (
                        s0 * a[j] + s1 * b[j] + s2 * c[j] + s3 * d[j] + s4 * e[j] + s5 * f[j] + s6 * g[j] + s7 * h[j]
                    )
        else:
            for m in range(start, end):
                row = L[m]
                for i in range(start):
                    share, target = row[i], L[i]
                    for j in range(i + 1):
                        target[j] -= share * row[j]
        end = start
    return True


@njit(fastmath=FAST)
def newton(L: Array, g: Array, z: Array) -> None:
    """Z = -H^-1 g from H = L'L."""
    size = g.shape[0]
    for i in range(size):
        z[i] = -g[i]
    for m in range(size - 1, -1, -1):
        z[m] /= L[m, m]
        share, row = z[m], L[m]
        for i in range(m):
            z[i] -= share * row[i]
    for m in range(size):
        row, total = L[m], z[m]
        for i in range(m):
            total -= row[i] * z[i]
        z[m] = total / row[m]


@njit
def mirror(H: Array, full: Array) -> None:
    """Copy the lower triangle of H to both triangles of `full`."""
    for i in range(H.shape[0]):
        for j in range(i + 1):
            full[i, j] = H[i, j]
            full[j, i] = H[i, j]


@njit
def inside(z: Array, low: Array, high: Array) -> bool:
    """Whether z keeps its bounds."""
    kept = True
    for i in range(z.shape[0]):
        kept = kept and low[i] <= z[i] <= high[i]
    return kept


@njit
def open_hinges(z: Array, steps: Array, n: int, limit: float, state: IntArray) -> bool:
    """Set `state` to the sign of each hinge that is open at z, else 0; True if any changed."""
    changed = False
    for i in range(z.shape[0]):
        step = steps[i] + z[i] - (z[i - n] if i >= n else 0.0)
        now = 1 if step > limit else (-1 if step < -limit else 0)
        changed = changed or now != state[i]
        state[i] = now
    return changed


@njit
def with_hinges(
    H: Array, g: Array, steps: Array, n: int, limit: float, rho: float, state: IntArray, H_out: Array, g_out: Array
) -> float:
    """Lower triangle and gradient of the problem with these hinges open; returns its constant."""
    constant = 0.0
    for i in range(H.shape[0]):
        for j in range(i + 1):
            H_out[i, j] = H[i, j]
        g_out[i] = g[i]
    for i in range(H.shape[0]):
        if state[i] != 0:
            over = state[i] * steps[i] - limit
            constant += rho * over * over
            slope = 2.0 * rho * over * state[i]
            g_out[i] += slope
            H_out[i, i] += 2.0 * rho
            if i >= n:
                g_out[i - n] -= slope
                H_out[i - n, i - n] += 2.0 * rho
                H_out[i, i - n] -= 2.0 * rho
    return constant


@njit(fastmath=FAST)
def model_value(H: Array, g: Array, z: Array) -> float:
    """G'z + 1/2 z'Hz from the lower triangle of H."""
    total = 0.0
    for i in range(z.shape[0]):
        row, across = H[i], 0.0
        for j in range(i):
            across += row[j] * z[j]
        total += z[i] * (g[i] + across + 0.5 * row[i] * z[i])
    return total


@dataclass(frozen=True, eq=False)
class BoxAnswer:
    """z, shape (n,); which solver found it; how many bounds are active; whether it is a solution; how much it
    promises.
    """

    z: Array
    solver: str
    active: int
    solved: bool
    promise: float = 0.0


class BoxQP:
    """Solves one problem after another of the same size and keeps the active set in between."""

    def __init__(self, size: int, thrusters: int, limit_N: float, rho: float) -> None:
        self._n, self._limit, self._rho = thrusters, limit_N, rho
        self._L, self._H, self._full = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
        self._g, self._z, self._zero = np.zeros(size), np.zeros(size), np.zeros(size)
        self._state = np.zeros(size, dtype=np.int64)
        self._sense = np.zeros(size, dtype=np.int32)
        self._rows = np.zeros((0, size))
        self._active = 0
        self._daqp: daqp.Model | None = None
        self._piqp: piqp.DenseSolver | None = None

    def forget(self) -> None:
        """Drop the active set."""
        self._sense[:] = 0
        self._active = 0

    def solve(self, H: Array, g: Array, low: Array, high: Array, steps: Array) -> BoxAnswer:
        """Solve with the lower triangle of H, shape (n, n), and g, low, high and steps, shape (n,)."""
        hinge = (steps, self._n, self._limit)
        open_hinges(self._zero, *hinge, self._state)
        before = with_hinges(H, g, *hinge, self._rho, self._state, self._H, self._g)
        constant = before
        answer = BoxAnswer(self._zero, "none", 0, False)
        for _ in range(HINGE_ROUNDS):
            answer = self._quadratic(low, high)
            if not answer.solved or not open_hinges(answer.z, *hinge, self._state):
                break
            constant = with_hinges(H, g, *hinge, self._rho, self._state, self._H, self._g)
        if not answer.solved:
            return answer
        promise = before - constant - model_value(self._H, self._g, answer.z)
        return replace(answer, promise=float(promise))

    def _quadratic(self, low: Array, high: Array) -> BoxAnswer:
        """Solve the problem with the hinges as they stand."""
        if not factor(self._H, self._L):
            return BoxAnswer(self._zero, "not convex", 0, False)
        newton(self._L, self._g, self._z)
        if inside(self._z, low, high):
            self.forget()
            return BoxAnswer(self._z, "newton", 0, True)
        mirror(self._H, self._full)
        if self._active <= MANY_ACTIVE:
            z, flag = self._by_daqp(self._g, low, high)
            if flag > 0 and np.isfinite(z).all():
                return self._kept(z, low, high, "daqp")
        z, solved = self._by_piqp(self._g, low, high)
        return self._kept(z, low, high, "piqp") if solved else BoxAnswer(self._zero, "piqp", 0, False)

    def _by_daqp(self, g: Array, low: Array, high: Array) -> tuple[Array, int]:
        if self._daqp is None:
            self._daqp = daqp.Model()
            self._daqp.setup(self._full, g, self._rows, high, low, self._sense)
            self._daqp.settings = {"iter_limit": 600}
        else:
            self._daqp.update(H=self._full, f=g, bupper=high, blower=low, sense=self._sense)
        z, _, flag, _ = self._daqp.solve()
        return z, flag

    def _by_piqp(self, g: Array, low: Array, high: Array) -> tuple[Array, bool]:
        if self._piqp is None:
            self._piqp = piqp.DenseSolver()
            self._piqp.settings.verbose = False
            self._piqp.settings.eps_abs = self._piqp.settings.eps_rel = 1e-6
            self._piqp.setup(self._full, g, None, None, None, None, None, low, high)
        else:
            self._piqp.update(P=self._full, c=g, x_l=low, x_u=high)
        solved = self._piqp.solve() == piqp.PIQP_SOLVED
        return np.clip(self._piqp.result.x, low, high), solved

    def _kept(self, z: Array, low: Array, high: Array, solver: str) -> BoxAnswer:
        tight = 1e-7 * (high - low)
        upper, lower = z >= high - tight, z <= low + tight
        # DAQP's flags: 1 starts a constraint active, 2 means at its lower bound.
        self._sense[:] = np.where(upper, 1, np.where(lower, 3, 0))
        self._active = int(upper.sum() + lower.sum())
        return BoxAnswer(z, solver, self._active, True)


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
def _mix6(
    out: Array, c0: float, c1: float, c2: float, c3: float, c4: float, c5: float, X: Array, first: int, count: int
) -> None:
    """Add six multiples of rows of X, from row `first` on, to `out`."""
    a, b, c = X[first], X[first + 1], X[first + 2]
    d, e, f = X[first + 3], X[first + 4], X[first + 5]
    for j in range(count):
        out[j] += c0 * a[j] + c1 * b[j] + c2 * c[j] + c3 * d[j] + c4 * e[j] + c5 * f[j]


@njit(apart=True, fastmath=FAST)
def _mix3(out: Array, c0: float, c1: float, c2: float, X: Array, first: int, count: int) -> None:
    a, b, c = X[first], X[first + 1], X[first + 2]
    for j in range(count):
        out[j] += c0 * a[j] + c1 * b[j] + c2 * c[j]


@njit(fastmath=FAST)
def condense(table: PlanTable, work: PlanWork, room: Condensed) -> None:
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
def motion_gradient(table: PlanTable, work: PlanWork, g: Array) -> None:
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
def add_commands(table: PlanTable, before: Array, U: Array, room: Condensed, steps: Array) -> None:
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
def add_rate_gradient(table: PlanTable, steps: Array, n: int, g: Array) -> None:
    """Add the gradient of the excess of rate."""
    for here in range(steps.shape[0]):
        over = abs(steps[here]) - table.weights[RATE_N]
        if over > 0.0:
            slope = 2.0 * table.weights[RHO] * (over if steps[here] > 0.0 else -over)
            g[here] += slope
            if here >= n:
                g[here - n] -= slope

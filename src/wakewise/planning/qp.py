"""The planner's quadratic problem: min 1/2 z'Hz + g'z + rho sum max(0, |s + E z| - r)^2 within bounds, dense.

s are the changes of the commands from stage to stage, E takes their differences, r is the soft limit of rate. Given
which of its hinges are open the problem is quadratic; they are found by solving again until none changes (a
semismooth Newton method: L. Qi and J. Sun, Mathematical Programming 58 (1993) 353, doi 10.1007/BF01581275), two or
three times as a rule.

Thrust limits of tens of newtons are rarely met while hovering near a coral, so the unconstrained minimum is tried
first: where it lies within bounds it is the answer. Otherwise DAQP (D. Arnstrom, A. Bemporad, D. Axehill, IEEE
Trans. Automatic Control 67 (2022) 4362, doi 10.1109/TAC.2022.3176430), a dual active-set method, starts from the
active set of the last problem; its time grows with the number of active bounds, so with many of them, or when it
fails, PIQP's interior point method answers (R. Schwan et al., CDC 2023, doi 10.1109/CDC49753.2023.10383915).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import daqp
import numpy as np
import piqp

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}
MANY_ACTIVE = 60
"""Active bounds of the last problem above which the interior-point method goes first."""
_PANEL = 8
HINGE_ROUNDS = 8
"""Most quadratic problems per answer; the line search on the true cost takes care of what is left."""


@njit(fastmath=FAST)
def factor(H, L):  # type: ignore[no-untyped-def]
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
def newton(L, g, z):  # type: ignore[no-untyped-def]
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
def mirror(H, full):  # type: ignore[no-untyped-def]
    """Copy the lower triangle of H to both triangles of `full`."""
    for i in range(H.shape[0]):
        for j in range(i + 1):
            full[i, j] = H[i, j]
            full[j, i] = H[i, j]


@njit
def inside(z, low, high):  # type: ignore[no-untyped-def]
    """Whether z keeps its bounds."""
    kept = True
    for i in range(z.shape[0]):
        kept = kept and low[i] <= z[i] <= high[i]
    return kept


@njit
def open_hinges(z, steps, n, limit, state):  # type: ignore[no-untyped-def]
    """Set `state` to the sign of each hinge that is open at z, else 0; True if any changed."""
    changed = False
    for i in range(z.shape[0]):
        step = steps[i] + z[i] - (z[i - n] if i >= n else 0.0)
        now = 1 if step > limit else (-1 if step < -limit else 0)
        changed = changed or now != state[i]
        state[i] = now
    return changed


@njit
def with_hinges(H, g, steps, n, limit, rho, state, H_out, g_out):  # type: ignore[no-untyped-def]
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
def model_value(H, g, z):  # type: ignore[no-untyped-def]
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

"""The allocation where squares of speeds add up (incoherent sum): a convex problem, solved and proven by its dual.

With G diagonal the cost is sum_i g_i+ T_i+ + g_i- T_i- + w_u |T|^2 + w_p |T - T_previous|^2, one quadratic program in
the split thrusts (T+, T-) >= 0. The multipliers of the wrench give a lower bound by weak duality, thruster by thruster.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array


def convex_allocation(
    B: Array, start: Array, lower: Array, upper: Array, gram: Array, previous: Array, weights: Array
) -> tuple[Array, float] | None:
    """Least cost at the wrench of `start`, shape (n,), and its proven gap (absolute); None if the solver fails.

    - `gram`, shape (2 n, 2 n): diagonal.
    - `weights`, shape (3,): (w_D, w_u, w_p).
    - Shapes: `B` (6, n); `start`, `lower`, `upper`, `previous` (n,).
    """
    import daqp  # nobody else here needs it, and 32-bit computers have none

    alive = np.flatnonzero(upper > lower)
    m = len(alive)
    n = len(start)
    # Independent rows: the solver wants no equality twice.
    u, size, _ = np.linalg.svd(B[:, alive], full_matrices=False)
    rows = (u[:, size > 1e-9 * size[0]].T @ B[:, alive]) if m else np.zeros((0, 0))
    wanted = rows @ start[alive]
    forward = weights[0] * np.diag(gram)[:n][alive]
    reverse = weights[0] * np.diag(gram)[n:][alive]
    square, pull = weights[1] + weights[2], -2.0 * weights[2] * previous[alive]
    # A cost that does not curve leaves the answer open: the least thrusts among equals are taken.
    curved = max(square, 1e-7 * float(np.max(np.concatenate([forward, reverse]), initial=1e-9)))
    one = np.eye(m)
    H = 2.0 * curved * np.block([[one, -one], [-one, one]]) + 1e-7 * curved * np.eye(2 * m)
    found, _, flag, info = daqp.solve(
        np.ascontiguousarray(H),
        np.concatenate([forward + pull, reverse - pull]),
        np.ascontiguousarray(np.hstack([rows, -rows])),
        np.concatenate([upper[alive], -lower[alive], wanted]),
        np.concatenate([np.zeros(2 * m), wanted]),
        np.concatenate([np.zeros(2 * m), np.full(len(rows), 5)]).astype(np.int32),
        primal_tol=1e-11,
    )
    if flag <= 0:
        return None
    low, high = lower[alive], upper[alive]

    def value(T: Array) -> float:
        own = float(np.sum(forward * np.maximum(T, 0.0) + reverse * np.maximum(-T, 0.0)))
        return own + square * float(T @ T) + float(pull @ T)

    def bound(price: Array) -> float:
        parts = [_least(forward[i], reverse[i], pull[i] - price[i], square, low[i], high[i]) for i in range(m)]
        return float(price @ start[alive]) + sum(parts)

    # The rounding of the solver must not cost wrench.
    T = np.clip(found[:m] - found[m:], low, high)
    T = np.clip(T + np.linalg.lstsq(rows, wanted - rows @ T, rcond=None)[0], low, high)
    proven = bound(-rows.T @ info["lam"][2 * m :])
    # Polish: which thrusters rest or are at a limit is known now, and the others follow from linear equations.
    free = (np.abs(T) > 1e-6) & (T - low > 1e-6) & (high - T > 1e-6)
    if square > 0.0 and np.any(free):
        held = np.where(free, 0.0, np.where(np.abs(T) <= 1e-6, 0.0, T))
        slope = np.where(T > 0.0, forward, -reverse) + pull
        A, count = rows[:, free], len(rows)
        system = np.block([[2.0 * square * np.eye(int(free.sum())), A.T], [A, np.zeros((count, count))]])
        answer = np.linalg.lstsq(system, np.concatenate([-slope[free], wanted - rows @ held]), rcond=1e-12)[0]
        polished = held.copy()
        polished[free] = answer[: int(free.sum())]
        proven = max(proven, bound(-rows.T @ answer[int(free.sum()) :]))
        sound = np.all((polished >= low) & (polished <= high)) and np.allclose(
            rows @ polished, wanted, rtol=0, atol=1e-11
        )
        if sound and value(polished) <= value(T) + 1e-9 * abs(value(T)):
            T = polished
    thrusts = np.zeros(n)
    thrusts[alive] = T
    return thrusts, max(value(T) - proven, 0.0)


def _least(forward: float, reverse: float, slope: float, square: float, low: float, high: float) -> float:
    """Least value over t in [low, high] of forward t+ + reverse t- + slope t + square t^2, low <= 0 <= high."""
    best = 0.0
    for linear, end in ((forward + slope, high), (slope - reverse, low)):
        t = end
        if square > 0.0:
            t = float(np.clip(-linear / (2.0 * square), min(end, 0.0), max(end, 0.0)))
        best = min(best, linear * t + square * t * t)
    return best

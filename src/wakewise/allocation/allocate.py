"""Control allocation: least thrusts (pseudo-inverse) or thrusts of least disturbance for one wrench.

All thrusts of a wrench differ by null-space thrusts: T = T_0 + Z lambda. `pseudo_inverse` takes the smallest |T| within
limits, `min_wash_allocation` the T of least D. Both give up the same part of a wrench that the limits do not allow, so
that they can be compared at equal wrench.

`convex_allocation` handles a diagonal G (incoherent sum): sum_i g_i+ T_i+ + g_i- T_i- + w_u |T|^2 +
w_p |T - T_previous|^2 is a quadratic program in the split thrusts (T+, T-) >= 0. The multipliers of the wrench give a
lower bound by weak duality.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.allocation.branch_and_bound import RELATIVE_GAP, global_minimum
from wakewise.allocation.layout import (
    AXES,
    Layout,
    compile_layout,
    largest_feasible_share,
    makes_wrench,
    parse_priority,
    prioritized_allocation,
)
from wakewise.allocation.line_search import (
    cost,
    coupled_directions,
    disjoint_search,
    feasible_starts,
    idle_starts,
    split_allocation,
    start_directions,
)
from wakewise.core.arrays import Array, freeze, frozen
from wakewise.core.checks import finite_number, instance_of, whole_number
from wakewise.core.defaults import BUDGET, CHANGE_WEIGHT, EFFORT_WEIGHT

__all__ = [
    "Allocation",
    "Layout",
    "Weights",
    "compile_layout",
    "disturbance_of",
    "min_norm_allocation",
    "min_wash_allocation",
    "pseudo_inverse",
]

COUPLING_LIMIT = 1e-10
"""Gram entries between two parts of the null space below this share of the largest count as zero: they are rounding."""

_NOTHING = 1e-18
"""A wrench whose square is less than this, or less than this share of what was asked for, is rounding."""
_DISTURBANCE = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Allocation:
    """Thrusts for one wrench, and how they were found."""

    thrusts_N: Array  # shape (n,)
    # wrench_B, requested_B: shape (6,): what the thrusts make, and what was asked for.
    wrench_B: Array
    requested_B: Array
    disturbance: float | None  # D = s' G s in (m/s)^2, None where no Gram matrix was given
    # "pseudo-inverse" (least thrusts); "unique" (no thruster to spare); "lines" (the null space splits into lines, each
    # searched exactly); "convex" (a quadratic program, where squares of speeds add up); "boxes" (branch and bound, any
    # layout).
    method: str
    # How far the weighted cost may lie above its global minimum, relative: proven by a lower bound, zero for
    # "pseudo-inverse" and "unique". Up to 1e-5 counts as closed; more means that the budget of "boxes" was spent.
    gap: float
    # Share of the attainable part of the requested wrench that the limits allow in its own direction: 1 if all of it, 0
    # where nothing of the wrench is made. What thrusters that failed or are not there cannot make at all is no part of
    # it: `given_up` says what of the wrench is not made.
    scale: float

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,), wrench_B=(6,), requested_B=(6,))

    def __str__(self) -> str:
        """Thrusts, D, method and gap, and what of the wrench is not made, in one line."""
        words = [f"{np.array2string(self.thrusts_N, precision=2, suppress_small=True, max_line_width=10_000)} N"]
        if self.disturbance is not None:
            words.append(f"D {self.disturbance:.3g} (m/s)^2")
        words.append(f"{self.method}, gap {self.gap:.1e}")
        if self.given_up:
            lost = ", ".join(
                f"{axis} {value:.3g} {'N' if axis in 'XYZ' else 'N m'}" for axis, value in self.given_up.items()
            )
            words.append(f"scale {self.scale:.3g}, given up {lost}")
        return "; ".join(words)

    @property
    def given_up_B(self) -> Array:
        """Requested wrench that is not made, shape (6,)."""
        return np.asarray(self.requested_B - self.wrench_B)

    @property
    def given_up(self) -> dict[str, float]:
        """The same by axis (X, Y, Z in N, K, M, N in N m), only what is more than rounding."""
        limit = 1e-9 * (1.0 + float(np.linalg.norm(self.requested_B)))
        return {axis: float(x) for axis, x in zip(AXES, self.given_up_B, strict=True) if abs(x) > limit}


@dataclass(frozen=True, kw_only=True, eq=False)
class Weights:
    """Weights of the cost w_D D + w_u |T|^2 + w_p |T - T_previous|^2, each per unit of its own term."""

    disturbance: float = 1.0
    effort: float = EFFORT_WEIGHT
    previous: float = CHANGE_WEIGHT

    def __post_init__(self) -> None:
        for name in ("disturbance", "effort", "previous"):
            value = getattr(self, name)
            if type(value) is not float or not 0.0 <= value < math.inf:
                finite_number(value, f"weight {name}", least=0.0)

    @cached_property
    def packed(self) -> Array:
        """(w_D, w_u, w_p), shape (3,)."""
        return np.array([self.disturbance, self.effort, self.previous], dtype=np.float64)


def pseudo_inverse(B: Array, wrench_B: Array, lower_N: Array, upper_N: Array) -> Allocation:
    """Least thrusts that make a wrench within limits.

    - `B`, shape (6, n): wrench per newton of each thruster.
    - `lower_N`, `upper_N`, shape (n,): limits; both zero for a thruster that has failed.
    - Shapes: `wrench_B` (6,).

    If the plain pseudo-inverse breaks a limit, the null space is used to stay within; if no thrusts within limits make
    the wrench, the largest share of it in the same direction is made (`scale`). Raises InputError as `compile_layout`,
    and if the wrench is not six finite numbers.
    """
    return min_norm_allocation(compile_layout(B, lower_N, upper_N), wrench_B)


def min_norm_allocation(
    layout: Layout, wrench_B: Array, gram: Array | None = None, priority: str | None = None
) -> Allocation:
    """`pseudo_inverse` for a layout compiled once; with `gram`, shape (2 n, 2 n), also says the disturbance.

    `priority`, such as "ZKMN,XY", says which axes to give up last where the limits (or missing thrusters) do not allow
    the whole wrench; without it the wrench keeps its direction.
    """
    instance_of(layout, Layout, "layout")
    requested = frozen(wrench_B, (6,), "wrench")
    thrusts, scale = _start(layout, requested, priority)
    return Allocation(
        thrusts_N=thrusts,
        wrench_B=layout.B @ thrusts,
        requested_B=requested,
        disturbance=None if gram is None else disturbance_of(gram, thrusts),
        method="pseudo-inverse",
        gap=0.0,
        scale=_share(layout, thrusts, requested, scale),
    )


def _share(layout: Layout, thrusts: Array, requested: Array, scale: float) -> float:
    """The share that limits allow, or 0 where nothing of a wrench is made: then nothing of it was attainable."""
    made, asked = layout.B @ thrusts, float(requested @ requested)
    return 0.0 if asked > _NOTHING and made @ made <= _NOTHING * asked else scale


def _start(layout: Layout, requested: Array, priority: str | None) -> tuple[Array, float]:
    """Least thrusts of what can be made of a wrench, and the share that keeps its direction."""
    groups = None if priority is None else parse_priority(priority)
    thrusts, scale = largest_feasible_share(layout, layout.inverse @ requested)
    if groups is not None and not makes_wrench(layout, thrusts, requested):
        thrusts = prioritized_allocation(layout, requested, groups)
    return thrusts, scale


def disturbance_of(gram: Array, thrusts_N: Array) -> float:
    """D = s' G s in (m/s)^2 with s_i = sqrt|T_i| in the slot of the jet that is on; G has shape (2 n, 2 n)."""
    thrusts = np.array(thrusts_N)
    return float(cost(gram, thrusts, thrusts, _DISTURBANCE))


def min_wash_allocation(
    layout: Layout,
    wrench_B: Array,
    gram: Array,
    weights: Weights,
    previous_N: Array | None = None,
    priority: str | None = None,
    budget: int = BUDGET,
) -> Allocation:
    """Thrusts of least w_D D + w_u |T|^2 + w_p |T - T_previous|^2 among those that make the wrench within limits.

    The global minimum, with a proven gap. Where the null space falls apart into lines that share no thruster and no
    Gram entry (vectored layouts of four horizontal and four vertical thrusters do), each line is searched exactly; a
    diagonal Gram matrix makes the problem convex; everything else is left to branch and bound, whose gap is what it
    reached within its budget. The cost never exceeds that of `min_norm_allocation`.

    - `gram`, shape (2 n, 2 n): of `wakewise.wake.gram`: jets of T > 0 first, jets of T < 0 after.
    - `previous_N`, shape (n,): thrusts of the step before; zeros if not given.
    - `priority`: as `min_norm_allocation`.
    - `budget`: most boxes to look at, where the layout needs branch and bound.
    - Shapes: `wrench_B` (6,).

    Raises InputError if the wrench, the Gram matrix or the previous thrusts have a wrong shape or are not finite, the
    priority is not a list of axes, or the budget is less than 1.
    """
    if type(layout) is not Layout or type(weights) is not Weights or type(budget) is not int or budget < 1:
        instance_of(layout, Layout, "layout")
        instance_of(weights, Weights, "weights")
        whole_number(budget, "budget", 1)
    n = layout.B.shape[1]
    requested = frozen(wrench_B, (6,), "wrench")
    G = frozen(gram, (2 * n, 2 * n), "Gram matrix")
    # Copies, here and of the lines: kernels are compiled for arrays that may be written to, and not again for others.
    previous = np.zeros(n) if previous_N is None else frozen(previous_N, (n,), "previous thrusts").copy()
    if priority is not None:
        parse_priority(priority)
    packed = weights.packed
    lower, upper = layout.lower_N, layout.upper_N
    scale = 1.0
    if len(layout.lines) == layout.k > 0:
        done, thrusts, gap = split_allocation(
            G, layout.inverse, requested, layout.lines.copy(), lower, upper, previous, packed, COUPLING_LIMIT
        )
        method = "lines"
    else:
        done = False
    if not done or (priority is not None and not makes_wrench(layout, thrusts, requested)):
        start, scale = _start(layout, requested, priority)
        thrusts, method, gap = _search(layout, start, G, previous, packed, budget)
    value = cost(G, thrusts, previous, packed)
    return Allocation(
        thrusts_N=thrusts,
        wrench_B=layout.B @ thrusts,
        requested_B=requested,
        disturbance=cost(G, thrusts, previous, _DISTURBANCE),
        method=method,
        gap=gap / value if value > 0.0 else 0.0,
        scale=_share(layout, thrusts, requested, scale),
    )


def _search(
    layout: Layout, start: Array, G: Array, previous: Array, packed: Array, budget: int
) -> tuple[Array, str, float]:
    """Least cost among the thrusts that make the wrench of `start`, how it was found, and its proven gap (absolute)."""
    lower, upper = layout.lower_N, layout.upper_N
    if layout.k == 0:
        return start, "unique", 0.0
    groups = _coupled_groups(layout, G)
    method = "lines" if all(group.shape[1] == 1 for group in groups) else "boxes"
    if method == "boxes" and is_incoherent(G):
        found = convex_allocation(layout.B, start, lower, upper, G, previous, packed)
        # The solver's own tolerance is not always enough; what it leaves open goes the way of all other layouts.
        exact = found is not None and makes_wrench(layout, found[0], layout.B @ start)
        if found is not None and exact and found[1] <= RELATIVE_GAP * cost(G, found[0], previous, packed):
            return found[0], "convex", found[1]
    spare = layout.owners.any(axis=0)
    thrusts, gap = start.copy(), 0.0
    for group in groups:
        own = (np.abs(group) > 1e-12).any(axis=1)
        # Thrusters of other groups neither move nor count; those that never move count.
        here = own | ~spare
        base, before = np.where(here, start, 0.0), np.where(here, previous, 0.0)
        if group.shape[1] == 1:
            result, part = disjoint_search(G, base, group.T.copy(), lower, upper, before, packed)
        else:
            starts = feasible_starts(base, before, group, start_directions(group.shape[1]), lower, upper)
            if group.shape[1] > 2:
                starts = np.vstack([starts, idle_starts(base, before, group, G, packed, lower, upper)])
            result, part, _ = global_minimum(G, starts, group, lower, upper, before, packed, budget)
        if cost(G, result, before, packed) <= cost(G, base, before, packed):
            thrusts[own] = result[own]
        gap += part
    return thrusts, method, gap


def is_incoherent(G: Array) -> bool:
    """Whether squares of speeds add up: a Gram matrix that is diagonal."""
    return int(np.count_nonzero(G)) == int(np.count_nonzero(G.diagonal()))


def _coupled_groups(layout: Layout, G: Array) -> list[Array]:
    """Parts of the null space, those joined that share a Gram entry; orthonormal bases, shape (n, k_g) each."""
    tied = coupled_directions(G, layout.owners, COUPLING_LIMIT)
    groups: list[list[int]] = []
    for new in range(len(tied)):
        joined = [new]
        for group in groups.copy():
            if any(tied[new, old] for old in group):
                groups.remove(group)
                joined = [*group, *joined]
        groups.append(joined)
    return [np.ascontiguousarray(np.hstack([layout.blocks[b] for b in group])) for group in groups]


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

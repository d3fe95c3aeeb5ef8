"""Layout of thrusters: allocation matrix B, thrust limits, null space, and the wrenches that the limits allow.

A wrench is tau = B T with B of shape (6, n). Thrusts of one wrench differ by null-space thrusts: T = T_0 + Z lambda.
Limits may allow all of a wrench, its largest share in the same direction, or its axes in an order of priority. QP and
LP solvers are imported where they are needed: layouts whose null space is lines need neither them nor SciPy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.allocation.line_search import box_range
from wakewise.core.arrays import Array, BoolArray, freeze, frozen
from wakewise.core.checks import quoted
from wakewise.core.errors import InputError

MAX_NULL_SPACE_DIM = 8
"""Largest dimension of a null space that is taken: boxes have 2^k corners."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """An allocation matrix with its limits, and what follows from them; make one with `compile_layout`.

    `inverse`, shape (n, 6), gives the least thrusts; `null`, shape (n, k), is an orthonormal basis of the thrusts
    without wrench, and `blocks` the same in parts that share no thruster, each an orthonormal basis of shape (n, k_b).
    `lines`, shape (k, n), holds the parts as rows if all of them are one-dimensional (else shape (0, n)). A thruster
    whose limits are both zero has failed: its row is zero in all of them.
    """

    B: Array
    lower_N: Array
    upper_N: Array
    inverse: Array
    null: Array
    blocks: tuple[Array, ...]
    lines: Array

    def __post_init__(self) -> None:
        n = self.B.shape[1]
        freeze(self, B=(6, n), lower_N=(n,), upper_N=(n,), inverse=(n, 6), null=(n, None), lines=(None, n))
        object.__setattr__(self, "blocks", tuple(frozen(block, (n, None), "null space") for block in self.blocks))

    @property
    def k(self) -> int:
        """Dimension of the null space."""
        return int(self.null.shape[1])

    @cached_property
    def owners(self) -> BoolArray:
        """Thrusters of each of the blocks, shape (b, n)."""
        return np.array([np.any(np.abs(block) > 1e-12, axis=1) for block in self.blocks]).reshape(-1, self.B.shape[1])

    @property
    def rank(self) -> int:
        """How many independent wrenches the thrusters that work can make."""
        return int(np.count_nonzero(self.upper_N > self.lower_N)) - self.k


def compile_layout(B: Array, lower_N: Array, upper_N: Array) -> Layout:
    """Check an allocation matrix, shape (6, n), and limits, shape (n,), and work out what each wrench needs of them.

    Where the thrusters cannot make every wrench, the nearest is taken, with moments measured against forces at the
    thrusters' own lever arm (root mean square), so that newtons and newton metres can be added.

    Raises InputError on a wrong shape, on numbers that are not finite, on a lower limit above the upper one, on limits
    that exclude zero thrust, or on more than 8 spare thrusters.
    """
    B = frozen(B, (6, None), "allocation matrix")
    n = B.shape[1]
    lower, upper = frozen(lower_N, (n,), "lower limits"), frozen(upper_N, (n,), "upper limits")
    if np.any(lower > upper):
        worst = int(np.argmax(lower - upper))
        raise InputError(f"thruster {worst + 1}: lower limit {lower[worst]:g} N above upper limit {upper[worst]:g} N")
    if np.any(lower > 0.0) or np.any(upper < 0.0):
        worst = int(np.argmax(np.maximum(lower, -upper)))
        raise InputError(
            f"thruster {worst + 1}: limits {lower[worst]:g} to {upper[worst]:g} N, zero thrust must lie between them"
        )
    alive = np.flatnonzero(upper - lower > 0.0)
    inverse, null = np.zeros((n, 6)), np.zeros((n, 0))
    if alive.size:
        scaling = axis_scaling(B[:, alive])
        scaled = B[:, alive] * scaling[:, None]
        inverse[alive] = np.linalg.pinv(scaled, rcond=1e-9) * scaling
        _, sizes, rows = np.linalg.svd(scaled)
        basis = rows[np.count_nonzero(sizes > 1e-9 * sizes[0]) :].T
        null = np.zeros((n, basis.shape[1]))
        null[alive] = basis
    if null.shape[1] > MAX_NULL_SPACE_DIM:
        raise InputError(
            f"allocation matrix: {null.shape[1]} spare thrusters, at most {MAX_NULL_SPACE_DIM} can be searched"
        )
    blocks = independent_blocks(null)
    alone = all(block.shape[1] == 1 for block in blocks)
    lines = np.array([block[:, 0] for block in blocks]).reshape(-1, n) if alone else np.zeros((0, n))
    return Layout(B=B, lower_N=lower, upper_N=upper, inverse=inverse, null=null, blocks=blocks, lines=lines)


def axis_scaling(B: Array) -> Array:
    """Factors, shape (6,), that measure moments against forces at the thrusters' lever arm (root mean square)."""
    force, moment = np.linalg.norm(B[:3]), np.linalg.norm(B[3:])
    arm = float(moment / force) if force > 0.0 and moment > 0.0 else 1.0
    return np.array([1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm, 1.0 / arm])


def independent_blocks(null: Array) -> tuple[Array, ...]:
    """Split the columns' span, shape (n, k), into parts that share no thruster, shape (n, k_b) each."""
    n, _ = null.shape
    projector = null @ null.T
    group = np.arange(n)
    for i in range(n):
        for j in range(i):
            if abs(projector[i, j]) > 1e-9:
                group[group == group[i]] = group[j]
    blocks = []
    for label in np.unique(group):
        members = group == label
        values, vectors = np.linalg.eigh(projector[np.ix_(members, members)])
        block = np.zeros((n, int(np.sum(values > 0.5))))
        block[members] = vectors[:, values > 0.5]
        if block.shape[1]:
            blocks.append(block)
    return tuple(blocks)


AXES = "XYZKMN"
"""Surge, sway and heave force, roll, pitch and yaw moment."""

_EXACT = 1e-10


def largest_feasible_share(layout: Layout, thrusts: Array) -> tuple[Array, float]:
    """Least-norm thrusts within limits that make the largest possible share of the same wrench, and that share."""
    lower, upper = layout.lower_N, layout.upper_N
    if ((thrusts >= lower) & (thrusts <= upper)).all():
        return thrusts, 1.0
    if len(layout.lines) != layout.k:
        result, scale = _within_polytope(layout, thrusts)
    else:
        immovable = np.all(np.abs(layout.null) < 1e-12, axis=1)
        scale = _box_scale(thrusts[immovable], lower[immovable], upper[immovable])
        for line in layout.lines:
            scale = min(scale, _line_scale(thrusts, line, lower, upper))
        result = scale * thrusts
        for line in layout.lines:
            low, high = box_range(result, line, lower, upper)
            result = result + (low if low > 0.0 else min(high, 0.0)) * line
    return np.clip(result, lower, upper), scale


def parse_priority(text: str) -> tuple[tuple[int, ...], ...]:
    """Groups of axes in order, such as "ZKMN,XY": what comes first is given up last; axes not named come at the end.

    Raises InputError if a letter is no axis, or comes twice.
    """
    if not isinstance(text, str):
        raise InputError(f"priority: {quoted(text)}, must be a text such as 'ZKMN,XY'")
    groups = [tuple(part.strip().upper()) for part in text.split(",") if part.strip()]
    named = [letter for group in groups for letter in group]
    wrong = [letter for letter in named if letter not in AXES or named.count(letter) > 1]
    if wrong or not named:
        what = f"'{wrong[0]}' {'twice' if wrong[0] in AXES else 'unknown'}" if wrong else "no axes"
        raise InputError(f"priority '{text}': {what}, allowed: X, Y, Z, K, M, N once each, groups separated by commas")
    rest = tuple(letter for letter in AXES if letter not in named)
    return tuple(tuple(AXES.index(letter) for letter in group) for group in [*groups, rest] if group)


def prioritized_allocation(layout: Layout, wrench_B: Array, groups: tuple[tuple[int, ...], ...]) -> Array:
    """Thrusts within limits, shape (n,), that come as near as they can to each group of axes in turn.

    What a group has got is not given back for those after it (lexicographic least squares, one quadratic program per
    group). Moments are measured against forces at the thrusters' lever arm.
    """
    import daqp

    n = layout.B.shape[1]
    alive = layout.upper_N > layout.lower_N
    if not np.any(alive):
        return np.zeros(n)
    rows = layout.B[:, alive] * axis_scaling(layout.B[:, alive])[:, None]
    wanted = wrench_B * axis_scaling(layout.B[:, alive])
    low, high = layout.lower_N[alive], layout.upper_N[alive]
    thrusts = np.zeros(int(alive.sum()))
    held = np.zeros((0, len(thrusts)))
    for group in groups:
        A = rows[list(group)]
        # The second term picks the least thrusts among equals, and is too weak to show.
        H = np.ascontiguousarray(A.T @ A + 1e-9 * np.eye(len(thrusts)))
        sense = np.zeros(len(thrusts) + len(held), dtype=np.int32)
        sense[len(thrusts) :] = 5
        made = held @ thrusts
        found, _, flag, _ = daqp.solve(
            H,
            -A.T @ wanted[list(group)],
            np.ascontiguousarray(held),
            np.concatenate([high, made]),
            np.concatenate([low, made]),
            sense,
            primal_tol=1e-9,
        )
        if flag > 0:
            thrusts = np.clip(found, low, high)
        # Only rows that say something new, or the equalities would contradict one another by rounding.
        for row in A:
            left = row - held.T @ (held @ row) if len(held) else row
            if np.linalg.norm(left) > 1e-9:
                held = np.vstack([held, left / np.linalg.norm(left)])
    result = np.zeros(n)
    result[alive] = thrusts
    return result


def makes_wrench(layout: Layout, thrusts: Array, wrench_B: Array) -> bool:
    """Whether thrusts make a wrench but for rounding."""
    missing = layout.B @ thrusts - wrench_B
    return math.sqrt(missing @ missing) <= _EXACT * (1.0 + math.sqrt(wrench_B @ wrench_B))


def _line_scale(thrusts: Array, line: Array, lower: Array, upper: Array) -> float:
    """Largest share alpha <= 1 for which some t keeps alpha T + t line within limits (pairs of limits, closed form)."""
    moving = np.abs(line) >= 1e-12
    a, z = thrusts[moving], line[moving]
    # Each thruster allows t from (near - alpha a)/z to (far - alpha a)/z; every start must lie below every end.
    near = np.where(z > 0.0, lower[moving], upper[moving]) / z
    far = np.where(z > 0.0, upper[moving], lower[moving]) / z
    rate = (a / z)[None, :] - (a / z)[:, None]
    room = far[None, :] - near[:, None]
    over = rate > room
    return float(np.min(room[over] / rate[over], initial=1.0))


def _box_scale(thrusts: Array, lower: Array, upper: Array) -> float:
    """Largest share alpha <= 1 of the thrusts that is within limits as it stands."""
    room = np.where(thrusts > 0.0, upper, lower)
    over = np.abs(thrusts) > np.abs(room)
    return float(np.min(room[over] / thrusts[over], initial=1.0))


def _within_polytope(layout: Layout, thrusts: Array) -> tuple[Array, float]:
    """The same for null spaces in one piece: linear programming over (alpha, lambda), then the smallest lambda."""
    from scipy.optimize import linprog

    Z = layout.null
    rows = np.vstack([np.column_stack([thrusts, Z]), np.column_stack([-thrusts, -Z])])
    limits = np.concatenate([layout.upper_N, -layout.lower_N])
    objective = np.zeros(1 + layout.k)
    objective[0] = -1.0
    bounds: list[tuple[float | None, float | None]] = [(0.0, 1.0), *[(None, None)] * layout.k]
    found = linprog(objective, A_ub=rows, b_ub=limits, bounds=bounds, method="highs")
    if not found.success or found.x is None:
        scale = _box_scale(thrusts, layout.lower_N, layout.upper_N)
        return scale * thrusts, scale
    scale = float(found.x[0])
    # Below one, the limits leave a single point, or nearly: the program's own answer is the one to take.
    shift = _least_shift(layout, thrusts) if scale >= 1.0 - 1e-12 else None
    if shift is not None:
        return thrusts + Z @ shift, 1.0
    return _at_limits(layout, thrusts, scale * thrusts + Z @ found.x[1:], scale)


def _at_limits(layout: Layout, full: Array, rough: Array, scale: float) -> tuple[Array, float]:
    """Sharpen a linear program's answer: what is at a limit is put there, and the rest follows from the direction."""
    low, high = layout.lower_N, layout.upper_N
    fixed = np.where(rough - low < 1e-6, low, high)
    free = (rough - low >= 1e-6) & (high - rough >= 1e-6)
    wrench = layout.B @ full
    system = np.column_stack([layout.B[:, free], -wrench])
    answer = np.linalg.lstsq(system, -layout.B[:, ~free] @ fixed[~free], rcond=None)[0]
    sharp = fixed.copy()
    sharp[free] = answer[:-1]
    sound = np.all((sharp >= low) & (sharp <= high)) and 0.0 <= answer[-1] <= 1.0
    error = np.linalg.norm(layout.B @ sharp - answer[-1] * wrench)
    if sound and error <= np.linalg.norm(layout.B @ rough - scale * wrench):
        return sharp, float(answer[-1])
    return rough, scale


def _least_shift(layout: Layout, thrusts: Array) -> Array | None:
    """Smallest lambda, shape (k,), that brings T + Z lambda within limits; None if rounding hides it.

    Least-distance programming by non-negative least squares (C. L. Lawson and R. J. Hanson, Solving Least Squares
    Problems, 1974, chapter 23).
    """
    from scipy.optimize import nnls

    rows = np.vstack([layout.null, -layout.null])
    limits = np.concatenate([layout.lower_N - thrusts, thrusts - layout.upper_N])
    E = np.vstack([rows.T, limits])
    target = np.zeros(layout.k + 1)
    target[-1] = 1.0
    try:
        u, _ = nnls(E, target)
    except RuntimeError:  # its iteration limit
        return None
    residual = E @ u - target
    if abs(residual[-1]) < 1e-12:
        return None
    shift = np.asarray(-residual[:-1] / residual[-1])
    moved = thrusts + layout.null @ shift
    inside = np.all(moved >= layout.lower_N - 1e-9) and np.all(moved <= layout.upper_N + 1e-9)
    return shift if inside else None

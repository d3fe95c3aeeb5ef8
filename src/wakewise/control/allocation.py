"""One wrench to many thrusts: the least thrusts, or the gentlest ones, that make the same wrench.

All thrusts that make a wrench differ by null-space thrusts only: T = T_0 + Z lambda. `pseudo_inverse` takes the
smallest |T| within limits; `gentle_allocation` takes the T that disturbs the target least. Both give up the same share
of a wrench that the limits do not allow, so that they can be compared at equal wrench.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog, nnls

from wakewise.arrays import Array, freeze, frozen
from wakewise.control.coupled import planar_search, restart_search
from wakewise.control.search import box_range, cost, coupling, disjoint_search
from wakewise.errors import InputError

COUPLING_LIMIT = 1e-10
"""Gram entries between two null vectors below this share of the largest count as zero: they are rounding."""

_PARALLEL_LINES = 48
_RESTARTS = 32


@dataclass(frozen=True, kw_only=True, eq=False)
class Allocation:
    """Thrusts for one wrench, and how they were found.

    Parameters
    ----------
    thrusts_N : ndarray, shape (n,)
    wrench_B, requested_B : ndarray, shape (6,)
        What the thrusts make, and what was asked for.
    disturbance : float or None
        D = s' G s in (m/s)^2, None where no Gram matrix was given.
    method : str
        "pseudo-inverse"; "unique" (no null space); "exact" (independent lines, global minimum proven); "planar" (two
        coupled directions); "restarts" (more than two).
    gap : float
        How far the weighted cost may lie above its global minimum, relative: proven for "exact", estimated for
        "planar" and "restarts", zero otherwise.
    scale : float
        Share of the attainable part of the requested wrench that the limits allowed, 1 if all of it.
    """

    thrusts_N: Array
    wrench_B: Array
    requested_B: Array
    disturbance: float | None
    method: str
    gap: float
    scale: float

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,), wrench_B=(6,), requested_B=(6,))

    @property
    def given_up_B(self) -> Array:
        """Requested wrench that is not made, shape (6,)."""
        return np.asarray(self.requested_B - self.wrench_B)


@dataclass(frozen=True, kw_only=True, eq=False)
class Weights:
    """Weights of the cost w_D D + w_u |T|^2 + w_p |T - T_previous|^2, each per unit of its own term."""

    disturbance: float = 1.0
    effort: float = 1e-3
    previous: float = 0.0

    def __post_init__(self) -> None:
        for name in ("disturbance", "effort", "previous"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"weight {name}: {value:g}, must be finite and not negative")

    @property
    def packed(self) -> Array:
        """(w_D, w_u, w_p), shape (3,)."""
        return np.array([self.disturbance, self.effort, self.previous], dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """An allocation matrix with its limits, and what follows from them; make one with `compile_layout`.

    `inverse`, shape (n, 6), gives the least thrusts; `null`, shape (n, k), is an orthonormal basis of the thrusts
    without wrench, and `lines`, shape (k, n), the same as vectors that share no thruster, if there are such (else
    shape (0, n)). A thruster whose limits are both zero has failed: its row is zero in all of them.
    """

    B: Array
    lower_N: Array
    upper_N: Array
    inverse: Array
    null: Array
    lines: Array

    def __post_init__(self) -> None:
        n = self.B.shape[1]
        freeze(self, B=(6, n), lower_N=(n,), upper_N=(n,), inverse=(n, 6), null=(n, None), lines=(None, n))

    @property
    def k(self) -> int:
        """Dimension of the null space."""
        return int(self.null.shape[1])


def compile_layout(B: Array, lower_N: Array, upper_N: Array) -> Layout:
    """Check an allocation matrix, shape (6, n), and limits, shape (n,), and work out what each wrench needs of them.

    Where the thrusters cannot make every wrench, the nearest is taken, with moments measured against forces at the
    thrusters' own lever arm (root mean square), so that newtons and newton metres can be added.

    Raises
    ------
    InputError
        On a wrong shape, on numbers that are not finite, or on limits that exclude zero thrust.
    """
    B = frozen(B, (6, None), "allocation matrix")
    n = B.shape[1]
    lower, upper = frozen(lower_N, (n,), "lower limits"), frozen(upper_N, (n,), "upper limits")
    if np.any(lower > 0.0) or np.any(upper < 0.0):
        worst = int(np.argmax(np.maximum(lower, -upper)))
        raise InputError(
            f"thruster {worst + 1}: limits {lower[worst]:g} to {upper[worst]:g} N, zero thrust must lie between them"
        )
    alive = np.flatnonzero(upper - lower > 0.0)
    inverse, null, lines = np.zeros((n, 6)), np.zeros((n, 0)), np.zeros((0, n))
    if alive.size:
        force, moment = np.linalg.norm(B[:3, alive]), np.linalg.norm(B[3:, alive])
        arm = moment / force if force > 0.0 and moment > 0.0 else 1.0
        scaling = np.array([1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm, 1.0 / arm])
        scaled = B[:, alive] * scaling[:, None]
        inverse[alive] = np.linalg.pinv(scaled, rcond=1e-9) * scaling
        basis = null_space(scaled, rcond=1e-9)
        null = np.zeros((n, basis.shape[1]))
        null[alive] = basis
        lines = _independent_lines(null)
    return Layout(B=B, lower_N=lower, upper_N=upper, inverse=inverse, null=null, lines=lines)


def _independent_lines(null: Array) -> Array:
    """Null vectors that share no thruster, shape (k, n), or shape (0, n) if there is no such basis."""
    n, k = null.shape
    linked = np.abs(null @ null.T) > 1e-9
    group = np.arange(n)
    for i in range(n):
        for j in range(i):
            if linked[i, j]:
                group[group == group[i]] = group[j]
    lines = []
    for label in np.unique(group):
        members = group == label
        block = null[members] @ null[members].T
        values, vectors = np.linalg.eigh(block)
        if np.sum(values > 0.5) > 1:
            return np.zeros((0, n))
        if values[-1] > 0.5:
            line = np.zeros(n)
            line[members] = vectors[:, -1]
            lines.append(line)
    return np.array(lines).reshape(k, n) if len(lines) == k else np.zeros((0, n))


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


def _within_limits(layout: Layout, thrusts: Array) -> tuple[Array, float]:
    """Least-norm thrusts within limits that make the largest possible share of the same wrench, and that share."""
    lower, upper = layout.lower_N, layout.upper_N
    if np.all(thrusts >= lower) and np.all(thrusts <= upper):
        return thrusts, 1.0
    if len(layout.lines) != layout.k:
        result, scale = _within_polytope(layout, thrusts)
    else:
        silent = np.all(np.abs(layout.null) < 1e-12, axis=1)
        scale = _box_scale(thrusts[silent], lower[silent], upper[silent])
        for line in layout.lines:
            scale = min(scale, _line_scale(thrusts, line, lower, upper))
        result = scale * thrusts
        for line in layout.lines:
            low, high = box_range(result, line, lower, upper)
            result = result + (low if low > 0.0 else min(high, 0.0)) * line
    return np.clip(result, lower, upper), scale


def _box_scale(thrusts: Array, lower: Array, upper: Array) -> float:
    """Largest share alpha <= 1 of the thrusts that is within limits as it stands."""
    room = np.where(thrusts > 0.0, upper, lower)
    over = np.abs(thrusts) > np.abs(room)
    return float(np.min(room[over] / thrusts[over], initial=1.0))


def _within_polytope(layout: Layout, thrusts: Array) -> tuple[Array, float]:
    """The same for null spaces in one piece: linear programming over (alpha, lambda), then the smallest lambda."""
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
    return scale * thrusts + Z @ (found.x[1:] if shift is None else shift), scale


def _least_shift(layout: Layout, thrusts: Array) -> Array | None:
    """Smallest lambda, shape (k,), that brings T + Z lambda within limits; None if rounding hides it.

    Least-distance programming by non-negative least squares (C. L. Lawson and R. J. Hanson, Solving Least Squares
    Problems, 1974, chapter 23).
    """
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


def pseudo_inverse(B: Array, wrench_B: Array, lower_N: Array, upper_N: Array) -> Allocation:
    """Least thrusts that make a wrench within limits.

    Parameters
    ----------
    B : ndarray, shape (6, n)
        Wrench per newton of each thruster.
    wrench_B : ndarray, shape (6,)
    lower_N, upper_N : ndarray, shape (n,)
        Limits; both zero for a thruster that has failed.

    Returns
    -------
    Allocation
        If the plain pseudo-inverse breaks a limit, the null space is used to stay within; if no thrusts within limits
        make the wrench, the largest share of it in the same direction is made (`scale`).

    Raises
    ------
    InputError
        As `compile_layout`, and if the wrench is not six finite numbers.
    """
    return least_thrusts(compile_layout(B, lower_N, upper_N), wrench_B)


def least_thrusts(layout: Layout, wrench_B: Array, gram: Array | None = None) -> Allocation:
    """`pseudo_inverse` for a layout compiled once; with `gram`, shape (2 n, 2 n), also says the disturbance."""
    requested = frozen(wrench_B, (6,), "wrench")
    thrusts, scale = _within_limits(layout, layout.inverse @ requested)
    return Allocation(
        thrusts_N=thrusts,
        wrench_B=layout.B @ thrusts,
        requested_B=requested,
        disturbance=None if gram is None else disturbance_of(gram, thrusts),
        method="pseudo-inverse",
        gap=0.0,
        scale=scale,
    )


def disturbance_of(gram: Array, thrusts_N: Array) -> float:
    """D = s' G s in (m/s)^2 with s_i = sqrt|T_i| in the slot of the jet that is on; G has shape (2 n, 2 n)."""
    return float(cost(gram, np.array(thrusts_N), np.array(thrusts_N), np.array([1.0, 0.0, 0.0])))


def gentle_allocation(
    layout: Layout, wrench_B: Array, gram: Array, weights: Weights, previous_N: Array | None = None
) -> Allocation:
    """Thrusts of least w_D D + w_u |T|^2 + w_p |T - T_previous|^2 among those that make the wrench within limits.

    Where the null space falls apart into lines that share no thruster and no Gram entry (vectored layouts of four
    horizontal and four vertical thrusters do), the global minimum is found and proven; otherwise see
    `coupled.planar_search` and `coupled.restart_search`. The cost never exceeds that of `pseudo_inverse`.

    Parameters
    ----------
    layout : Layout
    wrench_B : ndarray, shape (6,)
    gram : ndarray, shape (2 n, 2 n)
        Of `wakewise.wake.gram`: jets of T > 0 first, jets of T < 0 after.
    weights : Weights
    previous_N : ndarray, shape (n,), optional
        Thrusts of the step before; zeros if not given.

    Raises
    ------
    InputError
        If the wrench, the Gram matrix or the previous thrusts have a wrong shape or are not finite.
    """
    n = layout.B.shape[1]
    requested = frozen(wrench_B, (6,), "wrench")
    G = frozen(gram, (2 * n, 2 * n), "Gram matrix")
    previous = np.zeros(n) if previous_N is None else frozen(previous_N, (n,), "previous thrusts")
    start, scale = _within_limits(layout, layout.inverse @ requested)
    packed = weights.packed
    lower, upper = layout.lower_N, layout.upper_N
    gap = 0.0
    if layout.k == 0:
        thrusts, method = start, "unique"
    elif len(layout.lines) == layout.k and (layout.k == 1 or coupling(G, layout.lines) <= COUPLING_LIMIT):
        thrusts, gap = disjoint_search(G, start, layout.lines, lower, upper, previous, packed)
        method = "exact"
    elif layout.k == 2:
        thrusts, gap = planar_search(G, start, layout.null, lower, upper, previous, packed, _PARALLEL_LINES)
        method = "planar"
    else:
        starts = _feasible_starts(layout, start, previous)
        thrusts, gap = restart_search(G, starts, layout.null, lower, upper, previous, packed)
        method = "restarts"
    value = cost(G, thrusts, previous, packed)
    if value > cost(G, start, previous, packed):
        thrusts, value = start, cost(G, start, previous, packed)
    return Allocation(
        thrusts_N=thrusts,
        wrench_B=layout.B @ thrusts,
        requested_B=requested,
        disturbance=cost(G, thrusts, previous, np.array([1.0, 0.0, 0.0])),
        method=method,
        gap=gap / value if value > 0.0 else 0.0,
        scale=scale,
    )


def _feasible_starts(layout: Layout, start: Array, previous: Array) -> Array:
    """The least thrusts, the previous ones brought to this wrench, and points along fixed random directions."""
    Z = layout.null
    toward = Z.T @ (previous - start)
    # A fixed stream: the same wrench gives the same thrusts.
    directions = np.random.default_rng(0).normal(size=(_RESTARTS - 2, layout.k))
    starts = [start, start + _reach(layout, start, Z @ toward, 1.0) * (Z @ toward)]
    for number, direction in enumerate(directions):
        step = Z @ (direction / np.linalg.norm(direction))
        share = ((number + 1) / len(directions)) ** 2
        starts.append(start + share * _reach(layout, start, step, np.inf) * step)
    return np.clip(np.array(starts), layout.lower_N, layout.upper_N)


def _reach(layout: Layout, start: Array, step: Array, most: float) -> float:
    """Largest t <= most that keeps start + t step within limits."""
    moving = np.abs(step) > 1e-12
    room = np.where(step > 0.0, layout.upper_N, layout.lower_N) - start
    return max(float(np.min(room[moving] / step[moving], initial=most)), 0.0)

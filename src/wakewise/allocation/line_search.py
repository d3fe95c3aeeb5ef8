"""Global minimum of the allocation cost along a line of the null space, with a proven gap.

The cost of thrusts T is f(T) = w_D s' G s + w_u |T|^2 + w_p |T - T_previous|^2, with s_i = sqrt|T_i| in the slot of the
jet that thruster i emits (G is 2n x 2n: jets of T > 0 first, jets of T < 0 after).

Along T = base + t direction, between two sign changes of any thrust, f has three parts:

- a parabola: |T_i| is linear, the two square terms are quadratic;
- concave: geometric means sqrt(T_i T_j) with G_ij > 0;
- convex: the same with G_ij < 0.

On an interval the concave part lies above its chord and the convex part above its end tangents; the minimum of parabola
+ chord + tangents is a lower bound. `line_minimum` splits intervals until no bound lies below the best value.

Coupled directions share a thruster or an entry of G. Multistart descent along them gives local minima without proof;
`branch_and_bound` proves the global one.

The module is long because bound, search and descent share the pieces of one cost along a line.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.jit.njit import assign, njit

TOLERANCE = 1e-7
"""Relative gap at which a line search stops: far below what a thruster can reproduce."""

_DEPTH = 64
_EVALUATIONS = 2000
_STEEP = 1e300


@njit(apart=True)
def cost(G: Array, thrusts: Array, previous: Array, weights: Array) -> float:
    """f(T) in the units of the weights; `weights` is (w_D, w_u, w_p)."""
    n = thrusts.size
    total = 0.0
    for i in range(n):
        slot_i = i if thrusts[i] > 0.0 else i + n
        size_i = abs(thrusts[i])
        total += weights[0] * G[slot_i, slot_i] * size_i
        for j in range(i):
            slot_j = j if thrusts[j] > 0.0 else j + n
            total += 2.0 * weights[0] * G[slot_i, slot_j] * np.sqrt(size_i * abs(thrusts[j]))
        total += weights[1] * thrusts[i] ** 2 + weights[2] * (thrusts[i] - previous[i]) ** 2
    return total


@njit
def box_range(base: Array, direction: Array, lower: Array, upper: Array) -> tuple[float, float]:
    """Interval of t that keeps base + t direction within the limits; empty (low > high) if there is none."""
    low, high = -np.inf, np.inf
    for i in range(base.size):
        slope = direction[i]
        if abs(slope) < 1e-12:
            continue
        first, second = (lower[i] - base[i]) / slope, (upper[i] - base[i]) / slope
        low = max(low, min(first, second))
        high = min(high, max(first, second))
    return low, high


@njit
def _curved(t: float, a: Array, b: Array, cross: Array, single: Array, root: Array) -> tuple[float, float, float]:
    """Concave value, convex value and slope of the convex part at t, for |T_i| = a_i + b_i t."""
    m = a.size
    concave = 0.0
    convex = 0.0
    slope = 0.0
    for i in range(m):
        x = a[i] + b[i] * t
        root[i] = np.sqrt(x) if x > 1e-14 else 0.0
    for i in range(m):
        if single[i] > 0.0:
            concave += single[i] * root[i]
        elif single[i] < 0.0:
            convex += single[i] * root[i]
            slope = slope + single[i] * b[i] / (2.0 * root[i]) if root[i] > 1e-6 else _STEEP
        for j in range(i):
            c = cross[i, j]
            if c > 0.0:
                concave += c * root[i] * root[j]
            elif c < 0.0:
                convex += c * root[i] * root[j]
                if root[i] > 1e-6 and root[j] > 1e-6:
                    slope += 0.5 * c * (b[i] * root[j] / root[i] + b[j] * root[i] / root[j])
                else:
                    slope = _STEEP
    return concave, convex, slope


@njit
def _floor(low: float, high: float, a: Array, b: Array, cross: Array, single: Array) -> float:
    """Crude lower bound of the convex part on [low, high]: every root at its largest."""
    m = a.size
    root = np.empty(m)
    total = 0.0
    for i in range(m):
        root[i] = np.sqrt(max(a[i] + b[i] * low, a[i] + b[i] * high, 0.0))
        total += min(single[i], 0.0) * root[i]
        for j in range(i):
            total += min(cross[i, j], 0.0) * root[i] * root[j]
    return total


@njit
def _lowest(linear: float, square: float, low: float, high: float) -> tuple[float, float]:
    """Where linear t + square t^2 (square >= 0) is least on [low, high], and that value."""
    straight = low if linear > 0.0 else high
    t = min(max(-linear / (2.0 * square), low), high) if square > 0.0 else straight
    return t, linear * t + square * t * t


@njit
def _bound(
    a: float, left: Array, b: float, right: Array, constant: float, linear: float, square: float
) -> tuple[float, float]:
    """Lower bound of f on [a, b] and where it is reached; `left`, `right` hold (concave, convex, convex slope)."""
    chord = (right[0] - left[0]) / (b - a)
    offset = constant + left[0] - chord * a
    slope = linear + chord
    left_ok, right_ok = abs(left[2]) < _STEEP, abs(right[2]) < _STEEP
    if not left_ok and not right_ok:
        return 0.5 * (a + b), -np.inf
    crossing = 0.5 * (a + b)
    if left_ok and right_ok and right[2] - left[2] > 1e-14 * (abs(left[2]) + abs(right[2])):
        crossing = (left[1] - left[2] * a - right[1] + right[2] * b) / (right[2] - left[2])
        crossing = min(max(crossing, a), b)
    elif left_ok != right_ok:
        crossing = b if left_ok else a
    t_best, best = a, np.inf
    if left_ok and crossing > a:
        t, value = _lowest(slope + left[2], square, a, crossing)
        t_best, best = t, value + offset + left[1] - left[2] * a
    if right_ok and crossing < b:
        t, value = _lowest(slope + right[2], square, crossing, b)
        value += offset + right[1] - right[2] * b
        if value < best:
            t_best, best = t, value
    return t_best, best


@njit(apart=True)
def line_minimum(
    G: Array,
    base: Array,
    direction: Array,
    counted: Array,
    low: float,
    high: float,
    previous: Array,
    weights: Array,
    incumbent: float,
) -> tuple[float, float, float]:
    """Global minimum of f(base + t direction) over t in [low, high].

    - `counted`, shape (n,): which of the thrusters that do not move along the line enter f through their cross terms;
      terms that hold no moving thruster are constant and left out.
    - `weights`, shape (3,): (w_D, w_u, w_p).
    - `incumbent`: a value of f to beat (infinite if none); t is NaN when the line has nothing lower.
    - Shapes: `G` (2 n, 2 n); `base`, `direction`, `previous` (n,).

    Returns `t, value, gap`: `value` (without the constant terms) exceeds the true minimum of the line by at most `gap`.
    """
    n = base.size
    moving, m = np.empty(n, np.int64), 0
    for i in range(n):
        if abs(direction[i]) >= 1e-12:
            moving[m] = i
            m += 1
    slots = np.empty(m, np.int64)
    a, b, single, root = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    cross = np.empty((m, m))
    breaks = np.empty(m + 2)
    breaks[0] = low
    count = 1
    for i in range(n):
        if abs(direction[i]) < 1e-12:
            continue
        t = -base[i] / direction[i]
        if low < t < high:
            breaks[count] = t
            count += 1
    breaks[count] = high
    count += 1
    for i in range(2, count):  # in order; a few, so that no sorting of NumPy's need be compiled
        t, j = breaks[i], i
        while j > 0 and breaks[j - 1] > t:
            breaks[j] = breaks[j - 1]
            j -= 1
        breaks[j] = t
    square = 0.0
    square_linear = 0.0
    square_constant = 0.0
    for i in range(n):
        if abs(direction[i]) < 1e-12:
            continue
        square += (weights[1] + weights[2]) * direction[i] ** 2
        square_linear += 2.0 * direction[i] * ((weights[1] + weights[2]) * base[i] - weights[2] * previous[i])
        square_constant += weights[1] * base[i] ** 2 + weights[2] * (base[i] - previous[i]) ** 2
    t_best, best = np.nan, incumbent
    gap = 0.0
    ends = np.empty((_DEPTH, 2))
    lefts, rights = np.empty((_DEPTH, 3)), np.empty((_DEPTH, 3))
    targets, bounds = np.empty(_DEPTH), np.empty(_DEPTH)
    node = np.empty(3)
    evaluations = 0
    for piece in range(count - 1):
        start, stop = breaks[piece], breaks[piece + 1]
        if stop - start < 1e-12 and count > 2:
            continue
        middle = 0.5 * (start + stop)
        constant, linear = square_constant, square_linear
        for k in range(m):
            i = moving[k]
            sign = 1.0 if base[i] + middle * direction[i] > 0.0 else -1.0
            slots[k] = i if sign > 0.0 else i + n
            a[k], b[k] = sign * base[i], sign * direction[i]
            constant += weights[0] * G[slots[k], slots[k]] * a[k]
            linear += weights[0] * G[slots[k], slots[k]] * b[k]
            single[k] = 0.0
            for j in range(k):
                cross[k, j] = 2.0 * weights[0] * G[slots[k], slots[j]]
        for i in range(n):
            if counted[i] and abs(direction[i]) < 1e-12 and base[i] != 0.0:
                other = i if base[i] > 0.0 else i + n
                strength = 2.0 * weights[0] * np.sqrt(abs(base[i]))
                for k in range(m):
                    single[k] += strength * G[slots[k], other]
        ends[0, 0], ends[0, 1] = start, stop
        for side in range(2):
            t = ends[0, side]
            node[0], node[1], node[2] = _curved(t, a, b, cross, single, root)
            value = constant + linear * t + square * t * t + node[0] + node[1]
            if value < best:
                t_best, best = t, value
            if side == 0:
                assign(lefts[0], node)
            else:
                assign(rights[0], node)
        if stop - start < 1e-12:
            continue
        targets[0], bounds[0] = _bound(start, lefts[0], stop, rights[0], constant, linear, square)
        top = 1
        while top > 0:
            top -= 1
            tolerance = TOLERANCE * max(abs(best), 1e-30) if best < np.inf else 0.0
            if bounds[top] >= best - tolerance:
                continue
            low_t, high_t = ends[top, 0], ends[top, 1]
            width = high_t - low_t
            evaluations += 1
            if top + 2 > _DEPTH or evaluations > _EVALUATIONS or width < 1e-13 * (1.0 + abs(low_t)):
                floor = _floor(low_t, high_t, a, b, cross, single)
                floor += constant + _lowest(linear, square, low_t, high_t)[1] + min(lefts[top, 0], rights[top, 0])
                gap = max(gap, best - max(bounds[top], floor))
                continue
            t = min(max(targets[top], low_t + 0.1 * width), high_t - 0.1 * width)
            node[0], node[1], node[2] = _curved(t, a, b, cross, single, root)
            value = constant + linear * t + square * t * t + node[0] + node[1]
            if value < best:
                t_best, best = t, value
            assign(rights[top + 1], rights[top])
            ends[top + 1, 0], ends[top + 1, 1] = t, high_t
            assign(lefts[top + 1], node)
            assign(rights[top], node)
            ends[top, 1] = t
            for child in range(top, top + 2):
                targets[child], bounds[child] = _bound(
                    ends[child, 0], lefts[child], ends[child, 1], rights[child], constant, linear, square
                )
            if bounds[top] < bounds[top + 1]:
                for side in range(2):
                    ends[top, side], ends[top + 1, side] = ends[top + 1, side], ends[top, side]
                for part in range(3):
                    lefts[top, part], lefts[top + 1, part] = lefts[top + 1, part], lefts[top, part]
                    rights[top, part], rights[top + 1, part] = rights[top + 1, part], rights[top, part]
                targets[top], targets[top + 1] = targets[top + 1], targets[top]
                bounds[top], bounds[top + 1] = bounds[top + 1], bounds[top]
            top += 2
    return t_best, best, max(gap, TOLERANCE * abs(best))


@njit(apart=True)
def coupling(G: Array, lines: Array) -> float:
    """Largest |G_ij| between thrusters of different lines, relative to the largest |G|; `lines` has shape (k, n)."""
    k, n = lines.shape
    owner = np.full(n, -1)
    for g in range(k):
        for i in range(n):
            if abs(lines[g, i]) >= 1e-12:
                owner[i] = g
    largest, between = 0.0, 0.0
    for i in range(2 * n):
        for j in range(i + 1):
            size = abs(G[i, j])
            largest = max(largest, size)
            first, second = owner[i % n], owner[j % n]
            if first >= 0 and second >= 0 and first != second:
                between = max(between, size)
    return between / largest if largest > 0.0 else 0.0


@njit(apart=True)
def disjoint_search(
    G: Array, start: Array, lines: Array, lower: Array, upper: Array, previous: Array, weights: Array
) -> tuple[Array, float]:
    """Exact minimum when the null space is spanned by `lines`, shape (k, n), that share no thruster and no coupling.

    Returns the thrusts, shape (n,), and the proven gap (absolute, in the units of f).
    """
    thrusts = start.copy()
    gap = 0.0
    counted = np.ones(start.size, np.bool_)
    for g in range(lines.shape[0]):
        for i in range(start.size):
            if abs(lines[g, i]) >= 1e-12:
                counted[i] = False
    for g in range(lines.shape[0]):
        low, high = box_range(thrusts, lines[g], lower, upper)
        if low > high:
            continue
        t, _, part = line_minimum(G, thrusts, lines[g], counted, low, high, previous, weights, np.inf)
        if np.isfinite(t):
            thrusts += t * lines[g]
            gap += part
    return np.minimum(np.maximum(thrusts, lower), upper), gap


@njit
def split_allocation(
    G: Array,
    inverse: Array,
    wrench: Array,
    lines: Array,
    lower: Array,
    upper: Array,
    previous: Array,
    weights: Array,
    coupling_limit: float,
) -> tuple[bool, Array, float]:
    """Least thrusts and `disjoint_search` in one call: what a control step needs, wherever no limit is in the way.

    Returns whether it applies (the wrench can be made within limits, and the lines are not coupled), the thrusts and
    the proven gap. `inverse` has shape (n, 6).
    """
    n = lower.size
    start = np.zeros(n)
    for i in range(n):
        for axis in range(6):
            start[i] += inverse[i, axis] * wrench[axis]
    moves = np.zeros(n, np.bool_)
    for g in range(lines.shape[0]):
        low, high = box_range(start, lines[g], lower, upper)
        if low > high:
            return False, start, 0.0
        for i in range(n):
            moves[i] = moves[i] or abs(lines[g, i]) >= 1e-12
    for i in range(n):
        if not moves[i] and not lower[i] <= start[i] <= upper[i]:
            return False, start, 0.0
    if lines.shape[0] > 1 and coupling(G, lines) > coupling_limit:
        return False, start, 0.0
    thrusts, gap = disjoint_search(G, start, lines, lower, upper, previous, weights)
    return True, thrusts, gap


_STARTS = (0, 0, 6, 12, 24, 32)
_RESTS, _RESTS_KEPT = 400, 8


@njit
def coupled_directions(G: Array, owners: BoolArray, limit: float) -> BoolArray:
    """Which parts of the null space share a Gram entry, shape (b, b).

    `owners`, shape (b, n), are the thrusters of each part; what is below `limit` times the largest entry is none.
    """
    b, n = owners.shape
    strength, tied, largest = np.zeros((n, n)), np.zeros((b, b), np.bool_), 0.0
    for i in range(2 * n):
        for j in range(2 * n):
            strength[i % n, j % n] = max(strength[i % n, j % n], abs(G[i, j]))
            largest = max(largest, abs(G[i, j]))
    for p in range(b):
        for q in range(b):
            for i in range(n):
                for j in range(n):
                    if owners[p, i] and owners[q, j] and strength[i, j] > limit * largest:
                        tied[p, q] = True
    return tied


@cache
def start_directions(k: int) -> Array:
    """Unit vectors, shape (r, k), along which starts lie: a fixed stream, so that a wrench always gives its thrusts."""
    directions = np.random.default_rng(0).normal(size=(_STARTS[min(k, len(_STARTS) - 1)], k))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@njit
def feasible_starts(start: Array, previous: Array, null: Array, directions: Array, lower: Array, upper: Array) -> Array:
    """The least thrusts, the previous ones brought to this wrench, and points along directions, shape (r + 2, n).

    - `start`, `previous`, shape (n,): least thrusts and those of before.
    - `null`, shape (n, k): orthonormal columns.
    - Shapes: `directions` (r, k); `lower`, `upper` (n,).
    """
    n, k = null.shape
    many = directions.shape[0]
    starts, step = np.empty((many + 2, n)), np.empty(n)
    for number in range(-2, many):
        share = 0.0 if number == -2 else 1.0
        if number >= 0:
            share = ((number + 1) / many) ** 2
        step[:] = 0.0
        for c in range(k):
            along = 0.0
            if number >= 0:
                along = directions[number, c]
            else:
                for i in range(n):
                    along += null[i, c] * (previous[i] - start[i])
            for i in range(n):
                step[i] += along * null[i, c]
        far = share * step_limit(start, step, lower, upper, np.inf if number >= 0 else 1.0)
        for i in range(n):
            starts[number + 2, i] = min(max(start[i] + far * step[i], lower[i]), upper[i])
    return starts


@njit
def step_limit(start: Array, step: Array, lower: Array, upper: Array, most: float) -> float:
    """Largest t <= most that keeps start + t step within limits."""
    far = most
    for i in range(step.size):
        if abs(step[i]) > 1e-12:
            far = min(far, ((upper[i] if step[i] > 0.0 else lower[i]) - start[i]) / step[i])
    return max(far, 0.0)


def idle_starts(
    start: Array, previous: Array, null: Array, G: Array, packed: Array, lower: Array, upper: Array
) -> Array:
    """The cheapest of many points where as many thrusters rest as the null space has dimensions: minima like these."""
    k = null.shape[1]
    moving = np.flatnonzero(np.any(np.abs(null) > 1e-12, axis=1))
    rng = np.random.default_rng(0)
    sets = np.array([rng.permutation(moving)[:k] for _ in range(_RESTS)])
    sets = sets[np.abs(np.linalg.det(null[sets])) > 1e-3 / 2.0**k]
    shifts = np.linalg.solve(null[sets], start[sets][:, :, None])[:, :, 0]
    T = start - shifts @ null.T
    np.put_along_axis(T, sets, 0.0, axis=1)
    T = T[np.all((lower <= T) & (upper >= T), axis=1)]
    values = np.array([cost(G, row, previous, packed) for row in T])
    return np.ascontiguousarray(T[np.argsort(values, kind="stable")[:_RESTS_KEPT]])


@njit(apart=True)
def _move(
    G: Array, thrusts: Array, direction: Array, lower: Array, upper: Array, previous: Array, weights: Array
) -> float:
    """Move `thrusts` (in place) to the global minimum along a line through it; return the gain."""
    low, high = box_range(thrusts, direction, lower, upper)
    if not low < high or not np.isfinite(high - low):
        return 0.0
    low, high = min(low, 0.0), max(high, 0.0)
    counted = np.ones(thrusts.size, np.bool_)
    trial = thrusts.copy()
    before = cost(G, thrusts, previous, weights)
    t, _, _ = line_minimum(G, thrusts, direction, counted, low, high, previous, weights, np.inf)
    if not np.isfinite(t):
        return 0.0
    for i in range(trial.size):
        trial[i] = min(max(thrusts[i] + t * direction[i], lower[i]), upper[i])
    after = cost(G, trial, previous, weights)
    if after < before:
        assign(thrusts, trial)
        return before - after
    return 0.0


@njit(apart=True)
def descend(
    G: Array, thrusts: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array, sweeps: int
) -> float:
    """Line searches along the null vectors and along what keeps immovable thrusters immovable; in place, returns f."""
    n, k = null.shape
    held = np.empty((n, k))
    for _ in range(sweeps):
        gain = 0.0
        for c in range(k):
            gain += _move(G, thrusts, null[:, c].copy(), lower, upper, previous, weights)
        # In a kink (T_i = 0) f rises steeply to both sides: go on along the valley, with those T_i held.
        count = 0
        for i in range(n):
            if abs(thrusts[i]) < 1e-9 and count < k - 1:
                row = null[i].copy()
                for h in range(count):
                    row -= held[h] * np.dot(row, held[h])
                size = np.sqrt(np.dot(row, row))
                if size > 1e-9:
                    assign(held[count], row / size)
                    count += 1
        if count > 0:
            for c in range(k):
                step = np.zeros(k)
                step[c] = 1.0
                for h in range(count):
                    step -= held[h] * held[h, c]
                size = np.sqrt(np.dot(step, step))
                if size > 1e-6:
                    gain += _move(G, thrusts, null @ (step / size), lower, upper, previous, weights)
        if gain <= TOLERANCE * cost(G, thrusts, previous, weights):
            break
    return cost(G, thrusts, previous, weights)


@njit(apart=True)
def multistart_descent(
    G: Array, thrusts: Array, null: Array, lower: Array, upper: Array, previous: Array, weights: Array, rounds: int
) -> float:
    """Leave a minimum by bringing one thruster at a time to rest, or across zero, and descend from there; in place.

    Ends after a round without gain. Returns f.
    """
    n = thrusts.size
    value = cost(G, thrusts, previous, weights)
    for _ in range(rounds):
        before = value
        for i in range(n):
            along = np.dot(null[i], null[i])
            if along < 1e-9:
                continue
            direction = null @ null[i]
            for kick in range(2):
                goal, size = 0.0 if kick == 0 else -thrusts[i], 0.0
                for j in range(n):
                    size += abs(thrusts[j])
                if abs(thrusts[i]) < 1e-9:
                    goal = size / n if kick == 0 else -size / n
                low, high = box_range(thrusts, direction, lower, upper)
                t = min(max((goal - thrusts[i]) / along, min(low, 0.0)), max(high, 0.0))
                trial = np.empty(n)
                for j in range(n):
                    trial[j] = min(max(thrusts[j] + t * direction[j], lower[j]), upper[j])
                found = descend(G, trial, null, lower, upper, previous, weights, 4)
                if found < value * (1.0 - 1e-9):
                    value = found
                    assign(thrusts, trial)
        if value >= before:
            break
    return value

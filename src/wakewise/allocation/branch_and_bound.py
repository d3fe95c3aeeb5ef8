"""Branch and bound: global minimum of the allocation cost for null spaces of any dimension, with a proven gap.

As many thrusters as the null space has dimensions determine all others. Those of least thrust in the incumbent are the
coordinates, since minima lie where thrusters are idle. A box of their thrusts has 2^k corners and a lower bound; boxes
are taken in the order of their bounds and halved along the side that improves the bound most.

Lower bound of a cell from its corners. Where the signs are fixed, the cost (`line_search`) is concave (terms with
G_ij > 0) plus convex (squares, G_ii |T_i|, terms with G_ij < 0). With the convex part replaced by a tangent plane the
whole is concave, so its minimum is at a corner. Where a thrust changes sign within the cell, its terms with G_ij > 0
count as zero or as the least that their partners leave; |T_i| has the tangents of a vee; for G_ij < 0
sqrt(x y) <= (r x + y / r) / 2, with |T_i| interpolated from the corners.
"""

from __future__ import annotations

import heapq

import numpy as np

from wakewise.allocation.line_search import cost, descend, multistart_descent
from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, njit

RELATIVE_GAP = 1e-5
"""Relative gap at which a search ends: a tenth of what the thrusters could show."""

_ROUNDING_N = 1e-9


@njit(apart=True)
def _terms(
    G: Array,
    signs: Array,
    roots: Array,
    at: Array,
    previous: Array,
    weights: Array,
    cross: Array,
    linear: Array,
) -> None:
    """Fill the factor of each product of roots, shape (n, n), j < i, and the slope of each |T_i| by T_i, shape (n,).

    `roots`, shape (n, 2), holds the least and the greatest sqrt|T_i| at the corners.
    """
    n = signs.size
    for i in range(n):
        forward, reverse = weights[0] * G[i, i], -weights[0] * G[i + n, i + n]
        if signs[i] == 0.0:
            # A root lies above its chord from zero, so partners that do not come near zero steepen the vee.
            for j in range(n):
                if signs[j] != 0.0 and roots[j, 0] > 0.0:
                    slot = j if signs[j] > 0.0 else j + n
                    factor = 2.0 * weights[0] * roots[j, 0] / roots[i, 1]
                    forward += factor * max(G[i, slot], 0.0)
                    reverse -= factor * max(G[i + n, slot], 0.0)
            linear[i] = forward if at[i] > 0.0 else (reverse if at[i] < 0.0 else 0.5 * (forward + reverse))
        else:
            linear[i] = forward if signs[i] > 0.0 else reverse
        linear[i] -= 2.0 * weights[2] * previous[i]
        for j in range(i):
            if signs[i] != 0.0 and signs[j] != 0.0:
                cross[i, j] = 2.0 * weights[0] * G[i if signs[i] > 0.0 else i + n, j if signs[j] > 0.0 else j + n]
                continue
            worst = 0.0
            for half_i in range(2):
                for half_j in range(2):
                    if signs[i] != (-1.0 if half_i == 0 else 1.0) and signs[j] != (-1.0 if half_j == 0 else 1.0):
                        worst = min(worst, 2.0 * weights[0] * G[i + n * half_i, j + n * half_j])
            cross[i, j] = worst


@njit(apart=True)
def _tangent(
    cross: Array, single: Array, linear: Array, square: float, at: Array, signs: Array, slope: Array, size_slope: Array
) -> float:
    """Tangent plane of the convex part at `at`: slopes by T and by |T|, shape (n,) each; returns its constant."""
    n = at.size
    constant = 0.0
    for i in range(n):
        slope[i] = linear[i] + 2.0 * square * at[i]
        size_slope[i] = 0.0
        constant -= square * at[i] * at[i]
        if single[i] < 0.0:
            x = max(np.sqrt(abs(at[i])), 1e-6)
            size_slope[i] += 0.5 * single[i] / x
            constant += 0.5 * single[i] * x
    for i in range(n):
        for j in range(i):
            c = cross[i, j]
            if c < 0.0:
                ratio = np.sqrt(max(abs(at[j]), 1e-12) / max(abs(at[i]), 1e-12))
                size_slope[i] += 0.5 * c * ratio
                size_slope[j] += 0.5 * c / ratio
    for i in range(n):
        if signs[i] != 0.0:
            slope[i] += signs[i] * size_slope[i]
            size_slope[i] = 0.0
    return constant


@njit(inline="always")
def _least_corner(
    concave: Array, constant: float, slope: Array, size_slope: Array, T: Array, count: int
) -> tuple[float, int]:
    """Least value at a corner of the concave part plus a plane, and which corner that is."""
    least, lowest = np.inf, 0
    for r in range(count):
        here = concave[r] + constant
        for i in range(slope.size):
            here += slope[i] * T[r, i]
            if size_slope[i] != 0.0:
                here += size_slope[i] * abs(T[r, i])
        if here < least:
            least, lowest = here, r
    return least, lowest


@njit(apart=True)
def _gather(cross: Array, signs: Array, root: Array, roots: Array, count: int, single: Array, concave: Array) -> bool:
    """Join what hangs on the root of a thrust that comes close to zero into one term; False if nothing does.

    Where sqrt|T_i| varies and its partners hardly do, sqrt|T_i| sum_j c_ij sqrt|T_j| is not less than sqrt|T_i| times
    the sum of each product's least value: steep terms of both signs cancel before they are bounded. Changes `cross`,
    and fills `single`, shape (n,), and `concave` at the corners.
    """
    n = single.size
    small = np.zeros(n, np.bool_)
    for i in range(n):
        single[i] = 0.0
        small[i] = signs[i] != 0.0 and roots[i, 0] < 0.25 * roots[i, 1]
    joined = False
    for i in range(n):
        for j in range(i):
            c = cross[i, j]
            if small[i] == small[j] or c == 0.0 or signs[i] == 0.0 or signs[j] == 0.0:
                continue
            at, other = (i, j) if small[i] else (j, i)
            single[at] += c * (roots[other, 0] if c > 0.0 else roots[other, 1])
            cross[i, j] = 0.0
            joined = True
    if not joined:
        return False
    for r in range(count):
        concave[r] = 0.0
        for i in range(n):
            concave[r] += max(single[i], 0.0) * root[r, i]
            for j in range(i):
                if cross[i, j] > 0.0:
                    concave[r] += cross[i, j] * root[r, i] * root[r, j]
    return True


@njit(apart=True)
def _balance(
    concave: Array, linear: Array, square: float, along: Array, widths: Array, centre: Array, at: Array
) -> None:
    """Nearly the least point of a box where the concave part is as flat as its mean slopes say; fills `at`, shape (n,).

    A plane that touches the squares there loses nothing where effort decides.
    """
    n, k = along.shape
    slope, metric, moved = np.zeros(k), np.zeros((k, k)), np.zeros(k)
    corners = 1 << k
    for c in range(k):
        for r in range(corners):
            slope[c] += (concave[r] if (r >> c) & 1 else -concave[r]) / (0.5 * corners * max(widths[c], 1e-12))
        for i in range(n):
            slope[c] += along[i, c] * (linear[i] + 2.0 * square * centre[i])
        for d in range(k):
            for i in range(n):
                metric[c, d] += 2.0 * square * along[i, c] * along[i, d]
    for _ in range(8):
        for c in range(k):
            total = slope[c]
            for d in range(k):
                total += metric[c, d] * moved[d]
            moved[c] = min(max(moved[c] - total / metric[c, c], -0.5 * widths[c]), 0.5 * widths[c])
    for i in range(n):
        at[i] = centre[i]
        for c in range(k):
            at[i] += along[i, c] * moved[c]


@njit(apart=True)
def cell_lower_bound(
    G: Array,
    T: Array,
    along: Array,
    widths: Array,
    lower: Array,
    upper: Array,
    previous: Array,
    weights: Array,
    best: Array,
    value: float,
) -> tuple[float, float, int]:
    """Lower bound on the cost in a box of 2^k corners T, shape (2^k + 1, n); the last row is overwritten.

    Bit c of a corner's number says whether it is at the far end of side c, which is `widths[c]` long and moves the
    thrusts by `along[:, c]` per newton.

    Corners and centre within limits are tried; what costs less than `value` goes into `best`. Returns the bound, the
    least cost known and the corner that the bound comes from.
    """
    n = lower.size
    count = T.shape[0] - 1
    square = weights[1] + weights[2]
    base = weights[2] * np.dot(previous, previous)
    cross, linear, signs = np.empty((n, n)), np.empty(n), np.empty(n)
    root, roots, concave = np.empty((count + 1, n)), np.empty((n, 2)), np.empty(count)
    for i in range(n):
        least, most, total = T[0, i], T[0, i], 0.0
        for r in range(count):
            least, most, total = min(least, T[r, i]), max(most, T[r, i]), total + T[r, i]
        T[count, i] = total / count
        signs[i] = 1.0 if least >= -_ROUNDING_N else (-1.0 if most <= _ROUNDING_N else 0.0)
        for r in range(count + 1):
            if signs[i] != 0.0:
                T[r, i] = signs[i] * max(signs[i] * T[r, i], 0.0)
            root[r, i] = np.sqrt(abs(T[r, i]))
        roots[i, 0], roots[i, 1] = root[0, i], root[0, i]
        for r in range(1, count):
            roots[i, 0], roots[i, 1] = min(roots[i, 0], root[r, i]), max(roots[i, 1], root[r, i])
    centre = T[count].copy()
    _terms(G, signs, roots, centre, previous, weights, cross, linear)
    cheapest, least_cost = 0, np.inf
    for r in range(count):
        concave[r], convex = 0.0, 0.0
        for i in range(n):
            convex += (linear[i] + square * T[r, i]) * T[r, i]
            for j in range(i):
                term = cross[i, j] * root[r, i] * root[r, j]
                if term > 0.0:
                    concave[r] += term
                else:
                    convex += term
        if concave[r] + convex < least_cost:
            cheapest, least_cost = r, concave[r] + convex
    for r in (cheapest, count):
        inside = True
        for i in range(n):
            inside = inside and lower[i] - 1e-12 <= T[r, i] <= upper[i] + 1e-12
        if inside:
            here = cost(G, T[r], previous, weights)
            if here < value:
                value = here
                assign(best, T[r])
    slope, size_slope, at, single = np.empty(n), np.empty(n), centre.copy(), np.zeros(n)
    bound, corner = -np.inf, 0
    if square > 0.0:
        _balance(concave, linear, square, along, widths, centre, at)
        _terms(G, signs, roots, at, previous, weights, cross, linear)
    for turn in range(6):
        # Planes that touch where squares and mean slopes balance, at the centre, between it and the least corner, and
        # (nearly) at the cheapest corner: there, round a minimum, only the curvature of the concave part is lost.
        # Then two with gathered terms.
        constant = _tangent(cross, single, linear, square, at, signs, slope, size_slope) + base
        least, lowest = _least_corner(concave, constant, slope, size_slope, T, count)
        bound = max(bound, least)
        if bound >= value - RELATIVE_GAP * abs(value):
            break
        if turn == 0:
            corner = lowest
            _terms(G, signs, roots, centre, previous, weights, cross, linear)
        if turn == 3 and not _gather(cross, signs, root, roots, count, single, concave):
            break
        toward, share = (lowest, 0.0) if turn == 0 else ((cheapest, 0.98) if turn % 2 == 0 else (lowest, 0.5))
        for i in range(n):
            at[i] = (1.0 - share) * centre[i] + share * T[toward, i]
    return bound, value, corner


@njit(apart=True)
def coordinates(null: Array, thrusts: Array) -> IntArray:
    """Thrusters, shape (k,), whose rows of `null` are independent, those of least |thrust| first."""
    n, k = null.shape
    left = null.copy()
    chosen = np.empty(k, np.int64)
    for c in range(k):
        largest = 0.0
        for i in range(n):
            largest = max(largest, np.dot(left[i], left[i]))
        pick, least = -1, np.inf
        for i in range(n):
            if np.dot(left[i], left[i]) > 0.1 * largest and abs(thrusts[i]) < least:
                pick, least = i, abs(thrusts[i])
        chosen[c] = pick
        row = left[pick] / np.sqrt(np.dot(left[pick], left[pick]))
        for i in range(n):
            assign(left[i], left[i] - np.dot(left[i], row) * row)
    return chosen


@njit
def global_minimum(
    G: Array,
    starts: Array,
    null: Array,
    lower: Array,
    upper: Array,
    previous: Array,
    weights: Array,
    budget: int,
) -> tuple[Array, float, int]:
    """Minimum of the cost over T = start + null lambda within limits.

    - `starts`, shape (r, n): thrusts within limits that make the wrench; descents from them give the first answer.
    - `null`, shape (n, k): orthonormal columns.
    - `budget`: most boxes to look at.
    - Shapes: `G` (2 n, 2 n); `lower`, `upper`, `previous` (n,); `weights` (3,).

    The gap is absolute, in the units of the cost.
    """
    n, k = null.shape
    best, value = starts[0].copy(), np.inf
    for r in range(starts.shape[0]):
        trial = starts[r].copy()
        found = descend(G, trial, null, lower, upper, previous, weights, 8)
        if found < value:
            best, value = trial, found
    if k > 2:
        value = multistart_descent(G, best, null, lower, upper, previous, weights, 4)
    free = coordinates(null, best)
    rows = np.empty((k, k))
    for c in range(k):
        assign(rows[c], null[free[c]])
    along = null @ np.linalg.inv(rows)
    # How much a side loosens the bound, per newton: by what its thrusters disturb, and a little by their number.
    looseness, share = np.zeros(k), 0.1 * weights[0] * np.trace(G) / n
    for i in range(n):
        own = weights[0] * (G[i, i] + G[i + n, i + n])
        for c in range(k):
            looseness[c] += (own + share) * abs(along[i, c])
    origin = starts[0].copy()
    for c in range(k):
        origin -= along[:, c] * starts[0][free[c]]
    for c in range(k):
        origin[free[c]] = 0.0
    room = 2 * budget + 4
    lows, highs, targets = np.empty((room, k)), np.empty((room, k)), np.empty((room, k))
    corners = 1 << k
    T, widths = np.empty((corners + 1, n)), np.empty(k)
    # No thrust of a better answer is larger than effort alone allows.
    most = np.sqrt(value / weights[1]) * (1.0 + 1e-9) if weights[1] > 0.0 else np.inf
    for c in range(k):
        lows[0, c], highs[0, c] = max(lower[free[c]], -most), min(upper[free[c]], most)
    queue = [(0.0, 0)]
    queue.pop()
    made, pending, seen, closed, parent = 1, 1, 0, np.inf, 0.0
    trial = best.copy()
    while True:
        for box in range(made - pending, made):
            seen += 1
            empty = False
            for i in range(n):
                least, greatest = origin[i], origin[i]
                for c in range(k):
                    first, second = along[i, c] * lows[box, c], along[i, c] * highs[box, c]
                    least, greatest = least + min(first, second), greatest + max(first, second)
                low, high = max(lower[i], -most), min(upper[i], most)
                empty = empty or greatest < low - 1e-9 or least > high + 1e-9
            if empty:
                continue
            for c in range(k):
                widths[c] = highs[box, c] - lows[box, c]
            for r in range(corners):
                for i in range(n):
                    T[r, i] = origin[i]
                    for c in range(k):
                        T[r, i] += along[i, c] * (highs[box, c] if (r >> c) & 1 else lows[box, c])
            bound, found, corner = cell_lower_bound(G, T, along, widths, lower, upper, previous, weights, trial, value)
            if found < value * (1.0 - 1e-12):
                descent = np.empty(n)
                for i in range(n):
                    descent[i] = min(max(trial[i], lower[i]), upper[i])
                found = descend(G, descent, null, lower, upper, previous, weights, 4)
                if found < value:
                    best, value = descent, found
            bound = max(bound, parent)
            if bound >= value - RELATIVE_GAP * abs(value):
                closed = min(closed, bound)
                continue
            for c in range(k):
                targets[box, c] = highs[box, c] if (corner >> c) & 1 else lows[box, c]
            heapq.heappush(queue, (bound, box))
        if len(queue) == 0 or queue[0][0] >= value - RELATIVE_GAP * abs(value) or seen + 2 > budget:
            break
        parent, box = heapq.heappop(queue)
        longest, side = 0.0, 0
        for c in range(k):
            width = (highs[box, c] - lows[box, c]) * looseness[c]
            if width > longest:
                longest, side = width, c
        if longest < 1e-9:
            closed = min(closed, parent)
            pending = 0
            continue
        low, high = lows[box, side], highs[box, side]
        level = 0.25 * (low + high) + 0.5 * targets[box, side]
        level = min(max(level, low + 0.3 * (high - low)), high - 0.3 * (high - low))
        if low < 0.0 < high:
            level = 0.0
        for half in range(2):
            assign(lows[made], lows[box])
            assign(highs[made], highs[box])
            if half == 0:
                highs[made, side] = level
            else:
                lows[made, side] = level
            made += 1
        pending = 2
    value = min(value, descend(G, best, null, lower, upper, previous, weights, 60))
    proven = min(closed, value)
    if len(queue) > 0:
        proven = min(proven, queue[0][0])
    return best, max(value - proven, 0.0), seen

"""Branch and bound over boxes: the global minimum for null spaces of any dimension, with a proven gap.

As many thrusters as the null space has dimensions set all the others. Those of least thrust in the best answer known
are taken as coordinates, since minima lie where thrusters rest; a box of their thrusts has 2^k corners and a lower
bound (`cells`). Boxes are taken in the order of their bounds and halved along the side that loosens the bound most.
"""

from __future__ import annotations

import heapq

import numpy as np

from wakewise.allocation.coordinate_descent import descend, multistart_descent
from wakewise.allocation.cost_bounds import RELATIVE_GAP, cell_lower_bound
from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, njit


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

    Parameters
    ----------
    G : ndarray, shape (2 n, 2 n)
    starts : ndarray, shape (r, n)
        Thrusts within limits that make the wrench; descents from them give the first answer.
    null : ndarray, shape (n, k)
        Orthonormal columns.
    lower, upper, previous : ndarray, shape (n,)
    weights : ndarray, shape (3,)
    budget : int
        Most boxes to look at.

    Returns
    -------
    thrusts, gap, boxes
        The gap is absolute, in the units of the cost: no thrusts of this wrench cost less than the result's cost - gap.
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

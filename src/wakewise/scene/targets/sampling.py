"""Few weighted points that stand for many: cells, middles, and weights that are right for jets.

D adds the squared speed of jets over a region. A jet is a tube: across it the squared speed falls off within a few
centimetres, along it hardly at all. How alike the speeds at two points are, over tubes through random places in random
directions, therefore falls with the square of their distance r once it exceeds the width, since that is the chance
that a tube through the one reaches the other. The simplest such likeness is

    k(r) = 1 / (1 + r^2 / l^2).

(Tubes with a Gaussian profile of standard deviation s have exactly F(a) / a with a = r / (2 s), F Dawson's integral:
1 - r^2 / (6 s^2) near, 2 s^2 / r^2 far. So k is a mixture of widths, s = l / sqrt(2) in the mean square and
l / sqrt(6) in the harmonic one.) The mean squared error of sum_j w_j f(x_j) over such f, for a region of measure m, is

    e(x, w) = w' K w - 2 w' z + const,   K_ij = k(|x_i - x_j|),   z_i = integral of k(|x_i - y|) dm(y),

and `relaxed` moves points and weights to make it small, as quadrature for the average case does (F.-X. Briol et al.,
Stat. Sci. 34 (2019) 1, doi 10.1214/18-STS660). No jet model enters but its width.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import Bounds, minimize
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit

LIKENESS_M = 0.06
"""Length l of the likeness: widths s of 2.4 to 4.2 cm, a round jet's at 0.4 to 0.7 m (half-width slope 0.096)."""
LEAST_SHARE = 0.1
"""No relaxed point weighs less than this share of the mean: a point of no weight would be wasted."""
NEGLIGIBLE = 1e-3
"""A disturbance below this share of the largest is no disturbance; see `sampling_error_pct`."""


def cell_middles(points: Array, weights: Array, cells: int) -> tuple[Array, Array]:
    """Cut points into cells of equal weight, halving across the longest side; give the cells' centroids and weights.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    weights : ndarray, shape (n,)
        Positive.
    cells : int
        At most n.

    Returns
    -------
    tuple of ndarray, shapes (cells, 3) and (cells,)
        Total weight and first moment are those of the points.
    """
    middles, totals = np.empty((cells, 3)), np.empty(cells)

    def cut(members: IntArray, first: int, cells: int) -> None:
        here, share = points[members], weights[members]
        if cells == 1:
            totals[first] = share.sum()
            middles[first] = share @ here / totals[first]
            return
        left = cells // 2
        order = np.argsort(here[:, np.argmax(np.ptp(here, axis=0))], kind="stable")
        running = np.cumsum(share[order])
        split = int(np.searchsorted(running, running[-1] * left / cells))
        split = min(max(split, left), len(members) - (cells - left))
        cut(members[order[:split]], first, left)
        cut(members[order[split:]], first + left, cells - left)

    cut(np.arange(len(points)), 0, cells)
    return middles, totals


def centroidal(points: Array, weights: Array, count: int, rounds: int = 15) -> tuple[Array, Array]:
    """Centroids and weights of `count` clusters of weighted points: Lloyd's iteration from equal cells.

    A sum over centroids times weights keeps the total and the first moment exactly, and is in error by the second
    moment of the clusters, which Lloyd's iteration makes small (Q. Du, V. Faber and M. Gunzburger, SIAM Rev. 41 (1999)
    637, doi 10.1137/S0036144599352836).

    Parameters
    ----------
    points, weights : ndarray, shapes (n, 3) and (n,)
    count : int
        At most n.

    Returns
    -------
    tuple of ndarray, shapes (count, 3) and (count,)
    """
    middles, totals = cell_middles(points, weights, count)
    for _ in range(rounds):
        nearest = KDTree(middles).query(points)[1]
        share = np.asarray(np.bincount(nearest, weights, count), dtype=np.float64)
        if not np.all(share > 0.0):  # two middles at one place: the last cells without a gap stand
            break
        moment = np.stack([np.bincount(nearest, weights * points[:, k], count) for k in range(3)], axis=1)
        middles, totals = moment / share[:, None], share
    return middles, totals


def relaxed(
    points: Array, weights: Array, free: BoolArray, cells: Array, cell_weights: Array, rounds: int = 80
) -> tuple[Array, Array]:
    """Move free points and all weights so that random tubes are summed well over the measure that cells stand for.

    Parameters
    ----------
    points, weights : ndarray, shapes (n, 3) and (n,)
        Where to start.
    free : ndarray of bool, shape (n,)
        Points that may move.
    cells, cell_weights : ndarray, shapes (m, 3) and (m,)
        The measure, finely.
    rounds : int
        Iterations of L-BFGS-B at most.

    Returns
    -------
    tuple of ndarray, shapes (n, 3) and (n,)
        Weights are positive and have the measure's total.
    """
    n, total = len(points), float(cell_weights.sum())
    unit = total / n
    moving = np.flatnonzero(free)
    wished, _ = _likeness_sums(points, cells, cell_weights)

    def error(x: Array) -> tuple[float, Array]:
        w, place = x[:n] * unit, points.copy()
        place[moving] = x[n:].reshape(-1, 3) * LIKENESS_M
        own, own_slope = _likeness_sums(place, place, w)
        wished[moving], slope = _likeness_sums(place[moving], cells, cell_weights)
        # A constant added to the likeness makes the sum of any constant right too.
        excess = w.sum() - total
        value = w @ own - 2.0 * w @ wished + excess**2
        by_weight = 2.0 * (own - wished + excess) * unit
        by_place = 2.0 * w[moving, None] * (own_slope[moving] - slope) * LIKENESS_M
        return float(value) / unit**2, np.concatenate([by_weight, by_place.ravel()]) / unit**2

    start = np.concatenate([np.maximum(weights / unit, LEAST_SHARE), points[moving].ravel() / LIKENESS_M])
    found = _least(error, start, n, rounds)
    place, w = points.copy(), found[:n]
    place[moving] = found[n:].reshape(-1, 3) * LIKENESS_M
    return place, w * (total / w.sum())


def reweighted(points: Array, weights: Array, cells: Array, cell_weights: Array, rounds: int = 60) -> Array:
    """Weights, shape (n,), that sum random tubes well at fixed points; arguments as in `relaxed`."""
    n, total = len(points), float(cell_weights.sum())
    unit = total / n
    K = 1.0 / (1.0 + cdist(points, points, "sqeuclidean") / LIKENESS_M**2) + 1.0
    z = (_likeness_sums(points, cells, cell_weights)[0] + total) / unit

    def error(w: Array) -> tuple[float, Array]:
        Kw = K @ w
        return float(w @ Kw - 2.0 * w @ z), 2.0 * (Kw - z)

    w = _least(error, np.maximum(weights / unit, LEAST_SHARE), n, rounds)
    return np.asarray(w * (total / w.sum()), dtype=np.float64)


def _least(error: Callable[[Array], tuple[float, Array]], start: Array, weights: int, rounds: int) -> Array:
    """Minimum found from `start`, whose first entries are weights in units of their mean."""
    low = np.full(len(start), -np.inf)
    low[:weights] = LEAST_SHARE
    found = minimize(
        error,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(low, np.inf),
        options={"maxiter": rounds, "ftol": 0.0, "maxcor": 10},
    )
    return np.asarray(found.x, dtype=np.float64)


def sampling_error_pct(sample: Array, reference: Array, negligible: float = NEGLIGIBLE) -> Array:
    """Error in percent of disturbances D of a sample against those of a reference, pose by pose.

    Relative to the reference where it matters; where the reference is below `negligible` times the largest of all, the
    error is relative to that bound instead, since nobody cares by what factor nothing differs from nothing.

    Parameters
    ----------
    sample, reference : ndarray, shape (n,)
        D of the same poses and thrusts, each divided by the total weight of its points.

    Returns
    -------
    ndarray, shape (n,)
    """
    sample, reference = np.asarray(sample, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if sample.shape != reference.shape or len(reference) == 0 or not reference.max() > 0.0:
        raise InputError("sampling error: needs the same number of disturbances of both, at least one above 0")
    return 100.0 * np.abs(sample - reference) / np.maximum(reference, negligible * reference.max())


@njit(fastmath=True)
def _likeness_sums(points: Array, sources: Array, masses: Array) -> tuple[Array, Array]:
    """Sum of masses times likeness at every point, shape (n,), and its gradient, shape (n, 3)."""
    value, slope = np.empty(len(points)), np.empty((len(points), 3))
    per_length = 1.0 / LIKENESS_M
    # Side by side in memory, so that several sources are done at once.
    sx, sy, sz = sources[:, 0].copy(), sources[:, 1].copy(), sources[:, 2].copy()
    for j in range(len(points)):
        total, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
        for i in range(len(sources)):
            x = (points[j, 0] - sx[i]) * per_length
            y = (points[j, 1] - sy[i]) * per_length
            z = (points[j, 2] - sz[i]) * per_length
            k = 1.0 / (1.0 + x * x + y * y + z * z)
            mk = masses[i] * k
            mkk = mk * k
            total += mk
            gx += mkk * x
            gy += mkk * y
            gz += mkk * z
        value[j] = total
        slope[j, 0], slope[j, 1], slope[j, 2] = -2.0 * per_length * gx, -2.0 * per_length * gy, -2.0 * per_length * gz
    return value, slope

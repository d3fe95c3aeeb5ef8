"""Region of the target: weighted sample points of the water that must stay still (quadrature of the disturbance).

The paper sums over points on the target's surface and in the water round it with weights exp(-d / 5 cm). Here the
region is the surface above the bed and all water above the bed within 10 cm of it. At n points the sum stands for

    D = n/2 * mean of f over the surface  +  n/2 * mean of f exp(-d / 5 cm) over the water,   f = squared speed,

the mean of the paper's sum with half of its points on the surface. A third of the points lies on the surface, two
thirds in the water, each weighted by its neighbourhood: the same integrals with less error. D grows with n: compare it
at equal n. Marked delicate features count 1 + gain * score times; gain 0 gives the paper's weights.

Quadrature for jets. Across a jet the squared speed falls off within a few centimetres, along it hardly at all. For
tubes through random places in random directions the covariance of the squared speed at two points falls with the
square of their distance r beyond the width:

    k(r) = 1 / (1 + r^2 / l^2).

(Gaussian tubes of standard deviation s have exactly F(a) / a with a = r / (2 s), F Dawson's integral; k is a mixture of
widths, s = l / sqrt(2) in the mean square and l / sqrt(6) in the harmonic mean.) For a region of measure m the mean
squared error of sum_j w_j f(x_j) is

    e(x, w) = w' K w - 2 w' z + const,   K_ij = k(|x_i - x_j|),   z_i = integral of k(|x_i - y|) dm(y),

and `relaxed` moves points and weights to reduce it (Bayesian quadrature, F.-X. Briol et al., Stat. Sci. 34 (2019) 1,
doi 10.1214/18-STS660). The jet model enters by its width only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import Bounds, minimize
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.interfaces import TargetEstimate
from wakewise.core.jit.njit import njit
from wakewise.scene.targets.distance import MeshDistance
from wakewise.scene.targets.fragility import Fragility
from wakewise.scene.targets.mesh import Mesh
from wakewise.scene.targets.rays import Rays
from wakewise.scene.targets.target import Target

LIKENESS_M = 0.06
"""Length l of the likeness: widths s of 2.4 to 4.2 cm, a round jet's at 0.4 to 0.7 m (half-width slope 0.096)."""
LEAST_SHARE = 0.1
"""No relaxed point weighs less than this share of the mean: a point of no weight would be wasted."""
NEGLIGIBLE = 1e-3
"""A disturbance below this share of the largest is no disturbance; see `sampling_error_pct`."""


def cell_middles(points: Array, weights: Array, cells: int) -> tuple[Array, Array]:
    """Cut points into cells of equal weight, halving across the longest side; give the cells' centroids and weights.

    - `weights`, shape (n,): positive.
    - `cells`: at most n.
    - Shapes: `points` (n, 3).

    Returns shapes (cells, 3) and (cells,): total weight and first moment are those of the points.
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

    `count`: at most n. Shapes: `points`, `weights` (n, 3) and (n,). Returns shapes (count, 3) and (count,).
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

    - `points`, `weights`, shapes (n, 3) and (n,): where to start.
    - `free`, shape (n,): points that may move.
    - `cells`, `cell_weights`, shapes (m, 3) and (m,): the measure, finely.
    - `rounds`: iterations of L-BFGS-B at most.

    Returns shapes (n, 3) and (n,): weights are positive and have the measure's total.
    """
    n, total = len(points), float(cell_weights.sum())
    unit = total / n
    moving = np.flatnonzero(free)
    target_sums, _ = _likeness_sums(points, cells, cell_weights)

    def error(x: Array) -> tuple[float, Array]:
        w, place = x[:n] * unit, points.copy()
        place[moving] = x[n:].reshape(-1, 3) * LIKENESS_M
        own, own_slope = _likeness_sums(place, place, w)
        target_sums[moving], slope = _likeness_sums(place[moving], cells, cell_weights)
        # A constant added to the likeness makes the sum of any constant right too.
        excess = w.sum() - total
        value = w @ own - 2.0 * w @ target_sums + excess**2
        by_weight = 2.0 * (own - target_sums + excess) * unit
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
    error is relative to that bound instead, because a ratio of two vanishing errors means nothing.

    `sample`, `reference`, shape (n,): D of the same poses and thrusts, each divided by the total weight of its points.
    Returns shape (n,).
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


DECAY_M = 0.05
"""The paper's decay length of the weights."""
SHELL_M = 0.10
"""How far from the surface the region reaches: two decay lengths, where the weight has fallen to 0.14."""
POINTS_ALLOWED = (2, 10_000)
GAIN_ALLOWED = (0.0, 100.0)
SURFACE_SHARE = 1.0 / 3.0
"""Share of the points that lie on the surface."""
MEASURE_POINTS = (8_000, 40_000)
"""Points of surface, and of water, that stand for the whole: at least, and at most unless very many are drawn."""
PER_POINT = (8, 130)
"""How many of these for each point drawn: never fewer, and as many as the number above allows."""
RELAXED_UP_TO = 600
"""Up to this many points are relaxed, at a cost of n times the cells; with more, clusters alone are good enough."""
CELLS = (1500, 3000)
"""Cells of surface and of water that points are fitted to, or six for each point if that is more."""

# Steps of a Kronecker sequence in three dimensions: powers of the root of x^4 = x + 1.
_KRONECKER = 1.2207440846057596 ** -np.arange(1.0, 4.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """Points of the water that must stay still."""

    points_W_m: Array  # shape (n, 3): in the world, above the bed; those on the surface come first
    weights: Array  # shape (n,): positive; each times the squared speed at its point adds to D
    distance_m: Array  # shape (n,): to the target's surface; 0 for the points on it

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), weights=(n,), distance_m=(n,))

    @classmethod
    def of_estimate(cls, found: TargetEstimate) -> Region:
        """The region of a target that the camera has found."""
        return cls(points_W_m=found.points_W_m, weights=found.weights, distance_m=found.distance_m)

    def moved(self, shift_W_m: Array) -> Region:
        """The same points about a target elsewhere, by a shift of shape (3,)."""
        return replace(self, points_W_m=self.points_W_m + shift_W_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseQuadrature:
    """The region as very many weighted points, surface first: what few points are to stand for."""

    points_W_m: Array  # shape (n, 3)
    # Shape (n,): those of the surface add up to 1/2 (without a gain), those of the water to 1/2 * mean of exp(-d / 5
    # cm).
    weights: Array
    on_surface: int  # how many of the points lie on the surface

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), weights=(n,))


def sample_region(
    target: Target, n: int, rng: np.random.Generator, delicacy: Fragility | None = None, gain: float = 0.0
) -> Region:
    """Draw the region's sample points: a third on the surface, the others in the water round it.

    A fine measure of the region is cut into clusters; points are set at their middles, moved a little and weighed so
    that jets from any side are summed well. Points end on the surface or in the water, never in the flesh.

    - `n`: number of points; the paper takes 150 for a simple and 300 for a branching target.
    - `delicacy`: of the target's mesh, one score per vertex.
    - `gain`: how many times more the most delicate feature counts, 0 to 100.

    Returns a function of target, n and the generator's state alone. Raises InputError if n is outside 2 to 10,000, the
    gain out of range or given without features, or the features of another mesh.
    """
    if not POINTS_ALLOWED[0] <= n <= POINTS_ALLOWED[1]:
        raise InputError(f"region points {n}: allowed {POINTS_ALLOWED[0]} to {POINTS_ALLOWED[1]}")
    count = max(PER_POINT[0] * n, int(np.clip(PER_POINT[1] * n, *MEASURE_POINTS)))
    solid = InsideTest(target.mesh)
    measure = region_measure(target, count, count, rng, delicacy, gain, solid)
    s = measure.on_surface
    surface, water = measure.points_W_m[:s], measure.points_W_m[s:]
    few = max(1, round(SURFACE_SHARE * n))
    fine = [
        cell_middles(points, weights, min(max(cells, 6 * n), len(points)))
        for points, weights, cells in zip(
            (surface, water), (measure.weights[:s], measure.weights[s:]), CELLS, strict=True
        )
    ]
    dry, dry_weights = centroidal(*fine[0], few)
    wet, wet_weights = centroidal(*fine[1], n - few)
    dry = surface[KDTree(surface).query(dry)[1]]
    points, weights = np.concatenate([dry, wet]), np.concatenate([dry_weights, wet_weights])
    if n <= RELAXED_UP_TO:
        points, weights = relaxed(points, weights, np.arange(n) >= few, *_joined(fine))
    wet, distance = _in_water(points[few:], target, solid, water)
    points = np.concatenate([dry, wet])
    if n <= RELAXED_UP_TO:
        weights = reweighted(points, weights, *_joined(fine))
    return Region(points_W_m=points, weights=n * weights, distance_m=np.concatenate([np.zeros(few), distance]))


def region_measure(
    target: Target,
    on_surface: int,
    in_water: int,
    rng: np.random.Generator,
    delicacy: Fragility | None = None,
    gain: float = 0.0,
    solid: InsideTest | None = None,
) -> DenseQuadrature:
    """Very many evenly spread points of surface and water with the paper's weights; a reference for fewer.

    - `on_surface`, `in_water`: how many of each.
    - `rng`, `delicacy`, `gain`: as in `sample_region`.
    - `solid`: of the target's mesh, where it is at hand.

    Raises InputError as `sample_region`.
    """
    if not GAIN_ALLOWED[0] <= gain <= GAIN_ALLOWED[1]:
        raise InputError(f"delicate gain {gain:g}: allowed {GAIN_ALLOWED[0]:g} to {GAIN_ALLOWED[1]:g}")
    if gain > 0.0 and delicacy is None:
        raise InputError(f"delicate gain {gain:g}: no delicate features were given, find or mark them first, or pass 0")
    if delicacy is not None and len(delicacy.score) != len(target.mesh.vertices_m):
        raise InputError(
            f"delicacy: {len(delicacy.score)} scores, allowed one per vertex of {target.name} "
            f"({len(target.mesh.vertices_m)})"
        )
    score = None if delicacy is None or gain == 0.0 else delicacy.score
    surface, surface_score = _surface_points(target, on_surface, rng, score)
    water, distance, nearest = _water_points(target, solid or InsideTest(target.mesh), surface, in_water, rng)
    dry = np.full(len(surface), 0.5 / len(surface)) * (1.0 + gain * surface_score)
    # Distance to the nearest of many surface points is a fraction of a millimetre too long: 0.3 % of weight at most.
    wet = 0.5 / len(water) * np.exp(-distance / DECAY_M) * (1.0 + gain * surface_score[nearest])
    return DenseQuadrature(
        points_W_m=np.concatenate([surface, water]), weights=np.concatenate([dry, wet]), on_surface=len(surface)
    )


def _joined(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([points for points, _ in parts]), np.concatenate([weights for _, weights in parts])


def _surface_points(target: Target, count: int, rng: np.random.Generator, score: Array | None) -> tuple[Array, Array]:
    """Points spread evenly over the surface above the bed, and their scores: systematic in area, random in the face."""
    triangles = target.mesh.triangles_m
    share = target.mesh.face_areas_m2 * (triangles[:, :, 2].mean(axis=1) < target.bed_z_m)
    running = np.cumsum(share)
    if not running[-1] > 0.0:
        raise InputError(f"target {target.name}: no surface above the bed, nothing to keep undisturbed")
    stops = (np.arange(count) + rng.random(count)) / count * running[-1]
    face = np.searchsorted(running, stops, side="right").clip(max=len(share) - 1)
    u, v = rng.random((2, count))
    fold = u + v > 1.0
    u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
    within = np.stack([1.0 - u - v, u, v], axis=1)
    points = np.einsum("nk,nkd->nd", within, triangles[face])
    values = np.zeros(count) if score is None else np.einsum("nk,nk->n", within, score[target.mesh.faces[face]])
    # A face that straddles the bed may give a point under it.
    above = points[:, 2] <= target.bed_z_m
    if not np.any(above):
        raise InputError(f"target {target.name}: no surface above the bed, nothing to keep undisturbed")
    return points[above], values[above]


def _water_points(
    target: Target, solid: InsideTest, surface: Array, count: int, rng: np.random.Generator
) -> tuple[Array, Array, IntArray]:
    """Points spread evenly over the water within the shell, their distances, and their nearest surface points."""
    low, high = surface.min(axis=0) - SHELL_M, surface.max(axis=0) + SHELL_M
    high[2] = target.bed_z_m
    # Many leaves to a node and no balancing: half of the query time, the same answers.
    tree = KDTree(surface, leafsize=32, balanced_tree=False)
    shift, done, held = rng.random(3), 0, 0
    found: list[tuple[Array, Array, IntArray]] = []
    while held < count:
        steps = np.arange(done, done + count)[:, None]
        points = low + (high - low) * ((shift + (steps + 1) * _KRONECKER) % 1.0)
        distance, nearest = map(np.asarray, tree.query(points, distance_upper_bound=SHELL_M))
        keep = np.flatnonzero(distance <= SHELL_M)
        keep = keep[~solid.holds(points[keep])]
        found.append((points[keep], distance[keep], nearest[keep]))
        done, held = done + count, held + len(keep)
    points, distance = (np.concatenate([part[k] for part in found])[:count] for k in (0, 1))
    return points, distance, np.concatenate([part[2] for part in found])[:count]


def _in_water(points: Array, target: Target, solid: InsideTest, water: Array) -> tuple[Array, Array]:
    """Points, those that left the region put back on its nearest water, and their exact distances to the surface."""
    measure = MeshDistance(target.mesh.vertices_m, target.mesh.faces)
    distance = measure(points)
    left = (points[:, 2] > target.bed_z_m) | (distance > SHELL_M) | solid.holds(points)
    if np.any(left):
        points = points.copy()
        points[left] = water[KDTree(water).query(points[left])[1]]
        distance[left] = measure(points[left])
    return points, distance


class InsideTest:
    """Tells the flesh from the water: a point is inside when the first face straight above it is seen from behind.

    A closed mesh is judged right. So is a scan that is open towards the bed, where a count of crossings could not be.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._rays = Rays(mesh)
        self._faces_up = mesh.area_vectors_m2[:, 2] < 0.0

    def holds(self, points_W_m: Array) -> BoolArray:
        """Whether each point, shape (n, 3), is inside."""
        face, _ = self._rays.first(points_W_m, np.array([0.0, 0.0, -1.0]))
        return np.asarray((face >= 0) & self._faces_up[face], dtype=np.bool_)

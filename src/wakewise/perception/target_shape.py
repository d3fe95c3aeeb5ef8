"""Centre, size and surface of a target that is seen from some sides only, from its mapped points.

Seen along a level direction, a target's outline gives its middle across that direction; two directions give its middle
in plan. Along a direction, points lie nearer than the middle by a share k of the half chord q of a round body,
s = c - k q: k is 1 of a body whose near side alone is seen and 0 of one that is seen through. Both c and k are fitted,
unless so much of its depth was seen that c is the middle of that.
The side that has not been seen is the seen one, mirrored through the upright axis of the centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.perception.bed_plane import BedPlane
from wakewise.scene.targets.region import DECAY_M, SHELL_M, SURFACE_SHARE, Region, cell_middles

ABOVE_BED_M = 0.02
"""Points higher above the bed are of what stands on it: more than ripples and small stones."""
JOINED_M = 0.04
"""Points no farther apart are of one body; what is not known of their places comes on top."""
LEAST_POINTS = 6
TAIL = 0.02
"""Share of the points beyond each end of an extent: outliers."""
ACROSS_STD_M = 0.004
"""Standard deviation of a middle across a view, besides what the number of points brings."""
NEARER, NEARER_STD = 0.4, 0.3
"""Prior of k: between a bush and a boulder."""
UNROUND = 0.2
"""Standard deviation of a middle along a view, by the half width: bodies are not round."""
SEEN_THROUGH = (0.5, 0.75)
"""Share of the width that was seen in depth, from which on a body begins to be, and is, taken as seen through."""
CORRELATED = 4.0
"""So many neighbouring points tell as much as one."""
WORST = 2.0
"""Largest standard deviation of a body's points over the lower quartile of theirs."""
SHARED = 4.0
"""Shapes of one body share most of their points: so many of them tell as much as one."""
CENTRE_WALK_M, ROUND_WALK_M = 0.008, 0.002
"""Random walk of the centre from one shape to the next: more of the target is seen; and once all of it was seen."""
RECENT = 100
"""How far round a target was seen is told by so many last places of the camera."""
LONELY = 2.5
"""Points whose third neighbour is farther off than this many times the median are outliers."""
TALLEST_M = 2.0
SECTOR_RAD = math.radians(15.0)
"""Views within one sector in azimuth count once."""
ALL_ROUND_RAD = math.radians(225.0)
"""Seen from so far round, a target has no side that was not seen."""
BOX_TAIL, TOP_TAIL = 0.01, 0.005
"""As `TAIL`, of the box round a body that was seen from all round, and of its top: thin tips are seen by few points."""
VOXEL_M = 0.008
FILL = 12
"""Samples of the water per point of the region."""

_KRONECKER = 1.2207440846057596 ** -np.arange(1.0, 4.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetShape:
    """Centre (middle of the box above the bed), shape (3,), its covariance, (3, 3), radius, and surface points, (n, 3).

    The surface is thinned to one point in `VOXEL_M`, those of the side that was seen first, `seen` of them.
    `all_round`: whether it was seen from all round.
    """

    centre_W_m: Array
    covariance: Array
    radius_m: float
    surface_W_m: Array
    seen: int
    all_round: bool = False

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,), covariance=(3, 3), surface_W_m=(None, 3))

    @property
    def centre_std_m(self) -> float:
        """Standard deviation of the distance of the centre from the true one."""
        return math.sqrt(float(np.trace(self.covariance)))


def bodies(points_W_m: Array, bed: BedPlane, std_m: Array) -> list[IntArray]:
    """Indices of the points of each body that stands on the bed, largest body first; `std_m`, shape (n,): of points.

    Points in one cell of half of `JOINED_M` are of one body; cells are joined by the middles of their points.
    """
    height = bed.height_m(points_W_m)
    above = np.flatnonzero((height > ABOVE_BED_M) & (height < TALLEST_M))
    if not len(above):
        return []
    cells, cell = np.unique(
        np.floor(points_W_m[above] / (0.5 * JOINED_M)).astype(np.int64), axis=0, return_inverse=True
    )
    cell = cell.reshape(-1)  # NumPy 2.0 gave it another shape than later ones
    n, held = len(cells), np.bincount(cell)
    middles = np.stack([np.bincount(cell, along) for along in points_W_m[above].T], axis=1) / held[:, None]
    unsure = np.bincount(cell, std_m[above]) / held
    pairs = KDTree(middles).query_pairs(JOINED_M + float(unsure.max()), output_type="ndarray")
    apart = np.linalg.norm(middles[pairs[:, 0]] - middles[pairs[:, 1]], axis=1)
    graph = pairs[apart <= JOINED_M + 0.5 * unsure[pairs].sum(axis=1)]
    joined = coo_array((np.ones(len(graph)), (graph[:, 0], graph[:, 1])), shape=(n, n))
    count, label = connected_components(joined, directed=False)
    groups = [above[label[cell] == k] for k in range(count)]
    return sorted((group for group in groups if len(group) >= LEAST_POINTS), key=len, reverse=True)


def view_sectors(cameras_W_m: Array, about_W_m: Array) -> Array:
    """Level unit directions from which a place was seen, one for each sector of azimuth, shape (k, 2)."""
    level = about_W_m[:2] - cameras_W_m[:, :2]
    azimuth = np.arctan2(level[:, 1], level[:, 0])
    sector = np.round(azimuth / SECTOR_RAD).astype(int) % round(2.0 * math.pi / SECTOR_RAD)
    means = [math.atan2(*np.sin([azimuth[sector == s], azimuth[sector == s] + math.pi / 2]).sum(axis=1)) for s in
             np.unique(sector)]  # fmt: skip
    return np.array([[math.cos(a), math.sin(a)] for a in means]).reshape(-1, 2)


def shape_of(points_W_m: Array, bed: BedPlane, cameras_W_m: Array, place_std_m: float = 0.003) -> TargetShape:
    """Shape of a body of mapped points.

    - `points_W_m`, shape (n, 3): of its surface, above the bed.
    - `cameras_W_m`, shape (k, 3): where it was seen from.
    - `place_std_m`: standard deviation of the map's own place.
    """
    points_W_m = points_W_m[in_company(points_W_m)]
    views = view_sectors(cameras_W_m, points_W_m.mean(axis=0))
    rows, values, weights, halves = [], [], [], []
    for view in views:
        across = np.array([-view[1], view[0]])
        aside = points_W_m[:, :2] @ across
        low, high = np.quantile(aside, (TAIL, 1.0 - TAIL))
        half = max(0.5 * float(high - low), 0.01)
        depth, depth_std = middle_depth(points_W_m[:, :2] @ view, aside - 0.5 * (low + high), half)
        halves.append(half)
        rows += [across, view]
        values += [0.5 * (low + high), depth]
        weights += [1.0 / math.hypot(ACROSS_STD_M, half * CORRELATED / len(points_W_m)), 1.0 / depth_std]
    all_round = len(views) * SECTOR_RAD >= ALL_ROUND_RAD
    if all_round:  # the box round all that stands there, by its own axes
        low_W, high_W = np.quantile(points_W_m[:, :2], (BOX_TAIL, 1.0 - BOX_TAIL), axis=0)
        rows, values, weights = list(np.eye(2)), list(0.5 * (low_W + high_W)), [1.0 / ACROSS_STD_M] * 2
    W = np.array(weights)
    N = (np.array(rows) * W[:, None]).T @ (np.array(rows) * W[:, None])
    plan = np.linalg.solve(N, (np.array(rows) * W[:, None]).T @ (np.array(values) * W))
    top = float(np.quantile(points_W_m[:, 2], TOP_TAIL))
    foot = float(bed.below(np.append(plan, top))[2])
    centre = np.append(plan, 0.5 * (top + foot))
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = np.linalg.inv(N)
    covariance[2, 2] = (0.5 * ACROSS_STD_M) ** 2
    covariance += place_std_m**2 / 3.0 * np.eye(3)
    surface, seen = completed(points_W_m, centre)
    radius = float(np.quantile(np.linalg.norm(surface - centre, axis=1), 1.0 - TAIL))
    least = max(*halves, 0.5 * (foot - top))
    return TargetShape(
        centre_W_m=centre,
        covariance=covariance,
        radius_m=max(radius, least),
        surface_W_m=surface,
        seen=seen,
        all_round=all_round,
    )


def in_company(points_W_m: Array) -> BoolArray:
    """Which points, shape (n,), have neighbours about as near as the others have."""
    if len(points_W_m) < 2 * LEAST_POINTS:
        return np.ones(len(points_W_m), np.bool_)
    third = np.asarray(KDTree(points_W_m).query(points_W_m, k=4)[0])[:, 3]
    return np.asarray(third <= LONELY * np.median(third))


def middle_depth(depth_m: Array, aside_m: Array, half_m: float) -> tuple[float, float]:
    """Depth of a body's middle along a view and its standard deviation, from depths and places across it, shape (n,).

    Fits depth = c - k sqrt(half^2 - aside^2) with a normal prior on k. A body of which about as much depth as width was
    seen is seen through: its middle is that of what was seen.
    """
    chord = np.sqrt(np.maximum(half_m**2 - aside_m**2, 0.0))
    J = np.stack([np.ones_like(chord), -chord], axis=1)
    prior, offset = np.diag([0.0, 1.0 / NEARER_STD**2]), np.array([0.0, NEARER / NEARER_STD**2])
    spread = 0.3 * half_m
    for _ in range(2):
        H = J.T @ J / (CORRELATED * spread**2) + prior
        found = np.linalg.solve(H, J.T @ depth_m / (CORRELATED * spread**2) + offset)
        spread = max(float(np.std(depth_m - J @ found)), 0.1 * half_m)
    near, far = np.quantile(depth_m, (TAIL, 1.0 - TAIL))
    through = float(np.clip(((far - near) / (2.0 * half_m) - SEEN_THROUGH[0]) / np.diff(SEEN_THROUGH)[0], 0.0, 1.0))
    middle = through * 0.5 * float(near + far) + (1.0 - through) * float(found[0])
    return middle, math.hypot(math.sqrt(float(np.linalg.inv(H)[0, 0])), UNROUND * half_m)


def best_known(std_m: Array) -> BoolArray:
    """Which points of a body are used, shape (n,): from near, what was mapped from far is left out."""
    kept = np.asarray(std_m <= WORST * np.quantile(std_m, 0.25))
    return kept if int(kept.sum()) >= 3 * LEAST_POINTS else np.ones(len(std_m), np.bool_)


def averaged(before: TargetShape | None, now: TargetShape) -> TargetShape:
    """The shape of now, its centre averaged with that of before by their covariances (Kalman filter).

    The first shape that was seen from all round is taken as it is: what was guessed before tells nothing more.
    """
    if before is None or not before.seen or now.all_round > before.all_round:
        return now
    P = before.covariance + (ROUND_WALK_M if now.all_round else CENTRE_WALK_M) ** 2 * np.eye(3)
    gain = P @ np.linalg.inv(P + SHARED * now.covariance)
    centre = before.centre_W_m + gain @ (now.centre_W_m - before.centre_W_m)
    return replace(now, centre_W_m=centre, covariance=(np.eye(3) - gain) @ P)


def seen_round_rad(cameras_W_m: Array, about_W_m: Array) -> float:
    """Largest angle in azimuth between two of the places, shape (k, 3), from which a place was seen."""
    level = cameras_W_m[-RECENT:, :2] - about_W_m[:2]
    level = level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
    return math.acos(max(-1.0, min(1.0, float((level @ level.T).min(initial=1.0)))))


def thinned(points_W_m: Array, voxel_m: float = VOXEL_M) -> IntArray:
    """Indices of one point in each voxel, the first."""
    cells = np.floor(points_W_m / voxel_m).astype(np.int64)
    return np.sort(np.unique(cells, axis=0, return_index=True)[1])


def completed(points_W_m: Array, centre_W_m: Array) -> tuple[Array, int]:
    """Surface with the unseen side mirrored through the centre's upright axis, and how many of its points were seen."""
    seen = points_W_m[thinned(points_W_m)]
    mirrored = seen.copy()
    mirrored[:, :2] = 2.0 * centre_W_m[:2] - seen[:, :2]
    far = KDTree(seen).query(mirrored)[0] > 2.0 * VOXEL_M
    return np.concatenate([seen, mirrored[far]]), len(seen)


def protected_region(surface_W_m: Array, bed: BedPlane | None, n: int) -> Region:
    """Region of `n` weighted points for the disturbance, as `scene.targets.region` defines it, from surface points.

    A third lies on the surface, the others in the water above the bed within `SHELL_M` of it. Weights add up to
    n/2 on the surface and n/2 times the mean of exp(-d / `DECAY_M`) in the water.
    """
    few = min(max(1, round(SURFACE_SHARE * n)), len(surface_W_m))
    dry, dry_weights = cell_middles(surface_W_m, np.ones(len(surface_W_m)), few)
    tree = KDTree(surface_W_m)
    low, high = surface_W_m.min(axis=0) - SHELL_M, surface_W_m.max(axis=0) + SHELL_M
    share = np.mod(0.5 + np.arange(1, 2 * FILL * n + 1)[:, None] * _KRONECKER, 1.0)
    water = low + share * (high - low)
    distance = np.asarray(tree.query(water, distance_upper_bound=SHELL_M)[0])
    kept = np.asarray((distance > 0.5 * VOXEL_M) & (distance < SHELL_M))
    if bed is not None:
        kept &= bed.height_m(water) > 0.0
    water, distance = water[kept], distance[kept]
    many = min(n - few, len(water))
    if many == 0:
        return Region(points_W_m=dry, weights=0.5 * n * dry_weights / dry_weights.sum(), distance_m=np.zeros(few))
    fading = np.exp(-distance / DECAY_M)
    wet, wet_weights = cell_middles(water, fading, many)
    away = np.asarray(tree.query(wet)[0])
    return Region(
        points_W_m=np.concatenate([dry, wet]),
        weights=0.5 * n * np.concatenate([dry_weights / dry_weights.sum(), wet_weights / len(water)]),
        distance_m=np.concatenate([np.zeros(few), np.maximum(away, 1e-6)]),
    )


def ball(centre_W_m: Array, radius_m: float, std_m: float, points: int = 200) -> TargetShape:
    """A ball in place of a shape that is not known yet; `std_m` is that of its centre, per axis."""
    k = np.arange(points) + 0.5
    polar, azimuth = np.arccos(1.0 - 2.0 * k / points), math.pi * (1.0 + math.sqrt(5.0)) * k
    unit = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    return TargetShape(
        centre_W_m=centre_W_m,
        covariance=std_m**2 * np.eye(3),
        radius_m=radius_m,
        surface_W_m=centre_W_m + radius_m * unit,
        seen=0,
    )

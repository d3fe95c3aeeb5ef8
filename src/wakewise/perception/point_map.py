"""Map of tracked features: places by the intersection of their rays, kept as an information filter.

A ray from the camera's place c in the direction d holds a point p within the standard deviation s across it:
(I - d d') (p - c) = 0. With P = I - d d', each picture adds A += P / s^2, b += P c / s^2 and e += c' P c / s^2 to a
point's information, so that p = A^-1 b, with covariance A^-1, and the squared misses of all rays add up to e - b' p.
The angle of the pixel and the camera's own place make s. Information fades with a time constant.

Corners where a near edge crosses a far one belong to no place: they slide as the view changes, and their rays miss
each other (`MOST_MISS`).

A point is `mature` once its rays have crossed at an angle and its distance is known well enough. A ray that misses a
mature point is an outlier, and a point of many outliers is dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.geometry import Pose

PIXEL_STD = 0.6
"""Standard deviation of a tracked pixel, with what the lens's calibration leaves."""
LEAST_PARALLAX_RAD = 0.06
"""Least angle at which a point's rays must have crossed."""
LEAST_CROSSING = 1e-6
"""Least share of a point's information along its rays of that across them."""
MOST_DEPTH_STD = 0.05
"""Largest standard deviation of a mature point, as a share of its distance."""
GATE = 4.0
"""Rays farther off a mature point than this many standard deviations are outliers."""
MOST_OUTLIERS = 4
"""A point with so many outliers is dropped; each ray that fits takes one off the count."""
MOST_MISS = 0.6
"""Largest root mean square miss of a mature point's rays in their standard deviations, which are chosen large."""
FORGETS_S = 30.0
"""Time constant in which information fades."""
RAY_STD_M = 0.002
"""Standard deviation of a ray's origin where the pose brings none, and the least of a point: calibration and sway."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PointMap:
    """Features with their information; rows are sorted by `ids`.

    Shapes: `ids` (n,), `A` (n, 3, 3), `b` (n, 3), `e` (n,). `points_W_m` (n, 3), NaN until a point can be computed, and
    `std_m` (n,), its largest standard deviation. `first_W` (n, 3) is the direction of the first ray, `parallax_rad`
    (n,) the largest angle with it. `views` (n,) counts rays, `weight` (n,) those that have not faded, `outliers` (n,)
    those that missed, and `seen_s` (n,) is when it was last seen.
    """

    ids: IntArray
    A: Array
    b: Array
    e: Array
    points_W_m: Array
    std_m: Array
    first_W: Array
    parallax_rad: Array
    views: IntArray
    weight: Array
    outliers: IntArray
    seen_s: Array

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def mature(self) -> BoolArray:
        """Which points are known well enough to be used, shape (n,)."""
        return np.asarray(np.isfinite(self.points_W_m[:, 0]) & (self.std_m < np.inf))

    def known_places(self) -> tuple[IntArray, Array]:
        """Features that have a place, mature or not, and their places; shapes (k,) and (k, 3)."""
        known = np.isfinite(self.points_W_m[:, 0])
        return self.ids[known], self.points_W_m[known]

    def rows(self, ids: IntArray) -> IntArray:
        """Rows of features, -1 of those that are not in the map; shapes (m,)."""
        if not len(self.ids):
            return np.full(len(ids), -1)
        at = np.minimum(np.searchsorted(self.ids, ids), len(self.ids) - 1)
        return np.where(self.ids[at] == ids, at, -1)

    def moved(self, X_VW: Pose) -> PointMap:
        """The points in another frame V."""
        R, t = X_VW.R, X_VW.p_m
        A = R @ self.A @ R.T
        turned, shift = self.b @ R.T, A @ t
        return replace(
            self,
            A=A,
            b=turned + shift,
            e=self.e + 2.0 * turned @ t + shift @ t,
            points_W_m=X_VW.apply(self.points_W_m),
            first_W=self.first_W @ R.T,
        )

    def chosen(self, which: BoolArray | IntArray) -> PointMap:
        """Some of the points."""
        return PointMap(**{name: getattr(self, name)[which] for name in self.__dataclass_fields__})


def empty_map() -> PointMap:
    """A map without points."""
    return PointMap(
        ids=np.zeros(0, np.int64),
        A=np.zeros((0, 3, 3)),
        b=np.zeros((0, 3)),
        e=np.zeros(0),
        points_W_m=np.zeros((0, 3)),
        std_m=np.zeros(0),
        first_W=np.zeros((0, 3)),
        parallax_rad=np.zeros(0),
        views=np.zeros(0, np.int64),
        weight=np.zeros(0),
        outliers=np.zeros(0, np.int64),
        seen_s=np.zeros(0),
    )


def mapped_rows(points: PointMap, ids: IntArray) -> tuple[IntArray, BoolArray]:
    """Rows of features in the map, and which of them are mature, shapes (n,)."""
    rows = points.rows(ids)
    known = rows >= 0
    mature = np.zeros(len(rows), np.bool_)
    mature[known] = points.mature[rows[known]]
    return rows, mature


def ray_directions(slopes: Array, X_WC: Pose) -> Array:
    """Unit directions in W, shape (n, 3), of slopes in the camera frame, shape (n, 2)."""
    d = np.column_stack([slopes, np.ones(len(slopes))]) @ X_WC.R.T
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def add_rays(
    known: PointMap,
    ids: IntArray,
    slopes: Array,
    X_WC: Pose,
    time_s: float,
    focal_px: float,
    guess_m: float,
    place_std_m: float | Array = RAY_STD_M,
    turn_std_rad: float = 0.0,
) -> PointMap:
    """The map with the rays of one picture.

    - `ids`, `slopes`, shapes (m,) and (m, 2): features and their rays in the camera frame.
    - `guess_m`: distance of points that cannot be computed yet.
    - `place_std_m`: standard deviation of the camera's place, one or of each ray, shape (m,).
    - `turn_std_rad`: standard deviation of the camera's attitude.
    """
    order = np.argsort(ids, kind="stable")
    ids, d = ids[order], ray_directions(slopes[order], X_WC)
    place_std = np.broadcast_to(np.asarray(place_std_m, dtype=np.float64), ids.shape)[order]
    known = _with_rows(known, ids, d, time_s)
    at = known.rows(ids)
    fade = np.exp(-(time_s - known.seen_s[at]) / FORGETS_S)
    points = known.points_W_m[at]
    away = points - X_WC.p_m
    distance = np.where(np.isfinite(away[:, 0]), np.linalg.norm(away, axis=1), guess_m)
    std = np.hypot(math.hypot(PIXEL_STD / focal_px, turn_std_rad) * np.maximum(distance, 0.05), place_std)
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    miss = np.linalg.norm(np.einsum("nij,nj->ni", across, np.nan_to_num(away)), axis=1)
    mature = known.mature[at]
    wrong = mature & (miss > GATE * np.hypot(std, known.std_m[at], where=mature, out=np.full(len(at), np.inf)))
    A, b, e = known.A.copy(), known.b.copy(), known.e.copy()
    add = ~wrong
    inverse = np.where(add, 1.0 / std**2, 0.0)
    A[at] = fade[:, None, None] * A[at] + inverse[:, None, None] * across
    from_ray = across @ X_WC.p_m
    b[at] = fade[:, None] * b[at] + inverse[:, None] * from_ray
    e[at] = fade * e[at] + inverse * (from_ray @ X_WC.p_m)
    parallax, views, outliers = known.parallax_rad.copy(), known.views.copy(), known.outliers.copy()
    angle = np.arccos(np.clip(np.einsum("ni,ni->n", known.first_W[at], d), -1.0, 1.0))
    parallax[at] = np.where(add, np.maximum(parallax[at], angle), parallax[at])
    views[at] += add
    count = known.weight.copy()
    count[at] = fade * count[at] + add
    outliers[at] = np.where(wrong, outliers[at] + 1, np.maximum(outliers[at] - 1, 0))
    seen = known.seen_s.copy()
    seen[at] = time_s
    places, stds = known.points_W_m.copy(), known.std_m.copy()
    places[at], stds[at] = solved(A[at], b[at], e[at], count[at], parallax[at], X_WC.p_m)
    return PointMap(
        ids=known.ids,
        A=A,
        b=b,
        e=e,
        points_W_m=places,
        std_m=stds,
        first_W=known.first_W,
        parallax_rad=parallax,
        views=views,
        weight=count,
        outliers=outliers,
        seen_s=seen,
    )


def dropped(known: PointMap, tracked: IntArray, time_s: float, keep_s: float, most: int) -> PointMap:
    """The map without points of many outliers, points that ended before they were mature, and old points.

    Old are those that are tracked no more and were not seen for `keep_s`, and the oldest beyond `most`.
    """
    live = np.isin(known.ids, tracked)
    stays = (known.outliers < MOST_OUTLIERS) & (live | known.mature) & (live | (time_s - known.seen_s < keep_s))
    if int(stays.sum()) > most:
        oldest_first = np.flatnonzero(stays)[np.argsort(known.seen_s[stays], kind="stable")]
        stays[oldest_first[:-most]] = False
    return known if stays.all() else known.chosen(stays)


def joined(one: PointMap, other: PointMap) -> PointMap:
    """The points of two maps that have none in common."""
    ids = np.concatenate([one.ids, other.ids])
    order = np.argsort(ids, kind="stable")
    return PointMap(
        **{
            name: np.concatenate([getattr(one, name), getattr(other, name)])[order]
            for name in PointMap.__dataclass_fields__
        }
    )


def _with_rows(known: PointMap, ids: IntArray, d: Array, time_s: float) -> PointMap:
    """The map with rows for features that it lacks; `ids` ascending."""
    new = known.rows(ids) < 0
    k = int(new.sum())
    if k == 0:
        return known
    fresh = PointMap(
        ids=ids[new],
        A=np.zeros((k, 3, 3)),
        b=np.zeros((k, 3)),
        e=np.zeros(k),
        points_W_m=np.full((k, 3), np.nan),
        std_m=np.full(k, np.inf),
        first_W=d[new],
        parallax_rad=np.zeros(k),
        views=np.zeros(k, np.int64),
        weight=np.zeros(k),
        outliers=np.zeros(k, np.int64),
        seen_s=np.full(k, time_s),
    )
    return joined(known, fresh)


def solved(A: Array, b: Array, e: Array, count: Array, parallax_rad: Array, camera_W_m: Array) -> tuple[Array, Array]:
    """Points, shape (n, 3), NaN where rays do not cross; standard deviations, shape (n,), infinite if not mature."""
    points, std = np.full(b.shape, np.nan), np.full(len(b), np.inf)
    crossed = parallax_rad >= 0.5 * LEAST_PARALLAX_RAD
    spectrum = np.linalg.eigvalsh(A)  # rays that have faded to one direction do not cross any more
    crossed &= spectrum[:, 0] > LEAST_CROSSING * spectrum[:, -1]
    if not crossed.any():
        return points, std
    cov = np.linalg.inv(A[crossed])
    found = np.einsum("nij,nj->ni", cov, b[crossed])
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(cov)[:, -1], 0.0))
    away = np.linalg.norm(found - camera_W_m, axis=1)
    missed = np.maximum(e[crossed] - np.einsum("ni,ni->n", b[crossed], found), 0.0)
    miss = np.sqrt(missed / np.maximum(2.0 * count[crossed] - 3.0, 1.0))
    good = (parallax_rad[crossed] >= LEAST_PARALLAX_RAD) & (spread < MOST_DEPTH_STD * away) & (miss < MOST_MISS)
    points[crossed], std[crossed] = found, np.where(good, np.maximum(spread, RAY_STD_M), np.inf)
    return points, std

"""Keyframes, and the map made from them by bundle adjustment: first when rays cross well enough, then as it grows.

Before the first one the estimated poses, which are off by millimetres and tenths of a degree, would set the map's
scale: it was 6 % off where rays had crossed at .06 rad.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wakewise.core.arrays import IntArray
from wakewise.core.geometry import Pose
from wakewise.perception.bundle_adjustment import (
    PIXEL_STD,
    BundleAdjustment,
    Keyframe,
)
from wakewise.perception.point_map import PIXEL_STD as MAP_PIXEL_STD
from wakewise.perception.point_map import PointMap, joined, mapped_rows, solved

PARALLAX_RAD = 0.25
"""Median parallax of the mapped points in the picture from which on the map is initialised."""
KEYFRAME_M, MOST_KEYFRAMES = 0.025, 100
"""Keyframes are so far apart, and the last ones are kept."""
FIRST_ROUNDS = 4
"""Rounds of the adjustment that initialises the map."""
LOCAL_KEYFRAMES = 30
"""Then at each keyframe the last ones are adjusted by one round: they begin near the solution."""
LEAST_STD = (0.004, 0.004)
"""Least standard deviations of a pose by other sensors, m and rad: their errors last from picture to picture."""


def with_keyframe(frames: tuple[Keyframe, ...], frame: Keyframe) -> tuple[Keyframe, ...]:
    """Keyframes with one more, where it is far enough from the last."""
    if frames and np.linalg.norm(frames[-1].X_WC.p_m - frame.X_WC.p_m) < KEYFRAME_M:
        return frames
    return (*frames, frame)[-MOST_KEYFRAMES:]


def well_crossed(points: PointMap, ids: IntArray, least: int) -> bool:
    """Whether the mapped points among features, shape (n,), are enough and were seen from far enough apart."""
    rows, mapped = mapped_rows(points, ids)
    if int(mapped.sum()) < least:
        return False
    return float(np.median(points.parallax_rad[rows[mapped]])) >= PARALLAX_RAD


def adjusted_map(adjustment: BundleAdjustment, before: PointMap) -> PointMap:
    """The map with the adjusted points in place of what it had of them; others move as the last keyframe does."""
    a = adjustment
    origins = np.stack([pose.p_m for pose in a.poses])
    times = np.array([frame.time_s for frame in a.frames])
    point_of = np.repeat(np.arange(len(a.ids)), np.diff(a.starts))
    rays = a.points_W_m[point_of] - origins[a.frame_of]
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    first = rays[a.starts[:-1]]
    cosine = np.minimum.reduceat(np.einsum("oi,oi->o", rays, first[point_of]), a.starts[:-1])
    views = np.diff(a.starts)
    # The map's pixels are less certain: those of one point are not independent of each other.
    share = (PIXEL_STD / MAP_PIXEL_STD) ** 2
    A = share * a.information
    b = np.einsum("mij,mj->mi", A, a.points_W_m)
    e = np.einsum("mi,mi->m", b, a.points_W_m) + share * a.misfit
    parallax = np.arccos(np.clip(cosine, -1.0, 1.0))
    places, std = solved(A, b, e, views.astype(np.float64), parallax, origins[-1])
    fresh = PointMap(
        ids=a.ids,
        A=A,
        b=b,
        e=e,
        points_W_m=places,
        std_m=std,
        first_W=first,
        parallax_rad=parallax,
        views=views,
        weight=views.astype(np.float64),
        outliers=np.zeros(len(a.ids), np.int64),
        seen_s=np.maximum.reduceat(times[a.frame_of], a.starts[:-1]),
    )
    fresh = fresh.chosen(fresh.mature | ~np.isin(a.ids, before.ids))
    return joined(before.chosen(~np.isin(before.ids, fresh.ids)).moved(shift_of(adjustment)), fresh)


def shift_of(adjustment: BundleAdjustment) -> Pose:
    """How the last keyframe was moved, as a transform of W."""
    return adjustment.poses[-1] @ adjustment.frames[-1].X_WC.inverse()


def moved_since(frames: tuple[Keyframe, ...], adjustment: BundleAdjustment) -> tuple[Keyframe, ...]:
    """Keyframes after an adjustment: its own where they are kept, later ones moved as its last one was."""
    own = {frame.time_s: frame for frame in adjustment.adjusted_frames()}
    shift = shift_of(adjustment)
    return tuple(
        own[frame.time_s] if frame.time_s in own else replace(frame, X_WC=shift @ frame.X_WC) for frame in frames
    )

"""Initialisation of the map: keyframes with the estimator's poses, adjusted once their rays cross well enough.

Before that the estimated poses, which are off by millimetres and tenths of a degree, would set the map's scale: it was
6 % off where rays had crossed at .06 rad.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import IntArray
from wakewise.perception.bundle_adjustment import Keyframe, adjusted
from wakewise.perception.point_map import PointMap, add_rays, empty_map, mapped_rows

PARALLAX_RAD = 0.25
"""Median parallax of the mapped points in the picture from which on the map is initialised."""
KEYFRAME_M, MOST_KEYFRAMES = 0.02, 30
"""Keyframes are so far apart, and the last ones are kept."""


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


def initial_map(
    frames: tuple[Keyframe, ...], points: PointMap, focal_px: float, guess_m: float, place_std_m: float
) -> PointMap:
    """The map made anew from adjusted keyframes; `points` gives the first places, the rest as for `add_rays`."""
    known = np.isfinite(points.points_W_m[:, 0])
    first = {int(i): place for i, place in zip(points.ids[known], points.points_W_m[known], strict=True)}
    made = empty_map()
    for frame in adjusted(frames, first, focal_px):
        made = add_rays(made, frame.ids, frame.slopes, frame.X_WC, frame.time_s, focal_px, guess_m, place_std_m)
    return made

"""Depth of what is in a window of a picture, by sweeping a plane through it.

R. T. Collins 1996, A space-sweep approach to true multi-image matching, doi 10.1109/CVPR.1996.517097.

At each of some depths, evenly spaced in inverse depth, other pictures are brought to the reference by the homography of
the plane that faces it there. Where the surface has that depth they agree: the score is the correlation of windows of
normalised grey levels, the mean of the better views, as one of them may be hidden. The depth of the best score is
refined by a parabola. A pixel without texture, with a poor best score, or with another one about as good has no depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.feature_tracks import Grey

Window = tuple[int, int, int, int]
"""Left, top, right and bottom of a part of a picture, px; right and bottom are not in it."""
PATCH_PX = 5
"""Side of the windows that are correlated."""
DEPTHS = 36
LEAST_TEXTURE = 4.0
"""Grey levels of standard deviation in a patch, below which it shows nothing: twice a dim sensor's noise."""
LEAST_SCORE = 0.75
"""Least correlation of a depth that is taken."""
LEAST_LEAD = 0.05
"""By which it must exceed the scores of depths farther off than its neighbours."""
NEIGHBOURS = 2
MOST_HIDDEN = 1
"""Of three pictures and more so many may see something else at a place: the worst score is left out."""
DEPTH_PX = 0.3
"""Standard deviation of a depth in pixels of the picture farthest from the reference."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepView:
    """Grey levels of a picture without distortion, shape (h, w), and its camera pose X_WC."""

    X_WC: Pose
    levels: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneSweep:
    """A sweep under way: depths `inverse_m`, shape (d,), and `scores`, (d, h, w), of the others compared so far."""

    reference: SweepView
    others: tuple[SweepView, ...]
    window: Window
    inverse_m: Array
    scores: tuple[NDArray[np.float32], ...] = ()

    @property
    def done(self) -> bool:
        """Whether all pictures were compared."""
        return len(self.scores) == len(self.others)


@dataclass(frozen=True, kw_only=True, eq=False)
class SweptDepth:
    """Depths of a window, shape (h, w), NaN where there is none, and their standard deviations."""

    X_WC: Pose
    window: Window
    depth_m: Array
    std_m: Array


def sweep_view(picture: Grey, X_WC: Pose, camera: CalibratedCamera, speed_px_s: Array | None = None) -> SweepView:
    """A picture made ready for a sweep.

    `speed_px_s`, shape (2,): at which what is looked at moves over the picture, for a rolling shutter.
    """
    across, down = camera.straightening
    if speed_px_s is not None and camera.readout_s > 0.0:
        late_s = camera.readout_s * ((np.arange(camera.height, dtype=np.float32) + 0.5) / camera.height - 0.5)
        across, down = (
            (way + (late_s * speed)[:, None]).astype(np.float32)
            for way, speed in zip((across, down), speed_px_s, strict=True)
        )
    straight = cv2.remap(picture, across, down, cv2.INTER_LINEAR)
    return SweepView(X_WC=X_WC, levels=straight.astype(np.float32))


def begin_sweep(
    reference: SweepView, others: Sequence[SweepView], window: Window, near_m: float, far_m: float
) -> PlaneSweep:
    """Sweep of a window of a picture between two depths, by one other picture at least, of which none was compared."""
    return PlaneSweep(
        reference=reference,
        others=tuple(others),
        window=window,
        inverse_m=np.linspace(1.0 / near_m, 1.0 / far_m, DEPTHS),
    )


def compared(sweep: PlaneSweep, camera: CalibratedCamera) -> PlaneSweep:
    """The sweep with one more of the other pictures compared."""
    left, top, right, bottom = sweep.window
    size = (right - left, bottom - top)
    K = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    back = np.linalg.inv(K - np.array([[0.0, 0.0, left], [0.0, 0.0, top], [0.0, 0.0, 0.0]]))
    here = np.ascontiguousarray(sweep.reference.levels[top:bottom, left:right])
    mean, texture = _local_mean(here), _texture(here)
    other = sweep.others[len(sweep.scores)]
    X_OR = other.X_WC.inverse() @ sweep.reference.X_WC
    scores = np.empty((DEPTHS, size[1], size[0]), np.float32)
    for score, inverse in zip(scores, sweep.inverse_m, strict=True):
        plane = K @ (X_OR.R + np.outer(X_OR.p_m, [0.0, 0.0, inverse])) @ back
        there = cv2.warpPerspective(other.levels, plane, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        level = _local_mean(there)
        score[:] = (_local_mean(here * there) - mean * level) / (texture * _texture(there, level))
    return replace(sweep, scores=(*sweep.scores, scores))


def swept_depth(sweep: PlaneSweep, camera: CalibratedCamera) -> SweptDepth:
    """Depths by the pictures that were compared."""
    left, top, right, bottom = sweep.window
    texture = _texture(np.ascontiguousarray(sweep.reference.levels[top:bottom, left:right]))
    inverse, count = sweep.inverse_m, len(sweep.scores)
    score = np.sum(sweep.scores, axis=0) / count
    if count > MOST_HIDDEN + 1:
        score = (count * score - np.min(sweep.scores, axis=0)) / (count - MOST_HIDDEN)
    best = score.argmax(axis=0)
    inner = np.clip(best, 1, DEPTHS - 2)
    before, at, after = (np.take_along_axis(score, (inner + k)[None], axis=0)[0] for k in (-1, 0, 1))
    bend = np.minimum(before - 2.0 * at + after, -1e-6)
    offset = np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
    depth = 1.0 / (inverse[inner] + offset * (inverse[1] - inverse[0]))
    for k in range(-NEIGHBOURS, NEIGHBOURS + 1):
        np.put_along_axis(score, np.clip(best + k, 0, DEPTHS - 1)[None], -1.0, axis=0)
    known = (best == inner) & (at > LEAST_SCORE) & (score.max(axis=0) < at - LEAST_LEAD) & (texture > LEAST_TEXTURE)
    base = max(float(np.linalg.norm(other.X_WC.p_m - sweep.reference.X_WC.p_m)) for other in sweep.others)
    std = DEPTH_PX * depth**2 / (camera.focal_px * base)
    return SweptDepth(
        X_WC=sweep.reference.X_WC,
        window=sweep.window,
        depth_m=np.where(known, depth, np.nan),
        std_m=np.where(known, std, np.nan),
    )


def places_of(swept: SweptDepth, camera: CalibratedCamera) -> tuple[Array, Array]:
    """Places in W of the pixels that have a depth, shape (n, 3), and their standard deviations, shape (n,)."""
    row, column = np.nonzero(np.isfinite(swept.depth_m))
    z = swept.depth_m[row, column]
    x = (column + swept.window[0] - camera.cx) / camera.fx
    y = (row + swept.window[1] - camera.cy) / camera.fy
    p_C = np.stack([x * z, y * z, z], axis=1)
    return p_C @ swept.X_WC.R.T + swept.X_WC.p_m, swept.std_m[row, column]


def _texture(levels: NDArray[np.float32], mean: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Standard deviation in the patch about each pixel, one grey level at least."""
    middle = _local_mean(levels) if mean is None else mean
    return np.asarray(np.sqrt(np.maximum(_local_mean(levels * levels) - middle * middle, 1.0)), dtype=np.float32)


def _local_mean(values: NDArray[Any]) -> NDArray[np.float32]:
    return np.asarray(
        cv2.boxFilter(values, -1, (PATCH_PX, PATCH_PX), borderType=cv2.BORDER_REFLECT_101), dtype=np.float32
    )

"""Surface of the target as the camera has seen it: points from plane sweeps, gathered in cells of a grid.

Each cell holds the mean of its points, weighted by their variances, the mean direction to the cameras, and in how many
sweeps it was seen. A sweep that sees what lies behind a cell contradicts it; a cell that is contradicted as often as it
was seen is dropped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.geometry import Pose
from wakewise.perception.bed_plane import BedPlane
from wakewise.perception.bundle_adjustment import Keyframe
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.plane_sweep import (
    PlaneSweep,
    SweepView,
    SweptDepth,
    Window,
    begin_sweep,
    places_of,
    sweep_view,
)

CELL_M = 0.005
BEHIND = 3.0
"""A depth contradicts what lies before it by more than this many standard deviations and a cell."""
CONFIRMED = 2
"""Sweeps in which a cell was seen, from which on it is taken for surface."""
VIEW_CELL_M, VIEW_PX, VIEW_EVERY = 0.02, 320, 2
"""Cells of all that is in view, the width of the pictures that are swept for them, and which pixels count: each second
one."""
MOST_CELLS, MOST_VIEW_CELLS = 20000, 80000
APART_RAD, SLACK_RAD = tuple(math.radians(angle) for angle in (5.0, 10.0, 15.0)), math.radians(2.0)
"""Angles at the target between the reference of a sweep and the other pictures, and by how much they may differ."""
SWEEP_RAD = math.radians(6.0)
"""A sweep is made when the camera has gone so far round the target since the last one."""
LEAST_OTHERS = 2
AROUND, NEARER, FARTHER = 1.4, 1.3, 1.5
"""Window and depths of a sweep, in radii of the target: from its middle aside, and along the view."""
LEAST_RADIUS_M, LEAST_WINDOW_PX = 0.06, 24
LEAST_DEPTH_M = 0.05
VIEW_DEPTHS, VIEW_TAIL = (0.75, 1.3), 0.05
"""Depths of a sweep of all that is in view, over the nearest and the farthest mapped ones, this share left out."""
ABOVE_BED_M = 0.01
"""Points that are less high above the bed are of it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMap:
    """Cells that were seen: `points_W_m` (n, 3), `weight` (n,) in 1/m2, `towards_W` (n, 3), `views` and `denials` (n,).

    `towards_W` is the sum of unit directions to the cameras, and `std_m`, shape (n,), that of the best sweep.
    """

    points_W_m: Array
    weight: Array
    towards_W: Array
    views: IntArray
    denials: IntArray
    std_m: Array

    def __len__(self) -> int:
        return len(self.views)

    @property
    def confirmed(self) -> IntArray:
        """Rows of the cells that are taken for surface."""
        return np.flatnonzero(self.views - self.denials >= CONFIRMED)

    def chosen(self, which: BoolArray | IntArray) -> SurfaceMap:
        """Some of the cells."""
        return SurfaceMap(**{name: getattr(self, name)[which] for name in self.__dataclass_fields__})


def empty_surface() -> SurfaceMap:
    """A surface of which nothing was seen."""
    return SurfaceMap(
        points_W_m=np.zeros((0, 3)),
        weight=np.zeros(0),
        towards_W=np.zeros((0, 3)),
        views=np.zeros(0, np.int64),
        denials=np.zeros(0, np.int64),
        std_m=np.zeros(0),
    )


def with_sweep(
    surface: SurfaceMap,
    swept: SweptDepth,
    camera: CalibratedCamera,
    bed: BedPlane | None = None,
    cell_m: float = CELL_M,
    every: int = 1,
    most: int | None = None,
) -> SurfaceMap:
    """The surface with the points of one sweep, without those of the bed, if given; of each `every`-th row and column.

    `cell_m`: size of a cell, the same at each call for a surface. Of more than `most` cells (`MOST_CELLS`)
    the least seen are dropped.
    """
    known = np.full_like(swept.depth_m, np.nan)
    known[::every, ::every] = swept.depth_m[::every, ::every]
    points, std = places_of(replace(swept, depth_m=known), camera)
    if bed is not None:
        stands = bed.height_m(points) > ABOVE_BED_M
        points, std = points[stands], std[stands]
    surface = _denied(surface, swept, camera, cell_m)
    if not len(points):
        return surface
    towards = swept.X_WC.p_m - points
    fresh = SurfaceMap(
        points_W_m=points,
        weight=std**-2.0,
        towards_W=towards / np.linalg.norm(towards, axis=1, keepdims=True),
        views=np.ones(len(points), np.int64),
        denials=np.zeros(len(points), np.int64),
        std_m=std,
    )
    both = _gathered(surface, _gathered(empty_surface(), fresh, cell_m, one_view=True), cell_m)
    most = MOST_CELLS if most is None else most
    if len(both) <= most:
        return both
    return both.chosen(np.sort(np.argsort(both.denials - both.views, kind="stable")[:most]))


def sweep_target(
    frames: Sequence[Keyframe], centre_W_m: Array, radius_m: float, camera: CalibratedCamera
) -> PlaneSweep | None:
    """Sweep, not yet made, through a target in the last keyframe; None if too few others show it from other places."""
    last = frames[-1]
    others = _apart(frames, centre_W_m)
    window = _window(last.X_WC, centre_W_m, max(radius_m, LEAST_RADIUS_M), camera)
    if len(others) < LEAST_OTHERS or window is None:
        return None
    depth = float((centre_W_m - last.X_WC.p_m) @ last.X_WC.R[:, 2])
    reach = max(radius_m, LEAST_RADIUS_M)
    near = max(depth - NEARER * reach, LEAST_DEPTH_M)
    views = [_view(frame, camera) for frame in (last, *others)]
    return begin_sweep(views[0], views[1:], window, near, depth + FARTHER * reach)


def view_camera(camera: CalibratedCamera) -> CalibratedCamera:
    """The camera of the smaller pictures in which all that is in view is swept."""
    return camera.scaled(min(VIEW_PX, camera.width))


def sweep_in_view(
    frames: Sequence[Keyframe], seen_W_m: Array, small: CalibratedCamera, farthest_m: float
) -> PlaneSweep | None:
    """Sweep, not yet made, through all of the last keyframe; None if too few others show it from other places.

    `seen_W_m`, shape (n, 3): mapped points in view; `small`: `view_camera` of the keyframes' camera; depths beyond
    `farthest_m` are left out.
    """
    last, others = frames[-1], _apart(frames, seen_W_m.mean(axis=0))
    if len(others) < LEAST_OTHERS:
        return None
    depths = (seen_W_m - last.X_WC.p_m) @ last.X_WC.R[:, 2]
    near, far = np.quantile(depths, (VIEW_TAIL, 1.0 - VIEW_TAIL)) * VIEW_DEPTHS
    far = min(far, farthest_m)
    if near < LEAST_DEPTH_M or far <= near:
        return None
    size, views = (small.width, small.height), []
    for frame in (last, *others):
        assert frame.picture is not None
        speed = None if frame.speed_px_s is None else small.width / frame.picture.shape[1] * frame.speed_px_s
        reduced = np.asarray(cv2.resize(frame.picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        views.append(sweep_view(reduced, frame.X_WC, small, speed))
    return begin_sweep(views[0], views[1:], (0, 0, *size), float(near), float(far))


def turned_about(centre_W_m: Array, one_W_m: Array, other_W_m: Array) -> float:
    """Angle at a centre between two places."""
    a, b = one_W_m - centre_W_m, other_W_m - centre_W_m
    lengths = max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12)
    return math.acos(float(np.clip(a @ b / lengths, -1.0, 1.0)))


def _apart(frames: Sequence[Keyframe], centre_W_m: Array) -> list[Keyframe]:
    """The latest keyframes at about `APART_RAD` from the last one."""
    turned = [turned_about(centre_W_m, frames[-1].X_WC.p_m, frame.X_WC.p_m) for frame in frames[:-1]]
    found = []
    for desired in APART_RAD:
        fits = [
            k for k, angle in enumerate(turned) if abs(angle - desired) < SLACK_RAD and frames[k].picture is not None
        ]
        found += [frames[k] for k in fits[-1:]]
    return found


def _view(frame: Keyframe, camera: CalibratedCamera) -> SweepView:
    assert frame.picture is not None
    return sweep_view(frame.picture, frame.X_WC, camera, frame.speed_px_s)


def _window(X_WC: Pose, centre_W_m: Array, radius_m: float, camera: CalibratedCamera) -> Window | None:
    """Window about a ball in a picture; None where it is not in it, or small."""
    p_C = X_WC.inverse().apply(centre_W_m)
    if p_C[2] < LEAST_DEPTH_M:
        return None
    u, v = camera.fx * p_C[0] / p_C[2] + camera.cx, camera.fy * p_C[1] / p_C[2] + camera.cy
    half = AROUND * camera.focal_px * radius_m / p_C[2]
    left, right = max(round(u - half), 0), min(round(u + half), camera.width)
    top, bottom = max(round(v - half), 0), min(round(v + half), camera.height)
    if right - left < LEAST_WINDOW_PX or bottom - top < LEAST_WINDOW_PX:
        return None
    return left, top, right, bottom


def _gathered(surface: SurfaceMap, fresh: SurfaceMap, cell_m: float, *, one_view: bool = False) -> SurfaceMap:
    """Both, a row for each cell; with `one_view` the rows of a cell count as one view."""
    both = {
        name: np.concatenate([getattr(surface, name), getattr(fresh, name)]) for name in SurfaceMap.__dataclass_fields__
    }
    cells = np.floor(both["points_W_m"] / cell_m).astype(np.int64)
    cells -= cells.min(axis=0, initial=0)
    _, rows, columns = cells.max(axis=0, initial=0) + 1
    # One number a cell sorts as its three do, in a tenth of the time.
    number = (cells[:, 0] * rows + cells[:, 1]) * columns + cells[:, 2]
    cell = np.unique(number, return_inverse=True)[1].reshape(-1)
    n = 1 + int(cell.max(initial=0))

    def total(values: Array | IntArray) -> Array:
        columns = values.reshape(len(values), -1).T
        sums = np.stack([np.bincount(cell, column, n) for column in columns], axis=1)
        return np.asarray(sums.reshape(n, *values.shape[1:]), dtype=np.float64)

    weight: Array = total(both["weight"])
    count: Array = np.bincount(cell, minlength=n).astype(np.float64)
    towards = total(both["towards_W"])
    std = np.full(n, np.inf)
    np.minimum.at(std, cell, both["std_m"])
    return SurfaceMap(
        points_W_m=total(both["weight"][:, None] * both["points_W_m"]) / weight[:, None],
        weight=weight / count if one_view else weight,
        towards_W=towards / count[:, None] if one_view else towards,
        views=np.ones(n, np.int64) if one_view else total(both["views"]).astype(np.int64),
        denials=total(both["denials"]).astype(np.int64),
        std_m=std,
    )


def _denied(surface: SurfaceMap, swept: SweptDepth, camera: CalibratedCamera, cell_m: float) -> SurfaceMap:
    """The surface with the cells counted that lie before what a sweep has seen, without those that are so too often."""
    if not len(surface):
        return surface
    left, top, right, bottom = swept.window
    p_C = (surface.points_W_m - swept.X_WC.p_m) @ swept.X_WC.R
    z = np.maximum(p_C[:, 2], 1e-3)
    column = np.round(camera.fx * p_C[:, 0] / z + camera.cx).astype(np.int64) - left
    row = np.round(camera.fy * p_C[:, 1] / z + camera.cy).astype(np.int64) - top
    within = (p_C[:, 2] > 1e-3) & (column >= 0) & (column < right - left) & (row >= 0) & (row < bottom - top)
    at = np.where(within, row, 0), np.where(within, column, 0)
    seen = np.where(within, swept.depth_m[at], np.nan)
    slack = BEHIND * np.nan_to_num(swept.std_m[at]) + cell_m
    denials = surface.denials + (seen - z > slack)
    return replace(surface, denials=denials).chosen(denials < surface.views)

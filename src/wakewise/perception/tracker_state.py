"""State of the target's tracker, and the steps that change it without the tracker's settings: adjustment and sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from wakewise.core.arrays import Array, IntArray
from wakewise.core.interfaces import TargetEstimate
from wakewise.perception.bed_plane import BedPlane
from wakewise.perception.bundle_adjustment import BundleAdjustment, Keyframe
from wakewise.perception.calibrated_camera import CalibratedCamera
from wakewise.perception.designation import Designation, RefusedPlace
from wakewise.perception.feature_tracks import NO_TRACKS, FeatureTracks
from wakewise.perception.map_initialization import adjusted_map, moved_since
from wakewise.perception.plane_sweep import PlaneSweep, compared, swept_depth
from wakewise.perception.point_map import PointMap
from wakewise.perception.surface_map import (
    MOST_VIEW_CELLS,
    SWEEP_RAD,
    VIEW_CELL_M,
    VIEW_EVERY,
    SurfaceMap,
    sweep_in_view,
    sweep_target,
    turned_about,
    view_camera,
    with_sweep,
)
from wakewise.perception.target_shape import TargetShape


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackerState:
    """All that the tracker knows. `trouble` says what is wrong with the last picture, empty if nothing is."""

    tracks: FeatureTracks = NO_TRACKS
    camera: CalibratedCamera
    """As adjusted so far, by `lens`, shape (7,): `bundle_adjustment.LENS_STD`."""
    lens: Array
    points: PointMap
    bed: BedPlane | None = None
    surface: SurfaceMap
    sweep: PlaneSweep | None = None
    """Under way: one more picture is compared in each picture in which no region is computed."""
    swept_from_W_m: Array | None = None
    """Where the camera was in the last sweep."""
    cameras_W_m: Array
    designation: Designation | None = None
    refused: tuple[RefusedPlace, ...] = ()
    """Bodies there are not proposed."""
    shape: TargetShape | None = None
    members: IntArray
    shift_W_m: Array
    target: TargetEstimate | None = None
    versions: int = 0
    """Regions so far: a controller takes a region for new by its number, also after another designation."""
    pictures: int = 0
    first_s: float | None = None
    last_s: float = -math.inf
    tracked_s: float = -math.inf
    """Time of the picture of `tracks`."""
    shaped_s: float = -math.inf
    seen_s: float = -math.inf
    proposed_s: float = math.inf
    accepted: bool = False
    keyframes: tuple[Keyframe, ...] = ()
    adjusted_s: float = -math.inf
    """Time of the last keyframe that was adjusted."""
    initialized: bool = False
    trouble: str = ""


def with_sweep_step(state: TrackerState, time_s: float, view_m: float | None = None) -> TrackerState:
    """The state with one more picture compared of the sweep under way, or with a sweep begun at a new keyframe.

    `view_m`: all that is in view up to this depth is swept, in larger cells, and not the target alone.
    """
    sweep, shape = state.sweep, state.shape
    camera = state.camera if view_m is None else view_camera(state.camera)
    if sweep is None:
        last = state.keyframes[-1]
        if shape is None or not shape.seen or last.time_s < time_s:
            return state
        before = state.swept_from_W_m
        if before is not None and turned_about(shape.centre_W_m, before, last.X_WC.p_m) < SWEEP_RAD:
            return state
        if view_m is not None:
            begun = sweep_in_view(state.keyframes, shape.surface_W_m, camera, view_m)
        else:
            begun = sweep_target(state.keyframes, shape.centre_W_m, shape.radius_m, camera)
        return state if begun is None else replace(state, sweep=begun, swept_from_W_m=last.X_WC.p_m)
    sweep = compared(sweep, camera)
    if not sweep.done:
        return replace(state, sweep=sweep)
    swept = swept_depth(sweep, camera)
    if view_m is not None:
        surface = with_sweep(state.surface, swept, camera, None, VIEW_CELL_M, VIEW_EVERY, MOST_VIEW_CELLS)
    else:
        surface = with_sweep(state.surface, swept, camera, state.bed)
    return replace(state, surface=surface, sweep=None)


def with_adjustment(state: TrackerState, adjustment: BundleAdjustment, before: PointMap) -> TrackerState:
    """The state with the adjusted lens, keyframes and points; `before` holds the points that are kept beside them."""
    return replace(
        state,
        camera=adjustment.adjusted_camera(),
        lens=adjustment.lens,
        points=adjusted_map(adjustment, before),
        keyframes=moved_since(state.keyframes, adjustment),
        adjusted_s=adjustment.frames[-1].time_s,
    )

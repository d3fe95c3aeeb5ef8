"""Clearance of a route: collisions with floor, walls, surface and target, and rates of the camera's joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions.aim import CameraAim
from wakewise.scene.missions.route import Route


@dataclass(frozen=True, kw_only=True, eq=False)
class TankBounds:
    """The water a vehicle may be in: a box from `low_W_m` to `high_W_m`, shape (3,) each; z = high is the floor."""

    low_W_m: Array
    high_W_m: Array

    def __post_init__(self) -> None:
        freeze(self, low_W_m=(3,), high_W_m=(3,))


def hull_corners(size_m: Array) -> Array:
    """The eight corners, shape (8, 3), of a hull of this length, width and height centred on the body origin."""
    return 0.5 * np.asarray(size_m) * np.array(list(product((-1.0, 1.0), repeat=3)))


def box_distance(points_B_m: Array, size_m: Array) -> Array:
    """Distance, shape (n,), of points, shape (n, 3), to a solid box centred on the origin; negative inside."""
    outside = np.abs(points_B_m) - 0.5 * np.asarray(size_m)
    return np.linalg.norm(np.maximum(outside, 0.0), axis=-1) + np.minimum(np.max(outside, axis=-1), 0.0)


def gaps_of(X_WB: Pose, size_m: Array, bounds: TankBounds, target_W_m: Array) -> dict[str, float]:
    """How far a hull at a pose is, in metres, from the floor, the water surface, a wall and the target, by name.

    Parameters are those of `check_clearance`; of the target some 4000 points are looked at. Infinite where it has none.
    """
    near = target_W_m[:: max(1, len(target_W_m) // 4000)]
    hull_W = X_WB.apply(hull_corners(size_m))
    return {
        "the floor": float(bounds.high_W_m[2] - hull_W[:, 2].max()),
        "the water surface": float(hull_W[:, 2].min() - bounds.low_W_m[2]),
        "a wall": min(
            float((hull_W[:, :2] - bounds.low_W_m[:2]).min()), float((bounds.high_W_m[:2] - hull_W[:, :2]).min())
        ),
        "the target": float(box_distance(X_WB.inverse().apply(near), size_m).min(initial=np.inf)),
    }


def check_clearance(
    route: Route, aim: CameraAim | Pose, size_m: Array, bounds: TankBounds, target_W_m: Array, clearance_m: float
) -> float:
    """Least clearance of the hull along the route, in metres.

    - `aim`: what the camera is aimed with, or its fixed mount.
    - `size_m`, shape (3,): length, width and height of the hull.
    - `target_W_m`, shape (n, 3): points of the target, dense enough to stand for it (its mesh's vertices).
    - `clearance_m`: required clearance.

    Raises InputError: naming the field of the mission to change, the leg, what it would touch and by how much.
    """
    least = np.inf
    for time_s in np.arange(route.starts_s[0], route.duration_s, 0.25):
        gaps = gaps_of(route.body(float(time_s), aim).X_WB, size_m, bounds, target_W_m)
        what, gap = min(gaps.items(), key=lambda item: item[1])
        if gap < clearance_m:
            under_way = route.legs[route.leg_at(float(time_s))]
            leg, across = under_way.name, under_way.start[2] == 0.0  # a transect
            field, advice = (
                ("survey.height_m", "fly the transects at another height")
                if across
                else {
                    "the floor": (
                        "mission.elevations_deg",
                        "raise the lowest elevation or lengthen mission.standoff_m",
                    ),
                    "the water surface": ("mission.standoff_m", "shorten it, or lower the highest elevation"),
                    "a wall": ("mission.standoff_m", "shorten it or use a wider tank.size_m"),
                    "the target": ("mission.standoff_m", "lengthen it"),
                }[what]
            )
            raise InputError(
                f"{field}: on leg '{leg}' the hull comes within {gap:.3f} m of {what}, "
                f"allowed is {clearance_m:g} m or more (mission.clearance_m): {advice}"
            )
        least = min(least, gap)
    return float(least)


def check_tilt(route: Route, aim: CameraAim, *, stops_suffice: bool = False) -> None:
    """Refuse a route that the camera's joint cannot follow; `stops_suffice` asks it to be aimed by tilt alone.

    Raises InputError: naming the field of the mission to change, the leg, the tilt or its rate, and what the joint can
    do.
    """
    joint = aim.joint
    if joint is None:
        return
    low, high = math.degrees(joint.low_rad), math.degrees(joint.high_rad)
    for time_s in np.arange(route.starts_s[0], route.duration_s, 0.25):
        leg, elevation, rate = _view(route, float(time_s))
        level = math.degrees(aim.level_tilt(-elevation))
        if stops_suffice and not low - 1e-6 <= level <= high + 1e-6:
            raise InputError(
                f"mission.aim: tilt, on leg '{leg}' the camera would have to tilt to {level:.0f} deg, its stops are at "
                f"{low:g} and {high:g} deg: take both, which pitches the vehicle for the rest, or other elevations_deg"
            )
        if low <= level <= high and rate > joint.rate_rad_s:
            raise InputError(
                f"mission.speed_m_s: on leg '{leg}' the camera would have to tilt at {math.degrees(rate):.0f} deg/s, "
                f"its joint turns at {math.degrees(joint.rate_rad_s):g} deg/s: fly slower, or set mission.aim to pitch"
            )


def _view(route: Route, time_s: float) -> tuple[str, float, float]:
    """Leg under way, elevation of the camera, and how fast that changes (a magnitude)."""
    leg = route.legs[i := route.leg_at(time_s)]
    fraction, rate = leg.progress(time_s - float(route.starts_s[i]))
    elevation = float((1 - fraction) * leg.start[1] + fraction * leg.end[1])
    return leg.name, elevation, abs(rate * float(leg.end[1] - leg.start[1]))

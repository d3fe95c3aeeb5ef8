"""Transects over a patch at one height (lawnmower), and orbits round parts of it one after another.

In a transect a leg's centre is the camera itself (range 0), which looks ahead and down; lines are flown in turn towards
north and south, so that each slope is seen from two sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, permutations

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose
from wakewise.scene.missions.orbit import MissionSettings, camera_pose
from wakewise.scene.missions.route import Leg, Route, rest_to_rest

LAST_S = 0.5
"""The last shutter closes before the recording ends."""
TURN_M = 0.3
"""A leg takes at least the time of this much way for each radian that the camera turns."""
OVER_M = 0.15
"""Lines go on for so much longer than until their camera's axis meets the patch's end."""
CLEAR_AT = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Shares of a direct way at which the hull must be clear."""
MOST_ORDERED = 7
"""Up to so many parts all orders are tried, of more the nearest is next."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchTransects:
    """Lines over a patch: `middle_m`, `size_m`, shape (2,), north and east; camera depth, and what lies below it.

    `ahead_m` is how far before the camera its axis meets the patch.
    """

    middle_m: Array
    size_m: Array
    depth_m: float
    ahead_m: float
    spacing_m: float
    every_m: float
    look_rad: float

    def __post_init__(self) -> None:
        freeze(self, middle_m=(2,), size_m=(2,))

    def lines(self) -> list[tuple[Array, Array, float]]:
        """Begin and end of each line, shape (3,), and the camera's heading on it."""
        count = max(1, round(float(self.size_m[1]) / self.spacing_m))
        lines = []
        for number in range(count):
            sign = 1.0 if number % 2 == 0 else -1.0
            east = float(self.middle_m[1] + self.size_m[1] * ((number + 0.5) / count - 0.5))
            reach, north = 0.5 * float(self.size_m[0]), float(self.middle_m[0])
            marks = (-reach - self.ahead_m, reach - self.ahead_m + OVER_M)
            ends = [np.array([north + sign * mark, east, self.depth_m]) for mark in marks]
            lines.append((ends[0], ends[1], 0.0 if sign > 0.0 else math.pi))
        return lines


@dataclass(kw_only=True, eq=False)
class RouteBuilder:
    """Puts legs with photographs one after the other, from where the camera is.

    `centre_W_m`, shape (3,), and `place`, azimuth, elevation and range, shape (3,): of the camera at the start.
    """

    mission: MissionSettings
    centre_W_m: Array
    place: Array
    clock_s: float = 0.0
    legs: list[Leg] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)
    exposures: list[float] = field(default_factory=list)
    planned: list[Pose] = field(default_factory=list)

    def go(self, name: str, centre_W_m: Array, place: Array, photos: int = 0) -> None:
        """A leg to another centre and place, with photographs evenly along it, the first at its begin."""
        end = place.copy()
        shift = centre_W_m - self.centre_W_m
        speed, acceleration = self.mission.speed_m_s, self.mission.acceleration_m_s2
        leg = rest_to_rest(name, self.place, end, speed, acceleration, self.centre_W_m, shift)
        turn_m = TURN_M * float(np.linalg.norm(end[:2] - self.place[:2]))
        if leg.length_m < turn_m and leg.length_m > 0.0:
            slower = leg.length_m / turn_m
            slow = speed * slower, acceleration * slower
            leg = rest_to_rest(name, self.place, end, *slow, self.centre_W_m, shift)
        self.legs.append(leg)
        self.starts.append(self.clock_s)
        for share in np.linspace(0.0, 1.0, photos):
            self.exposures.append(self.clock_s + leg.time_at(float(share)))
            self.planned.append(self.between(centre_W_m, end, float(share)))
        self.clock_s += leg.duration_s
        self.centre_W_m, self.place = centre_W_m, end

    def between(self, centre_W_m: Array, place: Array, share: float) -> Pose:
        """Camera pose X_WC at a share of a leg to another centre and place."""
        at = (1.0 - share) * self.place + share * place
        return camera_pose((1.0 - share) * self.centre_W_m + share * centre_W_m, *at.tolist())

    def turned(self, azimuth_rad: float) -> float:
        """The same azimuth within half a turn of the present one."""
        return float(self.place[0] + math.remainder(azimuth_rad - self.place[0], 2.0 * math.pi))

    def route(self, first_photo: int = 0) -> Route:
        """What was put together; photographs are named from a number on."""
        names = tuple(f"{first_photo + k:03d}.png" for k in range(len(self.exposures)))
        return Route(
            centre_W_m=self.centre_W_m,
            legs=tuple(self.legs),
            starts_s=np.array(self.starts),
            exposures_s=np.array(self.exposures),
            exposure_names=names,
            X_WC_planned=tuple(self.planned),
            duration_s=self.clock_s + LAST_S,
        )


def transect_route(patch: PatchTransects, mission: MissionSettings, settle_s: float) -> Route:
    """Settle at the first line's begin, then all lines."""
    lines = patch.lines()
    # The camera looks along its heading, away from where an orbit's camera would stand.
    place = np.array([lines[0][2] + math.pi, patch.look_rad, 0.0])
    built = RouteBuilder(mission=mission, centre_W_m=lines[0][0], place=place, clock_s=settle_s)
    for number, (begin, end, heading) in enumerate(lines):
        azimuth = built.turned(heading + math.pi)
        if number:
            built.go(f"turn {number}", begin, np.array([azimuth, patch.look_rad, 0.0]))
        photos = max(2, 1 + round(float(np.linalg.norm(end - begin)) / patch.every_m))
        built.go(f"transect {number + 1}", end, np.array([azimuth, patch.look_rad, 0.0]), photos)
    return built.route()


@dataclass(frozen=True, kw_only=True, eq=False)
class PartOrbit:
    """A circle round a part of the surface: its middle, shape (3,), elevation, range, and number of photographs."""

    centre_W_m: Array
    elevation_rad: float
    range_m: float
    views: int

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,))


def orbits_route(
    orbits: Sequence[PartOrbit],
    centre_W_m: Array,
    place: Array,
    over_z_m: float,
    mission: MissionSettings,
    first: int,
    clear: Callable[[Pose], bool],
) -> Route:
    """Orbits one after another, each begun where the camera comes to it.

    The way from one to the next is direct where it is `clear`, else over everything, at the camera's depth `over_z_m`.
    `centre_W_m`, `place`: where the camera is, as of `RouteBuilder`; `first`: number of the first photograph.
    """
    built = RouteBuilder(mission=mission, centre_W_m=centre_W_m, place=place)
    for number, orbit in enumerate(orbits):
        here = camera_pose(built.centre_W_m, *built.place.tolist()).p_m
        away = here[:2] - orbit.centre_W_m[:2]
        azimuth = built.turned(math.atan2(away[1], away[0]))
        begin = np.array([azimuth, orbit.elevation_rad, orbit.range_m])
        there = camera_pose(orbit.centre_W_m, *begin.tolist()).p_m
        # From here on the camera itself is the centre, so that ways between orbits are straight.
        built.centre_W_m, built.place = here, built.place * [1.0, 1.0, 0.0]
        begin[2] = 0.0
        if not all(clear(built.between(there, begin, share)) for share in CLEAR_AT):
            built.go(f"rise to part {number + 1}", np.array([*here[:2], over_z_m]), built.place)
            built.go(f"over to part {number + 1}", np.array([*there[:2], over_z_m]), begin)
        built.go(f"to part {number + 1}", there, begin)
        built.centre_W_m, built.place = orbit.centre_W_m, np.array([azimuth, orbit.elevation_rad, orbit.range_m])
        end = built.place + 2.0 * math.pi * (1.0 - 1.0 / orbit.views) * np.array([1.0, 0.0, 0.0])
        built.go(f"orbit {number + 1}", orbit.centre_W_m, end, orbit.views)
    return built.route(first)


def ordered(orbits: Sequence[PartOrbit], here_W_m: Array) -> list[PartOrbit]:
    """The orbits in the order of the shortest way from a place, shape (3,), through their middles, seen from above."""
    if len(orbits) <= MOST_ORDERED:
        places = [np.asarray(here_W_m), *(orbit.centre_W_m for orbit in orbits)]
        away = np.linalg.norm(np.array(places)[:, None, :2] - np.array(places)[None, :, :2], axis=2)
        tours = permutations(range(1, len(places)))
        best = min(tours, key=lambda tour: sum(away[a, b] for a, b in pairwise((0, *tour))))
        return [orbits[k - 1] for k in best]
    left, tour, at = list(orbits), list[PartOrbit](), np.asarray(here_W_m)[:2]
    while left:
        nearest = min(range(len(left)), key=lambda k: float(np.linalg.norm(left[k].centre_W_m[:2] - at)))
        tour.append(left.pop(nearest))
        at = tour[-1].centre_W_m[:2]
    return tour

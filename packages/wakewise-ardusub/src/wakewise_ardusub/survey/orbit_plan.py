"""Orbits: circles round a centre at a constant speed, bow towards the centre, in layers of altitude.

The heading turns by speed / radius. The acceleration has a part speed^2 / radius towards the centre. A circle goes from
rest to rest by the pace's trapezoid of the speed along it.

Layers are flown in turn in opposite directions, because the tether of a vehicle that flies round a target winds round
it: two layers unwind each other.

Direction of the first layer. On the half of the circle from which the current comes, the jets that hold the vehicle
against the current blow towards the target, in either direction. The half beyond the target is clean in either
direction. So only the order can be chosen: `auto` sets out with the current, towards the half beyond the target. That
half is then photographed before silt from the other half drifts over the target. Without a current it goes to the
vehicle's right.

A way to an orbit, or back to one that was interrupted, goes straight away from or towards the centre, then along the
circle. It never crosses it, because a target may stand there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise_ardusub.survey.survey_plan import (
    ALTITUDES_M,
    SHORTEST_M,
    WEAK_M_S,
    SurveyLeg,
    SurveyPace,
    turned,
    wrapped,
)

Direction = Literal["auto", "right", "left"]
RADII_M, TURNS, MOST_LAYERS = (0.5, 20.0), (0.1, 20.0), 10
MOST_TURN_RAD_S, MOST_INWARDS_M_S2 = 0.1, 0.02
"""Fastest turn and largest acceleration towards the centre. Beyond them ArduSub's default gains (PSC_VELXY_I) leave the
circle by decimetres in simulation."""
CLEAR_M = 0.25
"""Least distance of the hull's bow or stern from the centre of an orbit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OrbitLeg(SurveyLeg):
    """An arc round a centre, shape (2,), by `sweep_rad`: positive to the right (clockwise from above)."""

    centre_W_m: Array
    sweep_rad: float

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, centre_W_m=(2,))

    @classmethod
    def about(
        cls, centre_W_m: Array, start_W_m: Array, sweep_rad: float, *, altitude_m: float | None, line: bool = True
    ) -> OrbitLeg:
        """The arc from a place, with its bow towards the centre."""
        start = np.array(start_W_m)
        return cls(
            start_W_m=start,
            end_W_m=centre_W_m + turned(start - centre_W_m, sweep_rad),
            heading_rad=_bearing(centre_W_m - start),
            line=line,
            altitude_m=altitude_m,
            centre_W_m=np.array(centre_W_m),
            sweep_rad=sweep_rad,
        )

    @property
    def radius_m(self) -> float:
        """Radius, m."""
        return math.dist(self.start_W_m, self.centre_W_m)

    @property
    def length_m(self) -> float:
        """Length, m."""
        return self.radius_m * abs(self.sweep_rad)

    @property
    def direction(self) -> Array:
        """Unit tangent at its start, shape (2,)."""
        return turned(self.start_W_m - self.centre_W_m, math.copysign(0.5 * math.pi, self.sweep_rad)) / self.radius_m

    @property
    def bend_per_m(self) -> float:
        """Turn to the right of its tangent and of its heading, rad per metre."""
        return math.copysign(1.0 / self.radius_m, self.sweep_rad)

    def place_at(self, along_m: float) -> Array:
        """The place so far along it, shape (2,)."""
        return self.centre_W_m + turned(self.start_W_m - self.centre_W_m, self.bend_per_m * along_m)

    def aim_from(self, _place_W_m: Array) -> float:
        """Bearing of the centre from a place, rad."""
        return _bearing(self.centre_W_m - _place_W_m)

    def off(self, place_W_m: Array, along_m: float) -> tuple[float, float]:
        """How far a place is to the right of the arc (by its radius), and ahead along the arc, m."""
        out, ahead = place_W_m - self.centre_W_m, self.place_at(along_m) - self.centre_W_m
        passed = wrapped(_bearing(out) - _bearing(ahead))
        outside = float(np.hypot(*out)) - self.radius_m
        return -math.copysign(1.0, self.sweep_rad) * outside, passed / self.bend_per_m

    def rest_from(self, along_m: float) -> OrbitLeg:
        """What is left of it."""
        left = self.sweep_rad - self.bend_per_m * along_m
        rest = OrbitLeg.about(self.centre_W_m, self.place_at(along_m), left, altitude_m=self.altitude_m)
        return replace(rest, line=self.line)

    def ways_from(self, place_W_m: Array, _heading_rad: float) -> list[SurveyLeg]:
        """Straight to or from the centre onto the circle, then along it the shorter way round; never across it."""
        out = place_W_m - self.centre_W_m
        onto = self.centre_W_m + self.radius_m * out / max(float(np.hypot(*out)), 1e-9)
        ways: list[SurveyLeg] = []
        if math.dist(place_W_m, onto) >= SHORTEST_M:
            ways.append(SurveyLeg(start_W_m=place_W_m, end_W_m=onto, heading_rad=self.aim_from(place_W_m), line=False))
        sweep = wrapped(_bearing(self.start_W_m - self.centre_W_m) - _bearing(out))
        if abs(sweep) * self.radius_m >= SHORTEST_M:
            ways.append(OrbitLeg.about(self.centre_W_m, onto, sweep, altitude_m=None, line=False))
        return [replace(way, altitude_m=self.altitude_m) for way in ways]


@dataclass(frozen=True, kw_only=True)
class OrbitRequest:
    """Radius (m), turns of each layer, altitudes of the layers (m), direction of the first, and a centre (north, east).

    Right is the vehicle's own right, with its bow towards the centre: counterclockwise from above. Without a centre it
    is `radius_m` ahead of the bow.
    """

    radius_m: float = 1.5
    turns: float = 1.0
    altitudes_m: tuple[float, ...] = (0.8,)
    direction: Direction = "auto"
    centre_W_m: tuple[float, float] | None = None

    def check(self, pace: SurveyPace, hull_m: float) -> None:
        """Raise InputError where an orbit is none, or its radius is too small for the speed or a hull of a length."""
        for option, value, (least, most), unit in (
            ("--turns", self.turns, TURNS, ""),
            ("--ahead or --radius", self.radius_m, RADII_M, " m"),
            *(("--altitude", altitude, ALTITUDES_M, " m") for altitude in self.altitudes_m),
        ):
            if not least <= value <= most:
                raise InputError(f"{option} {value:g}: must be from {least:g} to {most:g}{unit}")
        if not 1 <= len(self.altitudes_m) <= MOST_LAYERS:
            raise InputError(f"--altitude: {len(self.altitudes_m)} layers, must be 1 to {MOST_LAYERS}")
        turn = min(MOST_TURN_RAD_S, pace.turn_rad_s)
        least_m = max(pace.speed_m_s / turn, pace.speed_m_s**2 / MOST_INWARDS_M_S2)
        if self.radius_m < least_m - 1e-9:
            raise InputError(
                f"--ahead or --radius {self.radius_m:g}: at {pace.speed_m_s:g} m/s it must be {least_m:.2f} m or more, "
                f"because it turns by at most {math.degrees(turn):.1f} deg/s and {MOST_INWARDS_M_S2:g} m/s2 inwards"
            )
        if self.radius_m < 0.5 * hull_m + CLEAR_M:
            raise InputError(
                f"--ahead or --radius {self.radius_m:g}: must be {0.5 * hull_m + CLEAR_M:.2f} m or more, "
                f"because the hull is {hull_m:.2f} m long"
            )

    def legs(self, place_W_m: Array, heading_rad: float, current_W_m_s: Array) -> list[SurveyLeg]:
        """One arc for each layer, from the place of the circle that is next to a place, shape (2,).

        Raises
        ------
        InputError
            If the place is at the centre.
        """
        bow = np.array([math.cos(heading_rad), math.sin(heading_rad)])
        centre = place_W_m + self.radius_m * bow if self.centre_W_m is None else np.array(self.centre_W_m)
        out = place_W_m - centre
        if not float(np.hypot(*out)) >= SHORTEST_M:
            raise InputError(f"--centre: the vehicle is there; it must be {SHORTEST_M:g} m or more away")
        start = centre + self.radius_m * out / np.hypot(*out)
        sign = {"auto": with_current(start - centre, current_W_m_s), "right": -1, "left": 1}[self.direction]
        legs: list[SurveyLeg] = []
        for k, altitude in enumerate(self.altitudes_m):
            sweep = sign * (-1) ** k * 2.0 * math.pi * self.turns
            legs.append(OrbitLeg.about(centre, start, sweep, altitude_m=altitude))
            start = legs[-1].end_W_m
        return legs


def with_current(out_W_m: Array, current_W_m_s: Array) -> int:
    """Sign of the sweep that sets out with the current from a place beside a centre; -1 where the current is weak."""
    flows = float(turned(out_W_m, 0.5 * math.pi) @ current_W_m_s)
    return 1 if flows > 0.0 and math.hypot(*current_W_m_s) >= WEAK_M_S else -1


def _bearing(vector: Array) -> float:
    return math.atan2(vector[1], vector[0])

"""Survey plan: lines at a speed and an altitude, from rest to rest, and how far along it a vehicle is.

Between corners the speed is a trapezoid: it rises and falls by `acceleration_m_s2`. At each corner the vehicle rests,
turns by a trapezoid of the turn rate, and goes on. A pause brakes by the same bound.

Current. A vehicle that moves with velocity v over ground in a current c moves with v - c through the water. Its forward
thrusters blow along -(v - c). Rules, each with its reason:

- heading: along v - c, at most `MOST_CRAB_RAD` off the line. The wash then leaves over the stern, behind the vehicle,
  and no sideways jets are needed;
- order: a survey proceeds against the current (`ordered`), so that its wash drifts over what was photographed before;
- side: a lawnmower from the vehicle's place goes to the side that the current comes from, for the same reason.

A current that follows a line faster than the vehicle's speed makes it brake: then jets blow ahead (`warning_of`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise_ardusub.survey.map_files import GeoAnchor

SPEEDS_M_S = (0.05, 0.30)
ALTITUDES_M = (0.4, 10.0)
LONGEST_M = 5000.0
MOST_LINES = 500
MOST_CRAB_RAD = math.radians(30.0)
WEAK_M_S = 0.02
"""A current weaker than this does not change heading, order or side."""
SHORTEST_M = 0.1
_THERE_M, _TURNED_RAD = 1e-4, 1e-3
_SHARES = np.linspace(0.0, 1.0, 33)


@dataclass(frozen=True, kw_only=True)
class SurveyPace:
    """Speed, m/s, altitude above the bed, m, and bounds of acceleration (m/s2), turn rate and turn acceleration (rad/s,
    rad/s2). Raises InputError where a value is out of range.
    """

    speed_m_s: float = 0.1
    altitude_m: float = 0.8
    acceleration_m_s2: float = 0.01
    turn_rad_s: float = 0.15
    turn_rad_s2: float = 0.05

    def __post_init__(self) -> None:
        for option, value, (least, most), unit in (
            ("--speed", self.speed_m_s, SPEEDS_M_S, "m/s"),
            ("--altitude", self.altitude_m, ALTITUDES_M, "m"),
        ):
            if not least <= value <= most:
                raise InputError(f"{option} {value:g}: must be from {least:g} to {most:g} {unit}")
        for value in (self.acceleration_m_s2, self.turn_rad_s, self.turn_rad_s2):
            if not 0.0 < value < 10.0:
                raise InputError(f"survey: a bound of {value:g}, must be more than 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyLeg:
    """A straight leg between places north and east, shape (2,); `line` is false of a way between lines.

    `heading_rad` is the heading at its start. `altitude_m` is None where the pace's altitude holds. `centre_W_m` is the
    centre of an arc (`orbit_plan.OrbitLeg`), None of a straight leg.
    """

    start_W_m: Array
    end_W_m: Array
    heading_rad: float
    line: bool = True
    altitude_m: float | None = None
    centre_W_m: Array | None = None

    def __post_init__(self) -> None:
        freeze(self, start_W_m=(2,), end_W_m=(2,))

    @property
    def length_m(self) -> float:
        """Length, m."""
        return math.dist(self.start_W_m, self.end_W_m)

    @property
    def direction(self) -> Array:
        """Unit tangent at its start, shape (2,)."""
        return (self.end_W_m - self.start_W_m) / max(math.dist(self.start_W_m, self.end_W_m), 1e-9)

    @property
    def bend_per_m(self) -> float:
        """Turn to the right of its tangent and of its heading, rad per metre."""
        return 0.0

    def place_at(self, along_m: float) -> Array:
        """The place so far along it, shape (2,)."""
        return self.start_W_m + along_m * self.direction

    def way_at(self, along_m: float) -> Array:
        """Unit tangent so far along it, shape (2,)."""
        return turned(self.direction, self.bend_per_m * along_m)

    def heading_at(self, along_m: float) -> float:
        """Heading so far along it, rad."""
        return wrapped(self.heading_rad + self.bend_per_m * along_m)

    def aim_from(self, _place_W_m: Array) -> float:
        """Heading that is right at a place beside it, rad."""
        return self.heading_rad

    def off(self, place_W_m: Array, along_m: float) -> tuple[float, float]:
        """How far a place is to the right of it, and ahead of the place so far along it, m."""
        way, away = self.way_at(along_m), place_W_m - self.place_at(along_m)
        return float(way[0] * away[1] - way[1] * away[0]), float(away @ way)

    def rest_from(self, along_m: float) -> SurveyLeg:
        """What is left of it."""
        return replace(self, start_W_m=self.place_at(along_m))

    def ways_from(self, place_W_m: Array, heading_rad: float) -> list[SurveyLeg]:
        """Legs that are no lines from a place to its start: none where that is near."""
        if math.dist(place_W_m, self.start_W_m) < SHORTEST_M:
            return []
        way = SurveyLeg(start_W_m=place_W_m, end_W_m=self.start_W_m, heading_rad=heading_rad, line=False)
        return [replace(way, altitude_m=self.altitude_m)]


MakeLines = Callable[[Array, float, Array, GeoAnchor | None], Sequence[Array | SurveyLeg]]
"""Lines, shape (2, 2) or legs, from place (2,), heading, current (2,) and anchor; raises InputError without any."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyPlan:
    """Legs in their order, and the pace."""

    legs: tuple[SurveyLeg, ...]
    pace: SurveyPace

    @property
    def line_m(self) -> float:
        """Length of all lines, m."""
        return sum(leg.length_m for leg in self.legs if leg.line)

    @property
    def centre_W_m(self) -> Array | None:
        """Centre of its first arc, shape (2,)."""
        return next((leg.centre_W_m for leg in self.legs if leg.centre_W_m is not None), None)

    def farthest_m(self, place_W_m: Array) -> float:
        """Largest distance of its places from one, m."""
        places = [leg.place_at(share * leg.length_m) for leg in self.legs for share in _SHARES]
        return max(math.dist(place_W_m, place) for place in places)


@dataclass(frozen=True, kw_only=True)
class PlanProgress:
    """Where on a plan: leg, distance along it, speed, acceleration, heading, its rate, and metres flown on lines."""

    heading_rad: float
    leg: int = 0
    along_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    turn_rad_s: float = 0.0
    flown_m: float = 0.0


def wrapped(angle_rad: float) -> float:
    """The angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def turned(vector: Array, angle_rad: float) -> Array:
    """A vector north and east, shape (2,), turned to the right."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def next_speed(left: float, speed: float, most: float, rate: float, dt_s: float, *, go: bool = True) -> float:
    """Speed one step later of a trapezoid profile that ends at rest after `left`; without `go` it brakes to rest."""
    if not go:
        return max(speed - rate * dt_s, 0.0)
    stops = math.sqrt((0.5 * rate * dt_s) ** 2 + 2.0 * rate * max(left - 0.5 * speed * dt_s, 0.0)) - 0.5 * rate * dt_s
    return max(min(speed + rate * dt_s, most, stops), 0.0)


def advance(plan: SurveyPlan, at: PlanProgress, dt_s: float, *, go: bool = True) -> PlanProgress:
    """The progress one step later: first the turn to the leg's heading at rest, then the leg; `go` false is a pause."""
    if at.leg >= len(plan.legs):
        return replace(at, speed_m_s=0.0, acceleration_m_s2=0.0, turn_rad_s=0.0)
    leg, pace = plan.legs[at.leg], plan.pace
    missing = wrapped(leg.heading_rad - at.heading_rad)
    if at.along_m == 0.0 and (abs(missing) > _TURNED_RAD or at.turn_rad_s > _TURNED_RAD):
        rate = next_speed(abs(missing), at.turn_rad_s, pace.turn_rad_s, pace.turn_rad_s2, dt_s, go=go)
        step = min(0.5 * (at.turn_rad_s + rate) * dt_s, abs(missing))
        return replace(at, heading_rad=wrapped(at.heading_rad + math.copysign(step, missing)), turn_rad_s=rate)
    left = leg.length_m - at.along_m
    speed = next_speed(left, at.speed_m_s, pace.speed_m_s, pace.acceleration_m_s2, dt_s, go=go)
    step = min(0.5 * (at.speed_m_s + speed) * dt_s, left)
    along = at.along_m + step
    flown = at.flown_m + (step if leg.line else 0.0)
    if leg.length_m - along < _THERE_M or (go and speed == 0.0 and left < SHORTEST_M):
        return PlanProgress(heading_rad=leg.heading_at(leg.length_m), leg=at.leg + 1, flown_m=flown)
    return replace(
        at,
        heading_rad=leg.heading_at(along),
        along_m=along,
        speed_m_s=speed,
        acceleration_m_s2=(speed - at.speed_m_s) / dt_s,
        turn_rad_s=0.0,
        flown_m=flown,
    )


def target_of(plan: SurveyPlan, at: PlanProgress) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration, shape (2,) each, in W; on an arc with the centripetal acceleration."""
    if at.leg >= len(plan.legs):
        return plan.legs[-1].end_W_m, np.zeros(2), np.zeros(2)
    leg = plan.legs[at.leg]
    way = leg.way_at(at.along_m)
    inwards = at.speed_m_s**2 * leg.bend_per_m * np.array([-way[1], way[0]])
    return leg.place_at(at.along_m), at.speed_m_s * way, at.acceleration_m_s2 * way + inwards


def turn_of(plan: SurveyPlan, at: PlanProgress) -> float:
    """Turn rate of the heading on an arc, rad/s, positive to the right; 0 on straight legs."""
    return 0.0 if at.leg >= len(plan.legs) else plan.legs[at.leg].bend_per_m * at.speed_m_s


def time_left_s(plan: SurveyPlan, at: PlanProgress) -> float:
    """Seconds to the end, without pauses."""
    pace, total, heading = plan.pace, 0.0, at.heading_rad
    for number in range(at.leg, len(plan.legs)):
        leg = plan.legs[number]
        left = leg.length_m - (at.along_m if number == at.leg else 0.0)
        turn = abs(wrapped(leg.heading_rad - heading)) if number > at.leg or at.along_m == 0.0 else 0.0
        total += left / pace.speed_m_s + pace.speed_m_s / pace.acceleration_m_s2
        total += turn / pace.turn_rad_s + (pace.turn_rad_s / pace.turn_rad_s2 if turn > _TURNED_RAD else 0.0)
        heading = leg.heading_at(leg.length_m)
    return total


def crabbed(direction: Array, speed_m_s: float, current_W_m_s: Array) -> float:
    """Heading on a line, rad: along the velocity through the water, at most `MOST_CRAB_RAD` off the line."""
    track = math.atan2(direction[1], direction[0])
    if math.hypot(*current_W_m_s) < WEAK_M_S:
        return track
    through = speed_m_s * direction - current_W_m_s
    ahead, aside = float(through @ direction), float(direction[0] * through[1] - direction[1] * through[0])
    if ahead <= 0.0:  # the current is faster than the vehicle: it brakes, whatever its heading
        return track
    return wrapped(track + min(max(math.atan2(aside, ahead), -MOST_CRAB_RAD), MOST_CRAB_RAD))


def ordered(lines: Sequence[Array], current_W_m_s: Array) -> list[Array]:
    """Lines, shape (2, 2) each, in the order that proceeds against the current: as given, or all reversed."""
    first, last = lines[0], lines[-1]
    way = last.mean(axis=0) - first.mean(axis=0) if len(lines) > 1 else last[1] - first[0]
    with_it = math.hypot(*current_W_m_s) >= WEAK_M_S and float(way @ current_W_m_s) > 0.0
    return [line[::-1] for line in reversed(lines)] if with_it else list(lines)


def parallel_lines(
    start_W_m: Array, heading_rad: float, width_m: float, length_m: float, spacing_m: float, side: int
) -> list[Array]:
    """A lawnmower: lines of `length_m` along the heading, `spacing_m` apart, to the right (side 1) or the left (-1).

    Raises
    ------
    InputError
        If a size is not a length, or there would be too many lines.
    """
    for name, value in (("width", width_m), ("length", length_m)):
        if not SHORTEST_M <= value <= LONGEST_M:
            raise InputError(
                f"--length, --area: a {name} of {value:g} m, must be from {SHORTEST_M:g} to {LONGEST_M:g} m"
            )
    if not SHORTEST_M <= spacing_m <= LONGEST_M:
        raise InputError(f"--spacing {spacing_m:g}: must be from {SHORTEST_M:g} to {LONGEST_M:g} m")
    count = math.floor(width_m / spacing_m + 1e-9) + 1
    if count > MOST_LINES:
        raise InputError(f"--spacing {spacing_m:g}: {count} lines, at most {MOST_LINES}")
    along = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    across = side * np.array([-along[1], along[0]])
    lines = []
    for k in range(count):
        near = start_W_m + k * spacing_m * across
        ends = np.array([near, near + length_m * along])
        lines.append(ends if k % 2 == 0 else ends[::-1])
    return lines


def upstream_side(heading_rad: float, current_W_m_s: Array) -> int:
    """1 where the current comes from the right of a heading, or is weak, else -1."""
    right = np.array([-math.sin(heading_rad), math.cos(heading_rad)])
    flows = float(right @ current_W_m_s)
    return -1 if flows > 0.0 and math.hypot(*current_W_m_s) >= WEAK_M_S else 1


def plan_survey(
    lines: Sequence[Array | SurveyLeg], place_W_m: Array, pace: SurveyPace, current_W_m_s: Array
) -> SurveyPlan:
    """The plan of lines in their order, with ways between them and from the vehicle's place, shape (2,), to the first.

    A line is its two ends, shape (2, 2), or a leg that was made already.

    Raises
    ------
    InputError
        If there is no line, one is too short, a place is no number, or all are longer than `LONGEST_M`.
    """
    if not lines:
        raise InputError("survey: no line")
    ends = [np.array([line.start_W_m, line.end_W_m]) if isinstance(line, SurveyLeg) else line for line in lines]
    if not np.isfinite(np.concatenate([place_W_m[None], *ends])).all():
        raise InputError("survey: a place of a line is not a number")
    legs: list[SurveyLeg] = []
    here = place_W_m
    for line in lines:
        if isinstance(line, SurveyLeg):
            legs += [*line.ways_from(here, line.heading_rad), line]
            here = line.end_W_m
            continue
        if math.dist(line[0], line[1]) < SHORTEST_M:
            raise InputError(f"survey: a line of {math.dist(line[0], line[1]):.2f} m, must be {SHORTEST_M:g} m or more")
        for start, end, is_line in ((here, line[0], False), (line[0], line[1], True)):
            if is_line or math.dist(start, end) >= SHORTEST_M:
                way = (end - start) / math.dist(start, end)
                heading = crabbed(way, pace.speed_m_s, current_W_m_s)
                legs.append(SurveyLeg(start_W_m=start, end_W_m=end, heading_rad=heading, line=is_line))
        here = line[1]
    total = sum(leg.length_m for leg in legs)
    if total > LONGEST_M:
        raise InputError(f"survey: {total:.0f} m with the way to its start, at most {LONGEST_M:g} m")
    return SurveyPlan(legs=tuple(legs), pace=pace)


def made_plan(
    make: MakeLines,
    place_W_m: Array,
    heading_rad: float,
    current_W_m_s: Array,
    anchor: GeoAnchor | None,
    *,
    pace: SurveyPace,
    fence_m: float,
) -> SurveyPlan:
    """The plan of the lines as they are made from a place, shape (2,).

    Raises
    ------
    InputError
        As `plan_survey`, and if it reaches farther than the fence from the place.
    """
    plan = plan_survey(make(place_W_m, heading_rad, current_W_m_s, anchor), place_W_m, pace, current_W_m_s)
    away = plan.farthest_m(place_W_m)
    if away > fence_m:
        raise InputError(f"survey: {away:.0f} m from here, --fence is {fence_m:g} m")
    return plan


def resumed(plan: SurveyPlan, at: PlanProgress, place_W_m: Array) -> tuple[SurveyPlan, PlanProgress]:
    """The rest of a plan from where a vehicle is now: back to where it left the plan, then on.

    A way round a centre that was not ended is made anew from here.
    """
    rest = list(plan.legs[at.leg :])
    if rest:
        rest[0] = rest[0].rest_from(at.along_m)
        rest = rest if rest[0].length_m >= _THERE_M else rest[1:]
    while rest and not rest[0].line and any(leg.centre_W_m is not None for leg in rest):
        rest = rest[1:]
    ways = rest[0].ways_from(place_W_m, at.heading_rad) if rest else []
    return replace(plan, legs=(*ways, *rest)), PlanProgress(heading_rad=at.heading_rad, flown_m=at.flown_m)


def warning_of(plan: SurveyPlan, current_W_m_s: Array) -> str:
    """What the current does to a plan that its rules cannot help, in words; empty where there is nothing."""
    lines = [leg for leg in plan.legs if leg.line]
    follows = [max(float(leg.way_at(s * leg.length_m) @ current_W_m_s) for s in _SHARES) for leg in lines]
    faster = sum(flow > plan.pace.speed_m_s for flow in follows)
    if not faster:
        return ""
    return f"on {faster} of {len(follows)} lines the current is faster than the vehicle: it brakes, and jets blow ahead"

"""What ends a survey: pure functions of what is known.

Whatever they find, the session stops sending targets and asks for the firmware's own hold. If the program itself dies,
the firmware stops the vehicle 3 s after the last target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wakewise_ardusub.link.protocol import ALT_HOLD, GUIDED, POSHOLD
from wakewise_ardusub.logs.channels import MODES

BEHIND_S = 0.5
"""Two turns of the program further apart than this: it stood still."""


@dataclass(frozen=True, kw_only=True)
class SurveyLimits:
    """Ages (s) above which something is lost, and bounds (m) of the flight.

    `range_s` is the longest drop-out of the rangefinder that is flown through at a held depth. `off_m` is the distance
    from the target place, `near_share` the share of the altitude below which the bed is too near. `mode` is the flight
    mode that it is flown in.
    """

    telemetry_s: float = 0.7
    position_s: float = 0.7
    doppler_s: float = 0.8
    sticks_s: float = 0.7
    station_s: float = 3.5
    range_s: float = 0.8
    off_m: float = 0.6
    near_share: float = 0.25
    least_depth_m: float = 0.3
    fence_m: float = 200.0
    mode: int = GUIDED


@dataclass(frozen=True, kw_only=True)
class SurveyFacts:
    """What is known now: ages in s (infinite: never), NaN where a number is unknown.

    `doppler_s` is the age of the Doppler log's own messages, NaN where none was ever heard; `placed` is false where the
    autopilot's filter says that it has no horizontal position. `stick` is the largest deflection, 0 to 1.
    """

    armed: bool | None
    mode: int | None
    mode_name: str = ""
    telemetry_s: float = math.inf
    position_s: float = math.inf
    doppler_s: float = math.nan
    placed: bool = True
    sticks_s: float = math.inf
    station_s: float = math.inf
    stick: float = 0.0
    range_s: float = math.inf
    altitude_m: float = math.nan
    depth_m: float = math.nan
    off_m: float = 0.0
    takeover: str = ""
    rival: str = ""
    turn_s: float = 0.0


def missing(facts: SurveyFacts, limits: SurveyLimits, highest_m: float = 0.0) -> str:
    """What a survey cannot begin without, in words; empty where nothing is missing.

    `highest_m` is the greatest altitude that is asked for: it must lie below the surface.
    """
    if facts.telemetry_s > limits.telemetry_s or facts.armed is None:
        return "nothing is heard from the autopilot"
    if facts.position_s > limits.position_s or not facts.placed:
        return "no position (LOCAL_POSITION_NED); GUIDED needs a DVL or another positioning system"
    if facts.doppler_s > limits.doppler_s:
        return "no velocity of the Doppler log (DVL)"
    if facts.range_s > limits.range_s:
        return "no rangefinder that looks down (DISTANCE_SENSOR, orientation 25); an altitude needs one"
    if facts.sticks_s > limits.sticks_s:
        return "no sticks are heard (MANUAL_CONTROL): the pilot could not end it"
    if facts.station_s > limits.station_s:
        return "no ground station is heard (HEARTBEAT)"
    if facts.stick > 0.0:
        return "a stick is not in its middle"
    if facts.rival:
        return facts.rival
    if not facts.armed:
        return "the vehicle is disarmed; the pilot arms it"
    if facts.depth_m < limits.least_depth_m:
        return f"the vehicle is {facts.depth_m:.1f} m deep, {limits.least_depth_m:g} m is needed"
    bed_m = facts.depth_m + facts.altitude_m
    if bed_m - highest_m < limits.least_depth_m:
        return f"the bed is {bed_m:.1f} m deep: {highest_m:g} m above it is the surface"
    return ""


def fault_of(facts: SurveyFacts, limits: SurveyLimits, altitude_m: float) -> str:
    """The first fault that ends a survey, in words; empty where there is none. `altitude_m` is the one asked for."""
    faults = (
        (facts.turn_s > BEHIND_S, f"this program stood still for {facts.turn_s:.1f} s"),
        (facts.stick > 0.0, "the pilot moved a stick"),
        (bool(facts.takeover), facts.takeover),
        (bool(facts.rival), facts.rival),
        (facts.telemetry_s > limits.telemetry_s, "nothing is heard from the autopilot"),
        (facts.armed is False, "disarmed"),
        (facts.mode != limits.mode, f"mode {facts.mode_name or facts.mode}: no longer {MODES.get(limits.mode)}"),
        (facts.position_s > limits.position_s, "no position"),
        (not facts.placed, "the autopilot's filter has no horizontal position"),
        (facts.doppler_s > limits.doppler_s, "no velocity of the Doppler log (DVL)"),
        (facts.range_s > limits.range_s, "no distance of the rangefinder"),
        (facts.sticks_s > limits.sticks_s, "the pilot's sticks are silent"),
        (facts.station_s > limits.station_s, "the ground station is silent"),
        (facts.altitude_m < limits.near_share * altitude_m, f"the bed is {facts.altitude_m:.2f} m away"),
        (facts.depth_m < limits.least_depth_m, f"the surface is {facts.depth_m:.2f} m away"),
        (facts.off_m > limits.off_m, f"{facts.off_m:.2f} m off the target place: the current or the tether pulls"),
    )
    return next((words for holds, words in faults if holds), "")


def hold_mode(facts: SurveyFacts, limits: SurveyLimits) -> int:
    """The firmware's hold to ask for: POSHOLD, or ALT_HOLD where there is no position."""
    placed = facts.placed and facts.position_s <= limits.position_s and not facts.doppler_s > limits.doppler_s
    return POSHOLD if placed else ALT_HOLD

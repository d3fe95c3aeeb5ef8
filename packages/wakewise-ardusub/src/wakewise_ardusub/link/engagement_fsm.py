"""State machine that decides whether the companion's thrusts may act. It has no clock and no connection.

`EngagementState` evaluates `EngagementInputs` of one instant against `EngagementLimits`. Thrusts are permitted only in
the state `engaged` and without a fault. The operator consents in the state `ready`; a fault withdraws the consent.

    off -> listening <-> ready -> engaged -> refused -> listening

In `listening` a condition is missing, and `why` names it. In `ready` the consent is missing. `refused` follows a fault
for `REST_S`. Faults are evaluated in the order of `FAULTS`, the most severe first; docs/hazards.md lists the limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from wakewise_ardusub.link.protocol import ALLOWED_MODES, SCRIPT_VERSION, STATE_FRESH_S
from wakewise_ardusub.logs.channels import MODES

State = Literal["off", "listening", "ready", "engaged", "refused"]
Kind = Literal[
    "duplicate", "clock", "stopped", "disarmed", "mode", "takeover", "heartbeat", "telemetry", "pose", "operator",
    "script", "parameters", "late", "survey", "depth", "distance", "tilt", "speed", "battery",
]  # fmt: skip
FAULTS: tuple[Kind, ...] = (
    "duplicate", "clock", "stopped", "disarmed", "mode", "takeover", "heartbeat", "telemetry", "pose", "operator",
    "script", "parameters", "late", "survey", "depth", "distance", "tilt", "speed", "battery",
)  # fmt: skip
"""What can be amiss, the gravest first."""
REST_S = 1.0
"""How long a fault keeps consent from counting."""
ACTUATION_TIMEOUT_S = 1.2
"""From the first thrusts to a script that says that it acts: two of its reports and what they take."""


@dataclass(frozen=True, kw_only=True)
class EngagementLimits:
    """Bounds within which the companion drives; ages in s, lengths in m, angles in rad.

    What is fresh: a pose and an attitude of 0.2 s leave 0.1 s of the 0.3 s, within which thrusts must be gone after any
    loss, for the watch, the wire and the script. Heartbeats come once a second, so two may be missing. Thrusts are
    decided ten times a second, and the first ones after consent take a step and an answer.
    """

    pose_s: float = 0.2
    telemetry_s: float = 0.2
    operator_s: float = 0.2
    thrusts_s: float = 0.25
    loop_s: float = 0.5
    heartbeat_s: float = 2.5
    script_s: float = STATE_FRESH_S
    standstill_s: float = 0.2
    depth_m: tuple[float, float] = (0.2, 50.0)
    distance_m: float = 5.0
    tilt_rad: float = math.radians(45.0)
    speed_m_s: float = 1.0
    battery_V: float = 0.0
    modes: frozenset[int] = ALLOWED_MODES


@dataclass(frozen=True, kw_only=True)
class EngagementInputs:
    """What is known at one instant; ages are infinite and figures NaN where nothing was ever heard.

    Parameters
    ----------
    now_s : float
        On a clock that never goes back.
    armed : bool or None
    mode : int or None
        ArduSub's number, and in `mode_name` its name; `mode_before` is the name of another in which it was engaged.
    heartbeat_s, telemetry_s, pose_s, operator_s, script_s : float
        Ages of what was last heard from autopilot, its attitude, a position, the pilot's sticks and the script.
    script_version : int or None
    acts : bool or None
        What the script last said of itself, `script_s` ago.
    thrusts_s : float
        Age of the thrusts that the controller decided last, since it was engaged.
    loop_s : float
        Age of the control loop's last step.
    engaged_s : float
        How long it has been engaged.
    standstill_s : float
        Longest gap between two watches of late: a process that slept knows nothing of that time.
    duplicate, clock, takeover, parameters, survey : str
        In words, what was heard of another sender of thrusts, of a clock that jumped, of a ground station that took
        over, what the autopilot is set to that does not fit the vehicle, and what a survey lacks (rangefinder, Doppler
        log); empty where nothing was.
    depth_m, distance_m, tilt_rad, speed_m_s, battery_V : float
        As estimated; the distance is to the target.
    """

    now_s: float
    armed: bool | None = None
    mode: int | None = None
    mode_name: str = ""
    mode_before: str = ""
    heartbeat_s: float = math.inf
    telemetry_s: float = math.inf
    pose_s: float = math.inf
    operator_s: float = math.inf
    script_s: float = math.inf
    script_version: int | None = None
    acts: bool | None = None
    thrusts_s: float = 0.0
    loop_s: float = math.inf
    engaged_s: float = 0.0
    standstill_s: float = 0.0
    duplicate: str = ""
    clock: str = ""
    takeover: str = ""
    parameters: str = ""
    survey: str = ""
    depth_m: float = math.nan
    distance_m: float = math.nan
    tilt_rad: float = math.nan
    speed_m_s: float = math.nan
    battery_V: float = math.nan


@dataclass(frozen=True)
class EngagementFault:
    """What is amiss, and in words."""

    kind: Kind
    text: str


@dataclass(frozen=True)
class Transition:
    """A change of state with its reason, for the journal."""

    time_s: float
    before: State
    after: State
    reason: str
    kind: str = ""


def faults(facts: EngagementInputs, limits: EngagementLimits, *, engaged: bool) -> tuple[EngagementFault, ...]:
    """All that is amiss, the gravest first; some can only be while engaged."""
    f, m, found = facts, limits, dict[Kind, str]()
    told: tuple[tuple[Kind, str], ...] = (
        ("duplicate", f.duplicate), ("clock", f.clock), ("takeover", f.takeover), ("parameters", f.parameters),
        ("survey", f.survey),
    )  # fmt: skip
    found |= {kind: words for kind, words in told if words}
    if not f.armed:
        found["disarmed"] = "disarmed" if f.armed is False else "nothing is known of arming"
    if f.mode not in m.modes:
        allowed = ", ".join(MODES.get(mode, str(mode)) for mode in sorted(m.modes, reverse=True))
        found["mode"] = f"mode {f.mode_name or f.mode or 'unknown'}, allowed are {allowed}"
    ages: tuple[tuple[Kind, float, float, str], ...] = (
        ("heartbeat", f.heartbeat_s, m.heartbeat_s, "heartbeat of the autopilot"),
        ("telemetry", f.telemetry_s, m.telemetry_s, "attitude from the autopilot"),
        ("pose", f.pose_s, m.pose_s, "position"),
        ("operator", f.operator_s, m.operator_s, "sticks of the pilot"),
        ("script", f.script_s, m.script_s, "script on the autopilot"),
    )
    for kind, age_s, most_s, what in ages:
        if not age_s <= most_s:
            found[kind] = f"no {what} " + (f"for {age_s:.2f} s" if math.isfinite(age_s) else "yet")
    if "script" not in found and f.script_version != SCRIPT_VERSION:
        found["script"] = f"script of version {f.script_version}, this program needs {SCRIPT_VERSION}"
    if not f.loop_s <= m.loop_s:
        found["late"] = "the controller is not running" + (f", since {f.loop_s:.2f} s" if f.loop_s < math.inf else "")
    if engaged:
        if f.mode_before and "mode" not in found:
            found["mode"] = f"the mode changed from {f.mode_before} to {f.mode_name}"
        if not f.thrusts_s <= m.thrusts_s:
            found["late"] = f"no thrusts from the controller for {f.thrusts_s:.2f} s"
        if not f.standstill_s <= m.standstill_s:
            found["stopped"] = f"this program stood still for {f.standstill_s:.2f} s"
        if f.acts is False and f.engaged_s > ACTUATION_TIMEOUT_S and f.script_s < f.engaged_s - ACTUATION_TIMEOUT_S:
            found["script"] = "the script does not act on the thrusts"
    low, high = m.depth_m
    figures: tuple[tuple[Kind, bool, str], ...] = (
        ("depth", low <= f.depth_m <= high, f"depth {f.depth_m:.2f} m, allowed {low:g} to {high:g} m"),
        ("distance", f.distance_m <= m.distance_m, f"{f.distance_m:.2f} m from the target, allowed {m.distance_m:g} m"),
        (
            "tilt",
            f.tilt_rad <= m.tilt_rad,
            f"tilted by {math.degrees(f.tilt_rad):.0f} deg, allowed {math.degrees(m.tilt_rad):.0f} deg",
        ),
        ("speed", f.speed_m_s <= m.speed_m_s, f"{f.speed_m_s:.2f} m/s, allowed {m.speed_m_s:g} m/s"),
        (
            "battery",
            m.battery_V <= 0.0 or f.battery_V >= m.battery_V,
            f"battery {f.battery_V:.1f} V, at least {m.battery_V:g} V",
        ),
    )
    # What is not a number fits nothing.
    found |= {kind: text.replace("nan", "unknown") for kind, fits, text in figures if not fits}
    return tuple(EngagementFault(kind, found[kind]) for kind in FAULTS if kind in found)


@dataclass(frozen=True, kw_only=True)
class EngagementState:
    """Where it stands: the state, since when, and why in words; `entries` counts engagements."""

    state: State = "off"
    since_s: float = -math.inf
    why: str = "not begun"
    entries: int = 0
    told: tuple[Transition, ...] = field(default=(), compare=False)
    """Changes made by the last move."""

    def begun(self, now_s: float) -> EngagementState:
        """Start to listen."""
        return self._to("listening", now_s, "begun")

    def ended(self, now_s: float, why: str) -> EngagementState:
        """End for good."""
        return replace(self, told=()) if self.state == "off" else self._to("off", now_s, why)

    def judged(self, facts: EngagementInputs, limits: EngagementLimits) -> EngagementState:
        """What the facts make of it."""
        found, now_s = faults(facts, limits, engaged=self.state == "engaged"), facts.now_s
        first = found[0] if found else None
        match self.state:
            case "engaged" if first is not None:
                return self._to("refused", now_s, first.text, first.kind)
            case "refused" if now_s - self.since_s >= REST_S:
                return self._to("listening", now_s, "consent may be given anew" if not found else found[0].text)
            case "listening" if first is None:
                return self._to("ready", now_s, "consent is missing")
            case "ready" if first is not None:
                return self._to("listening", now_s, first.text, first.kind)
            case "listening" if first is not None and first.text != self.why:
                return replace(self, why=first.text, told=())
        return replace(self, told=())

    def consented(self, facts: EngagementInputs, limits: EngagementLimits) -> EngagementState:
        """The operator consents; it counts where all is well now."""
        now = self.judged(facts, limits)
        found = faults(facts, limits, engaged=False)
        if now.state != "ready" or found:
            return now
        after = now._to("engaged", facts.now_s, "the operator consents")
        return replace(after, entries=now.entries + 1, told=(*now.told, *after.told))

    def released(self, now_s: float, why: str = "the operator takes the sticks") -> EngagementState:
        """The operator, or who ends the session, takes consent back."""
        return self._to("listening", now_s, why) if self.state == "engaged" else replace(self, told=())

    def _to(self, state: State, now_s: float, why: str, kind: str = "") -> EngagementState:
        told = (Transition(now_s, self.state, state, why, kind),)
        return replace(self, state=state, since_s=now_s, why=why, told=told)

"""Session of a survey: from the pilot's consent by GUIDED targets at 10 Hz to the firmware's own hold.

States: *waiting* (something is missing), *ready*, *asked* (GUIDED is requested), *settling* (holds its place until it
is at rest; the current is estimated), *flying*, *paused*, *holding* (no target is sent any more, a hold mode is
requested), *ended*.

Consent is `consent` (a key press), or that the pilot sets GUIDED while the session is ready. It never arms. Any fault
of `survey_safety.fault_of` ends it. Afterwards nothing moves without consent anew, which resumes where it ended. Pure
parts are in the other modules; here are clock, messages and order. Nothing waits: a loop calls `take` and `tick`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.message_state import (
    GROUND_STATION_S,
    REMEMBERED_S,
    LinkState,
    MavlinkMessage,
    tilt_of,
    update_link_state,
)
from wakewise_ardusub.link.motor_interface import VehicleMotors
from wakewise_ardusub.link.protocol import (
    AGAIN_S,
    ALT_HOLD,
    AUTOPILOT_COMPONENT,
    AUTOPILOT_VERSION,
    GUIDED,
    HEARTBEAT_PERIOD_S,
    MOST_PARAMETERS,
    PARAMETERS_S,
    REQUEST_MESSAGE,
    SET_MESSAGE_INTERVAL,
    SET_MODE,
    heartbeat,
    parameter_request,
    photograph_command,
)
from wakewise_ardusub.link.session_log import SessionLog
from wakewise_ardusub.logs.channels import MODES
from wakewise_ardusub.survey.bed_following import BedTrack, DepthShaper
from wakewise_ardusub.survey.guided_messages import SurveyTarget
from wakewise_ardusub.survey.hold_current import current_of_hold
from wakewise_ardusub.survey.map_files import GeoAnchor
from wakewise_ardusub.survey.survey_figures import SurveyRow, errors_of
from wakewise_ardusub.survey.survey_plan import (
    MakeLines,
    PlanProgress,
    SurveyPace,
    SurveyPlan,
    advance,
    made_plan,
    resumed,
    target_of,
    time_left_s,
    turn_of,
    warning_of,
    wrapped,
)
from wakewise_ardusub.survey.survey_safety import (
    SurveyFacts,
    SurveyLimits,
    fault_of,
    hold_mode,
    missing,
)

State = Literal["waiting", "ready", "asked", "settling", "flying", "paused", "holding", "ended"]
ENGAGED = ("asked", "settling", "flying", "paused")
PERIOD_S, ASK_S, ASKS_FOR_S = 0.1, 0.2, 2.0
READY_S = 1.0
"""GUIDED set sooner than this after the session is ready is no consent: the pilot could not know that it was."""
GIVES_WAY_S = 0.5
"""How long an order of the pilot is given to act before a hold is asked for."""
LOOKS_DOWN = 25
"""MAV_SENSOR_ROTATION_PITCH_270."""
REACHED_M = 0.05
LOW, BRAKE_M_S2 = 0.8, 0.05
"""Share of the altitude below which the way ahead stops, by this deceleration, until the altitude is there again."""
STILL_M, STILL_M_S, REST_S = 0.05, 0.012, 3.0
"""A vehicle nearer than this to its place, and slower, for so long, is at rest."""
ACCELERATION_FROM = 4 << 24 | 8 << 16
"""Release of ArduSub from which GUIDED takes an acceleration (ardupilot 33609), as `flight_sw_version`."""
_RATES_HZ = {0: 5.0, 30: 20.0, 32: 20.0, 33: 2.0, 36: 5.0, 74: 5.0, 132: 10.0, 193: 5.0}
_HORIZONTAL, _CONSTANT = 0x08 | 0x10, 0x80


@dataclass(frozen=True, kw_only=True)
class TransectOptions:
    """Pace, limits, the rangefinder's delay (s), shortest and longest settling (s), a current (2,) that is given.

    Photographs: `camera` is the command, mavlink or digicam; `every_m` the metres between two, 0 for none. `layers_m`:
    altitudes of legs that differ from the pace's.
    """

    pace: SurveyPace = field(default_factory=SurveyPace)
    limits: SurveyLimits = field(default_factory=SurveyLimits)
    delay_s: float = 0.3
    settle_s: tuple[float, float] = (8.0, 40.0)
    current_W_m_s: tuple[float, float] | None = None
    camera: str = ""
    every_m: float = 0.0
    layers_m: tuple[float, ...] = ()


class TransectSession:
    """A survey of one vehicle.

    Parameters
    ----------
    send : callable
        Sends a message by the name of pymavlink's encoder and its fields, as the vehicle's companion.
    lines : callable
        Makes the lines once place, heading and current are known.
    vehicle : Vehicle
        Whose drag gives the current.
    options : TransectOptions
    clock : callable
        Seconds that never go back.
    journal : SessionLog, optional
    system, session : int
        The vehicle's id, and the number that own heartbeats carry.
    """

    def __init__(
        self,
        *,
        send: Callable[[str, Mapping[str, Any]], None],
        lines: MakeLines,
        vehicle: Vehicle,
        options: TransectOptions,
        clock: Callable[[], float],
        journal: SessionLog | None = None,
        system: int = 1,
        session: int = 1,
    ) -> None:
        self._send, self.options, self._clock = send, options, clock
        self._plan_from = partial(made_plan, lines, pace=options.pace, fence_m=options.limits.fence_m)
        self._vehicle, self._motors, self._journal = vehicle, VehicleMotors(vehicle), journal
        self.known = LinkState(system=system, session=session)
        self.state: State = "waiting"
        self.why = self.warning = self.ended_by = self.refused = self._lines_fault = ""
        """Why it is in its state; what the current does; the fault that ended it last; what is wrong with the lines."""
        self.plan: SurveyPlan | None = None
        self.at: PlanProgress | None = None
        self.track = BedTrack()
        self.current_W_m_s: Array | None = None
        self.photographs = self.interruptions = self.unsent = 0
        self.rows: list[SurveyRow] = []
        self._depth: DepthShaper | None = None
        self._reached, self._least_m = False, 0.0
        """Whether it is at its leg's altitude; the lowest altitude asked for, 0 until one was reached."""
        self._place: tuple[Array, Array] | None = None
        self._last_s = dict.fromkeys(
            ("position", "doppler", "range", "turn", "beat", "asked", "parameters", "mode", "told", "looked"), -math.inf
        )
        """When each was last received, sent or done."""
        self._history: deque[tuple[float, float, float]] = deque(maxlen=200)
        self._placed, self._takes_acceleration, self._facts = True, False, SurveyFacts(armed=None, mode=None)
        self._since_s, self._hold_mode, self._hold = clock(), GUIDED, np.zeros(3)
        self._pulses: list[Array] = []
        self._settled_s, self._quits = -math.inf, False
        self._anchor: GeoAnchor | None = None
        self._mode_before: int | None = None

    # What comes in.

    def take(self, said: MavlinkMessage) -> None:
        """A message of anybody on the link."""
        now_s = self._clock()
        self.known = self._heard(said, now_s)
        if said.system != self.known.system:
            return
        if said.name == "VISION_POSITION_DELTA":  # what a Doppler log's driver sends, whatever its component
            self._last_s["doppler"] = now_s
        elif said.name == "DISTANCE_SENSOR":
            self._ranged(now_s)
        elif said.component == AUTOPILOT_COMPONENT:
            try:
                self._from_autopilot(said.name, said.fields, now_s)
            except (KeyError, TypeError, ValueError):
                self.known = self.known.noise()

    def _heard(self, said: MavlinkMessage, now_s: float) -> LinkState:
        return update_link_state(self.known, said, now_s)

    def _from_autopilot(self, name: str, get: Mapping[str, Any], now_s: float) -> None:
        if name == "LOCAL_POSITION_NED":
            numbers = np.array([float(get[key]) for key in ("x", "y", "z", "vx", "vy", "vz")])
            if not np.isfinite(numbers).all():
                raise ValueError
            self._place, self._last_s["position"] = (numbers[:3], numbers[3:]), now_s
            self._history.append((now_s, float(numbers[2]), math.cos(tilt_of(self.known))))
        elif name == "EKF_STATUS_REPORT":
            flags = int(get["flags"])
            self._placed = bool(flags & _HORIZONTAL) and not flags & _CONSTANT
        elif name == "AUTOPILOT_VERSION":
            self._takes_acceleration = int(get["flight_sw_version"]) >= ACCELERATION_FROM
        elif name == "GLOBAL_POSITION_INT" and self._place is not None:
            (north, east, _), _ = self._place
            lat, lon = 1e-7 * float(get["lat"]), 1e-7 * float(get["lon"])
            self._anchor = None
            if lat or lon:
                self._anchor = GeoAnchor(latitude_deg=lat, longitude_deg=lon, north_m=north, east_m=east)

    def _ranged(self, now_s: float) -> None:
        """Bed depth of a distance: the vehicle's depth as it was measured, and the distance times the tilt's cosine."""
        distance, came_s = self.known.ranges.get(LOOKS_DOWN, (math.nan, -math.inf))
        at_s = now_s - self.options.delay_s
        before = [one for one in self._history if one[0] <= at_s]
        if came_s < now_s or not before:
            return
        _, depth, upright = before[-1]
        after = self.track.take(at_s, depth + distance * upright)
        if after.taken != self.track.taken:
            self._last_s["range"] = now_s
        self.track = after

    # What people do.

    def consent(self) -> str:
        """The operator's consent: asks for GUIDED and begins, or goes on after a pause; what it does, in words."""
        now_s = self._clock()
        if self.state == "paused":
            self._enter("flying", "resumed")
            return "goes on"
        self._judge(now_s)
        if self.state != "ready":
            return f"not begun: {self.why or self.state}"
        self.ended_by = ""
        return self._take_over(now_s)

    def _take_over(self, now_s: float) -> str:
        mode = self.options.limits.mode
        if self.known.mode == mode:
            return self._engage(now_s)
        self._enter("asked", f"{MODES[mode]} requested")
        self._request(mode, now_s)
        return self.why

    def _engage(self, now_s: float) -> str:
        self._settle(now_s)
        return "begun"

    def pause(self) -> str:
        """Brake by the plan's bound and hold the place until `consent`."""
        if self.state != "flying":
            return f"not paused: {self.state}"
        self._enter("paused", "paused by the operator")
        return "pauses"

    def abort(self, why: str) -> None:
        """End it in the firmware's own hold, and do not go on."""
        self._quits = True
        if self.state in ENGAGED:
            self._let_go(why, self._clock())
        elif self.state != "holding":
            self._enter("ended", why)

    @property
    def finished(self) -> bool:
        """Whether all lines were flown."""
        return self.plan is not None and self.at is not None and self.at.leg >= len(self.plan.legs)

    @property
    def altitude_m(self) -> float:
        """Altitude asked for now, m."""
        own = None
        if self.plan is not None and self.at is not None and self.plan.legs:
            own = self.plan.legs[min(self.at.leg, len(self.plan.legs) - 1)].altitude_m
        return self.options.pace.altitude_m if own is None else own

    # What time does.

    def tick(self) -> None:
        """Judge, and send what is due; to be called at 20 Hz or more."""
        now_s = self._clock()
        self._beat(now_s)
        self._judge(now_s)
        self._last_s["turn"] = now_s
        self._begin_by_mode(now_s)
        self._mode_before = self.known.mode
        if self.state == "asked" and now_s - self._since_s > ASKS_FOR_S:
            self._enter("waiting", f"{MODES[self.options.limits.mode]} was refused")
        elif self.state == "holding":
            self._hold_on(now_s)
        if self.state in ENGAGED[1:] and now_s - self._last_s["told"] >= PERIOD_S - 1e-3:
            dt_s = min(now_s - self._last_s["told"], 2.0 * PERIOD_S)
            self._last_s["told"] = now_s
            self._stream(now_s, dt_s)

    def _begin_by_mode(self, now_s: float) -> None:
        entered = self.known.mode == GUIDED and self._mode_before not in (None, GUIDED)
        if entered and (self.state == "asked" or (self.state == "ready" and now_s - self._since_s >= READY_S)):
            self._settle(now_s)

    def facts(self, now_s: float) -> SurveyFacts:
        """What is known now, as it is judged."""
        known, last_s = self.known, self._last_s
        engaged = self.state in ENGAGED
        overtaken = engaged and known.takeover_s > self._since_s and self.state != "asked"
        place = None if self._place is None else self._place[0]
        bed = self.track.bed(now_s)
        ground_s = max(known.ground.values(), default=-math.inf)
        sticks = known.sticks
        return SurveyFacts(
            armed=known.armed,
            mode=self.options.limits.mode if self.state == "asked" else known.mode,
            mode_name=known.mode_name,
            telemetry_s=now_s - max(known.attitude_s, last_s["position"]),
            position_s=now_s - last_s["position"],
            doppler_s=math.nan if last_s["doppler"] < 0.0 else now_s - last_s["doppler"],
            placed=self._placed,
            sticks_s=math.inf if sticks is None else now_s - sticks.came_s,
            station_s=now_s - ground_s if math.isfinite(ground_s) and now_s - ground_s < GROUND_STATION_S else math.inf,
            stick=0.0 if sticks is None else float(np.nanmax(np.abs(np.append(sticks.axes, 0.0)))),
            range_s=now_s - last_s["range"],
            altitude_m=math.nan if bed is None or place is None else bed[0] - float(place[2]),
            depth_m=math.nan if place is None else float(place[2]),
            off_m=self._off_m(place),
            takeover=known.takeover if overtaken else "",
            rival=known.duplicate if now_s - known.duplicate_s < REMEMBERED_S else "",
            turn_s=now_s - last_s["turn"] if engaged else 0.0,
        )

    def _off_m(self, place: Array | None) -> float:
        if place is None or self.state not in ENGAGED[1:]:
            return 0.0
        if self.plan is None or self.at is None or self.state == "settling":
            return float(math.dist(place[:2], self._hold[:2]))
        return float(math.dist(place[:2], target_of(self.plan, self.at)[0]))

    def _judge(self, now_s: float) -> None:
        self._facts = self.facts(now_s)
        lacks = self._amiss(self._facts)
        if self.state in ENGAGED:
            if lacks:
                self._let_go(lacks, now_s)
        elif self.state in ("waiting", "ready"):
            if lacks and (self.state == "ready" or lacks != self.why):
                self._enter("waiting", lacks)
            elif not lacks and self.state == "waiting":
                self._enter("ready", "")

    def _amiss(self, facts: SurveyFacts) -> str:
        if self.state in ENGAGED:
            return fault_of(facts, self.options.limits, self._least_m)
        highest_m = max(self.options.pace.altitude_m, *self.options.layers_m, 0.0)
        return missing(facts, self.options.limits, highest_m) or self._no_way(self._clock())

    def _no_way(self, now_s: float) -> str:
        """Once a second: what is wrong with the lines from here, so that it is told before anybody consents."""
        if self._place is not None and now_s - self._last_s["looked"] >= 1.0:
            self._last_s["looked"], self._lines_fault = now_s, ""
            try:
                self._plan_from(self._place[0][:2], self.known.attitude[2], np.zeros(2), self._anchor)
            except InputError as fault:
                self._lines_fault = str(fault)
        return "" if self.plan is not None and not self.finished else self._lines_fault

    def _settle(self, now_s: float) -> None:
        if self._place is None:
            return
        place = self._place[0].copy()
        self._hold, self._pulses, self._reached, self._least_m = place, [], False, 0.0
        self._depth = DepthShaper.at(float(place[2]), self.options.pace.speed_m_s)
        self._last_s["told"], self._settled_s = -math.inf, now_s
        self._enter("settling", "")

    def _begin(self, now_s: float) -> None:
        """The plan, from the current that the hold tells; or the rest of the plan of before."""
        heading, place = self.known.attitude[2], self._hold[:2]
        if self.plan is not None and self.at is not None and not self.finished:
            self.plan, self.at = resumed(self.plan, self.at, place)
            self.at = replace(self.at, heading_rad=heading)
        else:
            given = self.options.current_W_m_s
            self.current_W_m_s = np.array(given) if given is not None else self._felt(heading)
            current = np.zeros(2) if self.current_W_m_s is None else self.current_W_m_s
            try:
                plan = self._plan_from(place, heading, current, self._anchor)
            except InputError as fault:
                self.refused = str(fault)
                self._let_go(self.refused, now_s)
                return
            self.plan, self.at = plan, PlanProgress(heading_rad=heading)
            words = "unknown" if self.current_W_m_s is None else f"{np.round(current, 3).tolist()} m/s"
            self.warning = warning_of(plan, current)
            told = {"current": words, "warning": self.warning, "centre": plan.centre_W_m}
            self._write("plan", legs=len(plan.legs), line_m=plan.line_m, **told)
        self._enter("flying", "")

    def _moves(self) -> bool:
        """Whether the vehicle is not at rest where it is to hold."""
        if self._place is None:
            return True
        (p, v), hold = self._place, self._hold
        return math.dist(p[:2], hold[:2]) > STILL_M or math.hypot(*v[:2]) > STILL_M_S

    def _felt(self, heading: float) -> Array | None:
        if len(self._pulses) < 5:
            return None
        return current_of_hold(self._vehicle, np.mean(self._pulses, axis=0), heading)

    def _stream(self, now_s: float, dt_s: float) -> None:
        """One target, and a photograph where one is due."""
        if self._depth is None:
            return
        if self.state == "settling":
            self._settled_s = now_s if self._moves() else self._settled_s
            thrusts = self._motors.flown_N(self.known.parameters, self.known.servo_us, self.known.battery_V)
            if thrusts.any():
                self._pulses = [*self._pulses[-29:], thrusts]
            least, most = self.options.settle_s
            if now_s - self._since_s >= most or now_s - max(self._settled_s + REST_S, self._since_s + least) >= 0.0:
                self._begin(now_s)
        place, velocity, acceleration = self._hold[:2], np.zeros(2), np.zeros(2)
        heading, turn = self.known.attitude[2] if self.at is None else self.at.heading_rad, 0.0
        if self.state in ("flying", "paused") and self.plan is not None and self.at is not None:
            bed = self.track.bed(now_s)
            if bed is None or self._facts.range_s > 0.5 * self.options.limits.range_s:
                self._depth = self._depth.resting(dt_s)
            else:
                desired = max(bed[0] - self.altitude_m, self.options.limits.least_depth_m)
                self._depth = self._depth.towards(desired, bed[1], dt_s)
            asked_m = self.altitude_m
            self._reached |= abs(self._facts.altitude_m - asked_m) < REACHED_M
            self._reached &= self._facts.altitude_m > LOW * asked_m
            plan = self.plan
            if self._reached:
                self._least_m = min(self.options.pace.altitude_m, *self.options.layers_m, asked_m)
            else:  # too low: it waits for its altitude, and stops sooner than elsewhere
                plan = replace(plan, pace=replace(plan.pace, acceleration_m_s2=BRAKE_M_S2))
            self.at = advance(plan, self.at, dt_s, go=self.state == "flying" and self._reached)
            self._reached &= self.altitude_m == asked_m
            place, velocity, acceleration = target_of(self.plan, self.at)
            heading, turn = self.at.heading_rad, turn_of(self.plan, self.at)
            self._noted(now_s)
            self._photograph()
        depth = self._depth
        target = SurveyTarget(
            place_W_m=np.array([*place, depth.depth_m]),
            velocity_W_m_s=np.array([*velocity, depth.speed_m_s]),
            acceleration_W_m_s2=np.array([*acceleration, depth.acceleration_m_s2]),
            heading_rad=heading,
            turn_rad_s=turn,
        )
        if self.state in ENGAGED:
            self._drive(target, now_s, dt_s)
        if self.finished and self.state == "flying":
            self._let_go("finished", now_s)

    def _drive(self, target: SurveyTarget, now_s: float, _dt_s: float) -> None:
        fields = target.message(self._place, takes_acceleration=self._takes_acceleration)
        if fields is None:
            self._let_go("a target that is not a number", now_s)
        else:
            aim = {"target_system": self.known.system, "target_component": AUTOPILOT_COMPONENT}
            self._post("set_position_target_local_ned", fields | aim)

    def _noted(self, now_s: float) -> None:
        plan, at = self.plan, self.at
        if plan is None or at is None or at.leg >= len(plan.legs) or self._place is None:
            return
        leg = plan.legs[at.leg]
        if not leg.line or not self._reached:
            return
        p, v = self._place
        across, along = leg.off(p[:2], at.along_m)
        turned = wrapped(self.known.attitude[2] - leg.aim_from(p[:2]))
        speed, altitude = float(v[:2] @ leg.way_at(at.along_m)), self._facts.altitude_m
        row = SurveyRow(now_s, speed, at.speed_m_s, altitude, self.altitude_m, across, along, turned)
        self.rows.append(row)
        if len(self.rows) % 10 == 1:
            self._write("line", leg=at.leg, flown_m=at.flown_m, place=p, altitude_m=altitude, across_m=across)

    def _photograph(self) -> None:
        every, at, plan = self.options.every_m, self.at, self.plan
        if every <= 0.0 or at is None or plan is None or self.state != "flying" or not self._reached:
            return
        if at.leg >= len(plan.legs) or not plan.legs[at.leg].line or at.flown_m < self.photographs * every:
            return
        self.photographs += 1
        command, numbers = photograph_command(self.photographs, self.options.camera == "digicam")
        self._command(command, *numbers, component=0)
        self._write("photograph", number=self.photographs, flown_m=at.flown_m, place=self._place and self._place[0])

    # How it ends.

    def _let_go(self, why: str, now_s: float) -> None:
        """Send no target any more, and ask for a hold mode unless somebody else just changed mode or arming."""
        if why != "finished":
            self.interruptions, self.ended_by = self.interruptions + 1, why
        self._hold_mode = hold_mode(self._facts, self.options.limits)
        flown = self.state == "asked" or self.known.mode == self.options.limits.mode
        flown = flown and self.known.armed is not False
        self._enter("holding" if flown else "waiting", why)
        if flown:
            self._last_s["mode"] = now_s + GIVES_WAY_S if self._facts.takeover else -math.inf
            self._hold_on(now_s)

    def _hold_on(self, now_s: float) -> None:
        """Ask until the mode has changed; what POSHOLD refuses, ALT_HOLD may give."""
        heard = self.known.heartbeat_s > self._since_s
        if heard and (self.known.mode != GUIDED or self.known.armed is False):
            self._enter("ended" if self.finished or self.refused or self._quits else "waiting", self.why)
        elif now_s - self._since_s > ASKS_FOR_S:
            self._enter("ended", f"{self.why}; the autopilot did not answer, its own time-out stops the vehicle")
        elif now_s - self._last_s["mode"] >= ASK_S:
            refused = self.known.heartbeat_s > self._since_s + 2.0 * ASK_S
            self._request(ALT_HOLD if refused else self._hold_mode, now_s)

    # What goes out.

    def _enter(self, state: State, why: str) -> None:
        if (state, why) != (self.state, self.why):
            self._write("state", state=state, why=why)
        self.state, self.why, self._since_s = state, why, self._clock()

    def _request(self, mode: int, now_s: float) -> None:
        self._last_s["mode"] = now_s
        self._command(SET_MODE, 1.0, float(mode))

    def _beat(self, now_s: float) -> None:
        if now_s - self._last_s["beat"] >= HEARTBEAT_PERIOD_S:
            self._last_s["beat"] = now_s
            self._post("heartbeat", heartbeat(self.known.session))
        if math.isinf(self.known.heartbeat_s) or self.state in ("flying", "paused"):
            return  # nobody is there, or no address is known
        unknown = [name for name in self._motors.needs if name not in self.known.parameters]
        if unknown and now_s - self._last_s["parameters"] >= PARAMETERS_S:
            self._last_s["parameters"] = now_s
            for name in unknown[: 2 * MOST_PARAMETERS]:
                self._post("param_request_read", parameter_request(self.known.system, name))
        if now_s - self._last_s["asked"] >= AGAIN_S:
            self._last_s["asked"] = now_s
            for number, rate_hz in _RATES_HZ.items():
                self._command(SET_MESSAGE_INTERVAL, float(number), 1e6 / rate_hz)
            self._command(REQUEST_MESSAGE, float(AUTOPILOT_VERSION))

    def _command(self, number: int, *params: float, component: int = AUTOPILOT_COMPONENT) -> None:
        filled = (*params, *[0.0] * (7 - len(params)))
        fields = {"command": number, "confirmation": 0, **{f"param{i + 1}": value for i, value in enumerate(filled)}}
        self._post("command_long", {**fields, "target_system": self.known.system, "target_component": component})

    def _post(self, name: str, fields: Mapping[str, Any]) -> None:
        try:
            self._send(name, fields)
        except OSError:  # the link's silence is what is judged
            self.unsent += 1

    def _write(self, event: str, **told: Any) -> None:
        if self._journal is not None:
            self._journal.write(event, **told)

    # What it came to.

    def time_left_s(self) -> float:
        """Seconds to the end of the last line; NaN before there is a plan."""
        return math.nan if self.plan is None or self.at is None else time_left_s(self.plan, self.at)

    def line(self) -> str:
        """One line of how it stands."""
        if self.state in ("flying", "paused") and self.plan is not None and self.at is not None:
            waits = "" if self._reached else ", on the way to its altitude"
            return (
                f"{self.state}  {self.at.flown_m:.1f} of {self.plan.line_m:.1f} m, {self.time_left_s() / 60.0:.1f} min "
                f"left, {self._facts.altitude_m:.2f} m above the bed, {self.photographs} photographs{waits}"
            )
        begins = {"settling": "holds its place and measures the current", "ready": "Enter or the pilot's GUIDED begins"}
        return f"{self.state}  {'; '.join(filter(None, (self.why or self.ended_by, begins.get(self.state, ''))))}"

    def figures(self) -> dict[str, Any]:
        """Figures by the autopilot's own position, heading and rangefinder; None where nothing was flown."""
        centre = None if self.plan is None else self.plan.centre_W_m
        return {
            "finished": self.finished,
            "state": self.state,
            "why": self.why,
            "flown_m": 0.0 if self.at is None else self.at.flown_m,
            "planned_m": None if self.plan is None else self.plan.line_m,
            "centre_m": None if centre is None else np.round(centre, 3).tolist(),
            "current_m_s": None if self.current_W_m_s is None else self.current_W_m_s.tolist(),
            **errors_of(self.rows, self.options.pace.speed_m_s),
            "photographs": self.photographs,
            "interruptions": self.interruptions,
            "outliers": self.track.outliers,
        }

"""Output gate: the only place that sends thrusts. It evaluates every message, every tick and every thrust.

Thrusts are sent only while engaged, by the facts of that moment, and only if a controller computed them in this
engagement. At its end `RELEASES` messages tell the script to release the motors, and the pilot has the sticks at once.
If all of them are lost, the script releases `HOLD_MS` after the last thrusts. The gate also repeats the last thrusts
against message loss, for at most `EngagementLimits.thrusts_s`. It is thread-safe; its lock is held for one message.

`FreshnessMargins` records how close the age of each input comes to its limit. `EventLogger` writes changes of the
vehicle and of its senders to the journal.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Measurement
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.engagement_fsm import EngagementInputs, EngagementLimits, EngagementState, Transition, faults
from wakewise_ardusub.link.message_state import REMEMBERED_S, LinkState, MavlinkMessage, tilt_of, update_link_state
from wakewise_ardusub.link.motor_interface import MotorInterface
from wakewise_ardusub.link.parameters import BUTTON_PARAMETERS, button_faults
from wakewise_ardusub.link.protocol import AGAIN_S, MOST_PARAMETERS, PARAMETERS_S, interval_requests, parameter_request
from wakewise_ardusub.link.session_log import SessionLog
from wakewise_ardusub.link.telemetry_adapter import TelemetryAdapter, to_measurements

WINDOW_S = 60.0
QUANTILE = 0.99
_MOST = round(WINDOW_S / 0.02)
AGE_NAMES = ("pose", "sticks", "attitude")


class FreshnessMargins:
    """Ages of the last minute, looked at as often as the watch ticks, and trips.

    A trip is a fault that ended an engagement, or took back that all was well.

    Attributes
    ----------
    trips : Counter
        By the kind of fault.
    """

    def __init__(self) -> None:
        self.trips: Counter[str] = Counter()
        self._ages: deque[tuple[float, float, float]] = deque(maxlen=_MOST)

    def observe(self, facts: EngagementInputs) -> None:
        """What is known at a tick."""
        ages = (facts.pose_s, facts.operator_s, facts.telemetry_s)
        if all(map(math.isfinite, ages)):
            self._ages.append(ages)

    def told(self, change: Transition) -> None:
        """A change of state."""
        if change.kind and change.before in ("ready", "engaged"):
            self.trips[change.kind] += 1

    def p99_s(self) -> dict[str, float]:
        """The age that 99 of 100 looks of the last minute did not exceed, of each of `AGE_NAMES`; NaN before any."""
        if not self._ages:
            return dict.fromkeys(AGE_NAMES, math.nan)
        return dict(zip(AGE_NAMES, np.quantile(np.array(self._ages), QUANTILE, axis=0).tolist(), strict=True))

    def words(self, limits: EngagementLimits) -> str:
        """For the status line: ages in ms, those above their limits marked by !, and trips."""
        most = dict(zip(AGE_NAMES, (limits.pose_s, limits.operator_s, limits.telemetry_s), strict=True))
        ages = [
            f"{what} {1e3 * age_s:.0f}{'!' if age_s > most[what] else ''}"
            for what, age_s in self.p99_s().items()
            if math.isfinite(age_s)
        ]
        told = f"p99 ms {', '.join(ages)}" if ages else ""
        if self.trips:
            which = ", ".join(f"{kind} {count}" for kind, count in self.trips.most_common())
            told += f"{'  ' if told else ''}trips {self.trips.total()} ({which})"
        return told


TOLD_EVERY_S = 0.5
"""News of one kind are written down no more often, but for changes of state."""


class EventLogger:
    """Writes into a journal, if there is one."""

    def __init__(self, journal: SessionLog | None, clock: Callable[[], float]) -> None:
        self._journal, self._clock = journal, clock
        self._due: dict[str, tuple[float, int]] = {}
        self._jump = ""

    def log(self, event: str, **told: Any) -> None:
        """A line; what is told over and over only now and then, with how often it was left out."""
        if self._journal is None:
            return
        now_s = self._clock()
        due_s, left_out = self._due.get(event, (-math.inf, 0))
        if event != "state" and now_s < due_s:
            self._due[event] = (due_s, left_out + 1)
            return
        self._due[event] = (now_s + TOLD_EVERY_S, 0)
        self._journal.write(event, **told, **({"left_out": left_out} if left_out else {}))

    def changed(self, before: LinkState, after: LinkState, jump: str) -> None:
        """What a message changed; `jump` is what was last said of a clock."""
        if (before.armed, before.mode) != (after.armed, after.mode):
            self.log("vehicle", armed=after.armed, mode=after.mode_name)
        if after.duplicate_s != before.duplicate_s and before.duplicate != after.duplicate:
            self.log("rival", words=after.duplicate)
        if after.takeover_s != before.takeover_s:
            self.log("takeover", words=after.takeover)
        if after.camera_s != before.camera_s:
            self.log("camera", words=after.camera)
        if after.status != before.status:
            self.log("status", words=after.status)
        if jump != self._jump:
            self._jump = jump
            self.log("clock", words=jump)
        if set(before.ground) != set(after.ground):
            self.log("ground stations", systems=sorted(after.ground))
        if before.odd != after.odd:
            self.log("nonsense", message=after.odd[-1])


Send = Callable[[str, Mapping[str, Any]], None]
"""Sends a message: its name as pymavlink's encoders have it, and its fields."""


TICK_S = 0.02
"""Period of the watch."""
RELEASES = 3
"""How often letting go is said, a tick apart."""
_KEPT = 4096


class OutputGate:
    """Keeps what is known of the vehicle and lets thrusts through, or not.

    Parameters
    ----------
    send : callable
    drive : MotorInterface
    limits : EngagementLimits
    journal : SessionLog or None
    system : int
        The vehicle's id.
    session : int
        Number that tells this program's heartbeats, and the times of its thrusts, from a rival's.
    buttons : mapping
        What buttons of the pilot's sticks mean: "engage", which also releases, and actions of
        `wakewise.operation.teleop.input`. While the autopilot acts at one of them as well (`parameters.py`), nothing
        engages.
    listen_only : bool
        Never engages, and sends no thrust whatever happens.
    clock : callable
        Seconds that never go back.
    """

    def __init__(
        self,
        *,
        send: Send,
        drive: MotorInterface,
        limits: EngagementLimits | None = None,
        journal: SessionLog | None = None,
        system: int = protocol.DEFAULT_SYSTEM,
        session: int = 0,
        buttons: Mapping[str, int] | None = None,
        listen_only: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.limits, self.journal, self.clock = limits or EngagementLimits(), journal, clock
        self._send, self._drive, self._listen_only = send, drive, listen_only
        self._buttons = dict(buttons or {})
        self._needs = (*drive.needs, *(BUTTON_PARAMETERS if self._buttons else ()))
        self._lock = threading.RLock()
        self.known, self._telemetry, self.engagement = (
            LinkState(system=system, session=session),
            TelemetryAdapter(),
            EngagementState(),
        )
        self.target_W_m: Array | None = None
        self.survey_fault = ""
        """What a survey lacks, in words, as it last judged."""
        self.figures: dict[str, float] = {}
        self._estimate: BodyState | None = None
        self._slots: Array | None = None
        self._decided_s = self._sent_s = self._beat_s = self._figures_s = self._asked_s = -math.inf
        self._asked_parameters_s = self._estimated_s = -math.inf
        self._ticked_s, self._standstill_s, self._last_us = -math.inf, 0.0, 0
        self._pressed: deque[str] = deque(maxlen=64)
        self._measurements: deque[Measurement] = deque(maxlen=_KEPT)
        self._events = EventLogger(journal, clock)
        self._judged_for: Mapping[str, float] | None = None
        self._fault, self._engaged_with, self._engaged_mode = "", dict[str, float](), ""
        self._releases_left, self.margins = 0, FreshnessMargins()
        self.thrusts_sent = self.releases_sent = self.unsent = 0

    def begin(self) -> None:
        """Start to listen."""
        with self._lock:
            self._told(self.engagement.begun(self.clock()))

    def end(self, why: str) -> None:
        """Still the thrusters, if they are driven, and let nothing out any more."""
        with self._lock:
            self._told(self.engagement.ended(self.clock(), why))

    @property
    def button_fault(self) -> str | None:
        """At which of its buttons the autopilot acts as well, in words, empty for none; None before that is known."""
        parameters = self.known.parameters
        if self._buttons and any(name not in parameters for name in BUTTON_PARAMETERS):
            return None
        return button_faults(self._buttons, parameters)

    @property
    def entry(self) -> int | None:
        """Number of the engagement that is on; None while none is."""
        engagement = self.engagement
        return engagement.entries if engagement.state == "engaged" else None

    def facts(self) -> EngagementInputs:
        """What is known now, as it is judged."""
        with self._lock:
            known, now_s, held = self.known, self.clock(), self._telemetry
            version, _ = known.named_value(protocol.VERSION_NAME, now_s)
            acts, acts_s = known.named_value(protocol.ENGAGED_NAME, now_s)
            place, estimate = known.place_W_m, self._estimate
            # Judged at every message: plain numbers are computed several times faster than arrays of three.
            speeds = [math.hypot(*known.velocity_W_m_s)]
            if estimate is not None:
                speeds.append(math.hypot(*estimate.nu_B[:3].tolist()))
            finite = [speed for speed in speeds if math.isfinite(speed)]
            away = math.nan if place is None or self.target_W_m is None else math.dist(place, self.target_W_m)
            engaged = self.engagement.state == "engaged"
            since_s = self.engagement.since_s if engaged else now_s
            return EngagementInputs(
                now_s=now_s,
                armed=known.armed,
                mode=known.mode,
                mode_name=known.mode_name,
                mode_before=self._engaged_mode if engaged and self._engaged_mode != known.mode_name else "",
                heartbeat_s=now_s - known.heartbeat_s,
                telemetry_s=now_s - known.attitude_s,
                pose_s=now_s - known.pose_s,
                operator_s=math.inf if known.sticks is None else now_s - known.sticks.came_s,
                script_s=acts_s,
                script_version=round(version) if math.isfinite(version) else None,
                acts=acts > 0.5 if math.isfinite(acts) else None,
                thrusts_s=now_s - max(self._decided_s, since_s),
                loop_s=now_s - self._estimated_s,
                engaged_s=now_s - since_s,
                standstill_s=self._standstill_s,
                duplicate=known.duplicate if now_s - known.duplicate_s < REMEMBERED_S else "",
                takeover=known.takeover if now_s - known.takeover_s < REMEMBERED_S else "",
                parameters=self._set_up(),
                survey=self.survey_fault,
                clock=held.jump if now_s - held.jump_s < REMEMBERED_S else "",
                depth_m=known.depth_m,
                distance_m=away,
                tilt_rad=tilt_of(known),
                speed_m_s=max(finite, default=math.nan),
                battery_V=known.battery_V,
            )

    def _set_up(self) -> str:
        """What is amiss about the autopilot's parameters, in words."""
        parameters = self.known.parameters
        if parameters is not self._judged_for:
            missing = next((name for name in self._needs if name not in parameters), None)
            words = f"parameters of the autopilot are not known yet: {missing}" if missing else ""
            words = words or button_faults(self._buttons, parameters) or self._drive.amiss(parameters)
            self._judged_for, self._fault = parameters, words
        changed = [name for name, value in self._engaged_with.items() if parameters.get(name) != value]
        return self._fault or (f"{changed[0]} was changed" if changed else "")

    def take(self, said: MavlinkMessage) -> None:
        """A message came."""
        with self._lock:
            now_s, before = self.clock(), self.known
            self.known = known = update_link_state(before, said, now_s)
            self._telemetry, found = to_measurements(self._telemetry, said, now_s, known.system)
            self._measurements.extend(found)
            self._events.changed(before, known, self._telemetry.jump)
            if known.sticks is not None and known.sticks is not before.sticks:
                self._press(known.sticks.buttons & ~(0 if before.sticks is None else before.sticks.buttons))
            self._judge()

    def noise(self, count: int = 1) -> None:
        """Bytes came that are no message."""
        with self._lock:
            self.known = self.known.noise(count)

    def tick(self) -> None:
        """Look at the clock: judge, send again, beat, report. To be called every `TICK_S`, by one thread."""
        with self._lock:
            now_s = self.clock()
            gap_s = now_s - self._ticked_s if math.isfinite(self._ticked_s) else 0.0
            self._ticked_s = now_s
            if self._releases_left:
                self._let_go(now_s)
            # What is seen once must be judged once; after that it is over.
            self._standstill_s = gap_s
            self._judge()
            self._standstill_s = 0.0
            self.margins.observe(self.facts())
            if self.engagement.state == "off":
                return
            if self.entry is not None and self._slots is not None and now_s - self._sent_s >= protocol.SEND_PERIOD_S:
                self._out(self._slots, now_s)
            if now_s - self._beat_s >= protocol.HEARTBEAT_PERIOD_S:
                self._beat_s = now_s
                self._post("heartbeat", self.heartbeat())
            if self.figures and now_s - self._figures_s >= protocol.FIGURES_PERIOD_S:
                self._figures_s = now_s
                for name, value in self.figures.items():
                    if math.isfinite(value):
                        self._post("named_value_float", self._named(name, value, now_s))
            self._ask_for_parameters(now_s)
            facts = self.facts()
            # An autopilot that streams as slowly as it does out of the box is asked for more, too.
            slow = facts.telemetry_s > self.limits.telemetry_s or facts.pose_s > self.limits.pose_s
            lacking = math.isinf(self._asked_s) or slow or now_s - self.known.servo_s > 1.0
            if lacking and now_s - self._asked_s >= AGAIN_S and facts.heartbeat_s < self.limits.heartbeat_s:
                self._asked_s = now_s
                for name, fields in interval_requests(self.known.system):
                    self._post(name, fields)

    def _ask_for_parameters(self, now_s: float) -> None:
        missing = [name for name in self._needs if name not in self.known.parameters]
        if missing and now_s - self._asked_parameters_s >= PARAMETERS_S and math.isfinite(self.known.heartbeat_s):
            self._asked_parameters_s = now_s
            for name in missing[:MOST_PARAMETERS]:
                self._post("param_request_read", parameter_request(self.known.system, name))

    def command(self, thrusts_N: Array, entry: int) -> bool:
        """Thrusts, shape (n,), that a controller decided in an engagement; whether they were sent."""
        with self._lock:
            now_s = self.clock()
            if entry != self.entry or not np.isfinite(thrusts_N).all():
                self._judge()
                return False
            slots = self._drive.slots(self.known.parameters, thrusts_N, self.known.battery_V)
            self._decided_s = now_s
            self._judge()
            if entry != self.entry:
                return False
            self._slots = slots
            self._out(slots, now_s)
            return True

    def estimated(self, estimate: BodyState) -> None:
        """What the estimator says, once at each step of the control loop."""
        with self._lock:
            self._estimate, self._estimated_s = estimate, self.clock()

    def press(self) -> str:
        """The operator's one button: consent, or take the sticks; what came of it in words."""
        with self._lock:
            if self.entry is not None:
                self._told(self.engagement.released(self.clock()))
                return "released: the pilot has the sticks"
            if self._listen_only:
                return "listening only: never engages"
            after = self.engagement.consented(self.facts(), self.limits)
            self._told(after)
            if after.state == "engaged":
                return "engaged"
            found = faults(self.facts(), self.limits, engaged=False)
            words = "; ".join(fault.text for fault in found) or self.engagement.why
            return f"not engaged: {words}"

    def release(self, why: str) -> None:
        """Take consent back, if it was given."""
        with self._lock:
            self._told(self.engagement.released(self.clock(), why))

    def send(self, name: str, fields: Mapping[str, Any]) -> None:
        """Send a message that drives nothing, such as a request to a camera, until it has ended."""
        with self._lock:
            if self.engagement.state != "off":
                self._post(name, fields)

    def pressed(self) -> tuple[str, ...]:
        """Actions that the pilot's buttons asked for since the last call."""
        with self._lock:
            found = tuple(self._pressed)
            self._pressed.clear()
            return found

    def measurements(self) -> tuple[Measurement, ...]:
        """What was measured since the last call, oldest first; times on this object's clock."""
        with self._lock:
            found = tuple(self._measurements)
            self._measurements.clear()
            return found

    def heartbeat(self) -> dict[str, int]:
        """Fields of this program's heartbeat."""
        return protocol.heartbeat(self.known.session)

    def _judge(self) -> None:
        if self.engagement.state != "off":
            self._told(self.engagement.judged(self.facts(), self.limits))

    def _told(self, after: EngagementState) -> None:
        """Take a move over: what ends an engagement stills the thrusters first and is written down then."""
        before, self.engagement = self.engagement, after
        if before.state == "engaged" and after.state != "engaged":
            self._slots, self._releases_left, self._engaged_with = None, RELEASES, {}
            self._let_go(self.clock())
        elif after.state == "engaged" and before.state != "engaged":
            self._slots, self._releases_left, self._decided_s = None, 0, self.clock()
            self._engaged_mode = self.known.mode_name
            self._engaged_with = {name: self.known.parameters[name] for name in self._needs}
            self._pressed.clear()
        for t in after.told:
            self.margins.told(t)
            self._write("state", before=t.before, after=t.after, reason=t.reason, kind=t.kind)

    def _let_go(self, now_s: float) -> None:
        self._thrusts(np.zeros(protocol.SLOTS), now_s, protocol.RELEASE_GROUP)
        self._releases_left -= 1
        self.releases_sent += 1

    def _out(self, slots: Array, now_s: float) -> None:
        self._thrusts(slots, now_s, protocol.THRUST_GROUP)
        self._sent_s = now_s
        self.thrusts_sent += 1

    def _thrusts(self, slots: Array, now_s: float, group: int) -> None:
        begun_us = self.known.session * protocol.SESSION_STEP_US
        self._last_us = max(begun_us + round(1e6 * now_s), self._last_us + 1)
        self.known = self.known.sent(self._last_us)
        self._post(
            "set_actuator_control_target",
            {
                "time_usec": self._last_us,
                "group_mlx": group,
                "target_system": self.known.system,
                "target_component": protocol.AUTOPILOT_COMPONENT,
                "controls": [float(value) for value in slots],
            },
        )

    def _post(self, name: str, fields: Mapping[str, Any]) -> None:
        try:
            self._send(name, fields)
        except OSError as fault:  # a cable pulled out must not end the watch
            if not self.unsent:
                self._write("not sent", words=str(fault.strerror or fault))
            self.unsent += 1

    def _named(self, name: str, value: float, now_s: float) -> dict[str, Any]:
        return {"time_boot_ms": round(1e3 * now_s) % 2**32, "name": name.encode("ascii"), "value": value}

    def _press(self, new: int) -> None:
        """Buttons that went down."""
        for what, number in self._buttons.items():
            if new & 1 << number:
                if what == "engage":
                    said = self.press()
                    self._write("button", button=number, said=said)
                else:
                    self._pressed.append(what)

    def _write(self, event: str, **told: Any) -> None:
        self._events.log(event, **told)

"""A survey beside the simulated autopilot in a simulated sea, in one process and in simulated time.

The session is the shipped one; bytes go both ways. `SURVEY_FAULTS` are the losses that can be injected, and
`seconds_to_hold` how long the vehicle was commanded after one. The truth is in `rows`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.arrays import Array
from wakewise.core.errors import WakewiseError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.protocol import ALT_HOLD, COMPANION_COMPONENT, ENABLE_PARAMETER, STICKS_MIDDLE
from wakewise_ardusub.link.session_log import SessionLog
from wakewise_ardusub.link.transports import MavlinkCodec
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.guided import LAPSE_S
from wakewise_ardusub.sitl.inprocess_session import InProcessSession, MavlinkSender
from wakewise_ardusub.sitl.modes import GUIDED
from wakewise_ardusub.sitl.sea_sensors import Relief, SeaSensors, SensorErrors
from wakewise_ardusub.survey.allocated_session import AllocatedTransectSession
from wakewise_ardusub.survey.survey_plan import MakeLines, parallel_lines
from wakewise_ardusub.survey.transect_session import PERIOD_S, TransectOptions, TransectSession

TICK_LOOPS = 2
_OFFSET_S = 1000.0
_DOPPLER_COMPONENT, _DOPPLER_S = 197, 0.1


def straight_line(length_m: float) -> MakeLines:
    """One line of a length from the vehicle's place along its heading."""
    return lambda place, heading, _current, _anchor: parallel_lines(place, heading, 0.1, length_m, 5.0, 1)[:1]


class SurveyHarness:
    """A session on an in-process autopilot's links; implements `wakewise_ardusub.link.transports.Transport`.

    Parameters
    ----------
    vehicle : Vehicle
    relief, current, errors : the bed, the water's velocity over time, and the sensors' errors
    lines : callable
        As of `TransectSession`.
    options : TransectOptions, optional
    seed : int
    heading_rad, depth_m : float
        Where the vehicle starts to hold its depth.
    doppler : bool
        Whether a Doppler log's driver speaks on the link (VISION_POSITION_DELTA).
    allocates : bool
        By thrusts through the script (`AllocatedTransectSession`) in place of GUIDED targets.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        relief: Relief | None = None,
        current: Callable[[float], Array] | None = None,
        errors: SensorErrors | None = None,
        lines: MakeLines | None = None,
        options: TransectOptions | None = None,
        seed: int = 0,
        heading_rad: float = 0.0,
        depth_m: float = 3.6,
        doppler: bool = True,
        firmware: tuple[int, int, int] = (4, 5, 3),
        journal: SessionLog | None = None,
        allocates: bool = False,
    ) -> None:
        self.relief = relief or Relief()
        self.sensors = SeaSensors(self.relief, errors or SensorErrors(), np.random.default_rng(seed))
        start = BodyState(X_WB=Pose(np.array([0.0, 0.0, depth_m]), quat_from_euler(0.0, 0.0, heading_rad)))
        body = FreeWater(vehicle, start, current)
        self.flight = InProcessSession(
            vehicle,
            loop_hz=50.0,
            scripts=None if allocates else {},
            body=body,
            sensors=self.sensors,
            firmware=firmware,
        )
        self.allocates = allocates
        self.options = options or TransectOptions()
        self.receive_blocked = self.send_blocked = self.stopped = False
        """Faults: nothing reaches it, nothing of it reaches others, its program has died."""
        self._waiting: deque[bytes] = deque(maxlen=4096)
        self._codec = MavlinkCodec(self, self.flight.autopilot.system)
        make = AllocatedTransectSession if allocates else TransectSession
        self.session = make(
            send=self._codec.send,
            lines=lines or straight_line(20.0),
            vehicle=vehicle,
            options=self.options,
            clock=lambda: _OFFSET_S + self.flight.now_s,
            journal=journal,
        )
        self.rows: list[tuple[float, ...]] = []
        """Each 0.1 s of a line: asked and true speed along it, true altitude, place across and error of the heading by
        the autopilot's position, and the altitude asked for.
        """
        self._doppler = MavlinkSender(self.flight.carry, 1, _DOPPLER_COMPONENT, "doppler") if doppler else None
        self._loops = 0
        self.flight.listeners["companion"] = self._hear
        self.flight.turns.append(self._turn)

    def receive(self, _timeout_s: float) -> bytes:
        """What came since; nothing is waited for."""
        data = b"".join(self._waiting)
        self._waiting.clear()
        return data

    def send(self, data: bytes) -> None:
        """To everybody else."""
        if not self.send_blocked:
            self.flight.carry(data, "companion")

    def _hear(self, data: bytes) -> None:
        if not self.receive_blocked:
            self._waiting.append(data)

    def _turn(self) -> None:
        self._loops += 1
        self.flight.moments.clear()
        self.flight.said.clear()
        now_s = self.flight.now_s
        log_due = self._loops % round(_DOPPLER_S * self.flight.loop_hz) == 0
        if self._doppler is not None and log_due and not self.sensors.lost(now_s):
            zero = [0.0, 0.0, 0.0]
            self._doppler.send(mavlink.MAVLink_vision_position_delta_message(0, 100000, zero, zero, 100.0))
        if self.stopped:
            return
        said, _ = self._codec.receive(0.0)
        for message in said:
            self.session.take(message)
        if self._loops % TICK_LOOPS == 0:
            self.session.tick()
        if log_due:
            self._note()

    def _note(self) -> None:
        session = self.session
        plan, at = session.plan, session.at
        if session.state != "flying" or plan is None or at is None or at.leg >= len(plan.legs) or not session.rows:
            return
        if _OFFSET_S + self.flight.now_s - session.rows[-1].time_s > 1.5 * PERIOD_S:
            return  # on the way to its altitude
        leg, motion = plan.legs[at.leg], self.flight.autopilot.motion
        north, east, down = (float(v) for v in motion.p_WB_m)
        if leg.line:
            speed, last = float(motion.v_W_m_s[:2] @ leg.way_at(at.along_m)), session.rows[-1]
            altitude = self.relief.bed_m(north, east) - down
            self.rows.append((at.speed_m_s, speed, altitude, last.across_m, last.heading_rad, session.altitude_m))

    def ready(self) -> SurveyHarness:
        """Armed by the pilot, in ALT_HOLD, and ready; raises WakewiseError saying what is missing."""
        self.flight.run(0.3)
        self.flight.arm(True)
        self.flight.set_mode(ALT_HOLD)
        if self.allocates:
            self.flight.set(ENABLE_PARAMETER, 1.0)
        self._run_until(lambda: self.session.state == "ready", 10.0)
        return self

    def flying(self, seconds: float = 15.0) -> SurveyHarness:
        """With consent, on its line and at its altitude for so long; raises WakewiseError where it is not."""
        self.ready().session.consent()
        self._run_until(lambda: len(self.session.rows) > 10.0 * seconds, 120.0 + seconds)
        return self

    def to_the_end(self, most_s: float = 3600.0) -> SurveyHarness:
        """Until no target is sent any more, or for so long."""
        end_s = self.flight.now_s + most_s
        while self.session.state in ("asked", "settling", "flying", "paused", "holding") and self.flight.now_s < end_s:
            self.flight.run(0.5)
        return self

    def _run_until(self, holds: Callable[[], bool], most_s: float) -> None:
        end_s = self.flight.now_s + most_s
        while not holds():
            if self.flight.now_s >= end_s:
                raise WakewiseError(f"survey in simulation: {self.session.state}: {self.session.why}")
            self.flight.run(0.1)

    def figures(self) -> dict[str, Any]:
        """Figures by the truth: speed error in cruise, altitude error; place across the line (on an arc: along its
        radius) and heading error (on an arc: from the bearing of its centre) by the autopilot's position.
        """
        rows = np.array(self.rows)
        pace = self.options.pace
        cruise = rows[rows[:, 0] >= pace.speed_m_s - 1e-6]
        off = rows[:, 2] - rows[:, 5]
        return {
            "speed_rms_cm_s": 100.0 * float(np.sqrt(np.mean((cruise[:, 1] - pace.speed_m_s) ** 2))),
            "altitude_rms_cm": 100.0 * float(np.sqrt(np.mean(off**2))),
            "altitude_p95_cm": 100.0 * float(np.percentile(np.abs(off), 95)),
            "altitude_max_cm": 100.0 * float(np.abs(off).max()),
            "cross_track_rms_cm": 100.0 * float(np.sqrt(np.mean(rows[:, 3] ** 2))),
            "cross_track_p95_cm": 100.0 * float(np.percentile(np.abs(rows[:, 3]), 95)),
            "cross_track_max_cm": 100.0 * float(np.abs(rows[:, 3]).max()),
            "heading_p95_deg": math.degrees(float(np.percentile(np.abs(rows[:, 4]), 95))),
            "heading_max_deg": math.degrees(float(np.abs(rows[:, 4]).max())),
            "seconds": len(rows) / 10.0,
        }


def _sticks(harness: SurveyHarness, sticks: tuple[int, int, int, int] | None) -> None:
    harness.flight.sticks = sticks


def _station(harness: SurveyHarness) -> None:
    harness.flight.sticks, harness.flight.beats = None, False


def _sensor(name: str) -> Callable[[SurveyHarness], None]:
    return lambda harness: setattr(harness.sensors, name, True)


def _blocked(*names: str) -> Callable[[SurveyHarness], None]:
    def fault(harness: SurveyHarness) -> None:
        for name in names:
            setattr(harness, name, True)

    return fault


def _rival(harness: SurveyHarness) -> None:
    rival = MavlinkSender(harness.flight.carry, 1, COMPANION_COMPONENT, "rival")
    rival.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 77, 4, 3))


SURVEY_FAULTS: dict[str, Callable[[SurveyHarness], None]] = {
    "a stick is moved": lambda harness: _sticks(harness, (STICKS_MIDDLE[0] + 200, *STICKS_MIDDLE[1:])),
    "the pilot changes the mode": lambda harness: harness.flight.set_mode(ALT_HOLD),
    "disarmed": lambda harness: harness.flight.arm(False),
    "the operator aborts": lambda harness: harness.session.abort("aborted"),
    "the sticks stop": lambda harness: _sticks(harness, None),
    "the ground station is lost": _station,
    "no rangefinder": _sensor("range_lost"),
    "no Doppler log": _sensor("log_lost"),
    "nothing is heard from the autopilot": _blocked("receive_blocked"),
    "nobody hears the program": _blocked("send_blocked"),
    "the cable is cut": _blocked("receive_blocked", "send_blocked"),
    "the program dies": _blocked("stopped"),
    "a second program": _rival,
}
"""What may happen during a survey, and after which the firmware must hold by itself."""
BY_TIME_OUT = ("nobody hears the program", "the cable is cut", "the program dies")
"""Those in which only the firmware's own time-out is left: its `LAPSE_S`."""


def seconds_to_hold(harness: SurveyHarness, fault: Callable[[SurveyHarness], None]) -> float:
    """Seconds from a fault until no target moves the vehicle: another mode, disarmed, or the target lapsed.

    Of allocated thrusts: until the script drives no output.
    """
    autopilot, began_s = harness.flight.autopilot, harness.flight.now_s
    fault(harness)
    while harness.flight.now_s - began_s < 2.0 * LAPSE_S:
        target = autopilot.target
        moves = target is not None and math.hypot(*target.velocity_W_m_s) > 0.0 and target.lapses
        guided = autopilot.mode == GUIDED and autopilot.armed and moves
        if not (autopilot.overridden if harness.allocates else guided):
            return harness.flight.now_s - began_s
        harness.flight.run(0.02)
    return math.inf

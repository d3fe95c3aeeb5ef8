"""The companion's output gate beside the simulated autopilot, in one process and in simulated time.

The gate, codec, motor interface and limits are the shipped ones. The controller is the simplest: constant thrusts ten
times per second. `COMPANION_FAULTS` are the faults that can be injected; `run_companion_fault` measures how long the
script drives an output after one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.arrays import Array
from wakewise.core.errors import WakewiseError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.message_state import attitude_of
from wakewise_ardusub.link.motor_interface import VehicleMotors
from wakewise_ardusub.link.output_gate import TICK_S, OutputGate
from wakewise_ardusub.link.protocol import ALT_HOLD, COMPANION_COMPONENT, ENABLE_PARAMETER
from wakewise_ardusub.link.session_log import SessionLog
from wakewise_ardusub.link.transports import MavlinkCodec
from wakewise_ardusub.sitl.inprocess_session import (
    STATION_COMPONENT,
    FaultOutcome,
    InProcessSession,
    MavlinkSender,
    noise,
    outcome,
)

DECIDES_S = 0.1
SESSION = 1
SECOND_STATION = 254
_OFFSET_S = 1000.0


class CompanionHarness:
    """An output gate on a rehearsal's links; implements `wakewise_ardusub.link.transports.Transport`.

    Parameters
    ----------
    flight : InProcessSession
    limits : EngagementLimits, optional
    journal : SessionLog, optional
    buttons : mapping, optional
        As of `OutputGate`.
    thrusts_N : ndarray, shape (n,), optional
        What the plain controller asks for; 5 N of each thruster if not given.
    """

    def __init__(
        self,
        flight: InProcessSession,
        *,
        limits: EngagementLimits | None = None,
        journal: SessionLog | None = None,
        buttons: Mapping[str, int] | None = None,
        thrusts_N: Array | None = None,
    ) -> None:
        self.flight = flight
        self.thrusts_N = np.full(len(flight.vehicle.thrusters), 5.0) if thrusts_N is None else thrusts_N
        self.drive = VehicleMotors(flight.vehicle)
        self.withheld: set[str] = set()
        """Names of messages that do not reach it."""
        self.receive_blocked = self.send_blocked = self.controller_blocked = False
        """Faults: nothing reaches it, nothing of it reaches others, its program has stopped."""
        self.decides = True
        """Whether the plain controller decides."""
        self._waiting: deque[bytes] = deque(maxlen=4096)
        self._ticked_s = self._decided_s = -1.0
        self._post = MavlinkCodec(self, flight.autopilot.system)
        self.gate = OutputGate(
            send=self._post.send,
            drive=self.drive,
            limits=limits,
            journal=journal,
            system=flight.autopilot.system,
            session=SESSION,
            buttons=buttons,
            clock=self.clock,
        )
        self.gate.target_W_m = np.array([1.0, 0.0, 2.0])
        flight.listeners["companion"] = self.hear
        flight.turns.append(self.turn)
        self.gate.begin()

    def clock(self) -> float:
        """The companion's clock, which began at another time than the autopilot's."""
        return _OFFSET_S + self.flight.now_s

    def receive(self, _timeout_s: float) -> bytes:
        """What came since; nothing is waited for."""
        data = b"".join(self._waiting)
        self._waiting.clear()
        return data

    def send(self, data: bytes) -> None:
        """To everybody else."""
        if not self.send_blocked:
            self.flight.carry(data, "companion")

    def turn(self) -> None:
        """What the program does in the time of a loop: listen, watch, decide."""
        if self.controller_blocked:
            return
        said, bad = self._post.receive(0.0)
        if bad:
            self.gate.noise(bad)
        for message in said:
            if message.name not in self.withheld:
                self.gate.take(message)
        now_s = self.flight.now_s
        if now_s - self._ticked_s >= TICK_S - 1e-9:
            self._ticked_s = now_s
            self.gate.tick()
        if self.decides and now_s - self._decided_s >= DECIDES_S - 1e-9:
            self._decided_s = now_s
            self._decide()

    def engaged(self) -> CompanionHarness:
        """Armed, switched on and consented to, with all that this takes; acting for a second.

        Raises
        ------
        WakewiseError
            Saying what keeps the output gate from it.
        """
        flight = self.flight
        flight.run(0.5)
        flight.set(ENABLE_PARAMETER, 1.0)
        flight.arm(True)
        for _ in range(60):
            flight.run(0.1)
            if self.gate.engagement.state == "ready":
                break
        answer = self.gate.press()
        if answer != "engaged":
            raise WakewiseError(answer)
        flight.run(1.0)
        return self

    def flown_N(self) -> Array:
        """Thrusts by the servos' pulses, shape (n,), as the companion knows them."""
        known = self.gate.known
        return self.drive.flown_N(known.parameters, known.servo_us, known.battery_V)

    def hear(self, data: bytes) -> None:
        """Bytes come; they are taken in at its next turn."""
        if not self.receive_blocked:
            self._waiting.append(data)

    def _decide(self) -> None:
        known, gate = self.gate.known, self.gate
        if known.place_W_m is None or not np.isfinite(known.attitude[0]):
            return
        gate.estimated(BodyState(X_WB=Pose(known.place_W_m, attitude_of(known))))
        entry = gate.entry
        if entry is not None:
            gate.command(self.thrusts_N, entry)


def _no_sticks(aboard: CompanionHarness) -> None:
    aboard.flight.sticks = None


def _no_station(aboard: CompanionHarness) -> None:
    aboard.flight.sticks, aboard.flight.beats = None, False


def _withheld(*names: str) -> Callable[[CompanionHarness], None]:
    def fault(aboard: CompanionHarness) -> None:
        aboard.withheld |= set(names)

    return fault


def _cut(aboard: CompanionHarness) -> None:
    aboard.receive_blocked = aboard.send_blocked = True


def _block_receive(aboard: CompanionHarness) -> None:
    aboard.receive_blocked = True


def _block_send(aboard: CompanionHarness) -> None:
    aboard.send_blocked = True


def _block_controller(aboard: CompanionHarness) -> None:
    aboard.controller_blocked = True


def _controller_stuck(aboard: CompanionHarness) -> None:
    aboard.decides = False


def _disarm(aboard: CompanionHarness) -> None:
    aboard.flight.arm(False)


def _mode(aboard: CompanionHarness) -> None:
    aboard.flight.set_mode(ALT_HOLD)


def _switch_off(aboard: CompanionHarness) -> None:
    aboard.flight.set(ENABLE_PARAMETER, 0.0)


def _second_station(aboard: CompanionHarness) -> None:
    other = MavlinkSender(aboard.flight.carry, SECOND_STATION, STATION_COMPONENT, "second station")
    other.send(mavlink.MAVLink_manual_control_message(aboard.flight.autopilot.system, 900, 0, 500, 0, 0))


def _channel(aboard: CompanionHarness) -> None:
    aboard.flight.set("SERVO2_FUNCTION", 0.0)


def _direction(aboard: CompanionHarness) -> None:
    aboard.flight.set("MOT_3_DIRECTION", -aboard.gate.known.parameters["MOT_3_DIRECTION"])


def _second_companion(aboard: CompanionHarness) -> None:
    """One that sends for less than a second: after that the script takes a sender that is left alone for its own."""
    rival = MavlinkSender(aboard.flight.carry, aboard.flight.autopilot.system, COMPANION_COMPONENT, "rival")
    until_s = aboard.flight.now_s + 0.9

    def speak(flight: InProcessSession) -> None:
        if flight.now_s < until_s:
            flight.send_thrusts((0.3,) * 8, who=rival, ahead_s=60.0)

    aboard.flight.each = speak


def _noise(aboard: CompanionHarness) -> None:
    pieces = iter(noise(20_000, 5))
    aboard.flight.each = lambda flight: flight.carry(next(pieces, b""), "noise")
    aboard.flight.sticks = None


def _operator(aboard: CompanionHarness) -> None:
    aboard.gate.press()


def _end(aboard: CompanionHarness) -> None:
    aboard.gate.end("Ctrl-C")


COMPANION_FAULTS: dict[str, Callable[[CompanionHarness], None]] = {
    "the operator takes the sticks": _operator,
    "the session ends": _end,
    "the sticks stop": _no_sticks,
    "the ground station is lost": _no_station,
    "no position": _withheld("LOCAL_POSITION_NED"),
    "no attitude": _withheld("ATTITUDE"),
    "nothing from the autopilot": _withheld(
        "ATTITUDE", "LOCAL_POSITION_NED", "HEARTBEAT", "NAMED_VALUE_FLOAT", "VFR_HUD"
    ),
    "the companion hears nothing": _block_receive,
    "nobody hears the companion": _block_send,
    "the cable is cut": _cut,
    "the companion's program dies": _block_controller,
    "the controller hangs": _controller_stuck,
    "disarmed": _disarm,
    "mode changed": _mode,
    "switched off": _switch_off,
    "a second ground station": _second_station,
    "an output is given another function": _channel,
    "a parameter changed": _direction,
    "a second sender": _second_companion,
    "noise, and the sticks stop": _noise,
}
"""What may happen around a companion that drives, and after which the outputs must be the autopilot's again."""


def run_companion_fault(
    vehicle: Vehicle, fault: Callable[[CompanionHarness], None], seconds: float = 1.5
) -> FaultOutcome:
    """Drive as the companion does, let something go wrong, and look at the outputs."""
    aboard = CompanionHarness(InProcessSession(vehicle)).engaged()
    began_s = aboard.flight.now_s
    fault(aboard)
    return outcome(aboard.flight.run(seconds), began_s)

"""Flight of the simulated autopilot in one process and in simulated time: pilot, companion, faults and outputs.

The companion is only a stream of thrusts without safety functions, so the results show what script and autopilot do by
themselves.

`ScriptedGroundStation` is a pilot without a person: it arms the vehicle, enables the script and sends neutral sticks.
What another station changes afterwards stays so until the autopilot restarts.
"""

from __future__ import annotations

import random
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.robot.importers import any_vehicle
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.protocol import (
    ALT_HOLD,
    COMPANION_COMPONENT,
    ENABLE_PARAMETER,
    LOOP_MS,
    MIDDLE_US,
    SEND_PERIOD_S,
    STICKS_MIDDLE,
    THRUST_GROUP,
)
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.physics.physics import PulseTable, SimulatedBody
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.sea_sensors import SeaSensors
from wakewise_ardusub.sitl.simulated_autopilot import FIRMWARE, SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint, run

STATION, STATION_COMPONENT = 255, 190
THRUSTS = (0.2, -0.2, 0.15, -0.15, 0.1, 0.1, -0.1, -0.1)
"""What the companion streams unless it is told otherwise; none of them is the middle pulse."""


def shipped_script() -> dict[str, str]:
    """The script of the package, text by name."""
    return {"wakewise.lua": script_text()}


class MavlinkSender:
    """Somebody on a link, who packs messages under ids of their own."""

    def __init__(self, hear: Callable[[bytes, str], None], system: int, component: int, link: str) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._hear, self._link = hear, link

    def send(self, message: Any) -> None:
        """Send a message."""
        self._hear(bytes(message.pack(self._mav)), self._link)
        self._mav.seq = (self._mav.seq + 1) & 0xFF


@dataclass(frozen=True, kw_only=True)
class LoopRecord:
    """One loop: its time, whether armed, whether a script drove an output, and the pulses."""

    time_s: float
    armed: bool
    overridden: bool
    pulses_us: tuple[int, ...]

    @property
    def thrusting(self) -> bool:
        """Whether a motor's pulse was off the middle."""
        return any(pulse not in (0, MIDDLE_US) for pulse in self.pulses_us)


@dataclass
class InProcessSession:
    """Stand-in, body, pilot and companion; what they do is in the fields, which a fault changes.

    Parameters
    ----------
    vehicle : Vehicle
        Of six or eight thrusters.
    loop_hz : float
    values : mapping, optional
        Parameters in place of the stand-in's own.
    scripts : mapping, optional
        In place of the one that is shipped.
    body : SimulatedBody, optional
        In place of the vehicle in still water.
    sensors : SeaSensors, optional
        As of `SimulatedAutopilot`.
    firmware : tuple of three int
        As of `SimulatedAutopilot`.
    """

    vehicle: Vehicle
    loop_hz: float = 100.0
    values: Mapping[str, float] = field(default_factory=dict)
    scripts: Mapping[str, str] | None = None
    beats: bool = True
    sticks: tuple[int, int, int, int] | None = STICKS_MIDDLE
    buttons: int = 0
    streams: bool = False
    thrusts: tuple[float, ...] = THRUSTS
    moments: list[LoopRecord] = field(default_factory=list)
    said: list[Any] = field(default_factory=list)
    body: SimulatedBody | None = None
    sensors: SeaSensors | None = None
    firmware: tuple[int, int, int] = FIRMWARE

    def __post_init__(self) -> None:
        values = own_parameters(len(self.vehicle.thrusters)) | dict(self.values)
        scripts = shipped_script() if self.scripts is None else self.scripts
        self.autopilot = SimulatedAutopilot(
            values, loop_hz=self.loop_hz, scripts=scripts, sensors=self.sensors, firmware=self.firmware
        )
        body = FreeWater(self.vehicle) if self.body is None else self.body
        self._behind = InProcessPhysics(body=body, table=PulseTable.of(self.vehicle, values))
        self.station = MavlinkSender(self.carry, STATION, STATION_COMPONENT, "station")
        self.companion = MavlinkSender(self.carry, self.autopilot.system, COMPANION_COMPONENT, "companion")
        self.listeners: dict[str, Callable[[bytes], None]] = {}
        """Others on the vehicle's links, by name: each hears what the autopilot and all others say."""
        self.turns: list[Callable[[], None]] = []
        """Called after each loop."""
        self._parsers = mavlink.MAVLink(None)
        self._due = {"beat": 0.0, "sticks": 0.0, "stream": 0.0}
        self.each: Callable[[InProcessSession], None] | None = None
        """Called before every loop, if given."""

    @property
    def now_s(self) -> float:
        """Time since the stand-in's start."""
        return self.autopilot.motion.time_s

    def carry(self, data: bytes, link: str) -> None:
        """Bytes that somebody sends: to the autopilot and to all others, as the vehicle's router does."""
        self.autopilot.hear(data, link)
        for name, hear in self.listeners.items():
            if name != link:
                hear(data)

    def run(self, seconds: float) -> InProcessSession:
        """Let time pass."""
        end_s = self.now_s + seconds
        while self.now_s < end_s - 0.5 / self.loop_hz:
            self._speak()
            if self.each is not None:
                self.each(self)
            motion = self._behind.exchange(self.autopilot.pulses_us, round(self.loop_hz))
            if motion is not None:
                pulses = self.autopilot.step(motion)
                self.moments.append(
                    LoopRecord(
                        time_s=self.now_s,
                        armed=self.autopilot.armed,
                        overridden=self.autopilot.overridden,
                        pulses_us=pulses,
                    )
                )
            for packet in self.autopilot.take_out():
                self.said += self._parsers.parse_buffer(packet) or []
                for hear in self.listeners.values():
                    hear(packet)
            for turn in self.turns:
                turn()
        return self

    def engaged(self) -> InProcessSession:
        """Armed, enabled and acting for a second."""
        self.run(0.2)
        self.arm(True)
        self.set(ENABLE_PARAMETER, 1.0)
        self.streams = True
        return self.run(1.0)

    def arm(self, armed: bool) -> None:
        """Ask to arm or to disarm."""
        self.station.send(
            mavlink.MAVLink_command_long_message(
                self.autopilot.system, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, float(armed), 0, 0, 0, 0, 0, 0
            )
        )

    def set(self, name: str, value: float) -> None:
        """Ask for a parameter's value."""
        self.station.send(
            mavlink.MAVLink_param_set_message(
                self.autopilot.system, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
            )
        )

    def set_mode(self, mode: int) -> None:
        """Ask for a mode."""
        self.station.send(mavlink.MAVLink_set_mode_message(self.autopilot.system, 1, mode))

    def send_thrusts(
        self, values: tuple[float, ...], *, who: MavlinkSender | None = None, ahead_s: float = 0.0
    ) -> None:
        """One message of thrusts, its clock ahead of this one by so much."""
        stamp_us = max(0, round(1e6 * (self.now_s + ahead_s)))
        (who or self.companion).send(
            mavlink.MAVLink_set_actuator_control_target_message(
                stamp_us, THRUST_GROUP, self.autopilot.system, 1, list(values)
            )
        )

    def texts(self) -> list[str]:
        """STATUSTEXTs that were said, those in parts put together."""
        found: list[str] = []
        for message in self.said:
            if message.get_type() == "STATUSTEXT":
                if message.chunk_seq:
                    found[-1] += message.text
                else:
                    found.append(message.text)
        return found

    def last_override_s(self) -> float | None:
        """When a script last drove an output; None if it never did."""
        return next((moment.time_s for moment in reversed(self.moments) if moment.overridden), None)

    def _speak(self) -> None:
        if self.beats and self._is_due("beat", 1.0):
            self.station.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        if self.sticks is not None and self._is_due("sticks", 0.05):
            sticks = mavlink.MAVLink_manual_control_message(self.autopilot.system, *self.sticks, self.buttons)
            self.station.send(sticks)
        if self.streams and self._is_due("stream", SEND_PERIOD_S):
            self.send_thrusts(self.thrusts)

    def _is_due(self, what: str, every_s: float) -> bool:
        if self.now_s < self._due[what] - 1e-9:
            return False
        self._due[what] = self.now_s + every_s
        return True


def _stop_stream(flight: InProcessSession) -> None:
    flight.streams = False


def _disarm(flight: InProcessSession) -> None:
    flight.arm(False)


def _switch_off(flight: InProcessSession) -> None:
    flight.set(ENABLE_PARAMETER, 0.0)


def _change_mode(flight: InProcessSession) -> None:
    flight.set_mode(ALT_HOLD)


def _second_sender(flight: InProcessSession) -> None:
    flight.each = lambda now: now.send_thrusts((0.3,) * 8, ahead_s=60.0)


def _not_a_number(flight: InProcessSession) -> None:
    flight.thrusts = (float("nan"),) * 8


def _script_restart(flight: InProcessSession) -> None:
    flight.station.send(
        mavlink.MAVLink_command_long_message(flight.autopilot.system, 1, 42701, 0, 3.0, 0, 0, 0, 0, 0, 0)
    )


FAULTS: dict[str, Callable[[InProcessSession], None]] = {
    "the stream stops": _stop_stream,
    "disarmed while streaming": _disarm,
    "switched off while streaming": _switch_off,
    "mode changed while streaming": _change_mode,
    "a second sender": _second_sender,
    "thrusts that are no numbers": _not_a_number,
    "scripts started anew": _script_restart,
}
"""What may happen at any time, and after which the outputs must be the autopilot's again."""


@dataclass(frozen=True, kw_only=True)
class FaultOutcome:
    """What the outputs did after a fault.

    Parameters
    ----------
    neutral_ms : float
        How long a script still drove an output.
    after_disarm_ms : float
        How long a motor's pulse was still off the middle after it was disarmed; 0 where it never was.
    disarmed_thrusts : int
        Loops with such a pulse while disarmed, but for the two turns of the script after disarming.
    """

    neutral_ms: float
    after_disarm_ms: float
    disarmed_thrusts: int


def outcome(flight: InProcessSession, began_s: float) -> FaultOutcome:
    """Of a flight in which something went wrong at a time."""
    last_s = flight.last_override_s()
    ended_s, after_ms, thrusts, was_armed = 0.0, 0.0, 0, False
    for moment in flight.moments:
        if was_armed and not moment.armed:
            ended_s = moment.time_s
        was_armed = moment.armed
        if moment.thrusting and not moment.armed:
            after_ms = max(after_ms, 1e3 * (moment.time_s - ended_s) + 1e3 / flight.loop_hz)
            thrusts += moment.time_s > ended_s + 2e-3 * LOOP_MS
    return FaultOutcome(
        neutral_ms=0.0 if last_s is None else max(0.0, 1e3 * (last_s - began_s)),
        after_disarm_ms=after_ms,
        disarmed_thrusts=thrusts,
    )


def run_fault(vehicle: Vehicle, fault: Callable[[InProcessSession], None], seconds: float = 1.5) -> FaultOutcome:
    """Drive by a mere stream of thrusts, let something go wrong, and look at the outputs."""
    flight = InProcessSession(vehicle).engaged()
    began_s = flight.now_s
    fault(flight)
    return outcome(flight.run(seconds), began_s)


def sticks_packet(number: int) -> bytes:
    """A ground station's MANUAL_CONTROL, its sticks somewhere."""
    mav = mavlink.MAVLink(None, srcSystem=STATION, srcComponent=STATION_COMPONENT)
    mav.seq = number & 0xFF
    return bytes(mavlink.MAVLink_manual_control_message(1, number % 1000, 0, 500, 100, 0).pack(mav))


def noise(count: int, seed: int) -> list[bytes]:
    """At least so many bytes of noise in pieces: pure, packets with a bit turned, and whole packets of random content.

    The last are those that reach furthest: their checksums are right.
    """
    draw = random.Random(seed)
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=COMPANION_COMPONENT)
    kinds = sorted(mavlink.mavlink_map)
    pieces: list[bytes] = []
    total = 0
    while total < count:
        kind = draw.random()
        if kind < 0.3:
            piece = draw.randbytes(draw.randrange(1, 400))
        else:
            wanted = draw.choice(_HEARD) if draw.random() < 0.5 else draw.choice(kinds)
            piece = _random_packet(mav, wanted, draw)
            if kind < 0.5:
                spoilt = bytearray(piece)
                spoilt[draw.randrange(len(spoilt))] ^= 1 << draw.randrange(8)
                piece = bytes(spoilt)
        pieces.append(piece)
        total += len(piece)
    return pieces


_HEARD = (
    mavlink.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET,
    mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
    mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL,
    mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
)


def _random_packet(mav: Any, wanted: int, draw: random.Random) -> bytes:
    """A packet of any content; what arms or reboots by right is left to those who mean it."""
    kind = mavlink.mavlink_map[wanted]
    payload = draw.randbytes(draw.randrange(1, kind.unpacker.size + 1))
    system = draw.choice((1, 1, 2, STATION))
    header = struct.pack("<BBBBBBB", 0xFD, len(payload), 0, 0, mav.seq, system, draw.choice((1, 190, 191)))
    body = header + struct.pack("<I", wanted)[:3] + payload
    mav.seq = (mav.seq + 1) & 0xFF
    crc = mavlink.x25crc(body[1:])
    crc.accumulate(struct.pack("B", kind.crc_extra))
    return body + struct.pack("<H", crc.crc)


STICKS_S, BEAT_S, ASKS_S = 0.05, 1.0, 2.0
FIRST_S = 0.4
"""When it is first asked to arm: after the script has switched itself off, which it does as it starts."""


class ScriptedGroundStation:
    """Heartbeats and sticks of a ground station; arms and switches on once after each start.

    Parameters
    ----------
    made : SimulatedAutopilot
    carry : callable
        Takes bytes and the name of a link: to the stand-in and to everybody else.
    """

    def __init__(self, made: SimulatedAutopilot, carry: Callable[[bytes, str], None]) -> None:
        self._made, self._pilot = made, MavlinkSender(carry, STATION, STATION_COMPONENT, "pilot ashore")
        self._begin()

    def _begin(self) -> None:
        self._due = {"sticks": 0.0, "beat": 0.0, "ask": FIRST_S}
        self._done, self._last_s = False, 0.0

    def turn(self) -> None:
        """Say what is due, by the stand-in's time."""
        made, pilot = self._made, self._pilot
        if made.now_s < self._last_s:
            self._begin()
        self._last_s = made.now_s
        if self._is_due("sticks", STICKS_S):
            pilot.send(mavlink.MAVLink_manual_control_message(made.system, *STICKS_MIDDLE, 0))
        if self._is_due("beat", BEAT_S):
            pilot.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        self._done |= made.armed and made.parameters.get(ENABLE_PARAMETER) == 1.0
        if not self._done and self._is_due("ask", ASKS_S):
            if not made.armed:
                arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
                pilot.send(mavlink.MAVLink_command_long_message(made.system, 1, arm, 0, 1.0, 0, 0, 0, 0, 0, 0))
            if made.parameters.get(ENABLE_PARAMETER) != 1.0:
                real = mavlink.MAV_PARAM_TYPE_REAL32
                pilot.send(mavlink.MAVLink_param_set_message(made.system, 1, ENABLE_PARAMETER.encode(), 1.0, real))

    def _is_due(self, what: str, every_s: float) -> bool:
        now_s = self._made.now_s
        if now_s < self._due[what]:
            return False
        self._due[what] = now_s + every_s
        return True


def route_messages(made: SimulatedAutopilot, links: list[UdpEndpoint]) -> Callable[[bytes, str], None]:
    """Carries bytes to the stand-in and out on its links, as its router does."""

    def carry(data: bytes, name: str) -> None:
        made.hear(data, name)
        for link in links:
            link.write(data)

    return carry


def fly_piloted(vehicle: str, port: int, seconds: float = 3600.0, loop_hz: float = 100.0) -> None:
    """Fly until the time is over, or the process is ended; a companion listens at the port of this computer."""
    chosen = any_vehicle(vehicle)
    values = own_parameters(len(chosen.thrusters))
    made = SimulatedAutopilot(values, loop_hz=loop_hz, scripts=shipped_script())
    link = UdpEndpoint("127.0.0.1", port, out=True)
    behind = InProcessPhysics(body=FreeWater(chosen), table=PulseTable.of(chosen, values))
    end_s = time.monotonic() + seconds
    ashore = ScriptedGroundStation(made, route_messages(made, [link]))
    run(made, behind, [link], lambda: time.monotonic() < end_s, turn=ashore.turn)
    link.close()

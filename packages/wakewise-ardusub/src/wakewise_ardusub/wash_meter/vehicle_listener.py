"""Latest values of a vehicle by channel with their ages, and the MAVLink socket of the meter (UDP).

Messages are decoded as in the readers of logs. The socket is silent by default. It can send only what is listed here:
the heartbeat of an onboard computer (to a server that must be addressed first), requests to read a parameter, and named
values. None of them commands the vehicle or changes anything on it.
"""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise_ardusub.link.connection import Endpoint, dialect
from wakewise_ardusub.logs.channels import HELD_S, MODES, VehicleIdentity, is_parameter, valid_or_nan
from wakewise_ardusub.logs.mavlink import AUTOPILOT, WANTED, ClockModel, record_message

_SLACK_S = 1e-9


@dataclass
class LatestSamples:
    """The last sample of each channel of one system, and its parameters."""

    samples: dict[str, tuple[float, tuple[float, ...]]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    identity: VehicleIdentity = field(default_factory=VehicleIdentity)

    def put(self, channel: str, time_s: float, values: Iterable[float]) -> None:
        """Keep a sample in place of the last."""
        self.samples[channel] = (time_s, valid_or_nan(channel, values))

    def parameter(self, name: str, value: float) -> None:
        """Keep a parameter under a name that can be one."""
        if is_parameter(name, value):
            self.parameters[name] = value

    def beat(self, mav_type: int, autopilot: int) -> None:
        """Keep what the last heartbeat says the vehicle is."""
        self.identity = VehicleIdentity(mav_type=mav_type, autopilot=autopilot)


class _AsStamped:
    """The clock of who hears messages as they come: its own stamps are the time."""

    def at(self, stamp_s: float, _boot_s: float | None = None) -> float:
        return stamp_s


class VehicleListener:
    """Hears one vehicle.

    Parameters
    ----------
    system : int, optional
        MAVLink system id of the vehicle; the first whose servo outputs are heard if not given.
    parameters : mapping, optional
        The autopilot's, as known beforehand.
    clock : ClockModel, optional
        Makes times of stamps; they are taken as they are if not given.
    """

    def __init__(
        self, system: int | None = None, parameters: Mapping[str, float] | None = None, clock: ClockModel | None = None
    ) -> None:
        self.system = system
        self.clock: ClockModel = clock or _AsStamped()
        self.messages = 0
        self._before = dict(parameters or {})
        self._said: dict[int, LatestSamples] = {}

    def records_of(self, system: int) -> LatestSamples:
        """Where a system's samples go."""
        return self._said.setdefault(system, LatestSamples())

    def hear(self, stamp_s: float, system: int, component: int, name: str, fields: Mapping[str, Any]) -> None:
        """Take in one message; one whose fields make no sense is passed over."""
        try:
            record_message(self, stamp_s, system, component, name, fields)
        except (KeyError, TypeError, ValueError):
            return
        self.messages += 1
        if self.system is None and component == AUTOPILOT and name == "SERVO_OUTPUT_RAW":
            self.system = system

    @property
    def parameters(self) -> dict[str, float]:
        """The vehicle's: as known beforehand, and as heard since."""
        return self._before | (self._own.parameters if self._own is not None else {})

    @property
    def identity(self) -> VehicleIdentity:
        """What the vehicle says it is."""
        return self._own.identity if self._own is not None else VehicleIdentity()

    @property
    def others(self) -> tuple[int, ...]:
        """Systems with servo outputs that are not the vehicle."""
        return tuple(sorted(s for s, said in self._said.items() if s != self.system and "servo" in said.samples))

    def age_s(self, channel: str, now_s: float) -> float:
        """Seconds since a channel was heard; infinite where it never was."""
        sample = None if self._own is None else self._own.samples.get(channel)
        return math.inf if sample is None else now_s - sample[0]

    def last(self, channel: str, now_s: float) -> Array | None:
        """The last sample of a channel, None where there is none or it is too old (`HELD_S`)."""
        if self._own is None or self.age_s(channel, now_s) > HELD_S[channel] + _SLACK_S:
            return None
        return np.array(self._own.samples[channel][1])

    def number(self, channel: str, now_s: float) -> float | None:
        """The last sample of a channel of one number, None where it is not known."""
        value = self.last(channel, now_s)
        return None if value is None or not math.isfinite(value[0]) else float(value[0])

    def mode(self, now_s: float) -> str | None:
        """The flight mode in words."""
        number = self.number("mode", now_s)
        modes = {} if self.identity.is_other else MODES
        return None if number is None else modes.get(int(number), f"mode {int(number)}")

    def pose(self, now_s: float) -> Pose | None:
        """Where the vehicle is and how it lies, by the autopilot's own estimate; None where it does not know."""
        position, attitude = self.last("position", now_s), self.last("attitude", now_s)
        if position is None or attitude is None or not np.isfinite([*position, *attitude]).all():
            return None
        return Pose(position, quat_from_euler(*attitude))

    @property
    def _own(self) -> LatestSamples | None:
        return None if self.system is None else self._said.get(self.system)


COMPONENT = 192
"""MAV_COMP_ID_ONBOARD_COMPUTER2: 191 is the companion's, which takes a second sender of its own id for a rival."""
_MOST_SENDERS, _MOST_DATAGRAMS = 16, 400
_BIGGEST = 65535


@dataclass(frozen=True)
class TimedMessage:
    """One message: when, from whom, what it is called, and its fields."""

    time_s: float
    system: int
    component: int
    name: str
    fields: dict[str, Any]


class MavlinkSocket:
    """A UDP socket with MAVLink on it.

    Parameters
    ----------
    ends : Endpoint

    Raises
    ------
    InputError
        If there is no such address, or the port is taken.
    """

    def __init__(self, ends: Endpoint) -> None:
        self._dialect = dialect()
        self._parsers: dict[Any, Any] = {}
        self._ends = ends
        self._to: Any = None
        self.bad = 0
        self._sequence = -1
        try:
            family, kind, number, _, address = socket.getaddrinfo(ends.host, ends.port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, number)
            try:
                self._socket.setblocking(False)
                if ends.way == "udpin":
                    self._socket.bind(address)
                else:
                    self._to = address
            except OSError:
                self._socket.close()
                raise
        except OSError as fault:
            why = (fault.strerror or str(fault)).lower()
            raise InputError(f"--connection {ends.words}: {why}; give an address and a free port") from None

    @property
    def port(self) -> int:
        """The port of this end."""
        return int(self._socket.getsockname()[1])

    def wait(self, seconds: float) -> None:
        """Until something is there, or time is up."""
        select.select([self._socket], [], [], max(seconds, 0.0))

    def heard(self) -> Iterator[TimedMessage]:
        """The messages that have come, those that somebody here wants; what is no message is counted in `bad`."""
        for _ in range(_MOST_DATAGRAMS):
            try:
                data, sender = self._socket.recvfrom(_BIGGEST)
            except BlockingIOError:
                return
            except OSError:  # what was sent before came back refused: nobody listens there yet
                continue
            if self._ends.way == "udpin":
                self._to = sender
            now_s = time.monotonic()
            for message in self._messages(sender, data):
                name = message.get_type()
                if name == "BAD_DATA":
                    self.bad += 1
                elif name in WANTED:
                    yield TimedMessage(
                        now_s, message.get_srcSystem(), message.get_srcComponent(), name, message.to_dict()
                    )

    def _messages(self, sender: Any, data: bytes) -> list[Any]:
        """Messages in a datagram; each sender has a parser, so that nobody's rubbish spoils another's messages."""
        if sender not in self._parsers:
            if len(self._parsers) >= _MOST_SENDERS:
                self._parsers.pop(next(iter(self._parsers)))
            self._parsers[sender] = self._dialect.MAVLink(None)
            self._parsers[sender].robust_parsing = True
        try:
            return self._parsers[sender].parse_buffer(data) or []
        except Exception:  # pymavlink raises what the bytes made it raise
            self.bad += 1
            del self._parsers[sender]
            return []

    def _say(self, system: int, message: Any) -> None:
        """Send to whom was heard last, or to the server; unheard if nobody was."""
        if self._to is None:
            return
        sender = self._dialect.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        sender.seq = self._sequence = (self._sequence + 1) % 256
        try:
            self._socket.sendto(message.pack(sender), self._to)
        except OSError:  # a network that is gone for a while
            self.bad += 1

    def beat(self, system: int) -> None:
        """A heartbeat: an onboard computer, no autopilot, no ground station."""
        words = self._dialect
        kind, pilot, state = words.MAV_TYPE_ONBOARD_CONTROLLER, words.MAV_AUTOPILOT_INVALID, words.MAV_STATE_ACTIVE
        self._say(system, words.MAVLink_heartbeat_message(kind, pilot, 0, 0, state, 3))

    def ask(self, system: int, parameter: str) -> None:
        """Request to read a parameter of the autopilot."""
        self._say(system, self._dialect.MAVLink_param_request_read_message(system, 1, parameter.encode(), -1))

    def publish(self, system: int, boot_ms: int, name: str, value: float) -> None:
        """A named value, which every ground station can show."""
        self._say(system, self._dialect.MAVLink_named_value_float_message(boot_ms, name.encode(), value))

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

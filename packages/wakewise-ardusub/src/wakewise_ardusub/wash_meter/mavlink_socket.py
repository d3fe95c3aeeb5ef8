"""The connection that a vehicle is heard by: MAVLink over UDP, and the few words that a meter may say.

It is silent unless asked otherwise. What it can say is listed here and nowhere else: a heartbeat of an onboard computer
(a server that one must speak to first sends nothing otherwise), requests to read a parameter, and named values. None
of them commands the vehicle or changes anything on it.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from wakewise.core.errors import InputError
from wakewise_ardusub.link.connection import Endpoint, dialect
from wakewise_ardusub.logs.mavlink import WANTED

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

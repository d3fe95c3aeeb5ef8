"""Connection to a vehicle: parser of `--connection` strings and the only place that opens a pymavlink connection.

MAVLink 2 only, with the vehicle's own system id and component 191 (onboard computer).
"""

from __future__ import annotations

import errno
import importlib
import os
import re
import socket
import time
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.protocol import AUTOPILOT_COMPONENT, COMPANION_COMPONENT, DEFAULT_SYSTEM
from wakewise_ardusub.optional_dependencies import need
from wakewise_ardusub.sensors.devices import SerialPort

CONNECTION_FORMS = (
    "udpin:0.0.0.0:14560 (listen), udpout:192.168.2.2:14550, tcp:192.168.2.2:5777, serial:/dev/ttyACM0:115200 "
    "or file:flight.tlog"
)
GROUND_STATION_PORT = 14550
"""UDP port at which QGroundControl and other ground stations listen."""
WAYS = ("udpin", "udpout", "tcp", "serial", "file")
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?\Z")
_BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 1500000, 2000000)
_PYMAVLINK = ("pymavlink",)


@dataclass(frozen=True, kw_only=True)
class Endpoint:
    """What a connection's words mean: `way` is one of `WAYS`; host and port, or device and speed, or a file."""

    way: str
    host: str = ""
    port: int = 0
    path: str = ""
    baud: int = 0

    @property
    def words(self) -> str:
        """As it was said."""
        if self.way == "file":
            return f"file:{self.path}"
        if self.way == "serial":
            return f"serial:{self.path}:{self.baud}"
        return f"{self.way}:{self.host}:{self.port}"


def cannot_open(endpoint: Endpoint, fault: OSError) -> EnvironmentFailure:
    """Why an endpoint could not be opened, as an error to raise."""
    words = fault.strerror or str(fault)
    if fault.errno == errno.EADDRINUSE:
        words = "another program listens there already"
        if endpoint.port == GROUND_STATION_PORT:
            words += ", probably QGroundControl, whose port this is; take another, such as 14560"
    return EnvironmentFailure(f"{endpoint.words}: {words}")


def parse_connection(words: str, option: str = "--connection") -> Endpoint:
    """Read a connection's words.

    Raises
    ------
    InputError
        In one line: what is wrong with them and what would be right.
    """
    way, colon, rest = words.strip().partition(":")

    def wrong(what: str) -> InputError:
        return InputError(f"{option} {words!r}: {what}; right is {CONNECTION_FORMS}")

    if way not in WAYS:
        known = (
            f"{way!r} is not one of {', '.join(WAYS)}" if colon else f"must begin with {', '.join(WAYS)} and a colon"
        )
        raise wrong(known)
    if not rest:
        raise wrong("nothing after the colon")
    if way == "file":
        if not Path(rest).is_file():
            raise InputError(f"{option} {words!r}: there is no file {rest}")
        return Endpoint(way=way, path=rest)
    place, colon, number = rest.rpartition(":")
    if not colon or not place:
        raise wrong("a speed is missing at the end" if way == "serial" else "a port is missing at the end")
    if not (number.isascii() and number.isdigit()):
        raise wrong(f"{number!r} is not a number")
    value = int(number)
    if way == "serial":
        if value not in _BAUDS:
            raise wrong(f"speed {value} is none that serial ports have, such as 57600, 115200 or 921600")
        if not place.startswith("/") and not re.match(r"COM\d+\Z", place):
            raise wrong(f"{place!r} is no serial device")
        return Endpoint(way=way, path=place, baud=value)
    if not 1 <= value <= 65535:
        raise wrong(f"port {value} is not between 1 and 65535")
    if not _HOST.match(place):
        raise wrong(f"{place!r} is no host")
    return Endpoint(way=way, host=place, port=value)


class MavlinkSession(Protocol):
    """What conversations with an autopilot need of a connection."""

    system: int
    """The vehicle's id."""

    def hear(self, kinds: Collection[str], timeout_s: float) -> Any:
        """The next message of these kinds that the vehicle's autopilot sent, None if none came in time."""
        ...

    def receive_any(self, timeout_s: float) -> Any:
        """The next message of anybody, None if none came in time."""
        ...

    def send(self, name: str, **fields: Any) -> None:
        """Send a message by the name of pymavlink's encoder, as the companion."""
        ...


class Connection:
    """An open connection, which speaks as the companion of a vehicle; a context manager."""

    def __init__(self, endpoint: Endpoint, system: int = DEFAULT_SYSTEM) -> None:
        self.endpoint, self.system = endpoint, system
        self._file = _opened(endpoint, system)

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give port, device or file back."""
        self._file.close()

    @property
    def live(self) -> bool:
        """Whether somebody may answer."""
        return self.endpoint.way != "file"

    def receive_any(self, timeout_s: float) -> Any:
        """The next message of anybody that is whole, None if none came in time."""
        until = time.monotonic() + timeout_s
        while True:
            left_s = until - time.monotonic()
            try:
                message = self._file.recv_match(blocking=self.live, timeout=max(left_s, 1e-3))
            except OSError as fault:
                raise EnvironmentFailure(f"{self.endpoint.words}: {fault.strerror or fault}") from None
            if message is not None and message.get_type() != "BAD_DATA":
                return message
            if message is None and (not self.live or time.monotonic() >= until):
                return None

    def hear(self, kinds: Collection[str], timeout_s: float) -> Any:
        """The next message of these kinds that the vehicle's autopilot sent, None if none came in time."""
        return receive_kind(self, kinds, timeout_s)

    def send(self, name: str, **fields: Any) -> None:
        """Send a message by the name of pymavlink's encoder.

        Raises
        ------
        EnvironmentFailure
            If the way out is gone.
        """
        try:
            getattr(self._file.mav, f"{name}_send")(**fields)
        except OSError as fault:
            raise EnvironmentFailure(f"{self.endpoint.words}: {fault.strerror or fault}") from None


def receive_kind(link: MavlinkSession, kinds: Collection[str], timeout_s: float) -> Any:
    """The next message of these kinds from the autopilot of a connection's vehicle, None if none came in time."""
    until = time.monotonic() + timeout_s
    while True:
        message = link.receive_any(max(until - time.monotonic(), 0.0))
        if message is None:
            return None
        at_home = message.get_srcSystem() == link.system and message.get_srcComponent() == AUTOPILOT_COMPONENT
        if at_home and message.get_type() in kinds:
            return message


def send_command(link: MavlinkSession, number: int, *params: float) -> None:
    """Send a COMMAND_LONG; parameters that are left out are 0."""
    filled = (*params, *[0.0] * (7 - len(params)))
    link.send(
        "command_long",
        target_system=link.system,
        target_component=AUTOPILOT_COMPONENT,
        command=number,
        confirmation=0,
        **{f"param{i + 1}": float(value) for i, value in enumerate(filled)},
    )


@cache
def dialect() -> Any:
    """ArduPilot's messages of pymavlink, as MAVLink 2.

    Raises
    ------
    MissingExtra
        If pymavlink is not installed; says how it is.
    """
    need("the link to a vehicle", "links", only=_PYMAVLINK)
    return importlib.import_module("pymavlink.dialects.v20.ardupilotmega")


def _over_serial(mavutil: Any, endpoint: Endpoint, who: dict[str, Any]) -> Any:
    """A port of pymavlink over a serial line; its own prints to standard output and hides a device that was removed."""
    mavutil.set_dialect("ardupilotmega")
    port = SerialPort(endpoint.path, endpoint.baud)

    class SerialFile(mavutil.mavfile):
        def recv(self, n: int | None = None) -> bytes:
            del n
            return port.read()

        def write(self, buf: bytes) -> None:
            port.write(buf)

        def close(self) -> None:
            port.close()

    return SerialFile(port.fileno(), endpoint.path, **who)


def _opened(endpoint: Endpoint, system: int) -> Any:
    need("the link to a vehicle", "links", only=_PYMAVLINK)
    # Read by pymavlink when it is first imported: without it answers would go out as MAVLink 1.
    os.environ["MAVLINK20"] = "1"
    mavutil = importlib.import_module("pymavlink.mavutil")
    who: dict[str, Any] = {"source_system": system, "source_component": COMPANION_COMPONENT}
    if endpoint.way == "serial":
        return _over_serial(mavutil, endpoint, who)
    if endpoint.way == "file":
        device = endpoint.path
    else:
        device = endpoint.words
        try:
            socket.getaddrinfo(endpoint.host, endpoint.port, socket.AF_INET)
        except OSError as fault:
            raise InputError(f"{endpoint.words}: {endpoint.host} has no address ({fault.strerror})") from None
    if endpoint.way == "tcp":
        who["retries"] = 1
    try:
        return mavutil.mavlink_connection(device, dialect="ardupilotmega", **who)
    except OSError as fault:
        raise cannot_open(endpoint, fault) from None

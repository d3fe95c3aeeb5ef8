"""Byte transports (UDP, TCP, serial) and the MAVLink 2 codec of the companion.

`packets` finds MAVLink packets in bytes by their checksums. UDP is recommended: a stream that stalls delays everything
behind it.
"""

from __future__ import annotations

import select
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from threading import Condition
from typing import Any, Protocol

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.connection import Endpoint, cannot_open, dialect
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.protocol import COMPANION_COMPONENT
from wakewise_ardusub.sensors.devices import SerialPort

_MARK_1, _MARK_2, _SIGNED = 0xFE, 0xFD, 0x01
_HEAD_1, _HEAD_2, _CHECKSUM, _SIGNATURE = 6, 10, 2, 13


@dataclass(frozen=True)
class MavlinkPacket:
    """A packet of a datagram: where it begins and ends, where its payload begins, and its message's number."""

    start: int
    end: int
    payload: int
    number: int


def packets(data: bytes) -> Iterator[MavlinkPacket | tuple[int, int]]:
    """Packets in their order, and between them the stretches of bytes that are none, as (start, end).

    Of a message that is unknown the checksum cannot be told, so it counts as a stretch that is none.
    """
    at = noise = 0
    while (at := _next_mark(data, at)) < len(data):
        packet = packet_at(data, at)
        if packet is None:
            at += 1
            continue
        if noise < at:
            yield noise, at
        yield packet
        at = noise = packet.end
    if noise < len(data):
        yield noise, len(data)


def packet_at(data: bytes, at: int) -> MavlinkPacket | None:
    """The whole packet at an offset; None where there is none."""
    size, mark = len(data), data[at]
    if mark == _MARK_2 and at + _HEAD_2 + _CHECKSUM <= size:
        payload, number = at + _HEAD_2, int.from_bytes(data[at + 7 : at + 10], "little")
        signature = _SIGNATURE if data[at + 2] & _SIGNED else 0
    elif mark == _MARK_1 and at + _HEAD_1 + _CHECKSUM <= size:
        payload, number, signature = at + _HEAD_1, data[at + 5], 0
    else:
        return None
    last = payload + data[at + 1]
    end = last + _CHECKSUM + signature
    message = dialect().mavlink_map.get(number)
    if end > size or message is None:
        return None
    told = int.from_bytes(data[last : last + _CHECKSUM], "little")
    return MavlinkPacket(at, end, payload, number) if checksum(data[at + 1 : last], message.crc_extra) == told else None


def partial_packet_start(data: bytes) -> int:
    """Where a packet begins whose end has not come yet, by what its head promises; the end where there is none."""
    at = 0
    for part in packets(data):
        if isinstance(part, MavlinkPacket):
            at = part.end
    while (at := _next_mark(data, at)) < len(data):
        if len(data) - at < _HEAD_2 or at + _HEAD_2 + data[at + 1] + _CHECKSUM + _SIGNATURE > len(data):
            return at
        at += 1
    return len(data)


def is_signed(data: bytes, packet: MavlinkPacket) -> bool:
    """Whether a packet bears a signature, so that nobody may change it."""
    return data[packet.start] == _MARK_2 and bool(data[packet.start + 2] & _SIGNED)


def checksum(data: bytes, extra: int) -> int:
    """CRC-16/MCRF4XX of a packet from its length on, with the extra byte of its message."""
    crc = dialect().x25crc(data)
    crc.accumulate(bytes([extra]))
    return int(crc.crc)


def _next_mark(data: bytes, at: int) -> int:
    """Offset of the next byte that may begin a packet; the end where there is none."""
    found = [place for mark in (_MARK_1, _MARK_2) if (place := data.find(mark, at)) >= 0]
    return min(found, default=len(data))


LARGEST = 65535
_AT_ONCE = 4096
_PATIENCE_S = 5.0
_HEARTBEAT = 0


def open_transport(endpoint: Endpoint) -> UdpTransport | StreamTransport:
    """The transport to an endpoint.

    Raises
    ------
    InputError
        If the host has no address, or the endpoint is a file, which nobody can fly.
    EnvironmentFailure
        If the port is taken or the other side does not answer.
    """
    if endpoint.way == "file":
        raise InputError(f"--connection {endpoint.words}: a record cannot be flown; wakewise link log reads it")
    if endpoint.way == "tcp":
        return _tcp(endpoint)
    if endpoint.way == "serial":
        return _serial(endpoint)
    return UdpTransport(endpoint)


def open_udp(endpoint: Endpoint) -> socket.socket:
    """A UDP socket of an endpoint: `udpin` waits at its port, `udpout` speaks from one of the system's choosing.

    Raises
    ------
    InputError, EnvironmentFailure
        As `open_transport`.
    """
    at = _address(endpoint)
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind(at if endpoint.way == "udpin" else (_own_side(at[0]), 0))
    except OSError as fault:
        made.close()
        raise cannot_open(endpoint, fault) from None
    return made


class UdpTransport:
    """A `Transport` over a UDP socket: it speaks to the place that it was told, or to who sent heartbeats last.

    Who only sends poses to the same port, as `wakewise link sensors --forward` does, is heard and not answered. Before
    the first heartbeat it answers whoever spoke first.
    """

    def __init__(self, endpoint: Endpoint) -> None:
        self.socket = open_udp(endpoint)
        self.socket.setblocking(False)
        self._peer = None if endpoint.way == "udpin" else _address(endpoint)

    def receive(self, timeout_s: float) -> bytes:
        """The next datagram."""
        try:
            if select.select([self.socket], [], [], max(timeout_s, 0.0))[0]:
                data, sender = self.socket.recvfrom(LARGEST)
                if self._peer is None or (sender != self._peer and _beats(data)):
                    self._peer = sender
                return data
        except OSError:  # such as what a refused datagram leaves behind
            return b""
        return b""

    def send(self, data: bytes) -> None:
        """Send to the other side; nobody is there before it has spoken."""
        if self._peer is not None:
            self.socket.sendto(data, self._peer)

    def close(self) -> None:
        """Give the port back."""
        self.socket.close()


def _beats(data: bytes) -> bool:
    """Whether a HEARTBEAT is among the packets of a datagram."""
    return any(isinstance(part, MavlinkPacket) and part.number == _HEARTBEAT for part in packets(data))


class StreamTransport:
    """A `Transport` over bytes without borders: what may be the begin of a packet is kept until the rest has come."""

    def __init__(
        self, handle: Any, read: Callable[[int], bytes], write: Callable[[bytes], Any], close: Callable[[], Any]
    ) -> None:
        self._handle, self._read, self._write, self._close = handle, read, write, close
        self._kept, self._gone = b"", False

    def receive(self, timeout_s: float) -> bytes:
        """Whole packets, and what is none, that came."""
        if self._gone:  # silence is what the output gate judges
            time.sleep(max(timeout_s, 0.0))
            return b""
        if not select.select([self._handle], [], [], max(timeout_s, 0.0))[0]:
            return b""
        try:
            came = self._read(_AT_ONCE)
        except (OSError, EnvironmentFailure):
            came = b""
        self._gone = not came  # a line that can be read and has nothing is one whose other side is gone
        data = self._kept + came
        at = partial_packet_start(data)
        self._kept = data[at:]
        return data[:at]

    def send(self, data: bytes) -> None:
        """Send to the other side."""
        self._write(data)

    def close(self) -> None:
        """Hang up."""
        self._close()


def _tcp(endpoint: Endpoint) -> StreamTransport:
    try:
        made = socket.create_connection(_address(endpoint), timeout=_PATIENCE_S)
    except OSError as fault:
        raise cannot_open(endpoint, fault) from None
    made.settimeout(_PATIENCE_S)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return StreamTransport(made, made.recv, made.sendall, made.close)


def _serial(endpoint: Endpoint) -> StreamTransport:
    port = SerialPort(endpoint.path, endpoint.baud)
    return StreamTransport(port, lambda _: port.read(), port.write, port.close)


def _address(endpoint: Endpoint) -> tuple[str, int]:
    try:
        found = socket.getaddrinfo(endpoint.host, endpoint.port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
    except OSError as fault:
        why = fault.strerror or fault
        raise InputError(f"{endpoint.words}: {endpoint.host} has no address ({why})") from None
    return str(found[0]), int(found[1])


def _own_side(host: str) -> str:
    """Where to speak from: a program on this computer is spoken to from this computer alone."""
    return "127.0.0.1" if host.startswith("127.") else ""


class Transport(Protocol):
    """Carries bytes to a vehicle and from it."""

    def receive(self, timeout_s: float) -> bytes:
        """Bytes that came; waits for some at most so long, and gives none then."""
        ...

    def send(self, data: bytes) -> None:
        """Hand bytes over; may raise OSError."""
        ...


class MavlinkCodec:
    """Speaks as the companion of a vehicle.

    Parameters
    ----------
    transport : Transport
    system : int
        The vehicle's id, which its companion shares.
    """

    def __init__(self, transport: Transport, system: int) -> None:
        self._transport = transport
        self._out = dialect().MAVLink(None, srcSystem=system, srcComponent=COMPANION_COMPONENT)
        self._in = dialect().MAVLink(None)

    def receive(self, timeout_s: float) -> tuple[list[MavlinkMessage], int]:
        """Messages that came, and how many stretches of bytes were none; waits at most so long for the first."""
        data = self._transport.receive(timeout_s)
        said: list[MavlinkMessage] = []
        noise = 0
        for part in packets(data):
            try:
                if not isinstance(part, MavlinkPacket):
                    raise TypeError
                said.append(MavlinkMessage.of(self._in.decode(bytearray(data[part.start : part.end]))))
            except Exception:  # pymavlink raises what the fields made it raise
                noise += 1
        return said, noise

    def send(self, name: str, fields: Mapping[str, Any]) -> None:
        """Send a message, by the name of pymavlink's encoder."""
        message = getattr(self._out, f"{name}_encode")(**fields)
        data = message.pack(self._out)
        self._out.seq = (self._out.seq + 1) % 256
        self._transport.send(bytes(data))


class RelayTransport:
    """A `Transport` beside a relay: what it forwards is put in here, and what is to be sent goes out through it."""

    def __init__(self, most: int = 4096) -> None:
        self._waiting: deque[bytes] = deque(maxlen=most)
        self._arrived = Condition()
        self.out: Any = None
        """Sends bytes to the vehicle; set once the relay is there."""

    def put(self, data: bytes) -> None:
        """A datagram went by."""
        with self._arrived:
            self._waiting.append(data)
            self._arrived.notify()

    def receive(self, timeout_s: float) -> bytes:
        """All that went by since."""
        with self._arrived:
            if not self._waiting:
                self._arrived.wait(timeout_s)
            data = b"".join(self._waiting)
            self._waiting.clear()
            return data

    def send(self, data: bytes) -> None:
        """Hand bytes to the relay."""
        if self.out is not None:
            self.out(data)

"""What carries a session's bytes: UDP, TCP or a serial line, by the words that `connection.py` reads.

UDP is what vehicles' routers offer and what is recommended: a stream that stalls keeps everything behind it waiting.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from typing import Any

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.connection import Endpoint, open_serial
from wakewise_ardusub.link.packets import partial_packet_start
from wakewise_ardusub.sensors.devices import SerialPort

LARGEST = 65535
_AT_ONCE = 4096
_PATIENCE_S = 5.0
_TAKEN = 98


def carrier_of(endpoint: Endpoint) -> UdpTransport | StreamTransport:
    """The carrier to an endpoint.

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
        As `carrier_of`.
    """
    at = _address(endpoint)
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind(at if endpoint.way == "udpin" else (_own_side(at[0]), 0))
    except OSError as fault:
        made.close()
        raise _refused(endpoint, fault) from None
    return made


class UdpTransport:
    """A `Carrier` over a UDP socket. It answers whoever spoke last, or the place that it was told to speak to."""

    def __init__(self, endpoint: Endpoint) -> None:
        self.socket = open_udp(endpoint)
        self.socket.setblocking(False)
        self._peer = None if endpoint.way == "udpin" else _address(endpoint)

    def receive(self, timeout_s: float) -> bytes:
        """The next datagram."""
        try:
            if select.select([self.socket], [], [], max(timeout_s, 0.0))[0]:
                data, self._peer = self.socket.recvfrom(LARGEST)
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


class StreamTransport:
    """A `Carrier` over bytes without borders: what may be the begin of a packet is kept until the rest has come."""

    def __init__(
        self, handle: Any, read: Callable[[int], bytes], write: Callable[[bytes], Any], close: Callable[[], Any]
    ) -> None:
        self._handle, self._read, self._write, self._close = handle, read, write, close
        self._kept, self._gone = b"", False

    def receive(self, timeout_s: float) -> bytes:
        """Whole packets, and what is none, that came."""
        if self._gone:  # silence is what the warden judges
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
        raise _refused(endpoint, fault) from None
    made.settimeout(_PATIENCE_S)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return StreamTransport(made, made.recv, made.sendall, made.close)


def _serial(endpoint: Endpoint) -> StreamTransport:
    made = open_serial(endpoint)
    if isinstance(made, SerialPort):
        return StreamTransport(made, lambda _: made.read(), made.write, made.close)
    return StreamTransport(made, made.read, made.write, made.close)


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


def _refused(endpoint: Endpoint, fault: OSError) -> EnvironmentFailure:
    taken = "another program listens there already" if fault.errno == _TAKEN else str(fault.strerror or fault)
    return EnvironmentFailure(f"{endpoint.words}: {taken}")

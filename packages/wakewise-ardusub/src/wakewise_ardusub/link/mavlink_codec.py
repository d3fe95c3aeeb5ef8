"""Bytes to messages and back: the companion's MAVLink 2 over whatever carries bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from threading import Condition
from typing import Any, Protocol

from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.packets import MavlinkPacket, dialect, packets
from wakewise_ardusub.link.protocol import COMPANION_COMPONENT


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
    carrier : Transport
    system : int
        The vehicle's id, which its companion shares.
    """

    def __init__(self, carrier: Transport, system: int) -> None:
        self._carrier = carrier
        self._out = dialect().MAVLink(None, srcSystem=system, srcComponent=COMPANION_COMPONENT)
        self._in = dialect().MAVLink(None)

    def receive(self, timeout_s: float) -> tuple[list[MavlinkMessage], int]:
        """Messages that came, and how many stretches of bytes were none; waits at most so long for the first."""
        data = self._carrier.receive(timeout_s)
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
        self._carrier.send(bytes(data))


class RelayTransport:
    """A `Transport` beside a relay: what it forwards is put in here, and what is to be sent goes out through it."""

    def __init__(self, most: int = 4096) -> None:
        self._waiting: deque[bytes] = deque(maxlen=most)
        self._came = Condition()
        self.out: Any = None
        """Sends bytes to the vehicle; set once the relay is there."""

    def put(self, data: bytes) -> None:
        """A datagram went by."""
        with self._came:
            self._waiting.append(data)
            self._came.notify()

    def receive(self, timeout_s: float) -> bytes:
        """All that went by since."""
        with self._came:
            if not self._waiting:
                self._came.wait(timeout_s)
            data = b"".join(self._waiting)
            self._waiting.clear()
            return data

    def send(self, data: bytes) -> None:
        """Hand bytes to the relay."""
        if self.out is not None:
            self.out(data)

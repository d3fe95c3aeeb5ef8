"""MAVLink relay between ground station and vehicle, and a router for several programs. All endpoints are UDP.

`MavlinkRelay` is for set-ups whose router sends the companion no copy of the sticks. It forwards all bytes unchanged in
both directions, with one exception: while the companion drives, MANUAL_CONTROL carries neutral sticks, with the pilot's
ids, sequence and buttons, so that the autopilot's controllers do not integrate against them. The companion's messages
go to the vehicle separately. If one side is silent, the other side hears nothing, so that failsafes act as without it.

`MavlinkRouter` forwards the bytes of one autopilot to several programs, and theirs to it and to each other, unchanged.
"""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from wakewise.core.errors import InputError
from wakewise_ardusub.link.connection import Endpoint, dialect
from wakewise_ardusub.link.protocol import STICKS_MESSAGE, STICKS_MIDDLE
from wakewise_ardusub.link.transports import MavlinkPacket, UdpTransport, checksum, is_signed, packets

Address = tuple[str, int]
FORGOTTEN_S = 10.0
"""A ground station that said nothing for so long is sent nothing more."""
MOST_GROUND_STATIONS = 8
LARGEST = 65535
_MARK_2 = 0xFD
_STICKS = struct.Struct("<hhhh")
_PITCH_ROLL = slice(14, 18)
_WHOLE, _FIRST = 30, 11
"""Bytes of MANUAL_CONTROL's payload with all of its extensions, and without."""
_KEPT = 20_000
_TO_GROUND = frozenset({77, 253, 275})
"""COMMAND_ACK, STATUSTEXT and CAMERA_TRACKING_IMAGE_STATUS of the companion: for ground stations, too."""


def neutralize_sticks(data: bytes) -> bytes:
    """A datagram with the sticks of each MANUAL_CONTROL let go; all else, noise too, stays as it is.

    One that is signed cannot be changed without its key and is left out.
    """
    out = bytearray()
    for part in packets(data):
        if not isinstance(part, MavlinkPacket):
            out += data[slice(*part)]
        elif part.number != STICKS_MESSAGE:
            out += data[part.start : part.end]
        elif not is_signed(data, part):
            out += _let_go(data, part)
    return bytes(out)


def _let_go(data: bytes, packet: MavlinkPacket) -> bytes:
    """MANUAL_CONTROL with its sticks in the middle."""
    head = bytearray(data[packet.start : packet.payload])
    second = head[0] == _MARK_2
    whole = _WHOLE if second else _FIRST
    payload = bytearray(data[packet.payload : packet.payload + head[1]].ljust(whole, b"\0"))
    payload[: _STICKS.size] = _STICKS.pack(*STICKS_MIDDLE)
    if len(payload) >= _PITCH_ROLL.stop:
        payload[_PITCH_ROLL] = bytes(4)
    if second:
        # MAVLink 2 leaves zeros at the end out, all but the first byte.
        payload = bytearray(bytes(payload[:1]) + bytes(payload[1:]).rstrip(b"\0"))
    head[1] = len(payload)
    body = bytes(head[1:] + payload)
    extra = dialect().mavlink_map[STICKS_MESSAGE].crc_extra
    return bytes(head[:1]) + body + checksum(body, extra).to_bytes(2, "little")


class MavlinkRelay:
    """Forwards datagrams in a thread of its own.

    Parameters
    ----------
    vehicle, ground : socket
        UDP, bound: where the vehicle's router sends to, and where the ground station does.
    driving : callable
        Whether the companion drives now.
    heard : callable
        Called with each datagram, of either side, as it came; must be quick.
    vehicle_at, ground_at : (host, port), optional
        Where they are; by default where they last sent from.

    Attributes
    ----------
    forwarded : int
        Datagrams.
    dropped : int
        Those that nobody could be sent.
    """

    def __init__(
        self,
        vehicle: socket.socket,
        ground: socket.socket,
        *,
        driving: Callable[[], bool],
        heard: Callable[[bytes], None],
        vehicle_at: Address | None = None,
        ground_at: Address | None = None,
    ) -> None:
        dialect()  # what takes long is done before anything waits
        self._vehicle, self._ground = vehicle, ground
        self._driving, self._heard = driving, heard
        self._vehicle_at, self._ground_at = vehicle_at, ground_at
        self._stations: dict[Address, float] = {}
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)
        self._took_s: deque[float] = deque(maxlen=_KEPT)
        self.forwarded = self.dropped = 0
        for one in (vehicle, ground):
            one.setblocking(False)

    def start(self) -> None:
        """Begin to forward."""
        self._thread.start()

    def stop(self) -> None:
        """End; the sockets stay their owner's."""
        self._over.set()
        self._thread.join(timeout=2.0)

    def send(self, data: bytes) -> None:
        """Send the companion's own to the vehicle, and its answers to the ground stations."""
        if self._vehicle_at is not None:
            self._put(self._vehicle, data, self._vehicle_at)
        if any(isinstance(part, MavlinkPacket) and part.number in _TO_GROUND for part in packets(data)):
            for station in list(self._stations):
                self._put(self._ground, data, station)

    def latency_s(self, share: float = 0.99) -> float:
        """Within what time this share of the last datagrams was forwarded, from when they were read; 0 before any."""
        took = list(self._took_s)
        return float(np.quantile(took, share)) if took else 0.0

    def _run(self) -> None:
        while not self._over.is_set():
            for one in select.select([self._vehicle, self._ground], [], [], 0.1)[0]:
                self._take(one)

    def _take(self, one: socket.socket) -> None:
        """Forward what waits at a socket."""
        for _ in range(256):  # then the other side has its turn
            try:
                data, sender = one.recvfrom(LARGEST)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:  # what a refused datagram leaves behind
                continue
            began_s = time.perf_counter()
            if one is self._vehicle:
                self._vehicle_at = sender
                for station in self._listening(began_s):
                    self._put(self._ground, data, station)
            else:
                self._came_from(sender, began_s)
                forward = neutralize_sticks(data) if self._driving() else data
                if self._vehicle_at is None:
                    self.dropped += 1
                elif forward:
                    self._put(self._vehicle, forward, self._vehicle_at)
            self._took_s.append(time.perf_counter() - began_s)
            self._heard(data)

    def _put(self, one: socket.socket, data: bytes, to: Address) -> None:
        try:
            one.sendto(data, to)
            self.forwarded += 1
        except OSError:
            self.dropped += 1

    def _came_from(self, station: Address, now_s: float) -> None:
        if station in self._stations or len(self._stations) < MOST_GROUND_STATIONS:
            self._stations[station] = now_s

    def _listening(self, now_s: float) -> list[Address]:
        for station in [s for s, at_s in self._stations.items() if now_s - at_s > FORGOTTEN_S]:
            del self._stations[station]
        found = list(self._stations)
        if self._ground_at is not None and self._ground_at not in found:
            found.append(self._ground_at)
        return found


WAIT_S = 0.1
"""How soon `going` is asked again while nobody speaks."""
_UDP = ("udpin", "udpout")


class MavlinkRouter:
    """Sockets of an autopilot and of those who share it, in the order given: the autopilot first.

    Attributes
    ----------
    passed : list of int
        Datagrams that came from each.
    lost : int
        Copies that could not be sent.

    Raises
    ------
    InputError
        If a place is not UDP.
    EnvironmentFailure
        If one cannot be had.
    """

    def __init__(self, places: Sequence[Endpoint]) -> None:
        for place in places:
            if place.way not in _UDP:
                raise InputError(f"{place.words}: only udpin:HOST:PORT and udpout:HOST:PORT can be shared")
        self._ends: list[UdpTransport] = []
        try:
            self._ends += map(UdpTransport, places)
        except BaseException:
            self.close()
            raise
        self.passed, self.lost = [0] * len(places), 0

    def turn(self) -> None:
        """Wait a little for somebody to speak, and hand on what came: to everybody else."""
        heard = select.select([end.socket for end in self._ends], [], [], WAIT_S)[0]
        for index, end in enumerate(self._ends):
            data = end.receive(0.0) if end.socket in heard else b""
            if not data:
                continue
            self.passed[index] += 1
            for other in self._ends:
                if other is not end:
                    self._hand(other, data)

    def run(self, going: Callable[[], bool]) -> None:
        """Turns until `going` says no."""
        while going():
            self.turn()

    def close(self) -> None:
        """Give the ports back."""
        for end in self._ends:
            end.close()

    def _hand(self, end: UdpTransport, data: bytes) -> None:
        try:
            end.send(data)
        except OSError:  # nobody there yet
            self.lost += 1

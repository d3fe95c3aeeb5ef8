"""UDP sockets of the simulated autopilot in real time: ground stations and companions, and physics.

Like the router on a vehicle's computer, it forwards what comes from one endpoint to all others.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from wakewise.core.errors import InputError
from wakewise_ardusub.physics.datagrams import LARGEST_B, PhysicsState, ServoFrame, read_reply, write_request
from wakewise_ardusub.physics.physics import PulseTable, SimulatedBody
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot

RESEND_S = 0.1
"""How long an answer of physics is waited for before the frame is sent again."""
_BEHIND_S = 0.5
"""Further behind the wall's clock than this, time that is lost is not made up for."""
_DATAGRAMS_PER_LOOP = 50


class UdpEndpoint:
    """A UDP socket to one program: `out` speaks to an address, else whoever speaks to it first is answered.

    Raises
    ------
    InputError
        If the address cannot be had.
    """

    def __init__(self, host: str, port: int, *, out: bool) -> None:
        self.name = f"{'out' if out else 'in'} {host}:{port}"
        self._peer: tuple[str, int] | None = (host, port) if out else None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((_own_side(host), 0) if out else (host, port))
        except OSError as fault:
            self._socket.close()
            raise InputError(f"UDP {host}:{port}: {fault.strerror or fault}") from None

    @property
    def port(self) -> int:
        """Port here, 0 before anything was sent out."""
        return int(self._socket.getsockname()[1])

    def read(self) -> list[bytes]:
        """Datagrams that have come."""
        found: list[bytes] = []
        while len(found) < _DATAGRAMS_PER_LOOP:
            try:
                data, sender = self._socket.recvfrom(LARGEST_B)
            except (BlockingIOError, ConnectionResetError, ConnectionRefusedError):
                break
            self._peer = self._peer or (str(sender[0]), int(sender[1]))
            found.append(data)
        return found

    def write(self, data: bytes) -> None:
        """Send, if there is somebody."""
        if self._peer is not None:
            try:
                self._socket.sendto(data, self._peer)
            except OSError:  # nobody there yet: a ground station comes when it comes
                return

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


class PhysicsBackend(Protocol):
    """What moves the vehicle: physics over a socket, or a body in this process."""

    def exchange(self, pulses_us: tuple[int, ...], rate_hz: int) -> PhysicsState | None:
        """One frame of pulses for one motion; None where nobody answers for now."""
        ...

    def close(self) -> None:
        """Give back what it holds."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class InProcessPhysics:
    """A body in this process."""

    body: SimulatedBody
    table: PulseTable

    def exchange(self, pulses_us: tuple[int, ...], rate_hz: int) -> PhysicsState | None:
        """One step of the body."""
        return self.body.step(self.table.thrusts(pulses_us), 1.0 / rate_hz)

    def close(self) -> None:
        """Nothing is held."""


class UdpPhysics:
    """The JSON physics link, as its client: a frame, its answer, the next frame."""

    def __init__(self, host: str, port: int) -> None:
        self._address, self._frame = (host, port), 0
        self._waiting: bytes | None = None
        self.resent = 0
        """Frames that were not answered in time and sent again."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(RESEND_S)
        self._socket.bind((_own_side(host), 0))

    def exchange(self, pulses_us: tuple[int, ...], rate_hz: int) -> PhysicsState | None:
        """Send a frame and wait for its answer for a while; the same frame goes out next time if there is none."""
        if self._waiting is None:
            self._frame += 1
            self._waiting = write_request(ServoFrame(rate_hz=rate_hz, frame=self._frame, pulses_us=pulses_us))
        else:
            self.resent += 1
        try:
            self._socket.sendto(self._waiting, self._address)
            motion = read_reply(self._socket.recv(LARGEST_B))
        except (TimeoutError, ConnectionError, InputError):
            return None
        self._waiting = None
        return motion

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


def _own_side(host: str) -> str:
    """Address to speak from: nobody else's computer is heard where the other program is on this one."""
    return "127.0.0.1" if host == "localhost" or host.startswith("127.") else ""


def run(
    autopilot: SimulatedAutopilot,
    behind: PhysicsBackend,
    links: list[UdpEndpoint],
    going: Callable[[], bool],
    *,
    turn: Callable[[], None] | None = None,
    said: Callable[[], None] | None = None,
    every_s: float = 1.0,
) -> None:
    """Loops until `going` says no, by the clock on the wall; `turn` is called in each, `said` now and then."""
    rate_hz = round(autopilot.loop_hz)
    began_s = next_s = time.monotonic()
    began_at_s = autopilot.motion.time_s
    while going():
        for link in links:
            for data in link.read():
                autopilot.hear(data, link.name)
                for other in links:
                    if other is not link:
                        other.write(data)
        if turn is not None:
            turn()
        motion = behind.exchange(autopilot.pulses_us, rate_hz)
        if motion is not None:
            autopilot.step(motion)
        for packet in autopilot.take_out():
            for link in links:
                link.write(packet)
        now_s = time.monotonic()
        if said is not None and now_s >= next_s:
            said()
            next_s = now_s + every_s
        ahead_s = began_s + (autopilot.motion.time_s - began_at_s) - now_s
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        elif ahead_s < -_BEHIND_S:
            began_s, began_at_s = now_s, autopilot.motion.time_s

"""Physics server for ArduPilot's JSON interface: each frame of servo pulses advances the vehicle by one step.

`PhysicsServer.answer` has no socket and no clock, so that a test or the simulated autopilot calls it directly; `serve`
adds the UDP socket (loopback by default). `FrameCounter` detects repeated and lost frames: a repeat gets the same
answer and moves nothing.

`PulseTable` holds the thrust of each pulse, one row per thruster and one column per us. A motor with MOT_n_DIRECTION of
-1 is reversed here as well, because the autopilot reverses its pulse.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.motors import directions_of_motors, motor_channels, thrusts_of_pulses
from wakewise_ardusub.physics.datagrams import LARGEST_B, PhysicsState, read_request, write_reply

LATE = 8
"""A count that is lower by no more than this came late; lower by more, the firmware was started anew."""
QUIET_S = 1.0
"""How long the firmware must have been silent before another one may take its place."""

Verdict = Literal["begin", "step", "repeat", "late", "other"]


@dataclass(frozen=True, kw_only=True)
class FrameCounter:
    """What has come so far.

    Parameters
    ----------
    last : int or None
        Count of the last new frame.
    sender : tuple of str and int, or None
        Who sent it.
    heard_s : float
        When that one was last heard.
    stepped, repeats, lost, late, starts, strangers : int
        Frames that moved the vehicle, that were resent, that never came, that came late; how often the firmware
        started; frames of others meanwhile.
    """

    last: int | None = None
    sender: tuple[str, int] | None = None
    heard_s: float = 0.0
    stepped: int = 0
    repeats: int = 0
    lost: int = 0
    late: int = 0
    starts: int = 0
    strangers: int = 0

    def take(self, frame: int, sender: tuple[str, int], now_s: float) -> tuple[FrameCounter, Verdict]:
        """What a frame is, and the count after it.

        "begin" asks for the vehicle at its start and one step, "step" for a step, "repeat" for the last answer again;
        "late" and "other" (a second firmware beside the first) ask for nothing.
        """
        if self.last is None or sender != self.sender:
            if self.last is not None and now_s - self.heard_s < QUIET_S:
                return replace(self, strangers=self.strangers + 1), "other"
            return self._begun(frame, sender, now_s), "begin"
        ahead = frame - self.last
        if ahead == 0:
            return replace(self, repeats=self.repeats + 1, heard_s=now_s), "repeat"
        if ahead > 0:
            return (
                replace(self, last=frame, stepped=self.stepped + 1, lost=self.lost + ahead - 1, heard_s=now_s),
                "step",
            )
        if -ahead <= LATE and frame > 1:
            return replace(self, late=self.late + 1, heard_s=now_s), "late"
        return self._begun(frame, sender, now_s), "begin"

    def _begun(self, frame: int, sender: tuple[str, int], now_s: float) -> FrameCounter:
        return replace(self, last=frame, sender=sender, heard_s=now_s, stepped=self.stepped + 1, starts=self.starts + 1)


RATES_HZ = (20, 2000)
"""Steps a second that are taken; a firmware that asks for others is refused."""
_RATE_OVER = 400


class SimulatedBody(Protocol):
    """A vehicle in its water."""

    def step(self, thrusts_N: Array, dt_s: float) -> PhysicsState:
        """Hold commanded thrusts, shape (n,), for `dt_s` and tell how it moves then."""
        ...


@dataclass(frozen=True, kw_only=True)
class PhysicsFigures:
    """How the link went: counts as in `FrameCounter`, datagrams refused, frames a second, and how the vehicle is now.

    `stage` is what is done with it before it is free, see `Lowered`.
    """

    frames: int
    repeats: int
    lost: int
    late: int
    starts: int
    strangers: int
    refused: int
    rate_hz: float | None
    time_s: float
    depth_m: float | None
    thrusts_N: tuple[float, ...]
    pulses_us: tuple[int, ...]
    stage: str = ""


class PhysicsServer:
    """A vehicle behind a firmware.

    Parameters
    ----------
    begin : callable
        Gives the vehicle at its start; called anew whenever the firmware is started anew.
    thrusts : callable
        Thrusts in N, shape (n,), of one frame's pulses; see `PulseTable`.
    rate_hz : int, optional
        Steps a second whatever the firmware asks for.
    own_clock : bool
        Ask the firmware not to hold itself to the clock on the wall.

    Raises
    ------
    InputError
        If the rate is out of `RATES_HZ`.
    """

    def __init__(
        self,
        begin: Callable[[], SimulatedBody],
        thrusts: Callable[[tuple[int, ...]], Array],
        *,
        rate_hz: int | None = None,
        own_clock: bool = False,
    ) -> None:
        if rate_hz is not None and not RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
            raise InputError(f"--rate {rate_hz}: {RATES_HZ[0]} to {RATES_HZ[1]} Hz are allowed")
        self._begin, self._thrusts = begin, thrusts
        self._rate_hz, self._own_clock = rate_hz, own_clock
        self._body: SimulatedBody | None = None
        self._frames = FrameCounter()
        self._refused = 0
        self.why_refused = ""
        """Why the last datagram was refused that was."""
        self._times_s: deque[float] = deque(maxlen=_RATE_OVER + 1)
        self._last_reply = b""
        self.motion: PhysicsState | None = None
        """What was last told."""
        self._pulses: tuple[int, ...] = ()
        self._now_N: Array = np.zeros(0)

    def answer(self, datagram: bytes, sender: tuple[str, int], now_s: float) -> bytes | None:
        """What goes back to the sender of a datagram that came at `now_s` (any clock); None for nothing.

        What is no request is counted and not answered, whatever it holds.
        """
        try:
            if len(datagram) > LARGEST_B:
                raise InputError(f"physics link: a datagram of {len(datagram)} bytes")
            request = read_request(datagram)
            rate_hz = self._rate_hz or request.rate_hz
            if not RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
                raise InputError(f"physics link: {rate_hz} Hz asked for, {RATES_HZ[0]} to {RATES_HZ[1]} are allowed")
        except InputError as fault:
            self._refused, self.why_refused = self._refused + 1, str(fault)
            return None
        self._frames, verdict = self._frames.take(request.frame, sender, now_s)
        if verdict in ("late", "other"):
            return None
        if verdict == "repeat":
            return self._last_reply
        if verdict == "begin" or self._body is None:
            self._body = self._begin()
            self._times_s.clear()
        self._pulses = request.pulses_us
        self._now_N = self._thrusts(request.pulses_us)
        self.motion = self._body.step(self._now_N, 1.0 / rate_hz)
        self._last_reply = write_reply(self.motion, own_clock=self._own_clock)
        self._times_s.append(now_s)
        return self._last_reply

    def figures(self) -> PhysicsFigures:
        """How it goes."""
        frames, motion, times = self._frames, self.motion, self._times_s
        span_s = times[-1] - times[0] if len(times) > 1 else 0.0
        return PhysicsFigures(
            frames=frames.stepped,
            repeats=frames.repeats,
            lost=frames.lost,
            late=frames.late,
            starts=frames.starts,
            strangers=frames.strangers,
            refused=self._refused,
            rate_hz=(len(times) - 1) / span_s if span_s > 0.0 else None,
            time_s=0.0 if motion is None else motion.time_s,
            depth_m=None if motion is None else float(motion.p_WB_m[2]),
            thrusts_N=tuple(round(float(thrust), 3) for thrust in self._now_N),
            pulses_us=self._pulses,
            stage=str(getattr(self._body, "stage", "")),
        )


LOOPBACK = "127.0.0.1"
_LISTEN_S = 0.2


def open_socket(host: str, port: int) -> socket.socket:
    """A UDP socket that listens; port 0 lets the system choose.

    Raises
    ------
    InputError
        If the address cannot be had.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"--port {port}: 0 to 65535 are allowed")
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        listening.bind((host, port))
    except OSError as fault:
        listening.close()
        raise InputError(
            f"UDP {host}:{port}: {fault.strerror or fault}; another program listens there, or it is no address here"
        ) from None
    listening.settimeout(_LISTEN_S)
    return listening


def serve(
    physics: PhysicsServer,
    listening: socket.socket,
    going: Callable[[], bool],
    *,
    said: Callable[[], None] | None = None,
    every_s: float = 1.0,
) -> None:
    """Answer frames until `going` says no; `said` is called now and then, also while nobody sends.

    Whoever sends is answered; `going` is asked at least five times a second.
    """
    next_s = time.monotonic() + every_s
    while going():
        try:
            datagram, sender = listening.recvfrom(LARGEST_B + 1)
        except TimeoutError:
            datagram = b""
        except ConnectionResetError:  # Windows says so when the last answer found nobody
            continue
        now_s = time.monotonic()
        if datagram:
            reply = physics.answer(datagram, sender, now_s)
            if reply is not None:
                listening.sendto(reply, sender)
        if said is not None and now_s >= next_s:
            said()
            next_s = now_s + every_s


SIGNAL_US = (800, 2200)
"""Shortest and longest pulse that a speed controller takes for one; 0 is sent where there is no output."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PulseTable:
    """Thrusts of pulses for n thrusters.

    Parameters
    ----------
    channels : tuple of int
        Servo output of each thruster, from 1.
    thrusts_N : ndarray, shape (n, k)
        For the whole microseconds of `SIGNAL_US`, both ends included.
    """

    channels: tuple[int, ...]
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(len(self.channels), SIGNAL_US[1] - SIGNAL_US[0] + 1))

    @classmethod
    def of(cls, vehicle: Vehicle, parameters: Mapping[str, float] | None = None) -> PulseTable:
        """The table of a vehicle, its servo outputs and turned motors by the autopilot's parameters.

        Without parameters the thrusters are on the first outputs, in their order, and none is turned.

        Raises
        ------
        InputError
            If the parameters drive another number of motors than the vehicle has, or it has more than 16.
        """
        known = dict(parameters or {})
        channels = motor_channels(vehicle, known)
        directions = directions_of_motors(known, len(channels))
        supply_V = 0.0 if vehicle.curve is None else vehicle.curve.supply_V
        pulses = np.arange(SIGNAL_US[0], SIGNAL_US[1] + 1, dtype=np.float64)
        each = np.tile(pulses[:, None], (1, len(channels)))
        return cls(channels=channels, thrusts_N=thrusts_of_pulses(vehicle, each, directions, supply_V).T)

    def thrusts(self, pulses_us: tuple[int, ...]) -> Array:
        """Thrusts in N, shape (n,), of one frame's pulses; none where a pulse is no signal or its channel is absent."""
        asked = np.array([pulses_us[c - 1] if c <= len(pulses_us) else 0 for c in self.channels], dtype=np.int64)
        return self._looked_up(asked)

    def _looked_up(self, pulses_us: IntArray) -> Array:
        column = pulses_us - SIGNAL_US[0]
        signal = (column >= 0) & (column < self.thrusts_N.shape[1])
        rows = np.arange(len(pulses_us))
        return np.where(signal, self.thrusts_N[rows, np.clip(column, 0, self.thrusts_N.shape[1] - 1)], 0.0)

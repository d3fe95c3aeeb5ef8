"""Answers the firmware's frames: pulses move a vehicle in its water by one step, its true motion goes back.

No socket and no clock of its own, so that a test, or a stand-in in the same process, calls `answer` directly; the
sockets are in `udp.py`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise_ardusub.physics.datagrams import LARGEST_B, PhysicsState, read_request, write_reply
from wakewise_ardusub.physics.frames import FrameCounter

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

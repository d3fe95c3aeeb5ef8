"""Controls of a flight: a lease with one holder, and the holder's sticks as the flight reads them.

The page's messages come in the server's thread, the flight reads in its own. `ControlMailbox` is a `ControlSource` that
protects the state machine `ControlLease` by a lock.

Each transition of `ControlLease` takes a time of a monotonic clock and gives the next state. Its rules
(docs/research-log/0044):

- One holder. The controls are given if they are free or the lease has lapsed (`LEASE_TIMEOUT_S` without sticks). Else
  the holder is asked and may hand them over. They are never taken from an active holder.
- A lapsed lease is free for any client. The holder's next sticks renew it until another client has it, for `FORGET_S`.
- Sticks count by their number: a repeated or older one is dropped. Sticks older than `INPUT_TIMEOUT_S` are zero. Their
  age counts from the time of sending, by the difference of two clocks: the delay beyond that of the fastest message of
  this lease.
- After a gap of `INPUT_TIMEOUT_S` sticks count again once they were centred.
"""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.operation.teleop.input.controls import CENTRED, Controls, ControlSource

INPUT_TIMEOUT_S = 0.3
LEASE_TIMEOUT_S = 1.0
FORGET_S = 10.0
_MOST_PRESSED = 16
_COMPARED = 250
"""Messages over which two clocks are compared: more than come in while a lease is kept without any (`FORGET_S`)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HolderInput:
    """The holder's last sticks, their time of arrival, and their time of sending by this side's clock.

    `quickest_s` is the least difference of the two clocks over the last `compared` messages: the delay of the fastest
    one plus the offset of the clocks. `before_s` is that of the messages before those. Old values are dropped, because
    a clock may stop for a while, as in a suspended laptop.
    """

    seq: int = -1
    axes: Array = field(default_factory=lambda: CENTRED.axes)
    sent_s: float = -math.inf
    came_s: float = -math.inf
    quickest_s: float = math.inf
    before_s: float = math.inf
    compared: int = 0

    def then(self, seq: int, t_s: float, axes: Array, now_s: float) -> HolderInput:
        """The next message."""
        forget = self.compared >= _COMPARED
        quickest = min(now_s - t_s, math.inf if forget else self.quickest_s)
        before = self.quickest_s if forget else self.before_s
        return HolderInput(
            seq=seq,
            axes=axes,
            sent_s=t_s + min(quickest, before),
            came_s=now_s,
            quickest_s=quickest,
            before_s=before,
            compared=1 if forget else self.compared + 1,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLease:
    """Holder, lease, the client that requests the controls, and the holder's sticks.

    `armed`: the sticks have effect; not so after a gap, until they were centred.
    """

    holder: str | None = None
    lease: str | None = None
    renewed_s: float = -math.inf
    asked_by: str | None = None
    sticks: HolderInput = field(default_factory=HolderInput)
    armed: bool = True
    pressed: tuple[str, ...] = ()

    def held(self, now_s: float) -> bool:
        """Whether there is a holder and the lease has not lapsed."""
        return self.holder is not None and now_s - self.renewed_s <= LEASE_TIMEOUT_S

    def axes(self, now_s: float) -> Array:
        """Sticks with effect now, shape (5,): zero if they are old or without a holder."""
        fresh = self.armed and self.held(now_s) and now_s - self.sticks.sent_s <= INPUT_TIMEOUT_S
        return self.sticks.axes if fresh else np.zeros_like(CENTRED.axes)

    def ask(self, client: str, now_s: float, lease: str, force: bool = False) -> tuple[ControlLease, str]:
        """A client requests the controls, to be given under a new `lease`; the answer in words.

        They are given if they are free or the lease has lapsed. Else the holder is asked; `force` is refused.
        """
        if self.holder == client and self.held(now_s):
            return self, "the helm is yours already"
        if not self.held(now_s):
            return self._given(client, now_s, lease), "the helm is yours"
        if force:
            return self, "refused: the helm is in a hand that flies; it may be taken once that has been quiet for 1 s"
        if self.asked_by not in (None, client):
            return self, "somebody else has asked already"
        return replace(self, asked_by=client), "asked; the holder must agree"

    def consent(self, client: str, to: str, yes: bool, now_s: float, lease: str) -> tuple[ControlLease, str]:
        """The holder's answer to a request."""
        if client != self.holder or not self.held(now_s):
            return self, "not yours to give"
        if to != self.asked_by:
            return self, "nobody of that name has asked"
        if not yes:
            return replace(self, asked_by=None), "the holder keeps the helm"
        return self._given(to, now_s, lease), "the helm was handed over"

    def left(self, client: str) -> ControlLease:
        """A client gives the controls back, or has disconnected: its sticks are zero at once."""
        if client == self.holder:
            return replace(
                self, holder=None, lease=None, renewed_s=-math.inf, sticks=HolderInput(), armed=True, pressed=()
            )
        return replace(self, asked_by=None) if client == self.asked_by else self

    def moved(
        self, client: str, lease: str, seq: int, t_ms: float, axes: Array, now_s: float
    ) -> tuple[ControlLease, bool]:
        """The lease after sticks of a client, and whether they were accepted."""
        if not self.may(client, lease, now_s) or seq <= self.sticks.seq or not math.isfinite(t_ms):
            return self, False
        sticks = self.sticks.then(seq, 1e-3 * t_ms, axes, now_s)
        paused = self.sticks.seq >= 0 and now_s - self.renewed_s > INPUT_TIMEOUT_S
        armed = (self.armed and not paused) or not axes.any()
        return replace(self, sticks=sticks, armed=armed, renewed_s=now_s), True

    def press(self, client: str, lease: str, what: str, now_s: float) -> tuple[ControlLease, bool]:
        """The lease after a button of a client, and whether it was accepted."""
        if not self.may(client, lease, now_s) or len(self.pressed) >= _MOST_PRESSED:
            return self, False
        return replace(self, pressed=(*self.pressed, what)), True

    def may(self, client: str, lease: str, now_s: float) -> bool:
        """Whether this client, with this lease, may change what is flown."""
        now = self.tick(now_s)
        return client == now.holder and lease == now.lease

    def tick(self, now_s: float) -> ControlLease:
        """The lease now; void if it lapsed longer than `FORGET_S` ago."""
        if self.holder is not None and now_s - self.renewed_s > FORGET_S:
            return replace(self.left(self.holder), asked_by=None)
        return self

    def _given(self, client: str, now_s: float, lease: str) -> ControlLease:
        return ControlLease(holder=client, lease=lease, renewed_s=now_s)


DEVICE = "gamepad"
"""The client of a gamepad at this computer."""
_KEPT = 1024


@dataclass(frozen=True, kw_only=True)
class ControlOwnership:
    """Ids of the holder and the requesting client, the lease (secret to others), and whether its sticks have effect."""

    holder: str | None
    lease: str | None
    asked_by: str | None
    flying: bool
    armed: bool


class ControlMailbox:
    """The controls of one flight.

    `clock`: monotonic, s. `device`: a gamepad at this computer. It takes the controls when they are free and it moves,
    and gives them back when it is unplugged.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, device: ControlSource | None = None) -> None:
        self.clock = clock
        self._device = device
        self._lease = ControlLease()
        self._lock = threading.Lock()
        self._unflown_s: float | None = None
        self._flown = ("", -1)
        self._waits_s: deque[float] = deque(maxlen=_KEPT)
        self._device_lease, self._device_seq = "", 0

    @property
    def holding(self) -> ControlOwnership:
        """Holder and lease now."""
        with self._lock:
            self._lease = lease = self._lease.tick(self.clock())
            flying = lease.held(self.clock())
            return ControlOwnership(
                holder=lease.holder, lease=lease.lease, asked_by=lease.asked_by, flying=flying, armed=lease.armed
            )

    def ask(self, client: str, force: bool = False) -> str:
        """Request the controls for a client; the answer in words."""
        with self._lock:
            self._lease, words = self._lease.ask(client, self.clock(), secrets.token_urlsafe(12), force)
            return words

    def consent(self, client: str, to: str, yes: bool) -> str:
        """The holder's answer to a request; the result in words."""
        with self._lock:
            self._lease, words = self._lease.consent(client, to, yes, self.clock(), secrets.token_urlsafe(12))
            return words

    def left(self, client: str) -> None:
        """Give the controls of a client back."""
        with self._lock:
            self._lease = self._lease.left(client)

    def moved(self, client: str, lease: str, seq: int, t_ms: float, axes: Array) -> bool:
        """Take in sticks of a client; whether they were accepted."""
        with self._lock:
            self._lease, taken = self._lease.moved(client, lease, seq, t_ms, axes, self.clock())
            return taken

    def press(self, client: str, lease: str, what: str) -> bool:
        """Take in a button of a client; whether it was accepted."""
        with self._lock:
            self._lease, taken = self._lease.press(client, lease, what, self.clock())
            return taken

    def may(self, client: str, lease: str) -> bool:
        """Whether this client has the controls."""
        with self._lock:
            return self._lease.may(client, lease, self.clock())

    def read(self, time_s: float) -> Controls | None:
        """The holder's sticks now; None without a holder, or if the lease has lapsed."""
        if self._device is not None:
            self._read_device(time_s)
        with self._lock:
            now_s = self.clock()
            self._lease = lease = self._lease.tick(now_s)
            pressed = lease.pressed
            if pressed:
                self._lease = replace(lease, pressed=())
            if not lease.held(now_s):
                return Controls(axes=np.zeros(5), pressed=pressed) if pressed else None
            sticks = lease.sticks
            if sticks.seq >= 0 and (lease.lease or "", sticks.seq) != self._flown:
                self._flown, self._unflown_s = (lease.lease or "", sticks.seq), sticks.came_s
            return Controls(axes=lease.axes(now_s), pressed=pressed)

    def flown(self) -> None:
        """Thrusts were sent, which answer the sticks read before."""
        with self._lock:
            if self._unflown_s is not None:
                self._waits_s.append(self.clock() - self._unflown_s)
                self._unflown_s = None

    @property
    def waits_s(self) -> tuple[float, ...]:
        """Times from the arrival of sticks to the thrusts that answer them, s."""
        with self._lock:
            return tuple(self._waits_s)

    @property
    def stick_to_thrust_ms_p99(self) -> float | None:
        """The 99th percentile of `waits_s`; None before any."""
        waits_s = self.waits_s
        return 1e3 * float(np.percentile(waits_s, 99)) if waits_s else None

    def _read_device(self, time_s: float) -> None:
        assert self._device is not None
        controls = self._device.read(time_s)
        if controls is None:
            self.left(DEVICE)
            return
        holding = self.holding
        if holding.holder != DEVICE:
            if controls.centred and not controls.pressed:
                return
            self.ask(DEVICE)
            holding = self.holding
        if holding.holder != DEVICE or holding.lease is None:
            return
        self._device_seq += 1
        self.moved(DEVICE, holding.lease, self._device_seq, 1e3 * self.clock(), controls.axes)
        for what in controls.pressed:
            self.press(DEVICE, holding.lease, what)

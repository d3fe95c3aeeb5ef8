"""Where the flight meets the helm: a `ControlSource` that several threads may touch.

The page's messages come in the server's thread, the flight reads in its own; between them stands the state machine of
`wakewise.ui.cockpit.control_mailbox` behind a lock that nobody holds for longer than a move of it takes.

Who has the helm: one lease, renewed by the sticks of its holder, and what of those sticks may be flown.

`ControlLease` is a pure state machine: each move takes a time of one clock that never goes back and gives the next
state. Its rules are those that others learnt with sticks in browsers (docs/research-log/0044):

- One holder. The helm is taken where it is free or has lapsed (`LEASE_TIMEOUT_S` without sticks), else the holder is
asked and
  may hand it over; nothing forces it out of a hand that flies.
- A lapsed lease is anybody's. Its holder's next sticks take it up again while nobody has, for `FORGET_S`; after that it
  is void, so that a page left open for a day holds nothing.
- Sticks count by their number: a replay or an older one is dropped. Sticks older than `INPUT_TIMEOUT_S` when they would
be
  flown are zero. Their age counts from when they were sent, as far as two clocks can tell: by how much longer than the
  fastest of this lease they were under way.
- After a pause of `INPUT_TIMEOUT_S` sticks count again once they were seen centred: what was held meanwhile was not
meant.
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
    """What the holder's sticks last said, when that came, and when by this side's clock it was sent.

    `quickest_s` is the least difference of the two clocks over the last messages, the way of the fastest of them and
    what lies between their zeros; `before_s` that of the messages before those, and `compared` how many they are. What
    is old is forgotten, since a clock may stand still for a while, as in a laptop that slept.
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
    """Who holds the helm, with which lease, who asks for it, and the hands of the holder.

    `armed` tells whether the sticks are flown: not after a pause, until they were let go.
    """

    holder: str | None = None
    lease: str | None = None
    renewed_s: float = -math.inf
    asked_by: str | None = None
    hands: HolderInput = field(default_factory=HolderInput)
    armed: bool = True
    pressed: tuple[str, ...] = ()

    def held(self, now_s: float) -> bool:
        """Whether somebody flies: there is a holder, and the lease has not lapsed."""
        return self.holder is not None and now_s - self.renewed_s <= LEASE_TIMEOUT_S

    def axes(self, now_s: float) -> Array:
        """Sticks as they may be flown now, shape (5,): zero where they are old or nobody's."""
        fresh = self.armed and self.held(now_s) and now_s - self.hands.sent_s <= INPUT_TIMEOUT_S
        return self.hands.axes if fresh else np.zeros_like(CENTRED.axes)

    def ask(self, client: str, now_s: float, lease: str, force: bool = False) -> tuple[ControlLease, str]:
        """A client asks for the helm, to be given under a new `lease`; the answer in words.

        It is given where it is free or has lapsed. Else the holder is asked; whoever would `force` it is refused.
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
        """The holder's answer to the client who asked."""
        if client != self.holder or not self.held(now_s):
            return self, "not yours to give"
        if to != self.asked_by:
            return self, "nobody of that name has asked"
        if not yes:
            return replace(self, asked_by=None), "the holder keeps the helm"
        return self._given(to, now_s, lease), "the helm was handed over"

    def left(self, client: str) -> ControlLease:
        """A client gives the helm back, or is gone: its sticks are zero at once."""
        if client == self.holder:
            return replace(
                self, holder=None, lease=None, renewed_s=-math.inf, hands=HolderInput(), armed=True, pressed=()
            )
        return replace(self, asked_by=None) if client == self.asked_by else self

    def moved(
        self, client: str, lease: str, seq: int, t_ms: float, axes: Array, now_s: float
    ) -> tuple[ControlLease, bool]:
        """Sticks came in; whether they were taken."""
        if not self.may(client, lease, now_s) or seq <= self.hands.seq or not math.isfinite(t_ms):
            return self, False
        hands = self.hands.then(seq, 1e-3 * t_ms, axes, now_s)
        paused = self.hands.seq >= 0 and now_s - self.renewed_s > INPUT_TIMEOUT_S
        armed = (self.armed and not paused) or not axes.any()
        return replace(self, hands=hands, armed=armed, renewed_s=now_s), True

    def press(self, client: str, lease: str, what: str, now_s: float) -> tuple[ControlLease, bool]:
        """A button of the holder; whether it counts."""
        if not self.may(client, lease, now_s) or len(self.pressed) >= _MOST_PRESSED:
            return self, False
        return replace(self, pressed=(*self.pressed, what)), True

    def may(self, client: str, lease: str, now_s: float) -> bool:
        """Whether this client, with this lease, may change what is flown."""
        helm = self.tick(now_s)
        return client == helm.holder and lease == helm.lease

    def tick(self, now_s: float) -> ControlLease:
        """Time has passed: a lease that lapsed long ago is void."""
        if self.holder is not None and now_s - self.renewed_s > FORGET_S:
            return replace(self.left(self.holder), asked_by=None)
        return self

    def _given(self, client: str, now_s: float, lease: str) -> ControlLease:
        return ControlLease(holder=client, lease=lease, renewed_s=now_s)


DEVICE = "gamepad"
"""The client whose sticks are plugged into this computer."""
_KEPT = 1024


@dataclass(frozen=True, kw_only=True)
class ControlOwnership:
    """Who has the helm: ids of clients, the lease that only the holder is to be told, and whether its sticks count."""

    holder: str | None
    lease: str | None
    asked_by: str | None
    flying: bool
    armed: bool


class ControlMailbox:
    """The helm of one flight, and the sticks as the flight reads them.

    `clock`: seconds that never go back. `device`: sticks at this computer. They take the helm when it is free and they
    move; pulled out, they give it back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, device: ControlSource | None = None) -> None:
        self.clock = clock
        self._device = device
        self._helm = ControlLease()
        self._lock = threading.Lock()
        self._unflown_s: float | None = None
        self._flown = ("", -1)
        self._waits_s: deque[float] = deque(maxlen=_KEPT)
        self._device_lease, self._device_seq = "", 0

    @property
    def holding(self) -> ControlOwnership:
        """Who has the helm now."""
        with self._lock:
            self._helm = helm = self._helm.tick(self.clock())
            flying = helm.held(self.clock())
            return ControlOwnership(
                holder=helm.holder, lease=helm.lease, asked_by=helm.asked_by, flying=flying, armed=helm.armed
            )

    def ask(self, client: str, force: bool = False) -> str:
        """A client asks for the helm; the answer in words."""
        with self._lock:
            self._helm, words = self._helm.ask(client, self.clock(), secrets.token_urlsafe(12), force)
            return words

    def consent(self, client: str, to: str, yes: bool) -> str:
        """The holder answers who asked; the outcome in words."""
        with self._lock:
            self._helm, words = self._helm.consent(client, to, yes, self.clock(), secrets.token_urlsafe(12))
            return words

    def left(self, client: str) -> None:
        """A client gave the helm back, or is gone."""
        with self._lock:
            self._helm = self._helm.left(client)

    def moved(self, client: str, lease: str, seq: int, t_ms: float, axes: Array) -> bool:
        """Sticks came in; whether they were taken."""
        with self._lock:
            self._helm, taken = self._helm.moved(client, lease, seq, t_ms, axes, self.clock())
            return taken

    def press(self, client: str, lease: str, what: str) -> bool:
        """A button was pressed; whether it counts."""
        with self._lock:
            self._helm, taken = self._helm.press(client, lease, what, self.clock())
            return taken

    def may(self, client: str, lease: str) -> bool:
        """Whether this client may change what is flown."""
        with self._lock:
            return self._helm.may(client, lease, self.clock())

    def read(self, time_s: float) -> Controls | None:
        """The holder's hands now; None where nobody has the helm, or whoever has it has been quiet for a second."""
        if self._device is not None:
            self._read_device(time_s)
        with self._lock:
            now_s = self.clock()
            self._helm = helm = self._helm.tick(now_s)
            pressed = helm.pressed
            if pressed:
                self._helm = replace(helm, pressed=())
            if not helm.held(now_s):
                return Controls(axes=np.zeros(5), pressed=pressed) if pressed else None
            hands = helm.hands
            if hands.seq >= 0 and (helm.lease or "", hands.seq) != self._flown:
                self._flown, self._unflown_s = (helm.lease or "", hands.seq), hands.came_s
            return Controls(axes=helm.axes(now_s), pressed=pressed)

    def flown(self) -> None:
        """Thrusts were given: whatever sticks were read before that have had their effect."""
        with self._lock:
            if self._unflown_s is not None:
                self._waits_s.append(self.clock() - self._unflown_s)
                self._unflown_s = None

    @property
    def waits_s(self) -> tuple[float, ...]:
        """From a message's arrival to thrusts that know of it, of the last ones flown."""
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

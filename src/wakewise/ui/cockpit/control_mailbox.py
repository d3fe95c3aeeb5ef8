"""Where the flight meets the helm: a `ControlSource` that several threads may touch.

The page's messages come in the server's thread, the flight reads in its own; between them stands the state machine of
`wakewise.ui.cockpit.control_lease` behind a lock that nobody holds for longer than a move of it takes.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.operation.teleop.input.controls import Controls, ControlSource
from wakewise.ui.cockpit.control_lease import ControlLease

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

    Parameters
    ----------
    clock : callable
        Seconds that never go back.
    device : ControlSource, optional
        Sticks at this computer. They take the helm when it is free and they move; pulled out, they give it back.
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

"""Who has the helm: one lease, renewed by the sticks of its holder, and what of those sticks may be flown.

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
from dataclasses import dataclass, field, replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.operation.teleop.input.controls import CENTRED

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

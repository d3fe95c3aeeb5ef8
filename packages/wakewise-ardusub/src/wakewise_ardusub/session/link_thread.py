"""The thread that receives messages of a link and ticks its output gate."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Protocol

from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import RELEASES, TICK_S, OutputGate

MOST_AT_ONCE = 50
"""Messages taken between two looks at the clock, however many wait."""


class MessageReceiver(Protocol):
    """Where messages come in."""

    def receive(self, timeout_s: float) -> tuple[Iterable[MavlinkMessage], int]:
        """Messages that came, and bytes that are none; waits for the first at most so long."""
        ...


class LinkThread:
    """Runs until it is stopped; what breaks it is kept in `fault`, after the output gate has let go.

    `heard` is called with each message after the gate has taken it; must be quick.
    """

    def __init__(
        self, connection: MessageReceiver, gate: OutputGate, heard: Callable[[MavlinkMessage], object] | None = None
    ) -> None:
        self._connection, self._gate, self._heard = connection, gate, heard
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self.fault: BaseException | None = None

    def start(self) -> None:
        """Begin to listen."""
        self._gate.begin()
        self._thread.start()

    def stop(self, why: str) -> None:
        """Let go of the vehicle, say so as often as it takes, and end."""
        self._gate.end(why)
        self._over.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        gate = self._gate
        try:
            due_s, left = gate.clock(), RELEASES + 1
            while left:
                said, noise = self._connection.receive(max(due_s - gate.clock(), 0.0))
                if noise:
                    gate.noise(noise)
                for k, message in enumerate(said):
                    gate.take(message)
                    if self._heard is not None:
                        self._heard(message)
                    if k % MOST_AT_ONCE == 0 and gate.clock() >= due_s:
                        gate.tick()
                        due_s = gate.clock() + TICK_S
                if gate.clock() >= due_s:
                    gate.tick()
                    due_s = max(due_s + TICK_S, gate.clock())
                    left -= self._over.is_set()
        except BaseException as fault:  # whatever it is, the vehicle is let go first
            self.fault = fault
            gate.end(f"the link broke ({type(fault).__name__}: {fault})")

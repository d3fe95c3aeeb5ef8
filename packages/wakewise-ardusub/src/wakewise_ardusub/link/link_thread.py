"""The thread between a connection and its warden: takes what comes, and ticks whether anything comes or not."""

from __future__ import annotations

import threading
from collections.abc import Iterable
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
    """Runs until it is stopped; what breaks it is kept in `fault`, after the warden has let go."""

    def __init__(self, connection: MessageReceiver, warden: OutputGate) -> None:
        self._connection, self._warden = connection, warden
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self.fault: BaseException | None = None

    def start(self) -> None:
        """Begin to listen."""
        self._warden.begin()
        self._thread.start()

    def stop(self, why: str) -> None:
        """Let go of the vehicle, say so as often as it takes, and end."""
        self._warden.end(why)
        self._over.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        warden = self._warden
        try:
            due_s, left = warden.clock(), RELEASES + 1
            while left:
                said, noise = self._connection.receive(max(due_s - warden.clock(), 0.0))
                if noise:
                    warden.noise(noise)
                for k, message in enumerate(said):
                    warden.take(message)
                    if k % MOST_AT_ONCE == 0 and warden.clock() >= due_s:
                        warden.tick()
                        due_s = warden.clock() + TICK_S
                if warden.clock() >= due_s:
                    warden.tick()
                    due_s = max(due_s + TICK_S, warden.clock())
                    left -= self._over.is_set()
        except BaseException as fault:  # whatever it is, the vehicle is let go first
            self.fault = fault
            warden.end(f"the link broke ({type(fault).__name__}: {fault})")

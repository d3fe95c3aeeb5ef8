"""The vehicle in the sea as a `Plant`: thrusts go to the warden, what was measured meanwhile comes back.

A step holds its thrusts by waiting until shortly before the flight's clock has come to the step's end: the estimator
takes in what it returns meanwhile, so that the next thrusts are decided on time, by what is nearly as fresh as can be.
Whether thrusts go out is the warden's to say.

The thread between a connection and its warden: takes what comes, and ticks whether anything comes or not.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Measurement, TruthProvider
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import RELEASES, TICK_S, OutputGate

EARLY = 0.1
"""Share of a step by which measurements are handed over before its end: 10 ms at 10 Hz, where a filter takes 4."""


class FlightClock(Protocol):
    """When moments of a flight are by the computer's clock, which is also the warden's."""

    def due_s(self, time_s: float) -> float:
        """The computer's time at which `time_s` of the flight has come."""
        ...


@dataclass(kw_only=True, eq=False)
class ArduSubPlant:
    """The vehicle of a warden; implements `wakewise.core.interfaces.Plant`.

    Parameters
    ----------
    warden : OutputGate
    clock : FlightClock
    wait : callable
        Waits so many seconds, or less where there is nothing to wait for any more.
    entry : callable
        In which engagement the controller decided what it hands over; None: in none, and nothing is sent.
    """

    gate: OutputGate
    clock: FlightClock
    wait: Callable[[float], object]
    entry: Callable[[], int | None]
    _time_s: float = 0.0

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Send thrusts, shape (n,), if they may be, and return what was measured until they are nearly due again."""
        entry = self.entry()
        if entry is not None:
            self.gate.command(thrusts_N, entry)
        self._time_s += dt_s
        left_s = self.clock.due_s(self._time_s) - EARLY * dt_s - self.gate.clock()
        if left_s > 0.0:
            self.wait(left_s)
        begun_s = self.clock.due_s(0.0)
        return tuple(replace(found, time_s=found.time_s - begun_s) for found in self.gate.measurements())


@dataclass(kw_only=True, eq=False)
class ArduSubWorld:
    """Where a real vehicle flies; implements `wakewise.core.interfaces.World`. It does not wait, and nobody knows its
    truth.

    `plant` is what makes the plant when a flight begins.
    """

    plant: Callable[[], ArduSubPlant]
    name: str = "sea"
    waits: bool = field(default=False, init=False)

    def begin(self) -> tuple[ArduSubPlant, TruthProvider | None]:
        """The vehicle, and no witness."""
        return self.plant(), None


MOST_AT_ONCE = 50
"""Messages taken between two looks at the clock, however many wait."""


class MessageReceiver(Protocol):
    """Where messages come in."""

    def receive(self, timeout_s: float) -> tuple[Iterable[MavlinkMessage], int]:
        """Messages that came, and bytes that are none; waits for the first at most so long."""
        ...


class LinkThread:
    """Runs until it is stopped; what breaks it is kept in `fault`, after the warden has let go."""

    def __init__(self, connection: MessageReceiver, gate: OutputGate) -> None:
        self._connection, self._gate = connection, gate
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

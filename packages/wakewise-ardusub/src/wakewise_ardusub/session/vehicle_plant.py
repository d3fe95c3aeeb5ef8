"""A real vehicle as the plant and world of a flight.

`ArduSubPlant` passes thrusts to the output gate and returns the measurements since. A step waits until shortly before
the flight's clock has reached its end: the estimator processes the measurements meanwhile, so that the next thrusts are
computed on time from data that are nearly as fresh as possible. The gate decides whether thrusts are sent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Measurement, TruthProvider
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.session.camera_mount import MountControl

EARLY = 0.1
"""Share of a step by which measurements are handed over before its end: 10 ms at 10 Hz, where a filter takes 4."""


class FlightClock(Protocol):
    """When moments of a flight are by the computer's clock, which is also the output gate's."""

    def due_s(self, time_s: float) -> float:
        """The computer's time at which `time_s` of the flight has come."""
        ...


@dataclass(kw_only=True, eq=False)
class ArduSubPlant:
    """The vehicle of an output gate; implements `wakewise.core.interfaces.Plant`.

    Parameters
    ----------
    gate : OutputGate
    clock : FlightClock
    wait : callable
        Waits so many seconds, or less where there is nothing to wait for any more.
    entry : callable
        In which engagement the controller decided what it hands over; None: in none, and nothing is sent.
    mount : MountControl, optional
        The joint of its camera.
    """

    gate: OutputGate
    clock: FlightClock
    wait: Callable[[float], object]
    entry: Callable[[], int | None]
    mount: MountControl | None = None
    _time_s: float = 0.0

    def aim(self, tilt_rad: float) -> None:
        """Turn the camera's joint while engaged."""
        if self.mount is not None:
            entry = self.entry()
            self.mount.ask(tilt_rad, engaged=entry is not None and entry == self.gate.entry)

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Send thrusts, shape (n,), if they may be, and return what was measured until they are nearly due again."""
        entry = self.entry()
        if entry is not None:
            self.gate.command(thrusts_N, entry)
        self._time_s += dt_s
        left_s = self.clock.due_s(self._time_s) - EARLY * dt_s - self.gate.clock()
        if left_s > 0.0:
            self.wait(left_s)
        begun_s, mount = self.clock.due_s(0.0), self.mount
        tilt_rad = mount.current_angle_rad() if mount is not None and mount.reported else None
        return tuple(
            replace(found, time_s=found.time_s - begun_s, tilt_rad=tilt_rad) for found in self.gate.measurements()
        )


@dataclass(kw_only=True, eq=False)
class ArduSubWorld:
    """Where a real vehicle flies; implements `wakewise.core.interfaces.World`. It does not wait and has no truth.

    `plant` is what makes the plant when a flight begins.
    """

    plant: Callable[[], ArduSubPlant]
    name: str = "sea"
    waits: bool = field(default=False, init=False)

    def begin(self) -> tuple[ArduSubPlant, TruthProvider | None]:
        """The vehicle, and no truth provider."""
        return self.plant(), None

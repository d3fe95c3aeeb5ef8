"""Pilot, controller and estimator that take turns with the pilot of a real vehicle.

`FlightOwnership` records who flies, the pilot or the controller, once for each step; `EngagedPilot`,
`EngagedController` and `ServoEstimator` act on it. `GroundStationInput` reads the pilot's sticks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Command, Controller, Estimator, Goal, Measurement
from wakewise.operation.teleop.assisted import AssistedPilot
from wakewise.operation.teleop.input.controls import CENTRED, Controls
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.session.camera_mount import MountControl


@dataclass(kw_only=True, eq=False)
class FlightOwnership:
    """In which engagement the present step is flown, None in none, and when in the flight that began."""

    entry: int | None = None
    began_s: float = 0.0


@dataclass(kw_only=True, eq=False)
class GroundStationInput:
    """A `ControlSource`: the sticks that the pilot moves at the ground station, and the buttons that mean something."""

    gate: OutputGate
    stale_s: float = 0.3

    def read(self, _time_s: float) -> Controls | None:
        """The sticks as last heard; None where nobody was heard for a while."""
        sticks, pressed = self.gate.known.sticks, self.gate.pressed()
        if sticks is None or self.gate.clock() - sticks.came_s > self.stale_s:
            return Controls(axes=CENTRED.axes, pressed=pressed) if pressed else None
        return Controls(axes=sticks.axes, pressed=pressed)


@dataclass(kw_only=True, eq=False)
class EngagedPilot:
    """A `Pilot`: the assisted one while engaged, on its own clock; else the vehicle is desired to be where it is.

    `photographed`: called with the step's time and estimate for each photograph. `mount`: of its camera, which is where
    the pilot had turned it as an engagement begins.
    """

    inner: AssistedPilot
    gate: OutputGate
    turn: FlightOwnership
    photographed: Callable[[float, BodyState], None]
    mount: MountControl | None = None
    _step: tuple[float, BodyState] = field(init=False)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """What is wanted now; settles in which engagement this step is flown."""
        self._step = time_s, estimate
        self.gate.estimated(estimate)
        entry, turn = self.gate.entry, self.turn
        if entry is None:
            turn.entry = None
            return Goal(X_WB=estimate.X_WB, nu_B=estimate.nu_B)
        begins = entry != turn.entry
        if begins:
            turn.entry, turn.began_s = entry, time_s
        goal = self.inner.goal(time_s - turn.began_s, estimate)
        if begins and self.mount is not None and self.mount.reported:
            self.inner.motion = replace(self.inner.motion, tilt_rad=self.mount.current_angle_rad())
            goal = replace(goal, tilt_rad=self.inner.motion.tilt_rad)
        for note in self.inner.notes():
            if self.gate.journal is not None:
                self.gate.journal.write("note", level=note.level, words=note.text)
        return goal

    def taken(self) -> tuple[str, ...]:
        """Photographs and the end asked for since the last call."""
        actions = self.inner.taken() if self.turn.entry is not None else self.gate.pressed()
        found = tuple(what for what in actions if what in ("capture", "stop"))
        for _ in range(found.count("capture")):
            self.photographed(*self._step)
        return found

    @property
    def leg(self) -> str:
        """What is flown now, as the record calls it."""
        return self.inner.leg if self.turn.entry is not None else "the pilot flies"


@dataclass(frozen=True, eq=False)
class EngagedControllerState:
    """State of a controller that rests while it is not engaged."""

    entry: int | None
    inner: Any


@dataclass(kw_only=True, eq=False)
class EngagedController:
    """A `Controller` that begins afresh at each engagement and asks for nothing between them."""

    inner: Controller[Any]
    turn: FlightOwnership
    thrusters: int

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.inner.name

    def init(self) -> EngagedControllerState:
        """At rest."""
        return EngagedControllerState(None, None)

    def step(
        self, state: EngagedControllerState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[EngagedControllerState, Command]:
        """The method's thrusts while engaged, else none."""
        entry = self.turn.entry
        if entry is None:
            return EngagedControllerState(None, None), Command(thrusts_N=np.zeros(self.thrusters), wrench_B=np.zeros(6))
        inner = state.inner if entry == state.entry else self.inner.init()
        inner, command = self.inner.step(inner, dt_s, estimate, goal)
        return EngagedControllerState(entry, inner), command


@dataclass(kw_only=True, eq=False)
class ServoEstimator:
    """An `Estimator` that is told what the servos do while the pilot flies."""

    inner: Estimator[Any]
    turn: FlightOwnership
    flown_N: Callable[[], Array]

    def init(self, start: BodyState) -> Any:
        """State at the start."""
        return self.inner.init(start)

    def step(
        self, state: Any, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[Any, BodyState]:
        """Advance under the thrusts that act."""
        return self.inner.step(state, dt_s, measurements, self.flown_N() if self.turn.entry is None else thrusts_N)

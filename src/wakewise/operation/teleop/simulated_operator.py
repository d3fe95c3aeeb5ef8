"""The person of `wakewise.operation.teleop.input` at the desk's sticks: eyes on the video, the same `Controls` as any
other hands.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wakewise.control.intent import FULL_M_S, FULL_RAD_S
from wakewise.control.operator_model import (
    CameraMotion,
    OperatorModel,
    OperatorModelState,
    begin,
    sample_operator,
    steer,
)
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Pilot
from wakewise.operation.teleop.human_pilot import STICKS, viewed_point
from wakewise.operation.teleop.input import CENTRED, Controls


@dataclass(kw_only=True, eq=False)
class SimulatedOperatorInput:
    """A `ControlSource` with eyes: a drawn person who would like to see what a pilot says.

    Parameters
    ----------
    wish : Pilot
        What the person would like to see: goals by the clock.
    X_BC : Pose
        Camera mount.
    target_W_m : ndarray, shape (3,)
        What is to be kept in the picture.
    dt_s : float
        Time between two looks.
    seed : int
        Which person it is.
    pressed : tuple of str
        What the person presses on taking the sticks.
    """

    wish: Pilot
    X_BC: Pose
    target_W_m: Array
    dt_s: float
    seed: int
    pressed: tuple[str, ...] = ("operator",)
    person: OperatorModel = field(init=False)
    _state: OperatorModelState = field(init=False)
    _controls: Controls = CENTRED

    def __post_init__(self) -> None:
        self.person = sample_operator(self.seed, STICKS)
        self._state = begin(self.person)

    def look(self, time_s: float, estimate: BodyState, share: float) -> None:
        """See where the vehicle is, and move the sticks; `share` is what full stick asks for, of the fastest."""
        if time_s <= 0.0:
            self._state = begin(self.person)
        wished = self.wish.goal(time_s, estimate)
        view = CameraMotion.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        wish = CameraMotion.of(wished.X_WB, wished.nu_B, self.X_BC)
        seen = viewed_point(wished, self.X_BC, self.target_W_m)
        self._state, asked = steer(self.person, self._state, self.dt_s, view, wish, seen)
        full = share * np.array([FULL_M_S, FULL_M_S, FULL_M_S, FULL_RAD_S])
        pushed = np.clip(asked / full, -1.0, 1.0)
        first = time_s <= 0.0
        self._controls = Controls(axes=np.array([*pushed, 0.0]), pressed=self.pressed if first else ())

    def read(self, time_s: float) -> Controls:  # noqa: ARG002  (of the last look)
        """The sticks as they were moved on the last look."""
        return self._controls

"""Inputs of an operator at one instant, from any device: gamepad, keyboard, a page in the browser, a script.

Axes are shares of full stick in the vehicle's level frame: forward along its heading, right, down, turn clockwise as
seen from above, tilt of the camera upwards. The operator's settings (gain, precise mode) scale full stick
(`wakewise.operation`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError

CONTROL_AXES = ("forward", "right", "down", "turn", "tilt")
ACTIONS = ("capture", "hold", "scan", "operator", "stop", "precise", "gain_up", "gain_down")
"""Actions of buttons: take a photograph; hold the position; fly the mission; fly by sticks; end the flight; precise
mode on or off; the gain a step up or down."""
Box = tuple[float, float, float, float]
LEAST_SIDE = 0.01
"""Least side of a box drawn in a picture, (left, top, right, bottom) in shares of it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Controls:
    """Axes as shares of full stick, -1 to 1, in the order of `CONTROL_AXES`, shape (5,), and what was pressed since.

    Raises InputError if an axis is not a number within -1 to 1, or an action is unknown.
    """

    axes: Array
    pressed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, axes=(len(CONTROL_AXES),))
        if not np.all(np.abs(self.axes) <= 1.0):  # also refuses what is not a number
            raise InputError(f"axes: {np.round(self.axes, 3).tolist()}, must be numbers from -1 to 1")
        unknown = [name for name in self.pressed if name not in ACTIONS]
        if unknown:
            raise InputError(f"pressed: {unknown[0]!r} is not one of {', '.join(ACTIONS)}")

    @property
    def centred(self) -> bool:
        """Whether all axes are zero."""
        return not self.axes.any()


CENTRED = Controls(axes=np.zeros(len(CONTROL_AXES)))
"""All axes zero."""


class ControlSource(Protocol):
    """A source of inputs.

    A source that depends on the vehicle has a method `look(time_s, estimate, share)`, called before each read with the
    share of the largest speeds at full stick. A replay has `settings_at(time_s)`: the settings at that time, by field.
    """

    def read(self, time_s: float) -> Controls | None:
        """Inputs at `time_s` of the flight, at most once a control step; None: no inputs, so stop and hold."""
        ...


class TimedControls:
    """A `ControlSource` of entries in the order of time; each holds until the next, `before` until the first.

    `times_s` increases. A button is pressed once. A time before that of the last call starts again.
    """

    def __init__(
        self, times_s: Sequence[float] | Array, entries: Sequence[Controls | None], before: Controls | None
    ) -> None:
        self._times_s, self._entries, self._before = times_s, entries, before
        self._next, self._until_s = 0, -1.0

    def read(self, time_s: float) -> Controls | None:
        """The entry at `time_s`, with the buttons pressed since the last call."""
        if time_s < self._until_s:
            self._next = 0
        self._until_s, pressed = time_s, list[str]()
        while self._next < len(self._entries) and self._times_s[self._next] <= time_s + 1e-9:
            entry = self._entries[self._next]
            pressed += () if entry is None else entry.pressed
            self._next += 1
        held = self._before if self._next == 0 else self._entries[self._next - 1]
        return None if held is None else Controls(axes=held.axes, pressed=tuple(pressed))


def apply_dead_zone(raw: Iterable[float], dead_zone: float = 0.05) -> Array:
    """Axes of a device with a dead zone, shape (5,); the rest of the range is scaled to full stick.

    What is not a number counts as centred, what is larger than full as full.
    """
    out = np.zeros(len(CONTROL_AXES))
    for k, value in enumerate(raw):
        if k < len(out) and math.isfinite(value) and abs(value) > dead_zone:
            out[k] = math.copysign(min((abs(value) - dead_zone) / (1.0 - dead_zone), 1.0), value)
    return out

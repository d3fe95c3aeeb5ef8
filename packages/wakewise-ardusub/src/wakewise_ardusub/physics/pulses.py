"""Servo pulses to thrusts, as the vehicle's speed controllers and propellers make them; for every new frame, so quick.

What one pulse gives is looked up in a table made once, a row per thruster and a column per microsecond. A motor that
turns the other way round than the vehicle file says (MOT_n_DIRECTION of -1 makes up for it in the autopilot) does so
here, too: the autopilot's turned pulse meets the turned motor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.motors import directions_of_motors, motor_channels, thrusts_of_pulses

SIGNAL_US = (800, 2200)
"""Shortest and longest pulse that a speed controller takes for one; 0 is sent where there is no output."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PulseTable:
    """Thrusts of pulses for n thrusters.

    Parameters
    ----------
    channels : tuple of int
        Servo output of each thruster, from 1.
    thrusts_N : ndarray, shape (n, k)
        For the whole microseconds of `SIGNAL_US`, both ends included.
    """

    channels: tuple[int, ...]
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(len(self.channels), SIGNAL_US[1] - SIGNAL_US[0] + 1))

    @classmethod
    def of(cls, vehicle: Vehicle, parameters: Mapping[str, float] | None = None) -> PulseTable:
        """The table of a vehicle, its servo outputs and turned motors by the autopilot's parameters.

        Without parameters the thrusters are on the first outputs, in their order, and none is turned.

        Raises
        ------
        InputError
            If the parameters drive another number of motors than the vehicle has, or it has more than 16.
        """
        known = dict(parameters or {})
        channels = motor_channels(vehicle, known)
        directions = directions_of_motors(known, len(channels))
        supply_V = 0.0 if vehicle.curve is None else vehicle.curve.supply_V
        pulses = np.arange(SIGNAL_US[0], SIGNAL_US[1] + 1, dtype=np.float64)
        each = np.tile(pulses[:, None], (1, len(channels)))
        return cls(channels=channels, thrusts_N=thrusts_of_pulses(vehicle, each, directions, supply_V).T)

    def thrusts(self, pulses_us: tuple[int, ...]) -> Array:
        """Thrusts in N, shape (n,), of one frame's pulses; none where a pulse is no signal or its channel is absent."""
        asked = np.array([pulses_us[c - 1] if c <= len(pulses_us) else 0 for c in self.channels], dtype=np.int64)
        return self._looked_up(asked)

    def _looked_up(self, pulses_us: IntArray) -> Array:
        column = pulses_us - SIGNAL_US[0]
        signal = (column >= 0) & (column < self.thrusts_N.shape[1])
        rows = np.arange(len(pulses_us))
        return np.where(signal, self.thrusts_N[rows, np.clip(column, 0, self.thrusts_N.shape[1] - 1)], 0.0)

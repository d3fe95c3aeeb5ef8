"""What a session needs of the autopilot's parameters to drive its motors; thrusts to slots, servos to thrusts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.output import MotorOutput, motor_output
from wakewise_ardusub.link.protocol import SLOTS
from wakewise_ardusub.motors import OUTPUTS, channels_of_motors


class MotorInterface(Protocol):
    """What thrusts are to the script, by what the autopilot is set to."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the parameters that must be known, and stay as they are while it drives."""
        ...

    def amiss(self, parameters: Mapping[str, float]) -> str:
        """What of the parameters does not fit the vehicle, in words; empty where all does."""
        ...

    def slots(self, parameters: Mapping[str, float], thrusts_N: Array, battery_V: float) -> Array:
        """What the script is told, shape (8,), for thrusts of shape (n,): values in [-1, 1], NaN without a motor."""
        ...


@dataclass(eq=False)
class VehicleMotors:
    """The motors of a vehicle; implements `MotorInterface`.

    Raises
    ------
    InputError
        If the vehicle has more thrusters than a message has slots.
    """

    vehicle: Vehicle
    _made: tuple[Mapping[str, float], MotorOutput] | None = None

    def __post_init__(self) -> None:
        count = len(self.vehicle.thrusters)
        if count > SLOTS:
            raise InputError(f"vehicle {self.vehicle.name}: {count} thrusters, the script drives at most {SLOTS}")

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the parameters that must be known, and stay as they are while it drives."""
        directions = [f"MOT_{i + 1}_DIRECTION" for i in range(len(self.vehicle.thrusters))]
        return (*directions, *(f"SERVO{i + 1}_FUNCTION" for i in range(OUTPUTS)))

    def amiss(self, parameters: Mapping[str, float]) -> str:
        """What of the parameters does not fit the vehicle, in words; empty where all does."""
        try:
            self._output(parameters)
        except InputError as fault:
            return str(fault)
        return ""

    def slots(self, parameters: Mapping[str, float], thrusts_N: Array, battery_V: float) -> Array:
        """What the script is told, shape (8,), for thrusts of shape (n,): values in [-1, 1], NaN without a motor."""
        return self._output(parameters).controls(thrusts_N, battery_V)

    def flown_N(self, parameters: Mapping[str, float], servo_us: tuple[int, ...], battery_V: float) -> Array:
        """Thrusts, shape (n,), that the channels' pulses make; none where they are not known."""
        rest = np.zeros(len(self.vehicle.thrusters))
        known = all(name in parameters for name in self.needs) and not self.amiss(parameters)
        if len(servo_us) < OUTPUTS or not known:
            return rest
        channels = channels_of_motors(parameters)
        pulses = np.array([servo_us[channels[i + 1][0] - 1] for i in range(rest.size)], dtype=np.float64)
        if not np.all((pulses >= 500.0) & (pulses <= 2500.0)):  # 0: a channel that sends nothing
            return rest
        return self._output(parameters).delivered_N(pulses, battery_V)

    def _output(self, parameters: Mapping[str, float]) -> MotorOutput:
        """How the motors are driven, made once for what the parameters are now; raises as `motor_output`."""
        if self._made is None or self._made[0] is not parameters:
            self._made = (parameters, motor_output(self.vehicle, parameters))
        return self._made[1]

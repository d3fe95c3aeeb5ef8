"""Thrusts to actuator values of the script, servo outputs to thrusts, and the parameters that both need.

An actuator value lies in [-1, 1]. Either all motors get one or none does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.protocol import FULL_US, MIDDLE_US, SLOTS
from wakewise_ardusub.motors import (
    OUTPUTS,
    channels_of_motors,
    limits_of_motors,
    pulses_of_thrusts,
    require_motors,
    supply_in_table,
    thrusts_of_pulses,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorOutput:
    """How a vehicle's thrusters are driven through its autopilot; made by `motor_output`.

    Parameters
    ----------
    vehicle : Vehicle
    directions : ndarray, shape (n,)
        MOT_n_DIRECTION of each thruster's motor, 1 or -1. An override goes past the mixer that would apply it.
    """

    vehicle: Vehicle
    directions: Array

    def __post_init__(self) -> None:
        freeze(self, directions=(len(self.vehicle.thrusters),))

    def pulses_us(self, thrusts_N: Array, battery_V: float = math.nan) -> Array:
        """Whole pulses for desired thrusts, shape (n,), at the battery's voltage; unknown, the vehicle file's.

        Raises
        ------
        InputError
            If a thrust is not finite or there are not as many as thrusters.
        """
        self._require(np.shape(thrusts_N))
        return pulses_of_thrusts(self.vehicle, thrusts_N, self.directions, supply_in_table(self.vehicle, battery_V))

    def controls(self, thrusts_N: Array, battery_V: float = math.nan) -> Array:
        """Thrusts, shape (n,), as `controls` of SET_ACTUATOR_CONTROL_TARGET, shape (8,); NaN without a motor."""
        pulses = self.pulses_us(thrusts_N, battery_V)
        filled = np.full(SLOTS, np.nan)
        filled[: pulses.size] = (pulses - MIDDLE_US) / FULL_US
        return filled

    def neutral(self) -> Array:
        """`controls` of motors at rest, shape (8,)."""
        return self.controls(np.zeros(len(self.vehicle.thrusters)))

    def delivered_N(self, pulses_us: Array, battery_V: float = math.nan) -> Array:
        """Thrusts, shape (n,), of pulses: what comes of `pulses_us`, by the vehicle's own table."""
        self._require(np.shape(pulses_us))
        supply_V = supply_in_table(self.vehicle, battery_V)
        return thrusts_of_pulses(self.vehicle, pulses_us, self.directions, supply_V)

    def limits_N(self, battery_V: float = math.nan) -> tuple[Array, Array]:
        """Lowest and highest thrusts at the battery's voltage, shape (n,) each."""
        return limits_of_motors(self.vehicle, self.directions, supply_in_table(self.vehicle, battery_V))

    def _require(self, shape: tuple[int, ...]) -> None:
        if shape != self.directions.shape:
            raise InputError(
                f"thrusts: shape {shape}, vehicle {self.vehicle.name} has {self.directions.size} thrusters"
            )


def motor_output(vehicle: Vehicle, parameters: Mapping[str, float]) -> MotorOutput:
    """How a vehicle is driven through an autopilot with these parameters.

    Raises
    ------
    InputError
        If the autopilot drives other motors than the vehicle has, or a direction is missing or neither 1 nor -1.
    """
    count = len(vehicle.thrusters)
    if count > SLOTS:
        raise InputError(f"vehicle {vehicle.name}: {count} thrusters, one message holds {SLOTS} motors")
    require_motors(
        vehicle,
        list(channels_of_motors(parameters)),
        "the autopilot",
        "name the vehicle file of this vehicle, or set FRAME_CONFIG and SERVOn_FUNCTION to its motors",
    )
    for motor in range(1, count + 1):
        name = f"MOT_{motor}_DIRECTION"
        value = parameters.get(name)
        if value is None:
            raise InputError(f"{name}: the autopilot did not say it, and without it motor {motor} may run backwards")
        if value not in {1.0, -1.0}:
            raise InputError(f"{name} = {value:g}: must be 1 or -1")
    directions = np.array([parameters[f"MOT_{motor}_DIRECTION"] for motor in range(1, count + 1)])
    return MotorOutput(vehicle=vehicle, directions=directions)


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

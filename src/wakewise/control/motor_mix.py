"""ArduSub's mixer of the frame vectored_6dof: six demands in [-1, 1] to pulses, and what thrusts these give.

Facts, in our own words, from ArduPilot's AP_Motors6DOF (github.com/ArduPilot/ardupilot, libraries/AP_Motors; GPL, no
code of it is here). Each motor has one factor of +1, -1 or 0 for roll, pitch, yaw, throttle, forward and lateral. Roll,
pitch and throttle are summed, and divided by the largest sum where that is above 1; yaw, forward and lateral likewise;
both are added and cut at 1. An output of 1 is 400 microseconds from the middle pulse of 1500, and pulses go out as they
are: the frame undoes no curve of the thruster.

The factors of that frame are the signs of what each thruster does: level ones at 45 deg have yaw, forward and lateral,
upright ones roll, pitch and throttle (up). So they are read off a vehicle's own geometry, whatever its order; a motor
that is mounted the other way round is what ArduSub has MOT_n_DIRECTION for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import ThrustCurve
from wakewise.robot.thrusters.thrust_table import library_curve
from wakewise.robot.vehicles import Vehicle

FULL_US, MIDDLE_US = 400.0, 1500.0
"""Pulse of full output from the middle one, and the middle one."""
WORKING_N = 2.0
"""Thrust at which the slope of a curve is read: about what each of four level thrusters gives to hold 5 N."""
_STEP_N = 0.5
_LEAST_SHARE = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorMix:
    """Factors of n motors for roll, pitch, yaw, throttle, forward, lateral, shape (n, 6), and the thrusters' curve.

    `lower_N`, `upper_N`, shape (n,), are what an output of -1 and 1 gives where no curve is known. `reach`, shape (6,),
    is the wrench in B about its own axis, N m and N, that a small output gives per unit, in the order of the demands.
    """

    factors: Array
    lower_N: Array
    upper_N: Array
    reach: Array
    curve: ThrustCurve | None = None
    supply_V: float | None = None

    def __post_init__(self) -> None:
        n = len(self.lower_N)
        freeze(self, factors=(n, 6), lower_N=(n,), upper_N=(n,), reach=(6,))

    def outputs(self, demands: Array) -> tuple[Array, bool]:
        """Outputs in [-1, 1], shape (n,), of demands, shape (6,), and whether any had to be brought within."""
        groups = [self.factors[:, own] @ demands[own] for own in ([0, 1, 3], [2, 4, 5])]
        most = [max(1.0, float(np.abs(group).max())) for group in groups]
        mixed = groups[0] / most[0] + groups[1] / most[1]
        return np.clip(mixed, -1.0, 1.0), max(most) > 1.0

    def thrusts_N(self, outputs: Array) -> Array:
        """Thrusts of outputs, both shape (n,): pulses are in proportion to outputs, thrusts what the curve says."""
        if self.curve is None:
            return np.asarray(np.where(outputs > 0.0, outputs * self.upper_N, -outputs * self.lower_N))
        pulses_us = np.round(MIDDLE_US + FULL_US * outputs)
        return np.clip(self.curve.thrust_N(pulses_us, self.supply_V), self.lower_N, self.upper_N)


def motor_mix(vehicle: Vehicle) -> MotorMix:
    """The mixer for a vehicle, with the thrusters' curve as it is believed.

    Raises
    ------
    InputError
        If its thrusters are not four level ones that each push ahead, aside and in yaw and four upright ones that each
        push up and in roll and pitch, with the signs of the frame.
    """
    B = vehicle.allocation_matrix
    axes = vehicle.thruster_axes_B
    level = np.abs(axes[:, 2]) < 0.5
    if len(level) != 8 or int(level.sum()) != 4:
        raise InputError(
            f"ardusub: {vehicle.name} has {int(level.sum())} level and {int((~level).sum())} upright thrusters, the "
            "frame vectored_6dof four of each"
        )
    # Roll, pitch, yaw, throttle (up), forward, lateral.
    wrenches = np.stack([B[3], B[4], B[5], -B[2], B[0], B[1]], axis=1)
    used = np.where(level[:, None], [0, 0, 1, 0, 1, 1], [1, 1, 0, 1, 0, 0]).astype(bool)
    least = _LEAST_SHARE * np.abs(np.where(used, wrenches, 0.0)).max(axis=0)
    factors = np.where(used, np.sign(wrenches), 0.0)
    crossed = factors.T @ factors
    if np.any(used & (np.abs(wrenches) <= least)) or np.any(crossed - np.diag(np.diag(crossed)) != 0.0):
        raise InputError(f"ardusub: the thrusters of {vehicle.name} do not have the signs of the frame vectored_6dof")
    curve = None if vehicle.curve is None else library_curve(vehicle.curve.table)
    supply_V = None if vehicle.curve is None else vehicle.curve.supply_V
    if curve is None:
        slope_N = float(np.minimum(vehicle.thrust_upper_N, -vehicle.thrust_lower_N).mean())
    else:
        low_us, high_us = curve.pwm_us(np.array([WORKING_N - _STEP_N, WORKING_N + _STEP_N]), supply_V)
        slope_N = 2.0 * _STEP_N * FULL_US / float(high_us - low_us)
    return MotorMix(
        factors=factors,
        lower_N=vehicle.thrust_lower_N,
        upper_N=vehicle.thrust_upper_N,
        reach=slope_N * np.abs(np.where(used, wrenches, 0.0)).sum(axis=0),
        curve=curve,
        supply_V=supply_V,
    )

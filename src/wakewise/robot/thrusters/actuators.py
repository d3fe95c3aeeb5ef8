"""What a thruster does with a command: limits, lag and electrical power."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import TRIM_WATER_KG_M3
from wakewise.robot.thrusters.thrust_curve import ThrustCurve

FIGURE_OF_MERIT_FORWARD = 0.333
FIGURE_OF_MERIT_REVERSE = 0.229
"""Ideal over electrical power of a Blue Robotics T200 at 16 V, bollard pull, electronics included.

Least squares of P = |T|^1.5 / sqrt(2 rho A) / figure through the maker's public table (T200 performance data of
September 2019, 16 V sheet, A from 76 mm, rho 1000 kg/m3; 93 points each way): rms error 4.1 W forward and 7.7 W
reverse, of 381 and 389 W at full thrust. Between 2 and 10 N the fit is high: by 17 % forward, 21-33 % reverse.
"""


def saturate(thrusts_N: Array, lower_N: Array, upper_N: Array) -> Array:
    """Clip each thrust to its own limits, as the motors do; shapes (n,)."""
    return np.minimum(np.maximum(thrusts_N, lower_N), upper_N)


def scale_to_limits(thrusts_N: Array, lower_N: Array, upper_N: Array) -> Array:
    """Shrink all thrusts by one factor until each is within its limits, so that the wrench keeps its direction.

    Limits must allow zero thrust: lower <= 0 <= upper, shapes (n,).
    """
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    room = np.where(thrusts > 0.0, upper_N, lower_N)
    over = float(np.max(np.divide(thrusts, room, out=np.zeros_like(thrusts), where=room != 0.0), initial=1.0))
    blocked = bool(np.any((room == 0.0) & (thrusts != 0.0)))
    return np.zeros_like(thrusts) if blocked else thrusts / over


def thruster_lag(thrusts_N: Array, commands_N: Array, time_constants_s: Array, dt_s: float) -> Array:
    """Thrusts, shape (n,), after `dt_s` of constant commands: the exact step of dT/dt = (command - T) / time constant.

    A time constant of zero follows at once.
    """
    tau = np.asarray(time_constants_s, dtype=np.float64)
    ratio = np.divide(dt_s, tau, out=np.full_like(tau, np.inf), where=tau > 0.0)
    kept = np.exp(-ratio)
    return commands_N + kept * (np.asarray(thrusts_N, dtype=np.float64) - commands_N)


def electrical_power_W(
    thrusts_N: Array,
    disk_areas_m2: Array,
    *,
    water_density_kg_m3: float = TRIM_WATER_KG_M3,
    figure_of_merit_forward: float = FIGURE_OF_MERIT_FORWARD,
    figure_of_merit_reverse: float = FIGURE_OF_MERIT_REVERSE,
    curve: ThrustCurve | None = None,
    supply_V: float | None = None,
) -> Array:
    """Electrical power of each thruster, shape (n,), at thrusts, shape (n,): measured where a curve is, else estimated.

    With a curve its table gives the power at that supply voltage, limits and first step included, and the disk is not
    used. Without one it is actuator-disk theory at bollard pull, |T|^1.5 / sqrt(2 rho A) (e.g. J. Carlton, Marine
    Propellers and Propulsion, 4th ed., 2018, chapter 8), over a figure of merit measured on one thruster. Standby power
    is in neither. For a T200 at 16 V the two agree within 5 W rms forward and 9 W rms reverse, of 381 and 389 W.
    """
    if curve is not None:
        return curve.power_W(thrusts_N, supply_V)
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    figure = np.where(thrusts >= 0.0, figure_of_merit_forward, figure_of_merit_reverse)
    return np.abs(thrusts) ** 1.5 / np.sqrt(2.0 * water_density_kg_m3 * np.asarray(disk_areas_m2)) / figure

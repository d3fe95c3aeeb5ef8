"""Thrusters of a vehicle as motors of an ArduSub autopilot: channels, directions, and thrusts of pulses.

Thruster i is motor i, in their order. A pulse above 1500 us turns a motor in the direction in which its table has
positive thrust. MOT_n_DIRECTION = -1 is taken as a motor that is mounted in reverse, so its stronger direction is
reversed, too; an autopilot cannot distinguish this from swapped wires.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import ThrustCurve

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle

MIDDLE_US, FULL_US = 1500.0, 400.0
"""Pulse for rest, and from there to full thrust either way (ArduPilot, AP_Motors6DOF, with MOT_PWM_MIN and _MAX)."""
OUTPUTS = 16
"""Channels of an autopilot that are looked at."""
_FUNCTION = re.compile(r"SERVO(\d+)_FUNCTION\Z")
_FIRST_MOTORS, _LATER_MOTORS = 33, 82
"""SERVOn_FUNCTION of motor 1 (to 8), and of motor 9 (to 12)."""


class MotorDrivenVehicle(Protocol):
    """What is asked of a vehicle here: a `Vehicle`, or a `wakewise_ardusub.vehicle_summary.VehicleSummary`, which holds
    its curve itself.
    """

    @property
    def name(self) -> str:
        """Name used in messages."""
        ...

    @property
    def thrusters(self) -> Sequence[Any]:
        """Thrusters in the order of the motors."""
        ...

    @property
    def thrust_lower_N(self) -> Array:
        """Least thrust of each thruster, shape (n,), N."""
        ...

    @property
    def thrust_upper_N(self) -> Array:
        """Largest thrust of each thruster, shape (n,), N."""
        ...

    @property
    def curve(self) -> Any:
        """Thrust curve of the motors, or the record that names its table; None without one."""
        ...


def channels_of_motors(parameters: Mapping[str, float]) -> dict[int, list[int]]:
    """Output channels, from 1, of each motor that some SERVOn_FUNCTION names."""
    named: dict[int, list[int]] = {}
    for name, value in parameters.items():
        match = _FUNCTION.match(name)
        if match is None or not 1 <= int(match[1]) <= OUTPUTS:
            continue
        function = round(value)
        for first, motor, count in ((_FIRST_MOTORS, 1, 8), (_LATER_MOTORS, 9, 4)):
            if first <= function < first + count:
                named.setdefault(motor + function - first, []).append(int(match[1]))
    return {motor: sorted(named[motor]) for motor in sorted(named)}


def motor_channels(vehicle: MotorDrivenVehicle, parameters: Mapping[str, float]) -> tuple[int, ...]:
    """Servo channel of each thruster, from 1: as SERVOn_FUNCTION says, or in their order where nothing does.

    Raises
    ------
    InputError
        If the autopilot drives another number of motors than the vehicle has, or has fewer outputs.
    """
    count = len(vehicle.thrusters)
    named = channels_of_motors(parameters)
    if not named:
        if count > OUTPUTS:
            raise InputError(f"vehicle {vehicle.name}: {count} thrusters, an autopilot says {OUTPUTS} servo outputs")
        return tuple(range(1, count + 1))
    require_motors(vehicle, list(named), "SERVOn_FUNCTION", "name the vehicle that was flown with --vehicle")
    return tuple(channels[-1] for channels in named.values())


def directions_of_motors(parameters: Mapping[str, float], count: int) -> Array:
    """MOT_n_DIRECTION of the first `count` motors as 1 or -1, shape (count,); 1 where it is not known."""
    return np.array([np.sign(parameters.get(f"MOT_{i + 1}_DIRECTION", 1.0)) or 1.0 for i in range(count)])


def thrusts_of_pulses(vehicle: MotorDrivenVehicle, pulses_us: Array, directions: Array, supply_V: float) -> Array:
    """Thrusts of a vehicle's motors at pulses, both shape (n,) or (k, n); without a table they go in proportion.

    Raises
    ------
    InputError
        If a pulse is not finite or the voltage lies outside the vehicle's table.
    """
    return np.asarray(directions * _own_thrusts(vehicle, np.asarray(pulses_us, dtype=np.float64), supply_V))


def pulses_of_thrusts(vehicle: Vehicle, thrusts_N: Array, directions: Array, supply_V: float) -> Array:
    """Whole pulses for desired thrusts, both shape (n,) or (k, n), none of them in the dead band.

    They give the nearest thrusts that can be held: a demand below the least becomes none or the least, whichever is
    nearer, and one beyond the limits the limit.

    Raises
    ------
    InputError
        If a thrust is not finite or the voltage lies outside the vehicle's table.
    """
    desired = directions * np.asarray(thrusts_N, dtype=np.float64)
    if not np.all(np.isfinite(desired)):
        raise InputError(f"thrusts {np.asarray(thrusts_N).tolist()} N: every one must be finite")
    curve = _curve(vehicle)
    if curve is None:
        forward, reverse = vehicle.least_thrusts_N
        least, limit = (np.where(desired > 0.0, a, b) for a, b in ((forward, reverse), _own_limits(vehicle)))
        size = np.minimum(np.where(np.abs(desired) < 0.5 * least, 0.0, np.maximum(np.abs(desired), least)), limit)
        share = np.divide(size, limit, out=np.zeros_like(size), where=limit > 0.0)
        return np.asarray(np.rint(MIDDLE_US + FULL_US * np.sign(desired) * share))
    exact = curve.pwm_us(desired, supply_V)
    low, high = curve.pulse_limits_us(supply_V)
    # Of the whole pulses about the exact one, that with the nearest thrust: rounding alone may end in the dead band.
    around = np.clip(np.stack([np.floor(exact), np.ceil(exact)]), np.ceil(low), np.floor(high))
    best = np.abs(curve.thrust_N(around, supply_V) - curve.delivered_N(desired, supply_V)).argmin(axis=0)
    return np.asarray(np.take_along_axis(around, best[None], axis=0)[0])


def limits_of_motors(vehicle: MotorDrivenVehicle, directions: Array, supply_V: float) -> tuple[Array, Array]:
    """Lowest and highest thrusts at a voltage, shape (n,) each; a motor that is turned about has them turned about."""
    curve = _curve(vehicle)
    if curve is None:
        high, reverse = _own_limits(vehicle)
        low = -reverse
    else:
        low, high = (np.full(directions.shape, limit) for limit in curve.limits_N(supply_V))
    turned = directions < 0.0
    return np.where(turned, -high, low), np.where(turned, -low, high)


def supply_in_table(vehicle: Vehicle, supply_V: float) -> float:
    """A measured voltage within the vehicle's table; the vehicle file's own where it is not known."""
    curve = _curve(vehicle)
    if vehicle.curve is None or curve is None:
        return 0.0
    measured = supply_V if np.isfinite(supply_V) and supply_V > 0.0 else vehicle.curve.supply_V
    return float(np.clip(measured, curve.supply_V[0], curve.supply_V[-1]))


def require_motors(vehicle: MotorDrivenVehicle, motors: list[int], who: str, advice: str) -> None:
    """Refuse another number of motors than the vehicle has thrusters.

    Raises
    ------
    InputError
        Naming both numbers.
    """
    count = len(vehicle.thrusters)
    if motors != list(range(1, count + 1)):
        found = ", ".join(map(str, motors)) or "none"
        raise InputError(f"vehicle {vehicle.name}: {count} thrusters, {who} drives motors {found}; {advice}")


def _curve(vehicle: MotorDrivenVehicle) -> ThrustCurve | None:
    """The curve of a vehicle's motors, None without one."""
    if vehicle.curve is None or isinstance(vehicle.curve, ThrustCurve):
        return vehicle.curve
    from wakewise.robot.thrusters.thrust_table import library_curve  # its reader of tables needs SciPy

    return library_curve(vehicle.curve.table)


def _own_thrusts(vehicle: MotorDrivenVehicle, pulses_us: Array, supply_V: float) -> Array:
    """Thrusts as each motor itself turns."""
    curve = _curve(vehicle)
    if curve is not None:
        return curve.thrust_N(pulses_us, supply_V)
    output = np.clip((pulses_us - MIDDLE_US) / FULL_US, -1.0, 1.0)
    forward, reverse = _own_limits(vehicle)
    return np.asarray(output * np.where(output > 0.0, forward, reverse))


def _own_limits(vehicle: MotorDrivenVehicle) -> tuple[Array, Array]:
    """Largest thrusts of a vehicle without a table as each motor itself turns, shape (n,) each, as magnitudes."""
    return vehicle.thrust_upper_N, -vehicle.thrust_lower_N

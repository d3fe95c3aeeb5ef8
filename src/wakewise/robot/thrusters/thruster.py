"""One thruster: where it sits, which way it pushes, how hard and how fast.

What a thruster does with a command: limits, lag and electrical power.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import finite_number, instance_of
from wakewise.core.constants import TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import ThrustCurve

REACH_M = 10.0
"""Furthest a thruster may sit from the body origin; beyond it a file most likely holds millimetres."""


_ZERO_ALLOWED = frozenset({"max_forward_N", "max_reverse_N", "time_constant_s"})


class ThrusterPlacement(Protocol):
    """Anything with a thruster's name, place and axis."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def p_BT_m(self) -> Array:
        """Centre of the disk, shape (3,)."""

    @property
    def axis_B(self) -> Array:
        """Direction of the force, shape (3,)."""


def mount(record: ThrusterPlacement) -> None:
    """Check and freeze place and axis of a frozen record, and give the axis unit length (call in `__post_init__`).

    Raises InputError if a number is not finite, the axis has no length, or the place is more than 10 m away.
    """
    where = f"thruster {instance_of(record.name, str, 'thruster: name')}"
    place = frozen(record.p_BT_m, (3,), f"{where}: p_BT_m")
    axis = frozen(record.axis_B, (3,), f"{where}: axis_B")
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise InputError(f"{where}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    # A unit axis is kept to the last bit, so that a copy of a thruster is the same thruster.
    if abs(length - 1.0) > 1e-14:
        axis = frozen(axis / length, (3,), f"{where}: axis_B")
    distance = float(np.linalg.norm(place))
    if distance > REACH_M:
        raise InputError(f"{where}: {distance:g} m from the body origin, at most {REACH_M:g} m (are these metres?)")
    object.__setattr__(record, "p_BT_m", place)
    object.__setattr__(record, "axis_B", axis)


def require_limit(where: str, field: str, value: float) -> None:
    """Refuse a limit, area, lag or gain of a thruster that is not finite or out of range."""
    if field in _ZERO_ALLOWED:
        finite_number(value, f"{where}: {field}", least=0.0)
    else:
        finite_number(value, f"{where}: {field}", above=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Thruster:
    """Mounting and limits of one thruster T on body B.

    A thrust T > 0 pushes the vehicle along `axis_B` and sends the jet along `-axis_B`; T < 0 does the opposite.

    `p_BT_m`, shape (3,): centre of the disk from the origin of B, expressed in B. `axis_B`, shape (3,): direction of
    the force for positive thrust, normalised here. `max_forward_N`, `max_reverse_N`: largest thrust along `axis_B` and
    against it, both as magnitudes. `disk_area_m2`: area that the propeller sweeps. `time_constant_s`: first-order lag
    from commanded to delivered thrust; 0 means at once. `gain`: newton delivered per newton commanded. 1 unless the
    parameters are a plant's (see `perturbed`). Raises InputError if the axis has no length, a number is not finite or
    out of range, or the thruster is more than 10 m away.
    """

    name: str
    p_BT_m: Array
    axis_B: Array
    max_forward_N: float
    max_reverse_N: float
    disk_area_m2: float
    time_constant_s: float
    gain: float = 1.0

    def __post_init__(self) -> None:
        mount(self)
        where = f"thruster {self.name}"
        for field in ("max_forward_N", "max_reverse_N", "disk_area_m2", "time_constant_s"):
            require_limit(where, field, getattr(self, field))
        require_limit(where, "gain", self.gain)

    @property
    def wrench_per_newton_B(self) -> Array:
        """Force and moment about the body origin that one newton of thrust makes, shape (6,)."""
        return np.concatenate([self.axis_B, np.cross(self.p_BT_m, self.axis_B)])


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

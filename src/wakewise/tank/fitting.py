"""Whether failures and cable fit a vehicle and its route: said before it flies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.tank.settings import TankSettings
from wakewise.vehicles import Vehicle

_BRACKET_M = 0.1  # a cable may be held this far off the hull


def check_fit(settings: TankSettings, vehicle: Vehicle, route: Sequence[tuple[float, Pose]]) -> None:
    """Refuse failures of thrusters that are not there, or that come too late, and a cable that does not reach.

    Parameters
    ----------
    settings : TankSettings
    vehicle : Vehicle
    route : sequence of (float, Pose)
        Times and poses of the body, from start to end.

    Raises
    ------
    InputError
        Naming the field, what was found and what is allowed.
    """
    _check_failures(settings, vehicle, route[-1][0])
    if settings.tether.diameter_m > 0.0:
        _check_tether(settings, vehicle, route)


def _check_failures(settings: TankSettings, vehicle: Vehicle, end_s: float) -> None:
    for k, failure in enumerate(settings.failures):
        where = f"tank.failures.{k}"
        if failure.thruster > len(vehicle.thrusters):
            raise InputError(
                f"{where}.thruster: {failure.thruster}, {vehicle.name} has thrusters 1 to {len(vehicle.thrusters)}"
            )
        if failure.at_s > end_s:
            raise InputError(f"{where}.at_s: {failure.at_s:g} s, the flight takes {end_s:.0f} s")
        thruster = vehicle.thrusters[failure.thruster - 1]
        if failure.kind == "stuck" and failure.value is not None:
            low, high = -thruster.max_reverse_N, thruster.max_forward_N
            if not low <= failure.value <= high:
                raise InputError(
                    f"{where}.value: stuck at {failure.value:g} N, {thruster.name} gives {low:g} to {high:g} N"
                )


def _check_tether(settings: TankSettings, vehicle: Vehicle, route: Sequence[tuple[float, Pose]]) -> None:
    held_B = np.array(settings.tether.at_B_m)
    if np.any(np.abs(held_B) > vehicle.size_m / 2 + _BRACKET_M):
        place = ", ".join(f"{v:g}" for v in held_B)
        half = " x ".join(f"{v:g}" for v in vehicle.size_m / 2)
        raise InputError(f"tank.tether.at_B_m: ({place}) m is not on the hull, which reaches {half} m from its middle")
    away = [float(np.linalg.norm(X_WB.apply(held_B) - np.array(settings.tether.from_m))) for _, X_WB in route]
    farthest = int(np.argmax(away))
    if away[farthest] > settings.tether.length_m:
        raise InputError(
            f"tank.tether.length_m: {settings.tether.length_m:g}, the route is {away[farthest]:.2f} m from the winch "
            f"at {route[farthest][0]:.0f} s"
        )

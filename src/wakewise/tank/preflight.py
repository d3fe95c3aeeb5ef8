"""What is refused before a flight: a current that the vehicle cannot hold, failures and a cable that do not fit it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError, StageError
from wakewise.geometry import Pose
from wakewise.tank.settings import TankSettings
from wakewise.vehicles import RigidBody, Vehicle, allocation_rank, compile_body, damping_wrench

_AXES = ("surge", "sway", "heave")


@dataclass(frozen=True, kw_only=True, eq=False)
class Holding:
    """The hardest of the flows that a vehicle was asked to hold against.

    Parameters
    ----------
    passing_B_m_s : ndarray, shape (3,)
        Velocity of the water past the vehicle, in body axes.
    drag_N : ndarray, shape (3,)
        What it puts on the vehicle along each body axis.
    share : float
        The largest multiple of the wrench needed that the thrusters give without turning the vehicle.
    more_drag : float
        Share by which the drag is taken above that of the vehicle's model.
    """

    passing_B_m_s: Array
    drag_N: Array
    share: float
    more_drag: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, passing_B_m_s=(3,), drag_N=(3,))

    @property
    def margin_pct(self) -> float:
        """Thrust to spare in percent of what is needed; negative if it cannot hold."""
        return 100.0 * (self.share - 1.0)

    def said(self) -> str:
        """One line with the figures."""
        speed = float(np.linalg.norm(self.passing_B_m_s))
        axis = int(np.argmax(np.abs(self.drag_N)))
        able = self.share * abs(float(self.drag_N[axis]))
        worst = f" if its drag is {100 * self.more_drag:.0f} % more than believed" if self.more_drag > 0.0 else ""
        return (
            f"water that passes at {speed:.2f} m/s drags with {abs(float(self.drag_N[axis])):.1f} N in {_AXES[axis]}"
            f"{worst}, the thrusters hold {able:.1f} N there (margin {self.margin_pct:+.0f} %)"
        )


def holding(
    vehicle: Vehicle, passing_B_m_s: Array, density_kg_m3: float, trim_N: float = 0.0, more_drag: float = 0.0
) -> Holding | None:
    """Find the hardest flow past the vehicle, shape (n, 3) in body axes, to hold against; None if no water moves.

    The drag of each, as the vehicle's own model has it and the share `more_drag` on top, and an upward trim must be met
    by thrusts within their limits that make no other force and no moment but the one that balances drag; how many times
    over they can is a linear program per current. Only the twenty fastest are looked at.

    Raises
    ------
    StageError
        If a linear program fails.
    """
    body = compile_body(vehicle, density_kg_m3)
    flows = np.asarray(passing_B_m_s, dtype=np.float64).reshape(-1, 3)
    order = np.argsort(-np.linalg.norm(flows, axis=1), kind="stable")[:20]
    # Flows that agree to the millimetre per second are one.
    some = np.unique(np.round(flows[order], 3), axis=0)
    hardest: Holding | None = None
    for flow in some[np.any(some != 0.0, axis=1)]:
        found = _holding(vehicle, body, flow, trim_N, more_drag)
        if hardest is None or found.share < hardest.share:
            hardest = found
    return hardest


def _holding(vehicle: Vehicle, body: RigidBody, passing_B_m_s: Array, trim_N: float, more_drag: float) -> Holding:
    # Water that moves at u past a vehicle at rest drags it as the vehicle's own motion at -u does.
    drag = (1.0 + more_drag) * damping_wrench(body, np.concatenate([-passing_B_m_s, np.zeros(3)]))
    load = drag.copy()
    load[2] -= trim_N
    n = len(vehicle.thrusters)
    cost = np.zeros(n + 1)
    cost[n] = -1.0
    # A vehicle that cannot make every moment leaves roll and pitch to its weight.
    kept = slice(None) if allocation_rank(vehicle) == 6 else [0, 1, 2, 5]
    rows = np.hstack([vehicle.allocation_matrix, load[:, None]])[kept]
    bounds = [*zip(vehicle.thrust_lower_N, vehicle.thrust_upper_N, strict=True), (0.0, 1e6)]
    solved = linprog(cost, A_eq=rows, b_eq=np.zeros(len(rows)), bounds=bounds)
    if solved.x is None or not solved.success:
        raise StageError(f"holding against a current: linear program failed ({solved.message})")
    return Holding(passing_B_m_s=passing_B_m_s, drag_N=drag[:3], share=float(solved.x[n]), more_drag=more_drag)


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

"""Checks before a flight: currents, failures and tethers that exceed the vehicle's thrust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.geometry import Pose, matrix_from_quat
from wakewise.robot.vehicles import RigidBody, Vehicle, allocation_rank, compile_body, damping_wrench, restoring_wrench
from wakewise.simulation.tank.settings import TankSettings

_AXES = ("surge", "sway", "heave")
_LEVER_M = 0.2
"""At this lever a moment counts like a force where loads are put in order."""
_MOST = 10
_NONE = 1e-6
MOST_SHARE = 1e6
_SOME_N, _SOME_N_m = 0.05, 0.005
"""Weight and moment below these are not worth words."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StationKeepingDemand:
    """The largest load that a vehicle has to hold against: of water that passes, and of its own weight."""

    passing_B_m_s: Array  # shape (3,): velocity of the water past the vehicle, in body axes
    drag_N: Array  # shape (3,): what it puts on the vehicle along each body axis
    share: float  # the largest multiple of the wrench needed that the thrusters give without turning the vehicle
    more_drag: float = 0.0  # share by which the drag is taken above that of the vehicle's model
    heavy_N: float = 0.0  # weight less buoyancy, positive: it sinks
    righting_N_m: float = 0.0  # moment by which weight and buoyancy turn the vehicle out of its attitude

    def __post_init__(self) -> None:
        freeze(self, passing_B_m_s=(3,), drag_N=(3,))

    @property
    def margin_pct(self) -> float:
        """Thrust to spare in percent of what is needed; negative if it cannot hold."""
        return 100.0 * (self.share - 1.0)

    def said(self) -> str:
        """One line with the figures."""
        loads = []
        speed = float(np.linalg.norm(self.passing_B_m_s))
        axis = int(np.argmax(np.abs(self.drag_N)))
        drag_N = abs(float(self.drag_N[axis]))
        weighs = []
        if abs(self.heavy_N) >= _SOME_N:
            weighs.append(f"it is up to {abs(self.heavy_N):.1f} N {'heavy' if self.heavy_N > 0.0 else 'light'}")
        if self.righting_N_m >= _SOME_N_m:
            weighs.append(f"weight and buoyancy turn it with {self.righting_N_m:.2f} N m")
        if speed > 0.0 or not weighs:
            worst = f" if its drag is {100 * self.more_drag:.0f} % more than believed" if self.more_drag > 0.0 else ""
            loads.append(f"water that passes at {speed:.2f} m/s drags with {drag_N:.1f} N in {_AXES[axis]}{worst}")
        loads += weighs
        able = f"{100.0 * self.share:.3g} % of that" if weighs else f"{self.share * drag_N:.1f} N there"
        return f"{', '.join(loads)}, the thrusters hold {able} (margin {self.margin_pct:z.0f} %)"


def station_keeping_demand(
    vehicle: Vehicle,
    passing_B_m_s: Array,
    density_kg_m3: float,
    trim_N: float = 0.0,
    more_drag: float = 0.0,
    q_WB: Array | None = None,
) -> StationKeepingDemand | None:
    """Find the hardest load to hold against; None if there is none.

    The drag of the water that passes, as the vehicle's own model has it and the share `more_drag` on top, its weight,
    its buoyancy and an upward trim must be met by thrusts within their limits that make no other force and no other
    moment; how many times over they can is a linear program per load. Only the ten largest are looked at.

    - `passing_B_m_s`, shape (n, 3): flows past the vehicle, in body axes.
    - `trim_N`: buoyancy beyond the vehicle's own.
    - `q_WB`, shape (n, 4): attitude at each flow; level if not given.

    Raises StageError if a linear program fails.
    """
    body = compile_body(vehicle, density_kg_m3)
    flows = np.round(np.asarray(passing_B_m_s, dtype=np.float64).reshape(-1, 3), 3)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    attitudes = np.tile(level, (len(flows), 1)) if q_WB is None else np.asarray(q_WB, dtype=np.float64).reshape(-1, 4)
    cases = [_case(body, flow, q, trim_N, more_drag) for flow, q in zip(flows, attitudes, strict=True)]
    # Loads that agree to the millinewton are one.
    different = {tuple(np.round(case.load, 3)): case for case in cases}.values()
    # A vehicle that cannot make every moment leaves roll and pitch to its weight.
    kept = list(range(6)) if allocation_rank(vehicle) == 6 else [0, 1, 2, 5]
    hardest: StationKeepingDemand | None = None
    for case in sorted(different, key=lambda case: -case.size)[:_MOST]:
        if case.size > _NONE:
            share = _share(vehicle, case.load, kept)
            if hardest is None or share < hardest.share:
                hardest = StationKeepingDemand(
                    passing_B_m_s=case.flow,
                    drag_N=case.drag[:3],
                    share=share,
                    more_drag=more_drag,
                    heavy_N=body.weight_N - body.buoyancy_N - trim_N,
                    righting_N_m=float(np.linalg.norm(case.weighs[3:])),
                )
    return hardest


@dataclass(frozen=True, eq=False)
class _Case:
    """A flow, and the wrenches of shape (6,) that it and the weight put on the vehicle."""

    flow: Array
    drag: Array
    weighs: Array

    @property
    def load(self) -> Array:
        return self.drag + self.weighs

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.load[:3]) + np.linalg.norm(self.load[3:]) / _LEVER_M)


def _case(body: RigidBody, flow: Array, q_WB: Array, trim_N: float, more_drag: float) -> _Case:
    # Water that moves at u past a vehicle at rest drags it as the vehicle's own motion at -u does.
    drag = (1.0 + more_drag) * damping_wrench(body, np.concatenate([-flow, np.zeros(3)]))
    weighs = restoring_wrench(body, q_WB)
    weighs[:3] -= trim_N * matrix_from_quat(q_WB)[2]
    return _Case(flow, drag, weighs)


def _share(vehicle: Vehicle, load: Array, kept: list[int]) -> float:
    """The largest multiple of a load that thrusts within their limits balance, in the axes that are kept."""
    n, size = len(vehicle.thrusters), float(np.abs(load[kept]).max())
    if size <= _NONE:
        return MOST_SHARE
    cost = np.zeros(n + 1)
    cost[n] = -1.0
    rows = np.hstack([vehicle.allocation_matrix, load[:, None] / size])[kept]
    bounds = [*zip(vehicle.thrust_lower_N, vehicle.thrust_upper_N, strict=True), (0.0, MOST_SHARE)]
    solved = linprog(cost, A_eq=rows, b_eq=np.zeros(len(rows)), bounds=bounds)
    if solved.x is None or not solved.success:
        raise StageError(f"holding a load: linear program failed ({solved.message})")
    return min(float(solved.x[n]) / size, MOST_SHARE)


_BRACKET_M = 0.1  # a cable may be held this far off the hull


def check_fit(settings: TankSettings, vehicle: Vehicle, route: Sequence[tuple[float, Pose]]) -> None:
    """Refuse failures of thrusters that are not there, or that come too late, and a cable that does not reach.

    `route`: times and poses of the body, from start to end. Raises InputError: naming the field, what was found and
    what is allowed.
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

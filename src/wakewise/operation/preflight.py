"""What is checked before a flight: parts that do not fit each other, the water, or the mission are refused here.

The tank as a controller is told of it: its walls, stated obstacles, the target.

Switches that are set and cannot act: what a scenario asks for that its method, vehicle or pilot has no use for.

A setting that contradicts itself is refused where it is made (`control.allocation`).
One that merely has no effect here
is said before the flight, so that nobody reads a difference into it that is none: the same settings are flown with many
methods, and most of them are somebody's.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wakewise.control import METHODS
from wakewise.core.errors import InputError
from wakewise.planning import PlanSettings, Surroundings, check_start, covering_spheres, state_of
from wakewise.robot.vehicles import possible_drags, with_drag
from wakewise.scene.missions import TankBounds, check_clearance, check_tilt
from wakewise.scene.targets import Target
from wakewise.simulation.tank import StationKeepingDemand, station_keeping_demand, tank_ambient
from wakewise.simulation.tank.soft_body import check_loose, check_sway
from wakewise.simulation.tank.station_keeping import check_fit

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts
    from wakewise.operation.scenario import Scenario
    from wakewise.robot.vehicles import Vehicle


def tank_bounds(scenario: Scenario) -> TankBounds:
    """The tank's water."""
    length, width, depth = scenario.tank.size_m
    return TankBounds(
        low_W_m=np.array([-length / 2, -width / 2, 0.0]), high_W_m=np.array([length / 2, width / 2, depth])
    )


def surroundings_of(scenario: Scenario, target: Target | None = None) -> Surroundings:
    """What a planner keeps clear of: floor, walls and surface of the tank, stated obstacles, the target if given."""
    bounds = tank_bounds(scenario)
    obstacles = np.array(scenario.control.obstacles).reshape(-1, 4)
    names = tuple(f"obstacle {k + 1} (control.obstacles)" for k in range(len(obstacles)))
    around = np.zeros((0, 4)) if target is None else covering_spheres(target.mesh.vertices_m)
    return Surroundings.tank(
        bounds.low_W_m, bounds.high_W_m, np.vstack([obstacles, around]), (*names, *("the target",) * len(around))
    )


PLANNING = frozenset({"pseudo-inverse", "mpc", "mpc-smooth", "linear", "wake-aware"})
"""Our methods that plan."""
MITIGATION_METHODS = frozenset({"pseudo-inverse", "linear", "allocation-only", "wake-aware"})
"""Our methods that allocate in the null space; all but `allocation-only` need `null_space` for all but the bed."""
_NEED_NULL_SPACE = ("merging_jets", "advection", "direction_uncertainty", "power_limit")


def ineffective_settings(scenario: Scenario, vehicle: Vehicle) -> tuple[str, ...]:
    """What is set and does nothing, a sentence each, with the field's name; nothing is known of a method from outside.

    Its fields are on by default, so a method without null-space allocation is only told of the one that is not.
    """
    control, method, found = scenario.control, scenario.method, []
    if method in METHODS:
        allocation = control.allocation
        if method in MITIGATION_METHODS & PLANNING and not allocation.null_space:
            on = [name for name in _NEED_NULL_SPACE if getattr(allocation, name)]
            if on:
                found.append(
                    f"control.allocation.{', '.join(on)}: nothing without control.allocation.null_space, which "
                    f"{method} shares by"
                )
        if allocation.include_bed and method not in MITIGATION_METHODS:
            found.append(f"control.allocation.include_bed: nothing for {method}, which has no null-space stage")
        if method not in PLANNING:
            if control.obstacles:
                found.append(f"control.obstacles: not kept clear of by {method}, which does not plan")
            if control.plan != PlanSettings():
                found.append(f"control.plan: nothing for {method}, which does not plan")
        if control.operator_seed is not None and method != "manual" and scenario.pilot not in ("human", "assisted"):
            found.append(f"control.operator_seed: nobody flies {method} by hand with the pilot {scenario.pilot}")
    if control.pulse_s is not None and vehicle.thrust_steps is None:
        found.append(f"control.pulse_s: the thrusters of {vehicle.name} hold any thrust, so none is sent as pulses")
    return tuple(found)


log = logging.getLogger(__name__)

FASTEST_M_S, FASTEST_RAD_S = 5.0, 2.0 * np.pi
"""Faster no vehicle of this kind begins a mission."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PreflightResult:
    """What was found: the least clearance of the hull along the route, and the current that must be held.

    `idle` says what is set and cannot act, a sentence each (see `switches.py`).
    """

    clearance_m: float
    holding: StationKeepingDemand | None
    idle: tuple[str, ...] = ()


def preflight(parts: Parts) -> PreflightResult:
    """Hold vehicle, route, target and water of a flight against each other.

    Raises
    ------
    InputError
        A tilt beyond the camera's stops or faster than its joint, an orbit that would touch something, a start from
        which no plan can be good, a current faster than the vehicle can hold, failures or a cable that do not fit; what
        and where is named.
    """
    scenario, vehicle, route = parts.scenario, parts.vehicle, parts.route
    check_tilt(route, parts.aim, stops_suffice=scenario.mission.aim == "tilt")
    clearance_m = check_route(parts)
    check_way(parts)
    check_target(parts)
    times_s = np.linspace(0.0, route.duration_s, 400)
    check_fit(scenario.tank, vehicle, [(float(t), route.body(float(t), parts.aim).X_WB) for t in times_s])
    found = check_current(parts)
    check_volume(vehicle)
    idle = () if "controller" in parts.given else ineffective_settings(scenario, vehicle)
    for words in idle:
        log.warning("%s", words)
    return PreflightResult(clearance_m=clearance_m, holding=found, idle=idle)


def check_route(parts: Parts) -> float:
    """Least clearance of the hull along the route, in m.

    Raises
    ------
    InputError
        If it comes too near to anything; where, and to what, is named.
    """
    corners, allowed_m = parts.found_target.mesh.vertices_m, parts.scenario.mission.clearance_m
    return check_clearance(parts.route, parts.aim, parts.vehicle.size_m, parts.bounds, corners, allowed_m)


def check_target(parts: Parts, looks: int = 200) -> None:
    """Refuse a soft target that the water's steps cannot move or that lies down, a loose one that is carried away.

    Raises
    ------
    InputError
        See `wakewise.simulation.tank.soft_body.check_sway` and `check_loose`.
    """
    yielding, tank, target = parts.yielding, parts.scenario.tank, parts.target
    if yielding is None:
        return
    ambient = tank_ambient(tank, parts.seeds.tank())
    top = np.array([[target.centre_W_m[0], target.centre_W_m[1], target.mesh.vertices_m[:, 2].min()]])
    times_s = np.linspace(0.0, min(parts.route.duration_s, ambient.end_s), looks)
    passing = np.array([ambient.velocity(top, float(time_s))[0] for time_s in times_s])
    fastest = passing[np.argmax(np.linalg.norm(passing, axis=1))]
    if yielding.sway is not None:
        check_sway(target, yielding.sway, yielding.drag, fastest, tank.density_kg_m3, tank.flow_step_s)
    check_loose(target, yielding, fastest, tank.density_kg_m3)


def check_way(parts: Parts) -> None:
    """Refuse a start from which no plan can be good, and a route through a stated obstacle.

    How near the route comes to the target itself is for `wakewise.scene.missions.check_clearance`, which knows its
    mesh.

    Raises
    ------
    InputError
        See `wakewise.planning.check_start`; what is touched, and when, is named.
    """
    check_begin(parts)
    around = surroundings_of(parts.scenario)
    if parts.scenario.control.obstacles:
        for time_s in np.arange(0.0, parts.route.duration_s, 0.25):
            state = state_of(parts.route.body(float(time_s), parts.aim))
            check_start(parts.vehicle, parts.region, state, around, what=f"mission at {time_s:.0f} s")


def check_volume(vehicle: Vehicle) -> None:
    """Refuse a vehicle that displaces more water than the box round it holds.

    Raises
    ------
    InputError
        With both volumes.
    """
    box_m3 = float(np.prod(vehicle.size_m))
    if vehicle.displaced_volume_m3 > box_m3:
        raise InputError(
            f"vehicle {vehicle.name}: displaced_volume_m3 {vehicle.displaced_volume_m3:.4g}, the box round it (size_m) "
            f"holds {box_m3:.4g} m3"
        )


def check_begin(parts: Parts) -> None:
    """Refuse a start from which no plan can be good; also of missions that were made by hand.

    Raises
    ------
    InputError
        A start that is faster than any such vehicle, or see `wakewise.planning.check_start`.
    """
    for words, part, most, unit in (
        ("moves at", parts.start.nu_B[:3], FASTEST_M_S, "m/s"),
        ("turns at", parts.start.nu_B[3:], FASTEST_RAD_S, "rad/s"),
    ):
        if (speed := float(np.linalg.norm(part))) > most:
            raise InputError(f"start: {words} {speed:.3g} {unit}, at most {most:.3g} {unit}")
    check_start(parts.vehicle, parts.region, state_of(parts.start), surroundings_of(parts.scenario))


def check_current(parts: Parts, looks: int = 200) -> StationKeepingDemand | None:
    """Hold weight and the water that passes the vehicle along its route against what its thrusters can give.

    Drag and trim are the worst that the plant may have: of any case that may be drawn, all of
    `tank.mismatch.damping_pct` above it, and either end of the trim's range.

    Raises
    ------
    InputError
        If it cannot stay on the route, with the figures, or the current's series is shorter than the flight.
    """
    tank, vehicle, route = parts.scenario.tank, parts.vehicle, parts.route
    ambient = tank_ambient(tank, parts.seeds.tank())
    if ambient.end_s < route.duration_s:
        raise InputError(
            f"tank.current.file: {ambient.end_s:.0f} s of series are left, the flight takes {route.duration_s:.0f} s"
        )
    passing, attitudes = [], []
    for time_s in np.linspace(0.0, route.duration_s, looks):
        wished = route.body(float(time_s), parts.aim)
        current = ambient.velocity(wished.X_WB.p_m[None], float(time_s))[0]
        passing.append(current @ wished.X_WB.R - wished.nu_B[:3])
        attitudes.append(wished.X_WB.q)
    apart = tank.mismatch
    trims_N = (-apart.trim_range_N, apart.trim_range_N) if apart.trim_N is None else (apart.trim_N,)
    flows, turns, more = np.array(passing), np.array(attitudes), 0.01 * apart.damping_pct
    drags = [with_drag(vehicle, case) for case in possible_drags(vehicle, apart.drag)]
    loads = (
        station_keeping_demand(v, flows, tank.density_kg_m3, trim_N, more, turns) for v in drags for trim_N in trims_N
    )
    found = min((load for load in loads if load is not None), key=lambda load: load.share, default=None)
    if found is not None and found.share < 1.0:
        raise InputError(f"tank: {vehicle.name} cannot hold its route, {found.said()}")
    return found

"""What is checked before a flight: parts that do not fit each other, the water, or the mission are refused here."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wakewise.core.errors import InputError
from wakewise.operation.known_obstacles import surroundings_of
from wakewise.operation.setting_checks import ineffective_settings
from wakewise.planning import check_start, state_of
from wakewise.robot.vehicles import possible_drags, with_drag
from wakewise.scene.missions import check_clearance, check_tilt
from wakewise.simulation.tank import StationKeepingDemand, station_keeping_demand, tank_ambient
from wakewise.simulation.tank.soft_body import check_loose, check_sway
from wakewise.simulation.tank.station_keeping import check_fit

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts
    from wakewise.robot.vehicles import Vehicle

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

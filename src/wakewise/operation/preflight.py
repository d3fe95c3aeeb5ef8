"""What is checked before a flight: parts that do not fit each other, the water, or the mission are refused here."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wakewise.errors import InputError
from wakewise.missions import check_clearance, check_tilt
from wakewise.operation.surroundings import surroundings_of
from wakewise.operation.switches import idle_switches
from wakewise.planning import check_start, state_of
from wakewise.tank import Holding, holding, tank_ambient
from wakewise.tank.preflight import check_fit
from wakewise.tank.swaying import check_loose, check_sway
from wakewise.vehicles import possible_drags, with_drag

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class Preflight:
    """What was found: the least clearance of the hull along the route, and the current that must be held.

    `idle` says what is set and cannot act, a sentence each (see `switches.py`).
    """

    clearance_m: float
    holding: Holding | None
    idle: tuple[str, ...] = ()


def preflight(parts: Parts) -> Preflight:
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
    idle = () if "controller" in parts.given else idle_switches(scenario, vehicle)
    for words in idle:
        log.warning("%s", words)
    return Preflight(clearance_m=clearance_m, holding=check_current(parts), idle=idle)


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
        See `wakewise.tank.swaying.check_sway` and `check_loose`.
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

    How near the route comes to the target itself is for `wakewise.missions.check_clearance`, which knows its mesh.

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


def check_begin(parts: Parts) -> None:
    """Refuse a start from which no plan can be good; also of missions that were made by hand.

    Raises
    ------
    InputError
        See `wakewise.planning.check_start`.
    """
    check_start(parts.vehicle, parts.region, state_of(parts.start), surroundings_of(parts.scenario))


def check_current(parts: Parts, looks: int = 200) -> Holding | None:
    """Hold the water that passes the vehicle along its route against what its thrusters can give, with its worst drag.

    The drag is the worst that the plant may have: of any case that may be drawn, and all of `tank.mismatch.damping_pct`
    above it.

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
    passing = []
    for time_s in np.linspace(0.0, route.duration_s, looks):
        wished = route.body(float(time_s), parts.aim)
        current = ambient.velocity(wished.X_WB.p_m[None], float(time_s))[0]
        passing.append(current @ wished.X_WB.R - wished.nu_B[:3])
    apart = tank.mismatch
    trim_N = apart.trim_range_N if apart.trim_N is None else apart.trim_N
    flows, more = np.array(passing), 0.01 * apart.damping_pct
    drags = (with_drag(vehicle, case) for case in possible_drags(vehicle, apart.drag))
    held = [h for h in (holding(v, flows, tank.density_kg_m3, trim_N, more) for v in drags) if h is not None]
    found = min(held, key=lambda h: h.share, default=None)
    if found is not None and found.share < 1.0:
        raise InputError(f"tank: {vehicle.name} cannot hold its route, {found.said()}")
    return found

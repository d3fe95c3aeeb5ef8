"""Checks before a flight: parts that do not fit each other, the water or the mission are refused.

Each check raises InputError in one line, which names part, place or time, and numbers. Settings that are set and have
no effect are logged (`wakewise.operation.scenario.setting_checks`).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from wakewise.core.errors import InputError
from wakewise.operation.parts import Parts, surroundings_of
from wakewise.operation.scenario.setting_checks import ineffective_settings
from wakewise.planning import check_start, state_of
from wakewise.robot.vehicles import Vehicle, possible_drags, with_drag
from wakewise.scene.missions import check_clearance, check_tilt
from wakewise.simulation.tank import StationKeepingDemand, station_keeping_demand, tank_ambient
from wakewise.simulation.tank.soft_body import check_loose, check_sway
from wakewise.simulation.tank.station_keeping import check_fit

log = logging.getLogger(__name__)

FASTEST_M_S, FASTEST_RAD_S = 5.0, 2.0 * np.pi
"""Largest speed and angular rate at the start of a mission."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PreflightResult:
    """Least clearance of the hull along the route, and the load of station keeping; None if the load is zero.

    `ineffective` has one sentence for each setting that is set and has no effect.
    """

    clearance_m: float
    holding: StationKeepingDemand | None
    ineffective: tuple[str, ...] = ()


def preflight(parts: Parts) -> PreflightResult:
    """Check vehicle, route, target and water of a flight against each other.

    Refused are: a tilt beyond the stops or rate of the camera's joint, an orbit that touches something, a start in
    collision, a current that the vehicle cannot hold, failures or a cable that do not fit.
    """
    scenario, vehicle, route = parts.scenario, parts.vehicle, parts.route
    check_tilt(route, parts.aim, stops_suffice=scenario.mission.aim == "tilt")
    clearance_m = check_route(parts)
    check_obstacles(parts)
    check_target(parts)
    times_s = np.linspace(0.0, route.duration_s, 400)
    check_fit(scenario.tank, vehicle, [(float(t), route.body(float(t), parts.aim).X_WB) for t in times_s])
    found = check_current(parts)
    check_volume(vehicle)
    ineffective = () if "controller" in parts.given else ineffective_settings(scenario, vehicle)
    for words in ineffective:
        log.warning("%s", words)
    return PreflightResult(clearance_m=clearance_m, holding=found, ineffective=ineffective)


def check_route(parts: Parts) -> float:
    """Least clearance of the hull along the route, in m; one below `mission.clearance_m` is refused."""
    corners, allowed_m = parts.surveyed_target.mesh.vertices_m, parts.scenario.mission.clearance_m
    return check_clearance(parts.route, parts.aim, parts.vehicle.size_m, parts.bounds, corners, allowed_m)


def check_target(parts: Parts, samples: int = 200) -> None:
    """Refuse a soft target that is too stiff for the time step or lies flat, and a loose one that is carried away."""
    compliance, tank, target = parts.compliance, parts.scenario.tank, parts.target
    if compliance is None:
        return
    ambient = tank_ambient(tank, parts.seeds.tank())
    top = np.array([[target.centre_W_m[0], target.centre_W_m[1], target.mesh.vertices_m[:, 2].min()]])
    times_s = np.linspace(0.0, min(parts.route.duration_s, ambient.end_s), samples)
    flow = np.array([ambient.velocity(top, float(time_s))[0] for time_s in times_s])
    fastest = flow[np.argmax(np.linalg.norm(flow, axis=1))]
    if compliance.sway is not None:
        check_sway(target, compliance.sway, compliance.drag, fastest, tank.density_kg_m3, tank.flow_step_s)
    check_loose(target, compliance, fastest, tank.density_kg_m3)


def check_obstacles(parts: Parts) -> None:
    """Refuse a start in collision, and a route through a stated obstacle; `check_route` checks against the target."""
    check_initial_state(parts)
    around = surroundings_of(parts.scenario)
    if parts.scenario.control.obstacles:
        for time_s in np.arange(0.0, parts.route.duration_s, 0.25):
            state = state_of(parts.route.body(float(time_s), parts.aim))
            check_start(parts.vehicle, parts.region, state, around, what=f"mission at {time_s:.0f} s")


def check_volume(vehicle: Vehicle) -> None:
    """Refuse a vehicle that displaces more water than its bounding box holds."""
    box_m3 = float(np.prod(vehicle.size_m))
    if vehicle.displaced_volume_m3 > box_m3:
        raise InputError(
            f"vehicle {vehicle.name}: displaced_volume_m3 {vehicle.displaced_volume_m3:.4g}, the box round it (size_m) "
            f"holds {box_m3:.4g} m3"
        )


def check_initial_state(parts: Parts) -> None:
    """Refuse a start in collision (`wakewise.planning.check_start`) or above `FASTEST_M_S` or `FASTEST_RAD_S`."""
    for words, part, most, unit in (
        ("moves at", parts.start.nu_B[:3], FASTEST_M_S, "m/s"),
        ("turns at", parts.start.nu_B[3:], FASTEST_RAD_S, "rad/s"),
    ):
        if (speed := float(np.linalg.norm(part))) > most:
            raise InputError(f"start: {words} {speed:.3g} {unit}, at most {most:.3g} {unit}")
    check_start(parts.vehicle, parts.region, state_of(parts.start), surroundings_of(parts.scenario))


def check_current(parts: Parts, samples: int = 200) -> StationKeepingDemand | None:
    """Largest load of station keeping along the route, by weight and relative flow; a share of the thrusters' limits.

    Drag and trim are the worst that the plant may have: each case of drag, increased by `tank.mismatch.damping_pct`,
    at either end of the trim's range. A load above the limits is refused, as is a current series shorter than the
    flight.
    """
    tank, vehicle, route = parts.scenario.tank, parts.vehicle, parts.route
    ambient = tank_ambient(tank, parts.seeds.tank())
    if ambient.end_s < route.duration_s:
        raise InputError(
            f"tank.current.file: {ambient.end_s:.0f} s of series are left, the flight takes {route.duration_s:.0f} s"
        )
    flows_B, attitudes = [], []
    for time_s in np.linspace(0.0, route.duration_s, samples):
        reference = route.body(float(time_s), parts.aim)
        current = ambient.velocity(reference.X_WB.p_m[None], float(time_s))[0]
        flows_B.append(current @ reference.X_WB.R - reference.nu_B[:3])
        attitudes.append(reference.X_WB.q)
    mismatch = tank.mismatch
    trims_N = (-mismatch.trim_range_N, mismatch.trim_range_N) if mismatch.trim_N is None else (mismatch.trim_N,)
    flows, quaternions, more = np.array(flows_B), np.array(attitudes), 0.01 * mismatch.damping_pct
    drags = [with_drag(vehicle, case) for case in possible_drags(vehicle, mismatch.drag)]
    loads = (
        station_keeping_demand(v, flows, tank.density_kg_m3, trim_N, more, quaternions)
        for v in drags
        for trim_N in trims_N
    )
    found = min((load for load in loads if load is not None), key=lambda load: load.share, default=None)
    if found is not None and found.share < 1.0:
        raise InputError(f"vehicle {vehicle.name}: cannot hold its route, {found.said()}")
    return found

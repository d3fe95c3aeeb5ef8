"""The one place where a scenario becomes objects.

Here, and nowhere below, the controller's world and the true one are made side by side: the plant gets its own,
perturbed vehicle parameters and its own water; the controller gets the nominal vehicle and a wake model.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.control import make_controller
from wakewise.control.settings import told
from wakewise.errors import InputError
from wakewise.estimation import ErrorStateFilter
from wakewise.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.imaging import LensCamera, Panels, PinholeCamera, Scene
from wakewise.interfaces import BodyState, Controller, Estimator, ScalarGrid
from wakewise.missions import Route, RoutePilot, TankBounds, check_clearance, plan_route
from wakewise.operation.loop import Truth, WaterTruth
from wakewise.operation.scenario import Scenario, TargetSettings
from wakewise.planning import Surroundings, check_start, covering_spheres, state_of
from wakewise.tank import Holding, Tank, build_ambient, holding
from wakewise.tank.ambient import mean_current_m_s
from wakewise.tank.fitting import check_fit
from wakewise.targets import Region, Target, coral, coral_kinds, delicacy, load_mesh, place_on_bed, sample_region
from wakewise.vehicles import Vehicle, load_vehicle, perturbed
from wakewise.wake import wake_model


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """One random stream for each part of a trial, so that a change in one leaves the draws of the others alone."""

    plant: np.random.Generator
    tank: np.random.Generator
    region: np.random.Generator
    start: np.random.Generator
    imaging: np.random.Generator

    @classmethod
    def of(cls, seed: int) -> Seeds:
        """Children of one seed, always spawned in this order."""
        plant, tank, region, start, imaging = np.random.default_rng(seed).spawn(5)
        return cls(plant=plant, tank=tank, region=region, start=start, imaging=imaging)


@dataclass(frozen=True, kw_only=True, eq=False)
class Mission:
    """What is known before the flight: vehicle as believed, target, its water, the route, the current to hold in."""

    vehicle: Vehicle
    target: Target
    region: Region
    route: Route
    clearance_m: float
    holding: Holding | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """Everything the loop needs, ready to fly; `true_vehicle` is what the tank flies, known to nobody else."""

    mission: Mission
    true_vehicle: Vehicle
    pilot: RoutePilot
    controller: Controller[Any]
    estimator: Estimator[Any]
    tank: Tank
    witness: TankWitness
    start: BodyState


@dataclass(frozen=True, kw_only=True, eq=False)
class TankWitness:
    """Reads the truth from the simulated tank, for the record."""

    tank: Tank

    def observe(self) -> Truth:
        """Vehicle, thrusters and collisions now."""
        tank = self.tank
        return Truth(state=tank.state, thrusts_N=tank.thrusts_N, power_W=tank.power_W, collision=tank.collision)

    def water(self) -> WaterTruth:
        """Water at the target now."""
        return WaterTruth(**asdict(self.tank.measure()))

    def silt(self) -> ScalarGrid:
        """Silt around the target now."""
        return self.tank.concentration_grid()


def build_target(settings: TargetSettings, bed_z_m: float) -> Target:
    """The coral or mesh of a scenario, standing on the bed."""
    if settings.kind in coral_kinds():
        return place_on_bed(settings.kind, coral(settings.kind, settings.seed), bed_z_m)
    path = Path(settings.kind).expanduser()
    return place_on_bed(path.stem, load_mesh(path, settings.size_m), bed_z_m)


def build_mission(scenario: Scenario) -> Mission:
    """Plan a scenario's mission and check it against floor, walls and target.

    Raises
    ------
    InputError
        Unknown vehicle or target, an orbit that would touch something, a current faster than the vehicle can hold,
        failures or a cable that do not fit.
    """
    bounds = tank_bounds(scenario)
    vehicle = load_vehicle(scenario.vehicle)
    target = build_target(scenario.target, scenario.tank.size_m[2])
    route = plan_route(target.centre_W_m, scenario.mission)
    clearance_m = check_clearance(
        route, vehicle.X_BC, vehicle.size_m, bounds, target.mesh.vertices_m, scenario.mission.clearance_m
    )
    gain = scenario.target.delicate_gain
    region = sample_region(
        target,
        scenario.target.points,
        Seeds.of(scenario.seed).region,
        delicacy(target.mesh) if gain > 0.0 else None,
        gain,
    )
    check_way(scenario, vehicle, region, route)
    times_s = np.linspace(0.0, route.duration_s, 400)
    check_fit(scenario.tank, vehicle, [(float(t), route.body(float(t), vehicle.X_BC).X_WB) for t in times_s])
    return Mission(
        vehicle=vehicle,
        target=target,
        region=region,
        route=route,
        clearance_m=clearance_m,
        holding=check_current(scenario, vehicle, route),
    )


def build_surroundings(scenario: Scenario, target: Target | None = None) -> Surroundings:
    """What a planner keeps clear of: floor, walls and surface of the tank, stated obstacles, the target if given."""
    bounds = tank_bounds(scenario)
    obstacles = np.array(scenario.control.obstacles).reshape(-1, 4)
    names = tuple(f"obstacle {k + 1} (control.obstacles)" for k in range(len(obstacles)))
    around = np.zeros((0, 4)) if target is None else covering_spheres(target.mesh.vertices_m)
    return Surroundings.tank(
        bounds.low_W_m, bounds.high_W_m, np.vstack([obstacles, around]), (*names, *("the target",) * len(around))
    )


def tank_bounds(scenario: Scenario) -> TankBounds:
    """The tank's water."""
    length, width, depth = scenario.tank.size_m
    return TankBounds(
        low_W_m=np.array([-length / 2, -width / 2, 0.0]), high_W_m=np.array([length / 2, width / 2, depth])
    )


def check_way(scenario: Scenario, vehicle: Vehicle, region: Region, route: Route) -> None:
    """Refuse a start from which no plan can be good, and a route through a stated obstacle.

    How near the route comes to the target itself is for `wakewise.missions.check_clearance`, which knows its mesh.

    Raises
    ------
    InputError
        See `wakewise.control.check_start`; what is touched, and when, is named.
    """
    around = build_surroundings(scenario)
    check_start(vehicle, region, state_of(route.body(0.0, vehicle.X_BC)), around)
    if scenario.control.obstacles:
        for time_s in np.arange(0.0, route.duration_s, 0.25):
            state = state_of(route.body(float(time_s), vehicle.X_BC))
            check_start(vehicle, region, state, around, what=f"mission at {time_s:.0f} s")


def check_current(scenario: Scenario, vehicle: Vehicle, route: Route, looks: int = 200) -> Holding | None:
    """Hold the water that passes the vehicle along its route against what its thrusters can give.

    Raises
    ------
    InputError
        If it cannot stay on the route, with the figures, or the current's series is shorter than the flight.
    """
    tank = scenario.tank
    ambient = build_ambient(tank, np.random.default_rng(scenario.seed))
    if ambient.end_s < route.duration_s:
        raise InputError(
            f"tank.current.file: {ambient.end_s:.0f} s of series are left, the flight takes {route.duration_s:.0f} s"
        )
    passing = []
    for time_s in np.linspace(0.0, route.duration_s, looks):
        wished = route.body(float(time_s), vehicle.X_BC)
        current = ambient.velocity(wished.X_WB.p_m[None], float(time_s))[0]
        passing.append(current @ wished.X_WB.R - wished.nu_B[:3])
    apart = tank.mismatch
    trim_N = apart.trim_range_N if apart.trim_N is None else apart.trim_N
    found = holding(vehicle, np.array(passing), tank.density_kg_m3, trim_N)
    if found is not None and found.share < 1.0:
        raise InputError(f"tank: {vehicle.name} cannot hold its route, {found.said()}")
    return found


def build_flight(scenario: Scenario, mission: Mission) -> Flight:
    """Put controller and tank side by side; they share nothing but the interfaces."""
    seeds, tank_settings = Seeds.of(scenario.seed), scenario.tank
    believed = mission.vehicle
    apart = tank_settings.mismatch
    trim_N = apart.trim_N
    if trim_N is None:
        trim_N = float(seeds.plant.uniform(-apart.trim_range_N, apart.trim_range_N))
    true_vehicle = perturbed(
        believed,
        seeds.plant,
        mass_pct=apart.mass_pct,
        damping_pct=apart.damping_pct,
        added_mass_pct=apart.added_mass_pct,
        thrust_pct=apart.thrust_pct,
        trim_N=trim_N,
        water_density_kg_m3=tank_settings.density_kg_m3,
    )
    wished = mission.route.body(0.0, believed.X_BC)
    around = build_surroundings(scenario, mission.target)
    check_start(believed, mission.region, state_of(wished), build_surroundings(scenario))
    start = BodyState(X_WB=_misplaced(wished.X_WB, seeds.start))
    tank = Tank(true_vehicle, mission.target, tank_settings, start, seeds.tank)
    control = told(scenario.control, mean_current_m_s(tank_settings, mission.route.duration_s))
    depth_m = tank_settings.size_m[2]
    return Flight(
        mission=mission,
        true_vehicle=true_vehicle,
        pilot=RoutePilot(route=mission.route, X_BC=believed.X_BC, exposure_s=scenario.imaging.exposure_s),
        controller=make_controller(
            scenario.method, believed, mission.region, wake_model(control.wake, depth_m), control, around
        ),
        estimator=ErrorStateFilter(believed, scenario.estimation),
        tank=tank,
        witness=TankWitness(tank=tank),
        start=wished,
    )


def build_camera(scenario: Scenario) -> PinholeCamera | LensCamera:
    """The camera of a scenario."""
    return scenario.imaging.camera()


def build_scene(scenario: Scenario, target: Target) -> Scene:
    """The target on its bed, textured, as the camera finds it."""
    length, width, _ = scenario.tank.size_m
    return Scene.build(target, scenario.target.seed, panels=Panels.over_tank(length, width))


def _misplaced(X_WB: Pose, rng: np.random.Generator, spread_m: float = 0.02, spread_rad: float = 0.03) -> Pose:
    """Where the vehicle really is when the mission begins: near the start, not on it."""
    turn = quat_from_rotvec(rng.normal(0.0, spread_rad, 3))
    return Pose(X_WB.p_m + rng.normal(0.0, spread_m, 3), quat_multiply(X_WB.q, turn))

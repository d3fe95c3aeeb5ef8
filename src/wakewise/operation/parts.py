"""Parts of a flight: made from the scenario at first use, each replaceable. `build` is the entry.

This is the one place where the controller's model and the simulated world meet. The world gets the perturbed vehicle
and its own water; the controller gets the nominal vehicle and a wake model. No module below sees both.

Sampling a region takes seconds and a soft target's modes a third of one, so those of the last flights are cached.
The module is long because each part states how it is made and what it is made from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from hashlib import blake2b
from threading import Lock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

import numpy as np

from wakewise.control import ControlSettings, Pipeline, make_controller
from wakewise.control.settings import flown_by
from wakewise.core.arrays import Array
from wakewise.core.checks import instance_of, protocol_part, quoted
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Controller, Estimator, Pilot, WakeModel, World
from wakewise.estimation import ErrorStateFilter
from wakewise.operation.plugin_adapter import described, external_parts, flown_controller
from wakewise.operation.scenario.calibration_error import current_with_error, target_with_error
from wakewise.operation.scenario.randomization import Seeds
from wakewise.operation.scenario.settings import Scenario
from wakewise.planning import Surroundings, covering_spheres
from wakewise.robot.importers import any_vehicle
from wakewise.robot.vehicles import Vehicle
from wakewise.robot.vehicles.ballast import with_blocks
from wakewise.scene.missions import CameraAim, Route, TankBounds, aim_of, plan_route
from wakewise.scene.targets import (
    BendingModes,
    Region,
    Target,
    TissueProperties,
    find_fragility,
    find_target,
    sample_region,
)
from wakewise.simulation.tank import build_ambient
from wakewise.simulation.tank.soft_body import DRAG, TargetCompliance, UnanchoredTarget
from wakewise.wake import wake_model

if TYPE_CHECKING:  # imported at first use: rendering and flight checks are not needed to fly
    from wakewise.operation.finding.region_controller import RegionController
    from wakewise.operation.preflight import PreflightResult
    from wakewise.vision.imaging import LensCamera, PinholeCamera, Scene, SiltOptics

T = TypeVar("T")


def build(scenario: Scenario, replaced: Mapping[str, Any] | None = None) -> Parts:
    """The parts of a scenario's flight, with some of them replaced, by name (see `PARTS`).

    Raises InputError if there is no such part, or the value cannot be that part.
    """
    for name, value in (replaced or {}).items():
        if name not in PARTS:
            raise InputError(f"parts: {quoted(name)} is unknown, allowed are {', '.join(PARTS)}")
        check_part(name, value)
    return Parts(scenario, replaced)


class ReplaceablePart(cached_property[T]):
    """A part that is made at first use, unless another one was given in Python."""

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> T: ...

    def __get__(self, instance: Any, owner: type[Any] | None = None) -> Self | T:
        """The part that was given, or the scenario's own."""
        if instance is None:
            return self
        if self.attrname in instance.given:
            given: T = instance.given[self.attrname]
            return given
        once = instance.scenario.overrides.get(self.attrname or "")
        if once is not None:  # the scenario of a trial in which this part was given in Python
            raise InputError(
                f"{self.attrname}: was given in Python ({once}), which a scenario's file cannot hold; "
                f"give it again with replace({self.attrname}=...)"
            )
        return super().__get__(instance, owner)

    def __repr__(self) -> str:
        """The part's type and the first sentence of its docstring, for `help(Parts)`."""
        return f"<part, {self.func.__annotations__.get('return', '')}: {(self.__doc__ or '').partition('.')[0]}>"


class Parts:
    """The parts of one flight, made from its scenario or given in Python.

    Each part is made at first use, from the scenario and from other parts: a replaced vehicle is also the vehicle of
    the controller, and the one that the tank perturbs. `requested` is the scenario as given; `scenario` has the values
    that its seed draws for randomized fields. `given` holds the replaced parts by name.

    Attributes
    ----------
    vehicle : Vehicle
        Nominal vehicle of the controller, with its ballast.
    target : Target
        The target at its true place.
    region : Region
        Weighted sample points in which D is computed.
    route : Route
        Camera poses over time, and the times of the exposures.
    pilot : Pilot
        Source of the goals; by default the route.
    wake : WakeModel
        The controller's model of its jets.
    surroundings : Surroundings
        Obstacles of the planner.
    controller : Controller
        From an estimate and a goal to thrusts.
    estimator : Estimator
        From measurements to an estimate.
    world : World
        Plant and truth.
    start : BodyState
        Start of the mission.

    Examples
    --------
    >>> import wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> parts.vehicle.name, parts.target.name, round(parts.route.duration_s)
    ('paper', 'soft-coral', 96)
    >>> parts.replace(vehicle=ww.load_vehicle("bluerov2-heavy")).controller.name
    'wake-aware'
    """

    def __init__(self, scenario: Scenario, given: Mapping[str, Any] | None = None) -> None:
        self.requested = scenario
        self.scenario = scenario.drawn()
        self.given: Mapping[str, Any] = MappingProxyType(dict(given or {}))
        if "vehicle" in self.given and scenario.ballast:
            raise InputError("ballast: the vehicle was given in Python, take it with its blocks (vehicles.ballast)")

    def replace(self, **given: Any) -> Parts:
        """The same parts with some replaced; what depends on them is made anew.

        Names are `vehicle`, `target`, `region`, `route`, `start`, `pilot`, `wake`, `controller`, `estimator`, `world`,
        `surroundings`; or `scenario`, and fields of the scenario such as `method="dp"` or `seed=3`. A method removes a
        controller that was given. Raises InputError if there is no such part or field, or the value cannot be that
        part.
        """
        scenario = given.pop("scenario", self.requested)
        if not isinstance(scenario, Scenario):
            raise InputError(f"scenario: {quoted(scenario)}, must be a Scenario")
        for name in given.keys() & set(PARTS):
            check_part(name, given[name])
        fields = {name: given.pop(name) for name in list(given) if name not in PARTS}
        if fields:
            scenario = scenario.replace(**fields)
        kept = {name: value for name, value in self.given.items() if name != "controller" or "method" not in fields}
        return Parts(scenario, {**kept, **given})

    @property
    def overrides(self) -> dict[str, str]:
        """The replaced parts in words, by name."""
        return {name: described(value) for name, value in self.given.items()}

    @cached_property
    def external_parts(self) -> dict[str, str]:
        """Parts that are not of this project, in words, by name; record, report and comparison list them."""
        return external_parts(self.scenario, self.given)

    @property
    def method(self) -> str:
        """Name of the flight in tables: the scenario's method, or the name of the given controller."""
        return str(self.controller.name) if "controller" in self.given else self.scenario.method

    @cached_property
    def seeds(self) -> Seeds:
        """Random streams of the trial, one for each use."""
        return Seeds(self.scenario.seed)

    @ReplaceablePart
    def vehicle(self) -> Vehicle:
        """The nominal vehicle, as the controller has it, with its ballast."""
        vehicle = with_blocks(any_vehicle(self.scenario.vehicle), self.scenario.ballast)
        return vehicle.with_ideal_thrusters() if self.scenario.tank.ideal_thrusters else vehicle

    @ReplaceablePart
    def target(self) -> Target:
        """The target at its true place on the bed."""
        settings = self.scenario.target
        return find_target(settings.kind, self.scenario.tank.size_m[2], settings.seed, settings.size_m)

    @cached_property
    def surveyed_target(self) -> Target:
        """The target at its surveyed place, which mission, controller and reconstruction use."""
        place_rng, _ = self.seeds.survey()
        return target_with_error(self.target, self.scenario.calibration_error, place_rng)

    @cached_property
    def compliance(self) -> TargetCompliance | None:
        """How the target bends and slides in flow; None if it is rigid and fixed."""
        settings = self.scenario.target
        tissue = settings.tissue
        weight_N = settings.unanchored.weight_N
        if tissue is None and weight_N is None:
            return None
        loose = None if weight_N is None else UnanchoredTarget(weight_N=weight_N, friction=settings.unanchored.friction)
        drag = tissue.drag if tissue is not None else settings.drag or DRAG
        sway = None if tissue is None else modes_of(self.target, tissue, self.scenario.tank.density_kg_m3)
        return TargetCompliance(drag=drag, sway=sway, loose=loose)

    @ReplaceablePart
    def region(self) -> Region:
        """Weighted sample points in the water around the surveyed target, in which D is computed."""
        settings = self.scenario.target
        return region_of(self.surveyed_target, settings.points, self.seeds, settings.fragility_gain)

    @property
    def finds(self) -> bool:
        """Whether the pilot goes by the camera: then nothing that flies is told the target's place."""
        return self.scenario.pilot in ("find", "survey") and "pilot" not in self.given

    @ReplaceablePart
    def route(self) -> Route:
        """Camera poses over time, and the times of the exposures."""
        if self.finds:
            from wakewise.operation.finding.find_parts import find_route

            return find_route(self)
        centre, mission = self.surveyed_target.centre_W_m, self.scenario.mission
        return plan_route(centre, mission, None if mission.order == "plain" else self.surveyed_current_W_m_s)

    @cached_property
    def surveyed_current_W_m_s(self) -> Array:
        """Current at the target, shape (3,), as surveyed before the flight."""
        water_rng, error_rng = self.seeds.current()
        water = build_ambient(self.scenario.tank, water_rng)
        return current_with_error(water, self.surveyed_target.centre_W_m, error_rng)

    @ReplaceablePart
    def pilot(self) -> Pilot:
        """Source of the goals; by default it follows the route by the clock."""
        from wakewise.operation.pilot_makers import make_pilot

        return make_pilot(self)

    @cached_property
    def control(self) -> ControlSettings:
        """Settings of the controllers: the scenario's, with the simulated operator's seed."""
        settings = flown_by(self.scenario.control, int(self.seeds.operator().integers(2**32)))
        return settings if self._attitude_is_free() else settings.without_attitude_optimization()

    def _attitude_is_free(self) -> bool:
        """Whether the controller may choose the body's attitude: neither mission nor pilot prescribes it.

        Raises InputError if the optimization is set and the mission prescribes what aims the camera.
        """
        aim, wanted = self.scenario.mission.aim, self.scenario.control.allocation.optimize_attitude
        if wanted and aim != "auto":
            raise InputError(
                f"control.allocation.optimize_attitude: true, but mission.aim is {aim}, which prescribes the attitude; "
                "leave mission.aim at auto, or optimize_attitude at null"
            )
        return aim == "auto" and (bool(wanted) or (self.scenario.pilot == "route" and "pilot" not in self.given))

    @ReplaceablePart
    def wake(self) -> WakeModel:
        """The controller's model of its jets."""
        return wake_model(self.scenario.control.wake, self.scenario.tank.size_m[2])

    @ReplaceablePart
    def surroundings(self) -> Surroundings:
        """Obstacles of the planner: bed, walls, surface, stated obstacles, surveyed target."""
        return surroundings_of(self.scenario, self.surveyed_target)

    @ReplaceablePart
    def controller(self) -> Controller[Any]:
        """From an estimate and a goal to thrusts."""
        if self.finds:
            from wakewise.operation.finding.find_parts import find_controller

            return find_controller(self)
        return make_controller(
            self.scenario.method, self.vehicle, self.region, self.wake, self.control, self.surroundings
        )

    @cached_property
    def pipeline(self) -> Pipeline | RegionController:
        """The controller with its failsafe and thruster model, as it is flown.

        The deadline is enforced in a world that does not wait for its controller (see `World`).
        """
        if self.finds:
            from wakewise.operation.finding.region_controller import RegionController

            if isinstance(self.controller, RegionController):
                return self.controller
        enforce = not getattr(self.world, "waits", True)
        return flown_controller(self.controller, self.vehicle, self.region, self.wake, self.control, enforce)

    @ReplaceablePart
    def estimator(self) -> Estimator[Any]:
        """From measurements to an estimate of pose, twist, load and current: an error-state Kalman filter."""
        if self.finds:
            from wakewise.operation.finding.camera_estimator import camera_estimator

            return camera_estimator(self)
        return ErrorStateFilter(self.vehicle, self.scenario.estimation)

    @ReplaceablePart
    def world(self) -> World:
        """The simulated or real world: plant and, if simulated, its truth."""
        if self.finds:
            from wakewise.operation.finding.find_parts import find_world

            return find_world(self)
        from wakewise.operation.worlds.makers import make_world

        return make_world(self)

    @property
    def bounds(self) -> TankBounds:
        """Box of water that the vehicle may be in."""
        return tank_bounds(self.scenario)

    @ReplaceablePart
    def start(self) -> BodyState:
        """Start of the mission, and the first estimate."""
        if self.finds:
            from wakewise.operation.finding.find_parts import find_start

            return find_start(self)
        return self.route.body(0.0, self.aim)

    @cached_property
    def aim(self) -> CameraAim:
        """How the camera is aimed; raises InputError if the mission asks for a joint that the vehicle has not."""
        return aim_of(self.vehicle, self.scenario.mission.aim)

    @property
    def start_tilt_rad(self) -> float:
        """Angle of the camera's joint at the start of the mission."""
        return self.route.tilt(0.0, self.aim)[0]

    @cached_property
    def preflight(self) -> PreflightResult:
        """Result of the checks before a flight; raises InputError if the parts do not fit each other."""
        from wakewise.operation.preflight import preflight

        return preflight(self)

    @cached_property
    def camera(self) -> PinholeCamera | LensCamera:
        """The camera of the scenario."""
        return self.scenario.imaging.camera()

    @property
    def grains(self) -> SiltOptics:
        """Optics of the silt's grains."""
        from wakewise.vision.imaging import SiltOptics

        silt = self.scenario.tank.silt
        return SiltOptics(diameter_m=silt.grain_m, density_kg_m3=silt.grain_density_kg_m3)

    @cached_property
    def scene(self) -> Scene:
        """The textured target on its bed, for rendering."""
        from wakewise.vision.imaging import LedPanels, Scene

        length, width, _ = self.scenario.tank.size_m
        return Scene.build(self.target, self.scenario.target.seed, panels=LedPanels.over_tank(length, width))


PARTS: tuple[str, ...] = tuple(name for name, value in vars(Parts).items() if isinstance(value, ReplaceablePart))
"""Names of the parts that can be replaced."""

_RECORDS: dict[str, type] = {
    "vehicle": Vehicle,
    "target": Target,
    "region": Region,
    "route": Route,
    "start": BodyState,
    "surroundings": Surroundings,
}


def check_part(name: str, given: object) -> None:
    """Raise InputError if a value cannot be the part of that name; its type or what is missing is named."""
    if name in _RECORDS:
        instance_of(given, _RECORDS[name], name)
    else:
        protocol_part(given, name)


def tank_bounds(scenario: Scenario) -> TankBounds:
    """The box of the tank's water."""
    length, width, depth = scenario.tank.size_m
    return TankBounds(
        low_W_m=np.array([-length / 2, -width / 2, 0.0]), high_W_m=np.array([length / 2, width / 2, depth])
    )


def surroundings_of(scenario: Scenario, target: Target | None = None) -> Surroundings:
    """Obstacles of a planner: bed, walls and surface of the tank, stated obstacles, the target if given."""
    bounds = tank_bounds(scenario)
    obstacles = np.array(scenario.control.obstacles).reshape(-1, 4)
    names = tuple(f"obstacle {k + 1} (control.obstacles)" for k in range(len(obstacles)))
    around = np.zeros((0, 4)) if target is None else covering_spheres(target.mesh.vertices_m)
    return Surroundings.tank(
        bounds.low_W_m, bounds.high_W_m, np.vstack([obstacles, around]), (*names, *("the target",) * len(around))
    )


CACHED_REGIONS = 16
"""Regions in the cache, the last ones used; 300 points are 12 kB."""

_regions: dict[bytes, Region] = {}
_regions_lock = Lock()

CACHED_MODES = 8
"""Soft targets whose modes are in the cache, the last ones used; one's modes are 1 MB."""

_modes: dict[bytes, BendingModes] = {}
_modes_lock = Lock()


def modes_of(target: Target, tissue: TissueProperties, water_kg_m3: float) -> BendingModes:
    """Stems and modes of a soft target, cached by its shape and depth, tissue and water.

    Raises InputError as `BendingModes.of`.
    """
    key = _shape_digest(target, tissue, float(water_kg_m3), target.bed_z_m)
    with _modes_lock:
        return _cached(_modes, CACHED_MODES, key, lambda: BendingModes.of(target, tissue, water_kg_m3))


def region_of(target: Target, points: int, seeds: Seeds, fragility_gain: float = 0.0) -> Region:
    """Sample points around a target, cached by its shape and place, the number of points, the seed and the gain.

    With `fragility_gain` above 0 thin and sharp features of the target weigh more. Raises InputError as
    `sample_region`.
    """

    def sampled() -> Region:
        marks = find_fragility(target.mesh) if fragility_gain > 0.0 else None
        return sample_region(target, points, seeds.region(), marks, fragility_gain)

    key = _shape_digest(target, points, seeds.seed, float(fragility_gain), target.bed_z_m, target.radius_m)
    with _regions_lock:
        return _cached(_regions, CACHED_REGIONS, key, sampled)


def _cached(cache: dict[bytes, T], most: int, key: bytes, make: Callable[[], T]) -> T:
    """The value of a key, made where it is not there; the last used are kept, so many at most."""
    found = cache.pop(key) if key in cache else make()
    cache[key] = found
    while len(cache) > most:
        del cache[next(iter(cache))]
    return found


def _shape_digest(target: Target, *more: Any) -> bytes:
    """Digest of a target's mesh and place and of what else counts; its name does not."""
    digest = blake2b(repr(more).encode())
    for values in (target.mesh.vertices_m, target.mesh.faces, target.centre_W_m):
        digest.update(repr(values.shape).encode())
        digest.update(np.ascontiguousarray(values).data)
    return digest.digest()

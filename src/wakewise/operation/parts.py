"""What a flight is built from: parts, each made from the scenario when first asked for, each replaceable.

Here, and nowhere below, the controller's world and the true one are made side by side: the world gets its own,
perturbed vehicle parameters and its own water; the controller gets the nominal vehicle and a wake model.

The region of a flight, kept: drawing its points takes seconds, and flights that are compared share them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from hashlib import blake2b
from threading import Lock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar, overload

import numpy as np

from wakewise.control import ControlSettings, Pipeline, make_controller
from wakewise.control.settings import flown_by
from wakewise.core.arrays import Array
from wakewise.core.checks import has_methods, instance_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Controller, Estimator, Pilot, WakeModel, World
from wakewise.estimation import ErrorStateFilter
from wakewise.operation.calibration_error import current_with_error, target_with_error
from wakewise.operation.pilot_makers import make_pilot
from wakewise.operation.plugin_adapter import described, external_parts, flown_controller
from wakewise.operation.preflight import PreflightResult, preflight, surroundings_of, tank_bounds
from wakewise.operation.randomization import Seeds
from wakewise.operation.worlds.makers import make_world
from wakewise.planning import Surroundings
from wakewise.robot.importers import any_vehicle
from wakewise.robot.vehicles import Vehicle
from wakewise.robot.vehicles.ballast import with_blocks
from wakewise.scene.missions import CameraAim, Route, TankBounds, aim_of, plan_route
from wakewise.scene.targets import BendingModes, Region, Target, find_fragility, find_target, sample_region
from wakewise.simulation.tank import build_ambient
from wakewise.simulation.tank.soft_body import DRAG, TargetCompliance, UnanchoredTarget
from wakewise.wake import wake_model

if TYPE_CHECKING:
    from wakewise.operation.scenario import Scenario
    from wakewise.vision.imaging import LensCamera, PinholeCamera, Scene


MOST_KEPT = 16
"""Regions that are kept, the last ones asked for: 300 points are 12 kB."""

_kept: dict[bytes, Region] = {}
_one_at_a_time = Lock()


def region_of(target: Target, points: int, seeds: Seeds, fragility_gain: float = 0.0) -> Region:
    """Points that stand for the water round a target; asking again for the same is answered from memory.

    Parameters
    ----------
    target : Target
        What counts is its shape and place, not which object it is.
    points : int
    seeds : Seeds
    fragility_gain : float
        Above 0 the target's delicate features are found and weighted, see `sample_region`.

    Raises
    ------
    InputError
        As `sample_region`.
    """
    key = _fingerprint(target, points, seeds, fragility_gain)
    with _one_at_a_time:
        found = _kept.pop(key, None)
        if found is None:
            marks = find_fragility(target.mesh) if fragility_gain > 0.0 else None
            found = sample_region(target, points, seeds.region(), marks, fragility_gain)
        _kept[key] = found  # the last one asked for is the last to go
        while len(_kept) > MOST_KEPT:
            del _kept[next(iter(_kept))]
        return found


def _fingerprint(target: Target, points: int, seeds: Seeds, fragility_gain: float) -> bytes:
    """Of all that the points follow from; the name stands in errors only, of which nothing is kept."""
    told = blake2b(repr((points, seeds.seed, float(fragility_gain), target.bed_z_m, target.radius_m)).encode())
    for values in (target.mesh.vertices_m, target.mesh.faces, target.centre_W_m):
        told.update(repr(values.shape).encode())
        told.update(np.ascontiguousarray(values).data)
    return told.digest()


T = TypeVar("T")


class part(cached_property[T]):  # noqa: N801  (a decorator, like cached_property)
    """A part that is made when first asked for, unless another one was given in its place."""

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> T: ...

    def __get__(self, instance: Any, owner: type[Any] | None = None) -> Self | T:
        """The part that was given, or the scenario's own, made once."""
        if instance is None:
            return self
        if self.attrname in instance.given:
            given: T = instance.given[self.attrname]
            return given
        once = instance.scenario.overrides.get(self.attrname or "")
        if once is not None:  # the scenario of a trial that was flown with another part than it can name
            raise InputError(
                f"{self.attrname}: was given in Python ({once}), which a scenario's file cannot hold; "
                f"give it again with replace({self.attrname}=...)"
            )
        return super().__get__(instance, owner)

    def __repr__(self) -> str:
        """What `help(Parts)` shows of it: its type, and what it is."""
        return f"<part, {self.func.__annotations__.get('return', '')}: {(self.__doc__ or '').partition('.')[0]}>"


class Parts:
    """The parts of one flight: what its scenario says, with what was put in its place.

    Parts are made when they are first asked for (no planner is compiled to look at the water), from the scenario and
    from each other: another vehicle is also what the controller is made for and what the tank perturbs.

    Parameters
    ----------
    scenario : Scenario
        What it leaves to be drawn is drawn here: `asked` is the scenario as given, `scenario` the one world of it that
        is flown.
    given : mapping
        Names of parts and what stands in their place; see `replace`.

    Attributes
    ----------
    vehicle : Vehicle
        As the controller believes it to be, with its ballast.
    target : Target
        What is looked at.
    region : Region
        Points and weights that stand for the water to spare.
    route : Route
        Camera poses over time, and when the shutter opens.
    pilot : Pilot
        Where goals come from: by default the route.
    wake : WakeModel
        What the controller believes its jets do.
    surroundings : Surroundings
        What a planner keeps clear of.
    controller : Controller
        From an estimate and a goal to thrusts.
    estimator : Estimator
        From measurements to an estimate.
    world : World
        Where the vehicle really flies.
    start : BodyState
        Where the mission begins.

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
        self.asked = scenario
        self.scenario = scenario.drawn()
        self.given: Mapping[str, Any] = MappingProxyType(dict(given or {}))
        if "vehicle" in self.given and scenario.ballast:
            raise InputError("ballast: the vehicle was given in Python, take it with its blocks (vehicles.ballast)")

    def replace(self, **given: Any) -> Parts:
        """The same parts with others in place of some; what depends on them is made anew.

        Parameters
        ----------
        **given
            `vehicle`, `target`, `region`, `route`, `start`, `pilot`, `wake`, `controller`, `estimator`, `world`,
            `surroundings`; or `scenario`, and fields of the scenario by their first name such as `method="dp"` or
            `seed=3`.

        Raises
        ------
        InputError
            If there is no such part or field, or what is given cannot be that part.
        """
        scenario = given.pop("scenario", self.asked)
        if not (hasattr(scenario, "drawn") and hasattr(scenario, "parts")):
            raise InputError(f"scenario: {quoted(scenario)}, must be a Scenario")
        for name in given.keys() & set(PARTS):
            check_part(name, given[name])
        fields = {name: given.pop(name) for name in list(given) if name not in PARTS}
        if fields:
            scenario = scenario.replace(**fields)
        kept = {name: value for name, value in self.given.items() if name not in _MADE_BY.get("method", ())}
        return Parts(scenario, {**(kept if "method" in fields else self.given), **given})

    @property
    def overrides(self) -> dict[str, str]:
        """What was put in place of the scenario's own parts, in words, by name."""
        return {name: described(value) for name, value in self.given.items()}

    @cached_property
    def from_outside(self) -> dict[str, str]:
        """Parts that are not this package's own, by name, in words; scenario, report and comparison name them."""
        return external_parts(self)

    @property
    def method(self) -> str:
        """What the flight is called in tables: the scenario's method, or the name of the controller given."""
        return str(self.controller.name) if "controller" in self.given else self.scenario.method

    @cached_property
    def seeds(self) -> Seeds:
        """Random streams of the trial, one for each use."""
        return Seeds(self.scenario.seed)

    @part
    def vehicle(self) -> Vehicle:
        """The vehicle as it is believed to be, with its ballast."""
        vehicle = with_blocks(any_vehicle(self.scenario.vehicle), self.scenario.ballast)
        return vehicle.with_ideal_thrusters() if self.scenario.tank.ideal_thrusters else vehicle

    @part
    def target(self) -> Target:
        """What is looked at, standing on the bed, where it truly is."""
        settings = self.scenario.target
        return find_target(settings.kind, self.scenario.tank.size_m[2], settings.seed, settings.size_m)

    @cached_property
    def found_target(self) -> Target:
        """The target where mission, controller and reconstruction take it to be (see `operation.survey`)."""
        place_rng, _ = self.seeds.survey()
        return target_with_error(self.target, self.scenario.calibration_error, place_rng)

    @cached_property
    def yielding(self) -> TargetCompliance | None:
        """How the target gives way to the water; None of one that nothing moves."""
        settings = self.scenario.target
        tissue = settings.tissue
        weight_N = settings.unanchored.weight_N
        if tissue is None and weight_N is None:
            return None
        loose = None if weight_N is None else UnanchoredTarget(weight_N=weight_N, friction=settings.unanchored.friction)
        drag = tissue.drag if tissue is not None else settings.drag or DRAG
        sway = None if tissue is None else BendingModes.of(self.target, tissue, self.scenario.tank.density_kg_m3)
        return TargetCompliance(drag=drag, sway=sway, loose=loose)

    @part
    def region(self) -> Region:
        """Points that stand for the water round the target, where it is taken to be."""
        settings = self.scenario.target
        return region_of(self.found_target, settings.points, self.seeds, settings.fragility_gain)

    @part
    def route(self) -> Route:
        """Where the camera is wished to be, when, and when the shutter opens."""
        centre, mission = self.found_target.centre_W_m, self.scenario.mission
        return plan_route(centre, mission, None if mission.order == "plain" else self.surveyed_current_W_m_s)

    @cached_property
    def surveyed_current_W_m_s(self) -> Array:
        """The current at the target, shape (3,), as it is known before the flight."""
        water_rng, error_rng = self.seeds.current()
        water = build_ambient(self.scenario.tank, water_rng)
        return current_with_error(water, self.found_target.centre_W_m, error_rng)

    @part
    def pilot(self) -> Pilot:
        """Where goals come from: by default the route, by the clock."""
        return make_pilot(self)

    @cached_property
    def control(self) -> ControlSettings:
        """What the controllers are told: the scenario's settings and who flies, nothing of the water flown in."""
        told = flown_by(self.scenario.control, int(self.seeds.person().integers(2**32)))
        return told if self._leans else told.without_attitude_optimization()

    @property
    def _leans(self) -> bool:
        """Whether a controller may choose the body's attitude: where the mission leaves it open, and no pilot flies by
        the body's own place.

        Raises
        ------
        InputError
            If that is asked for and the mission says what aims the camera.
        """
        aim, wanted = self.scenario.mission.aim, self.scenario.control.allocation.optimize_attitude
        if wanted and aim != "auto":
            raise InputError(
                f"control.allocation.optimize_attitude: true, but mission.aim is {aim}, which says how the body "
                "stands: leave "
                "mission.aim at auto, or posture at null"
            )
        return aim == "auto" and (bool(wanted) or (self.scenario.pilot == "route" and "pilot" not in self.given))

    @part
    def wake(self) -> WakeModel:
        """What the controller believes its jets do."""
        return wake_model(self.scenario.control.wake, self.scenario.tank.size_m[2])

    @part
    def surroundings(self) -> Surroundings:
        """What a planner keeps clear of."""
        return surroundings_of(self.scenario, self.found_target)

    @part
    def controller(self) -> Controller[Any]:
        """From an estimate and a goal to thrusts."""
        return make_controller(
            self.scenario.method,
            self.vehicle,
            self.region,
            self.wake,
            self.control,
            self.surroundings,
        )

    @part
    def estimator(self) -> Estimator[Any]:
        """From measurements to an estimate."""
        return ErrorStateFilter(self.vehicle, self.scenario.estimation)

    @part
    def world(self) -> World:
        """Plant and witness: where the vehicle really flies."""
        return make_world(self)

    @property
    def bounds(self) -> TankBounds:
        """The water that the vehicle may be in."""
        return tank_bounds(self.scenario)

    @part
    def start(self) -> BodyState:
        """Where the mission begins, which is all that the estimator is told."""
        return self.route.body(0.0, self.aim)

    @cached_property
    def aim(self) -> CameraAim:
        """What the camera is aimed with; raises InputError where the mission asks for a joint that is not there."""
        return aim_of(self.vehicle, self.scenario.mission.aim)

    @property
    def start_tilt_rad(self) -> float:
        """Angle of the camera's joint when the mission begins."""
        return self.route.tilt(0.0, self.aim)[0]

    @cached_property
    def preflight(self) -> PreflightResult:
        """What was found when the parts were held against each other; raises InputError where they do not fit."""
        return preflight(self)

    @cached_property
    def flying(self) -> Pipeline:
        """The controller as it is flown, with failsafe and thruster model."""
        return flown_controller(self)

    @cached_property
    def camera(self) -> PinholeCamera | LensCamera:
        """The camera of the scenario."""
        return self.scenario.imaging.camera()

    @cached_property
    def scene(self) -> Scene:
        """The target on its bed, textured, as the camera finds it."""
        from wakewise.vision.imaging import LedPanels, Scene

        length, width, _ = self.scenario.tank.size_m
        return Scene.build(self.target, self.scenario.target.seed, panels=LedPanels.over_tank(length, width))


PARTS: tuple[str, ...] = tuple(name for name, value in vars(Parts).items() if isinstance(value, part))
"""Names of the parts that can be replaced."""

_MADE_BY = {"method": ("controller",)}
"""Parts that give way when this field of the scenario is replaced."""

_RECORDS: dict[str, type] = {
    "vehicle": Vehicle,
    "target": Target,
    "region": Region,
    "route": Route,
    "start": BodyState,
    "surroundings": Surroundings,
}
_METHODS: dict[str, tuple[str, ...]] = {
    "pilot": ("goal",),
    "wake": ("unit_velocity",),
    "controller": ("init", "step"),
    "estimator": ("init", "step"),
    "world": ("begin",),
}
"""What a part of a kind that is a Protocol must have at least (see `wakewise.core.interfaces`)."""


def check_part(name: str, given: object) -> None:
    """Refuse what cannot be the part of that name.

    Raises
    ------
    InputError
        Naming what it is instead, or the methods that it lacks.
    """
    if name in _RECORDS:
        instance_of(given, _RECORDS[name], name)
    else:
        has_methods(given, _METHODS[name], name, name)

"""A controller whose protected region follows the estimate of the target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wakewise.control import make_controller
from wakewise.control.failsafe import Incidents
from wakewise.control.pipeline import Pipeline, PipelineState
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal, TargetEstimate
from wakewise.operation.parts import Parts, surroundings_of
from wakewise.operation.plugin_adapter import flown_controller
from wakewise.perception.target_shape import ball, protected_region
from wakewise.planning import Surroundings, covering_spheres
from wakewise.scene.targets import Region

LEAST_S = 0.2
"""A new region is not taken sooner than this after the last: making a controller takes 10 to 20 ms."""
NEAR_M, SPHERES, SPHERE_M = 0.6, 12, 0.1
"""Of all that is in view, what is so near to the vehicle is an obstacle, as so many spheres of this radius at most."""


class RegionController:
    """`wakewise.core.interfaces.Controller` that is made anew, with the same state, when the target's region changes.

    `make` gives the pipeline of a region and of what the hull must not touch of it, spheres, shape (k, 4); `first` is
    the region before there is an estimate. `in_view`: the region is all that is in view.
    """

    def __init__(self, make: Callable[[Region, Array], Pipeline], first: Region, in_view: bool = False) -> None:
        self._make, self._in_view = make, in_view
        self._pipeline = self._start = make(first, np.zeros((0, 4)))
        self._version, self._age_s = -1, np.inf

    @property
    def name(self) -> str:
        """Method name."""
        return self._pipeline.name

    @property
    def incidents(self) -> Incidents:
        """Troubles by kind."""
        return self._pipeline.incidents

    def init(self) -> PipelineState:
        """State before the first step."""
        self._pipeline, self._version, self._age_s = self._start, -1, np.inf
        return self._pipeline.init()

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Command]:
        """As the pipeline of the present region."""
        target = estimate.target
        self._age_s += dt_s
        if target is not None and target.version != self._version and self._age_s >= LEAST_S:
            region = Region.of_estimate(target)
            solid = near_spheres(region, estimate.X_WB.p_m) if self._in_view else ball_of(target)
            self._pipeline = replace(self._make(region, solid), incidents=self._pipeline.incidents)
            self._version, self._age_s = target.version, 0.0
        return self._pipeline.step(state, dt_s, estimate, goal)


def ball_of(target: TargetEstimate) -> Array:
    """The sphere round a target, shape (1, 4)."""
    return np.array([[*target.centre_W_m, target.radius_m]])


def near_spheres(region: Region, p_W_m: Array) -> Array:
    """Spheres, shape (k, 4), round the points of a region's surface that are near to a place, shape (3,)."""
    surface = region.points_W_m[region.distance_m <= 0.0]
    near = surface[np.linalg.norm(surface - p_W_m, axis=1) < NEAR_M]
    return covering_spheres(near, SPHERE_M, SPHERES)


def region_controller(parts: Parts, X_WC: Pose) -> RegionController:
    """Controller of the scenario's method; before there is an estimate it protects a ball at the stated distance.

    `X_WC`: camera pose at the start.
    """
    settings = parts.scenario.perception
    assumed_W_m, radius_m = X_WC.p_m + settings.assumed_distance_m * X_WC.R[:, 2], settings.assumed_radius_m
    bounds = surroundings_of(parts.scenario)

    def make(region: Region, solid: Array) -> Pipeline:
        around = Surroundings(
            planes=bounds.planes,
            spheres=np.vstack([bounds.spheres, solid]),
            names=(*bounds.names, *("the target",) * len(solid)),
        )
        controller = make_controller(parts.scenario.method, parts.vehicle, region, parts.wake, parts.control, around)
        return flown_controller(controller, parts.vehicle, region, parts.wake, parts.control, False)

    first = protected_region(ball(assumed_W_m, radius_m, 0.1).surface_W_m, None, parts.scenario.target.points)
    return RegionController(make, first, settings.protect == "view")

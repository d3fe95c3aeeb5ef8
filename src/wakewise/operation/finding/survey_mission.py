"""Mission `survey`: transects over a patch at one height, then close orbits round the parts that need them.

The pilot knows the patch's place and size, the bed's depth and the water it may be in. Which parts get an orbit, how
high that is and in which order they are flown is decided after the last transect, by the surface mapped until then.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal, TargetEstimate
from wakewise.operation.finding.missed_parts import CHECKED, MAPPED_MARGIN_M, PhotographedSurface, ViewChooser
from wakewise.operation.scenario.find_settings import SurveySettings
from wakewise.perception.target_shape import thinned
from wakewise.scene.missions import CameraAim, Coverage, Leg, MissionSettings, Route, open_route
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.part_choice import choose_parts, everywhere, middle_of, need_of
from wakewise.scene.missions.point_surface import LEAST_POINTS, MAPPED_CRITERIA, patches_of_points
from wakewise.scene.missions.transects import PartOrbit, PatchTransects, orbits_route, ordered, transect_route

ELEVATIONS_DEG = (30.0, 40.0, 50.0, 60.0, 70.0)
"""Orbits are as low as the hull keeps clear of what is mapped."""
MIDDLE_M = np.zeros(2)
LOOK_DEG = 60.0
"""Angle of the camera below the horizon on transects."""
RELIEF = 0.2
"""Share of the transects' height at which they look, and orbits where nothing is mapped."""
PART_RADIUS_M = 0.3
THINNED_M, AROUND_M, GRID = 0.05, 0.1, 96
"""Spacing of the points by which parts are chosen, how far about the patch they lie, and cells of depth pictures."""
SETTLE_S = 3.0
"""Hover before the first transect."""


log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class OrbitPlanner:
    """Plans orbits by what is mapped; `bed_z_m`: depth of the bed, `views`: what is known of vehicle and water."""

    survey: SurveySettings
    bed_z_m: float
    views: ViewChooser

    def plan(
        self, target: TargetEstimate | None, taken_from: Sequence[Pose], over_z_m: float, last: Leg
    ) -> tuple[list[PartOrbit], Route]:
        """Orbits in the order in which they are flown, and the route through them; parts without a clear one have none.

        - `target`: its mapped surface; None if there is none. `taken_from`: X_WC of the photographs so far.
        - `over_z_m`: depth at which the camera is clear of everything; `last`: the leg that it comes from.
        """
        survey, coverage = self.survey, self._coverage(target, taken_from)
        points, covered = np.zeros((0, 3)), np.zeros(0, np.bool_)
        if coverage is not None:
            points, covered = coverage.patches.points_W_m, coverage.covered
        if survey.orbits == "everywhere":
            middles = everywhere(MIDDLE_M, np.array(survey.size_m), PART_RADIUS_M)
        else:
            need = need_of(points, covered, MIDDLE_M, np.array(survey.size_m))
            middles = choose_parts(need, PART_RADIUS_M, survey.least_orbits, survey.most_orbits)
        assert last.centre_W_m is not None
        end_W_m = last.centre_W_m + last.shift_W_m
        orbits = ordered([orbit for middle in middles if (orbit := self._lowest(middle, points))], end_W_m)
        clear = partial(self._clear, solid_W_m=_some(points))
        return orbits, orbits_route(orbits, end_W_m, last.end, over_z_m, self.views.mission, len(taken_from), clear)

    def load_kernels(self, X_WC: Pose) -> None:
        """Have what counts coverage compiled or loaded, which takes a second, before the flight."""
        points = X_WC.p_m + X_WC.R[:, 2] + np.random.default_rng(0).uniform(-0.2, 0.2, (2 * LEAST_POINTS, 3))
        patches = patches_of_points(points, np.tile(-X_WC.R[:, 2], (len(points), 1)), THINNED_M)
        Coverage.begin(patches, None, MAPPED_CRITERIA).seen(X_WC, self.views.lens).seen(X_WC, self.views.lens)

    def _coverage(self, target: TargetEstimate | None, taken_from: Sequence[Pose]) -> Coverage | None:
        """Coverage of the mapped patch and a little around it, thinned to `THINNED_M`."""
        if target is None or target.surface_W_m is None or target.towards_W is None:
            return None
        aside = np.abs(target.surface_W_m[:, :2] - MIDDLE_M) - 0.5 * np.array(self.survey.size_m)
        kept = np.flatnonzero((aside < AROUND_M).all(axis=1))
        kept = kept[thinned(target.surface_W_m[kept], THINNED_M)]
        if len(kept) < LEAST_POINTS:
            return None
        patches = patches_of_points(target.surface_W_m[kept], target.towards_W[kept], THINNED_M)
        coverage = Coverage.begin(patches, None, replace(MAPPED_CRITERIA, grid=GRID))
        for X_WC in taken_from:
            coverage = coverage.seen(X_WC, self.views.lens)
        return coverage

    def _lowest(self, plan_m: Array, points_W_m: Array) -> PartOrbit | None:
        """The lowest orbit round a part at which the hull keeps clear of what is mapped; None if there is none."""
        views, count, range_m = self.views, self.survey.orbit_views, self.views.mission.standoff_m
        centre = middle_of(points_W_m, plan_m, PART_RADIUS_M, self.bed_z_m - RELIEF * self.survey.height_m)
        away = np.linalg.norm(points_W_m[:, :2] - plan_m, axis=1)
        solid = _some(points_W_m[away < range_m + 2.0 * float(np.max(views.size_m))])
        azimuths = 2.0 * math.pi / CHECKED * np.arange(CHECKED)
        for elevation in np.radians(ELEVATIONS_DEG).tolist():
            if all(self._clear(camera_pose(centre, float(a), elevation, range_m), solid) for a in azimuths):
                return PartOrbit(centre_W_m=centre, elevation_rad=elevation, range_m=range_m, views=count)
        words = (
            "no orbit round the part at %.1f, %.1f m: the hull would come too near to what is mapped, at any elevation"
        )
        log.warning(words, *plan_m.tolist())
        return None

    def _clear(self, X_WC: Pose, solid_W_m: Array) -> bool:
        """Whether the hull keeps clear of what is mapped and of the water's bounds, with its camera at a pose."""
        gaps = self.views.gaps(X_WC, solid_W_m)
        return min(gaps.values()) >= self.views.mission.clearance_m + MAPPED_MARGIN_M


class SurveyPilot:
    """A `Pilot` and `PhotoSchedule` that flies transects, chooses parts, and flies orbits round them.

    `bed_z_m`: depth of the bed; `chooser`: says what the photographs saw well.
    """

    found_s: float | None = 0.0
    accepted_s: float | None = 0.0

    def __init__(
        self, bed_z_m: float, aim: CameraAim, mission: MissionSettings, survey: SurveySettings, chooser: ViewChooser
    ) -> None:
        self._aim, self._mission, self._survey, self.chooser = aim, mission, survey, chooser
        self._planner = OrbitPlanner(survey=survey, bed_z_m=bed_z_m, views=chooser)
        self.transects = transect_route(transects_of(survey, bed_z_m), mission, SETTLE_S)
        self._planner.load_kernels(self.transects.X_WC_planned[0])
        self.begin()

    def begin(self) -> None:
        """Forget an earlier flight."""
        self._phase: Literal["transects", "orbits", "done"] = "transects"
        self._route, self._since_s = self.transects, 0.0
        self._first = 0
        self.photographed: PhotographedSurface | None = None
        self.parts: list[PartOrbit] = []
        self.replanned_ms: float | None = None
        self._mapped: TargetEstimate | None = None
        self._camera, self._tilt, self._taken_from = self.transects.X_WC_planned[0], 0.0, list[Pose]()

    @property
    def phase(self) -> str:
        """What is being done."""
        return self._phase

    def done(self) -> bool:
        """Whether the mission is over."""
        return self._phase == "done"

    @property
    def planned(self) -> int:
        """How many photographs transects and orbits have."""
        return len(self.transects.exposures_s) + self._survey.orbit_views * len(self.parts)

    def most_s(self) -> float:
        """Longest time that the mission may take."""
        survey, speed = self._survey, self._mission.speed_m_s
        orbits = {"none": 0, "chosen": survey.most_orbits}.get(survey.orbits)
        if orbits is None:
            orbits = len(everywhere(MIDDLE_M, np.array(survey.size_m), PART_RADIUS_M))
        around_m = 2.0 * math.pi * self._mission.standoff_m + 2.0 * survey.height_m + math.hypot(*survey.size_m)
        return self.transects.duration_s + 1.0 + orbits * (around_m / speed + 30.0)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Reference of the leg under way."""
        if estimate.target is not None and estimate.target.surface_W_m is not None:
            self._mapped = estimate.target
        if time_s - self._since_s >= self._route.duration_s and self._phase != "done":
            self._next(time_s)
        self._camera = estimate.X_WB @ self._aim.mount(self._tilt)
        X_WB, nu_B, self._tilt = self._route.reference(time_s - self._since_s, self._aim)
        return Goal(
            X_WB=X_WB, nu_B=nu_B, tilt_rad=self._tilt, max_tracking_deviation=self._mission.max_tracking_deviation
        )

    def leg_name(self, time_s: float) -> str:
        """What the vehicle is doing."""
        return self._phase if self._phase == "done" else self._route.leg_name(time_s - self._since_s)

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """When photograph `number` is taken, if in the step that begins at `time_s`."""
        opens_s = self._route.shutter_s(number - self._first, time_s - self._since_s, dt_s)
        if opens_s is None or self._phase == "done":
            return None
        self._taken_from.append(self._camera)
        return opens_s + self._since_s

    def _next(self, time_s: float) -> None:
        """After the transects the orbits, after these the end; what was seen well is kept."""
        last = self._route.legs[-1]
        if self._phase == "transects" and self._survey.orbits != "none":
            began = time.thread_time()
            over = float(self.transects.X_WC_planned[0].p_m[2])
            self.parts, route = self._planner.plan(self._mapped, self._taken_from, over, last)
            self.replanned_ms = 1e3 * (time.thread_time() - began)
            if self.parts:
                self._route, self._first = route, len(self.transects.exposures_s)
                self._phase, self._since_s = "orbits", time_s
                return
        self.photographed = self._seen()
        self._phase, self._since_s = "done", time_s
        self._route = open_route(self._route.centre_W_m, 1.0, "done", last.end)

    def _seen(self) -> PhotographedSurface | None:
        """What the photographs saw well of the mapped surface; None if too little of it is mapped."""
        if self._mapped is None:
            return None
        return self.chooser.photographed(self._mapped, self._taken_from, with_views=False)


def _some(points_W_m: Array) -> Array:
    """Points to keep clear of, one far away where there is none."""
    return points_W_m if len(points_W_m) else np.full((1, 3), 1e6)


def transects_of(survey: SurveySettings, bed_z_m: float) -> PatchTransects:
    """The survey's lines over a bed at this depth."""
    look = math.radians(LOOK_DEG)
    return PatchTransects(
        middle_m=MIDDLE_M,
        size_m=np.array(survey.size_m),
        depth_m=bed_z_m - survey.height_m,
        ahead_m=(1.0 - RELIEF) * survey.height_m / math.tan(look),
        spacing_m=survey.spacing_m,
        every_m=survey.photo_every_m,
        look_rad=look,
    )


def waiting_route(pilot: SurveyPilot) -> Route:
    """The transects, with the time that the mission may take in all."""
    return replace(pilot.transects, duration_s=pilot.most_s())

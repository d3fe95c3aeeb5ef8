"""Mission `find`: look at what is in view from two sides, detect the target, approach it, scan it, see what was missed.

The pilot knows where the vehicle starts, and a distance at which something is assumed to be. All its legs are arcs
about the centre that the camera has found so far, which moves slowly enough for the vehicle to follow.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal, TargetEstimate
from wakewise.operation.finding.missed_parts import PhotographedSurface, ViewChooser, route_through
from wakewise.operation.scenario.find_settings import FindSettings
from wakewise.scene.missions import CameraAim, Leg, MissionSettings, Route
from wakewise.scene.missions.route import open_route, plan_route, rest_to_rest

FOLLOWS_M_S = 0.03
"""Largest speed at which the legs' centre follows the estimate."""
LOWEST_RAD = math.radians(5.0)
ROUND_RAD = math.radians(50.0)
"""How far round the target it flies while it comes near: with the look before, a quarter of a circle."""

log = logging.getLogger(__name__)


PhaseName = Literal["look", "approach", "hold", "scan", "missed parts", "done"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Phase:
    """What is flown: legs about the centre, from a time on."""

    name: PhaseName
    route: Route
    since_s: float


class FindPilot:
    """A `Pilot` and `PhotoSchedule` that looks, detects, approaches, scans, and photographs what the scan has missed.

    - `start`: camera pose X_WC at the start; `assumed_m`: distance of what it looks at.
    - `aim`: what aims the camera; `chooser`: chooses views of what was missed.
    """

    def __init__(
        self,
        start: Pose,
        assumed_m: float,
        aim: CameraAim,
        mission: MissionSettings,
        find: FindSettings,
        chooser: ViewChooser | None = None,
    ) -> None:
        self._aim, self._requested, self._find, self._chooser = aim, mission, find, chooser
        self._start, self._assumed_m = start, assumed_m
        self.begin()

    def begin(self) -> None:
        """Forget an earlier flight: what is known at the start of one."""
        self._mission = self._requested
        self.centre_W_m = self._start.p_m + self._assumed_m * self._start.R[:, 2]
        self._here = on_sphere(self._start.p_m - self.centre_W_m)
        self._last_s = 0.0
        self._phase = _Phase(name="look", route=self._look(), since_s=0.0)
        self.found_s: float | None = None
        self.accepted_s: float | None = None
        self.photographed: PhotographedSurface | None = None
        self._camera, self._taken_from, self._further = self._start, list[Pose](), 0
        self._tilt = 0.0

    @property
    def phase(self) -> str:
        """What is being done."""
        return self._phase.name

    def done(self) -> bool:
        """Whether the mission is over."""
        return self._phase.name == "done"

    @property
    def planned(self) -> int:
        """How many photographs the scan has, and those of what it missed."""
        return sum(self._mission.views) + self._further

    def most_s(self) -> float:
        """Longest time that the mission may take."""
        scan = plan_route(self.centre_W_m, self._mission)
        mission = self._mission
        view_s = math.pi * mission.standoff_m / mission.speed_m_s + mission.speed_m_s / mission.acceleration_m_s2
        approach_m = self._assumed_m * (1.0 + ROUND_RAD)
        approach_s = approach_m / mission.speed_m_s + view_s
        before_s = self._find.give_up_s + 2.0 * self._phase.route.duration_s + approach_s + self._find.hold_s
        return before_s + scan.duration_s + self._find.further_views * view_s

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Reference of the present phase about the centre found so far."""
        target = estimate.target
        velocity = self._follow(time_s, target)
        self._advance(time_s, target)
        self._camera = estimate.X_WB @ self._aim.mount(self._tilt)
        route = replace(self._phase.route, centre_W_m=self.centre_W_m)
        X_WB, nu_B, tilt = route.reference(time_s - self._phase.since_s, self._aim)
        nu_B, self._tilt = nu_B.copy(), tilt
        nu_B[:3] += X_WB.R.T @ velocity
        return Goal(X_WB=X_WB, nu_B=nu_B, tilt_rad=tilt, max_tracking_deviation=self._mission.max_tracking_deviation)

    def leg_name(self, time_s: float) -> str:
        """What the vehicle is doing."""
        if self._phase.name not in ("scan", "missed parts"):
            return self._phase.name
        return self._phase.route.leg_name(time_s - self._phase.since_s)

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:
        """When photograph `number` is taken, if in the step that begins at `time_s`; none before the scan."""
        if self._phase.name not in ("scan", "missed parts"):
            return None
        since_s = self._phase.since_s
        first = 0 if self._phase.name == "scan" else sum(self._mission.views)
        opens_s = self._phase.route.shutter_s(number - first, time_s - since_s, dt_s)
        if opens_s is None:
            return None
        self._taken_from.append(self._camera)
        return opens_s + since_s

    def _look(self) -> Route:
        """Settle, then arcs to one side and to the other, about what is in view."""
        azimuth, elevation, distance = self._here
        side = math.radians(self._find.look_deg)
        legs, starts, clock_s, here = [], [], self._find.settle_s, self._here
        for name, turn in (("look left", -side), ("look right", side)):
            end = np.array([azimuth + turn, elevation, distance])
            leg = rest_to_rest(name, here, end, self._mission.speed_m_s, self._mission.acceleration_m_s2)
            legs.append(leg)
            starts.append(clock_s)
            clock_s, here = clock_s + leg.duration_s, end
        return _route(self.centre_W_m, legs, starts, clock_s)

    def _follow(self, time_s: float, target: TargetEstimate | None) -> Array:
        """Move the centre towards the estimate; its velocity, shape (3,)."""
        dt_s, self._last_s = time_s - self._last_s, time_s
        if target is None or target.status == "assumed" or dt_s <= 0.0 or self._phase.name == "hold":
            return np.zeros(3)
        way = target.centre_W_m - self.centre_W_m
        far = float(np.linalg.norm(way))
        step = way if far <= FOLLOWS_M_S * dt_s else way * (FOLLOWS_M_S * dt_s / far)
        # In the last centimetre it closes in by a share, so that the desired velocity is smooth.
        step = step * min(1.0, far / 0.01) if far < 0.01 else step
        self.centre_W_m = self.centre_W_m + step
        return np.asarray(step / dt_s)

    def _advance(self, time_s: float, target: TargetEstimate | None) -> None:
        """Begin the next phase where the present one is over."""
        phase, into_s = self._phase, time_s - self._phase.since_s
        known = target is not None and target.status in ("tracked", "lost")
        if self.found_s is None and target is not None and target.status != "assumed":
            self.found_s = time_s
        if self.accepted_s is None and known:
            self.accepted_s = time_s
        if phase.name == "done":
            return
        if self.accepted_s is None and time_s >= self._find.give_up_s:
            self._begin("done", open_route(self.centre_W_m, 1.0, "done", self._at(time_s)), time_s)
        elif into_s < phase.route.duration_s:
            return
        elif phase.name in ("scan", "missed parts"):
            self._after_photographs(time_s, target)
        elif phase.name == "look" and target is not None and target.status != "assumed":
            self._keep_clear(target)
            self._begin("approach", self._approach(), time_s)
        elif not known:  # what is proposed is looked at from near, what is not from here again
            self._here = self._at(time_s)
            self._begin("look", self._look(), time_s)
        elif phase.name == "approach" and self._find.hold_s > 0.0:
            self._begin("hold", open_route(self.centre_W_m, self._find.hold_s, "hold", self._at(time_s)), time_s)
        else:
            if target is not None:
                self._keep_clear(target)
            self._begin("scan", self._scan(time_s), time_s)

    def _after_photographs(self, time_s: float, target: TargetEstimate | None) -> None:
        """Photograph what the scan has missed, once, or end."""
        here, goes_on = self._at(time_s), self._phase.name == "scan"
        if target is not None and self._chooser is not None:
            self.photographed = self._chooser.photographed(target, self._taken_from, with_views=goes_on)
        if self.photographed is not None and self._chooser is not None and goes_on:
            places = self._chooser.further(self.photographed, self._camera, self._find.further_views)
            if places:
                self._further = len(places)
                route = route_through(places, here, self.centre_W_m, self._mission)
                self._begin("missed parts", route, time_s)
                return
        self._begin("done", open_route(self.centre_W_m, 1.0, "done", here), time_s)

    def _begin(self, name: PhaseName, route: Route, time_s: float) -> None:
        self._phase = _Phase(name=name, route=route, since_s=time_s)

    def _at(self, time_s: float) -> Array:
        """Azimuth, elevation and range of the camera that the present phase asks for."""
        return self._phase.route.on_sphere(time_s - self._phase.since_s)[0]

    def _approach(self) -> Route:
        """From where the look ended to the standoff at the first orbit's elevation, and round the target meanwhile.

        A straight way would show it from one side. The depth of what was seen from one side only is a guess; from a
        quarter of a circle each view's depth is measured across another view.
        """
        here = self._phase.route.legs[-1].end
        end = np.array([here[0] + ROUND_RAD, math.radians(self._mission.elevations_deg[0]), self._mission.standoff_m])
        leg = rest_to_rest("approach", here, end, self._mission.speed_m_s, self._mission.acceleration_m_s2)
        return _route(self.centre_W_m, [leg], [0.0], leg.duration_s)

    def _keep_clear(self, target: TargetEstimate) -> None:
        """Raise orbits on which the hull would come too near to the floor or to what is mapped of the target."""
        if self._chooser is None:
            return
        before, now = self._mission.elevations_deg, []
        for desired_deg in self._requested.elevations_deg:
            elevation_deg, below = self._chooser.clear_elevation_deg(target, desired_deg)
            now.append(elevation_deg)
            if below and elevation_deg not in before:
                log.warning(
                    "orbit at %g deg raised to %g deg: the hull would come nearer to %s than mission.clearance_m",
                    desired_deg, elevation_deg, below,
                )  # fmt: skip
        self._mission = self._mission.model_copy(update={"elevations_deg": tuple(now)})

    def _scan(self, time_s: float) -> Route:
        """The mission's orbits, begun at the azimuth where the vehicle is."""
        settings = self._mission.model_copy(update={"approach_m": 0.0, "settle_s": 0.0})
        planned = plan_route(self.centre_W_m, settings)
        turn = np.array([float(self._at(time_s)[0] - planned.legs[0].start[0]), 0.0, 0.0])
        legs = tuple(replace(leg, start=leg.start + turn, end=leg.end + turn) for leg in planned.legs)
        return replace(planned, legs=legs)


def _route(centre_W_m: Array, legs: list[Leg], starts: list[float], duration_s: float) -> Route:
    return Route(
        centre_W_m=centre_W_m,
        legs=tuple(legs),
        starts_s=np.array(starts),
        exposures_s=np.zeros(0),
        exposure_names=(),
        X_WC_planned=(),
        duration_s=duration_s,
    )


def on_sphere(from_centre_W_m: Array) -> Array:
    """Azimuth, elevation and range, shape (3,), of a camera's place relative to the centre."""
    x, y, z = from_centre_W_m.tolist()
    return np.array(
        [math.atan2(y, x), max(math.atan2(-z, math.hypot(x, y)), LOWEST_RAD), math.sqrt(x * x + y * y + z * z)]
    )

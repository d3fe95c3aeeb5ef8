"""What photographs of a found target have missed, and from where to take more, by the surface mapped in flight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TargetEstimate
from wakewise.operation.finding import MISSED_RGB, SEEN_RGB
from wakewise.perception.surface_map import CELL_M
from wakewise.scene.missions import (
    CameraAim,
    CandidateViews,
    Coverage,
    CoverageGaps,
    MissionSettings,
    Route,
    SurfacePatches,
    TankBounds,
    find_coverage_gaps,
    reachable_views,
)
from wakewise.scene.missions.clearance import gaps_of, hull_corners
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.point_surface import LEAST_POINTS, MAPPED_CRITERIA, patches_of_points
from wakewise.scene.missions.route import rest_to_rest
from wakewise.scene.missions.visibility import CameraIntrinsics
from wakewise.vision.reconstruction import OrientedPointCloud

CHECKED = 8
"""Places of an orbit at which clearance is looked at."""
MAPPED_MARGIN_M = 0.05
"""By which the mapped surface may lie nearer than it was mapped, besides the mission's clearance."""
STEP_DEG, STEEPEST_DEG = 2.5, 80.0
"""An orbit that is not clear is raised in such steps, up to this elevation."""
LAST_S = 0.5
"""The last shutter closes before the recording ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotographedSurface:
    """Coverage of the mapped surface by the photographs so far, and its gaps."""

    coverage: Coverage
    gaps: CoverageGaps

    def as_cloud(self) -> OrientedPointCloud:
        """The mapped surface, coloured by whether it was seen well."""
        patches = self.coverage.patches
        colours = np.where(self.coverage.covered[:, None], SEEN_RGB, MISSED_RGB)
        return OrientedPointCloud(points_m=patches.points_W_m, normals=patches.normals, colours=colours)

    def as_dict(self) -> dict[str, float]:
        """Shares in percent, as found.json has them."""
        return {
            "seen_well_pct": 100.0 * self.coverage.share,
            "unseen_pct": 100.0 * self.gaps.unseen,
            "poorly_pct": 100.0 * self.gaps.poorly,
            "seldom_pct": 100.0 * self.gaps.seldom,
            "photographs": float(self.coverage.photos),
        }


@dataclass(frozen=True, kw_only=True)
class ViewChooser:
    """Chooses further views; what it knows of the vehicle and of the water, nothing of the true target.

    `lens`: the camera as the crew knows it; `aim`, `size_m`, shape (3,), `bounds` and `mission`: as of
    `reachable_views`.
    """

    lens: CameraIntrinsics
    aim: CameraAim
    size_m: Array
    bounds: TankBounds
    mission: MissionSettings
    cell_m: float = CELL_M

    def photographed(
        self, target: TargetEstimate, taken_from: Sequence[Pose], *, with_views: bool = True
    ) -> PhotographedSurface | None:
        """Coverage by photographs from camera poses X_WC; None if too little of the target is mapped.

        `with_views` looks for places of further views, too, which takes most of the time.
        """
        surface, towards = target.surface_W_m, target.towards_W
        if surface is None or towards is None or len(surface) < LEAST_POINTS:
            return None
        patches = patches_of_points(surface, towards, self.cell_m)
        views = self._views(patches, target) if with_views else None
        coverage = Coverage.begin(patches, views, MAPPED_CRITERIA)
        for X_WC in taken_from:
            coverage = coverage.seen(X_WC, self.lens)
        return PhotographedSurface(coverage=coverage, gaps=find_coverage_gaps(coverage, taken_from, self.lens))

    def _views(self, patches: SurfacePatches, target: TargetEstimate) -> CandidateViews:
        """Places at the standoff from which the vehicle can photograph the target."""
        assert target.surface_W_m is not None
        return reachable_views(
            patches,
            self.lens,
            centre_W_m=target.centre_W_m,
            ranges_m=(self.mission.standoff_m,),
            aim=self.aim,
            size_m=self.size_m,
            bounds=self.bounds,
            target_W_m=target.surface_W_m,
            clearance_m=self.mission.clearance_m,
            need=MAPPED_CRITERIA,
        )

    def gaps(self, X_WC: Pose, solid_W_m: Array) -> dict[str, float]:
        """Distances of the hull, its camera at a pose, from the water's bounds and from points, shape (n, 3), in m."""
        pitch = math.asin(float(np.clip(-X_WC.R[2, 2], -1.0, 1.0)))
        mount = self.aim.mount(self.aim.tilt(pitch)[0]).inverse()
        return gaps_of(X_WC @ mount, self.size_m, self.bounds, solid_W_m)

    def clear_elevation_deg(self, target: TargetEstimate, desired_deg: float) -> tuple[float, str]:
        """Lowest elevation from the desired one on at which the orbit keeps the clearance, and what is below it.

        What is below is "" if the desired one is clear. Bounds are known, the target as far as it is mapped, else as
        a ball.
        """
        ball = target.centre_W_m + hull_corners(np.full(3, 2.0 * target.radius_m / math.sqrt(3.0)))
        known = (target.surface_W_m, target.points_W_m, ball)
        solid = next(points for points in known if points is not None and len(points))
        clearance_m, elevation_deg, below = self.mission.clearance_m, desired_deg, ""
        # Higher up, the surface and the walls are no farther.
        least = {"the floor": clearance_m, "the target": clearance_m + MAPPED_MARGIN_M}
        azimuths = (2.0 * math.pi / CHECKED * np.arange(CHECKED)).tolist()
        while True:
            elevation_rad, range_m = math.radians(elevation_deg), self.mission.standoff_m
            poses = [camera_pose(target.centre_W_m, azimuth, elevation_rad, range_m) for azimuth in azimuths]
            around = [self.gaps(X_WC, solid) for X_WC in poses]
            blocks = next((what for what in least if min(gaps[what] for gaps in around) < least[what]), "")
            if not blocks or elevation_deg + STEP_DEG > STEEPEST_DEG:
                return elevation_deg, below
            below, elevation_deg = below or blocks, elevation_deg + STEP_DEG

    def further(self, surface: PhotographedSurface, X_WC: Pose, most: int) -> list[Array]:
        """Azimuth, elevation and range of further views, shape (3,) each, in the order in which they are flown to."""
        coverage, places = surface.coverage, list[Array]()
        while len(places) < most and (best := coverage.best_view(X_WC)) is not None:
            places.append(coverage.views.places[best])
            X_WC = coverage.views.pose(best)
            coverage = coverage.seen(X_WC, self.lens).without_view(best)
        return places


def route_through(places: Sequence[Array], here: Array, centre_W_m: Array, mission: MissionSettings) -> Route:
    """Legs from a place to views one after another, on spheres, with a photograph at the end of each.

    `here` and `places`: azimuth, elevation and range, shape (3,).
    """
    legs, starts, opens, clock_s = [], [], [], 0.0
    for number, place in enumerate(places):
        end = place.copy()
        end[0] = here[0] + np.remainder(end[0] - here[0] + np.pi, 2.0 * np.pi) - np.pi
        leg = rest_to_rest(f"view {number + 1}", here, end, mission.speed_m_s, mission.acceleration_m_s2)
        legs.append(leg)
        starts.append(clock_s)
        clock_s += leg.duration_s
        opens.append(clock_s)
        here = end
    return Route(
        centre_W_m=centre_W_m,
        legs=tuple(legs),
        starts_s=np.array(starts),
        exposures_s=np.array(opens),
        exposure_names=(),
        X_WC_planned=(),
        duration_s=clock_s + LAST_S,
    )

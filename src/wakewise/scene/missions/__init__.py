"""Missions: viewpoints, orbits, timed routes, camera aim, and coverage of a target by photographs.

- `orbit.py`: settings of a mission; viewpoints on hemispheres, and where each orbit starts.
- `route.py`: timed routes with shutter instants, and the pilot that follows them.
- `aim.py`: camera aim by pitch, tilt joint or both. `clearance.py`: collisions and tilts that the joint cannot follow.
- `coverage.py`: coverage of the target by photographs and its gaps; `visibility.py`: what one photograph shows well;
  `reachability.py`: next views that the hull can reach.
- `transects.py`: lines over a patch at one height, and orbits round parts of it; `part_choice.py`: which parts.
"""

from wakewise.scene.missions.aim import CameraAim, aim_of
from wakewise.scene.missions.clearance import TankBounds, check_clearance, check_tilt
from wakewise.scene.missions.coverage import Coverage, CoverageGaps, find_coverage_gaps
from wakewise.scene.missions.orbit import MissionSettings, Orbit, layered_orbits
from wakewise.scene.missions.reachability import CandidateViews, reachable_views
from wakewise.scene.missions.route import SETTLING, Leg, Route, RoutePilot, open_route, plan_route
from wakewise.scene.missions.visibility import SurfacePatches, VisibilityCriteria, patches_of

__all__ = [
    "SETTLING",
    "CameraAim",
    "CandidateViews",
    "Coverage",
    "CoverageGaps",
    "Leg",
    "MissionSettings",
    "Orbit",
    "Route",
    "RoutePilot",
    "SurfacePatches",
    "TankBounds",
    "VisibilityCriteria",
    "aim_of",
    "check_clearance",
    "check_tilt",
    "find_coverage_gaps",
    "layered_orbits",
    "open_route",
    "patches_of",
    "plan_route",
    "reachable_views",
]

"""What to look at, from where, in what order and when: viewpoints, layered orbits, timed routes.

Start reading in `route.py` (legs, shutter, the pilot that follows them) and `orbit.py` (viewpoints on layered
hemispheres), `orbit.py` (which of them is the first); `aim.py` is what points the camera there (pitch, tilt joint or
both), `clearance.py` refuses what would touch and tilts that the joint cannot follow, `orbit.py` is what a user may
say. `coverage.py` says what of the target photographs have seen well (`visibility.py`, `visibility.py`) and where
to go next (`reachability.py`), `coverage.py` why a part was not seen.
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

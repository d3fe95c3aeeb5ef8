"""What to look at, from where, in what order and when: viewpoints, layered orbits, timed routes.

Start reading in `route.py` (legs, shutter, the pilot that follows them) and `orbit.py` (viewpoints on layered
hemispheres); `clearance.py` refuses what would touch, `settings.py` is what a user may say.
"""

from wakewise.missions.clearance import TankBounds, check_clearance
from wakewise.missions.orbit import Orbit, layered_orbits
from wakewise.missions.route import SETTLING, Leg, Route, RoutePilot, open_route, plan_route
from wakewise.missions.settings import MissionSettings

__all__ = [
    "SETTLING",
    "Leg",
    "MissionSettings",
    "Orbit",
    "Route",
    "RoutePilot",
    "TankBounds",
    "check_clearance",
    "layered_orbits",
    "open_route",
    "plan_route",
]

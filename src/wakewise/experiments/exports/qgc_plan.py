"""A route as QGroundControl's `.plan`: a waypoint per photograph, with heading and depth.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. Waypoints are
MAV_CMD_NAV_WAYPOINT (16) in MAV_FRAME_GLOBAL_RELATIVE_ALT (3): heights above home, which is the
origin at the surface, so depths are negative. Autopilots keep latitudes in steps of 1e-7 degree: a waypoint is no
better than 1.1 cm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import write_json
from wakewise.core.geometry import euler_from_quat
from wakewise.experiments.exports.records import Trajectory

# WGS 84 (NIMA TR8350.2): half of the larger axis, and the square of the eccentricity.
_A_M, _E2 = 6378137.0, 6.69437999014e-3
_WAYPOINT, _RELATIVE_ALT = 16, 3
_ARDUPILOT, _SUBMARINE = 3, 12


@dataclass(frozen=True)
class GeodeticOrigin:
    """Where the world's origin lies: latitude and longitude in degrees, WGS 84, at the water's surface."""

    lat_deg: float
    lon_deg: float

    def __post_init__(self) -> None:
        if not (abs(self.lat_deg) <= 89.0 and abs(self.lon_deg) <= 180.0):
            raise InputError(
                f"origin: {self.lat_deg:g}, {self.lon_deg:g}, allowed latitudes -89 to 89, longitudes -180 to 180 deg"
            )

    def place(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Latitudes and longitudes in degrees of points north and east of the origin, shapes (n,).

        The surface is taken for flat with the ellipsoid's two radii of curvature at the origin (Torge & Müller 2012,
        "Geodesy"); at 100 m that is wrong by less than 2 mm up to 60 degrees of latitude.
        """
        lat = math.radians(self.lat_deg)
        bend = 1.0 - _E2 * math.sin(lat) ** 2
        meridian_m, normal_m = _A_M * (1.0 - _E2) / bend**1.5, _A_M / math.sqrt(bend)
        lats = self.lat_deg + np.degrees(np.asarray(north_m) / meridian_m)
        lons = self.lon_deg + np.degrees(np.asarray(east_m) / (normal_m * math.cos(lat)))
        return lats, (lons + 180.0) % 360.0 - 180.0


def write_plan(path: Path, waypoints: Trajectory, origin: GeodeticOrigin, speed_m_s: float) -> None:
    """Write a mission through the poses of a vehicle, in their order, at one speed."""
    lats, lons = origin.place(waypoints.p_W_m[:, 0], waypoints.p_W_m[:, 1])
    headings = np.degrees(euler_from_quat(waypoints.q)[:, 2]) % 360.0
    items = [
        _item(k + 1, float(lat), float(lon), -float(p[2]), float(heading))
        for k, (lat, lon, p, heading) in enumerate(zip(lats, lons, waypoints.p_W_m, headings, strict=True))
    ]
    mission = {
        "cruiseSpeed": speed_m_s,
        "hoverSpeed": speed_m_s,
        "firmwareType": _ARDUPILOT,
        "vehicleType": _SUBMARINE,
        "globalPlanAltitudeMode": 1,
        "plannedHomePosition": [origin.lat_deg, origin.lon_deg, 0.0],
        "items": items,
        "version": 2,
    }
    write_json(
        path,
        {
            "fileType": "Plan",
            "version": 1,
            "groundStation": "QGroundControl",
            "geoFence": {"circles": [], "polygons": [], "version": 2},
            "rallyPoints": {"points": [], "version": 2},
            "mission": mission,
        },
    )


def _item(number: int, lat: float, lon: float, height_m: float, heading_deg: float) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "command": _WAYPOINT,
        "doJumpId": number,
        "frame": _RELATIVE_ALT,
        # Hold in s, radius of acceptance and of passing by (the vehicle's own), heading, place.
        "params": [0, 0, 0, heading_deg, lat, lon, height_m],
        "Altitude": height_m,
        "AltitudeMode": 1,
        "AMSLAltAboveTerrain": None,
        "autoContinue": True,
    }

"""QGroundControl's missions: places, depths, headings."""

import json
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler
from wakewise.experiments.exports import GeodeticOrigin, Trajectory, write_plan


def _ecef(lat_deg: float, lon_deg: float, height_m: float) -> np.ndarray:
    """Earth-centred coordinates by the textbook's formula (WGS 84)."""
    a, f = 6378137.0, 1.0 / 298.257223563
    e2 = f * (2.0 - f)
    lat, lon = np.radians([lat_deg, lon_deg])
    normal = a / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    across = (normal + height_m) * np.cos(lat)
    return np.array([across * np.cos(lon), across * np.sin(lon), (normal * (1.0 - e2) + height_m) * np.sin(lat)])


@pytest.mark.parametrize(
    "origin", [GeodeticOrigin(36.52, -6.28), GeodeticOrigin(-60.0, 179.9995), GeodeticOrigin(0.0, 0.0)]
)
def test_places_are_where_the_ellipsoid_has_them(origin: GeodeticOrigin) -> None:
    """Reckoned back through Earth-centred coordinates, points within 100 m are right to 2 mm, also across 180 deg."""
    rng = np.random.default_rng(1)
    north, east = rng.uniform(-70.0, 70.0, (2, 30))
    lat, lon = np.radians([origin.lat_deg, origin.lon_deg])
    to_ned = np.array(
        [
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [-np.sin(lon), np.cos(lon), 0.0],
        ]
    )
    lats, lons = origin.place(north, east)
    assert (np.abs(lons) <= 180.0).all()
    for k in range(30):
        back = to_ned @ (_ecef(lats[k], lons[k], 0.0) - _ecef(origin.lat_deg, origin.lon_deg, 0.0))
        np.testing.assert_allclose(back, [north[k], east[k]], atol=2e-3)


def test_a_waypoint_is_below_home_and_faces_as_the_vehicle(tmp_path: Path) -> None:
    """Depth is a negative height, a heading of west is 270, and the items are numbered in their order."""
    track = Trajectory(
        times_s=np.array([0.0, 1.0]),
        p_W_m=np.array([[1.0, 0.0, 1.5], [0.0, -2.0, 0.5]]),
        q=np.array([quat_from_euler(0.0, 0.1, 0.0), quat_from_euler(0.0, 0.0, -np.pi / 2)]),
    )
    write_plan(tmp_path / "a.plan", track, GeodeticOrigin(40.0, 3.0), 0.1)
    plan = json.loads((tmp_path / "a.plan").read_text())
    assert (plan["fileType"], plan["version"], plan["mission"]["version"]) == ("Plan", 1, 2)
    assert plan["mission"]["plannedHomePosition"] == [40.0, 3.0, 0.0]
    first, second = plan["mission"]["items"]
    assert (first["type"], first["command"], first["frame"], first["doJumpId"]) == ("SimpleItem", 16, 3, 1)
    assert first["params"][6] == first["Altitude"] == -1.5
    assert first["params"][4] > 40.0
    assert first["params"][5] == pytest.approx(3.0, abs=1e-12)
    assert second["params"][3] == pytest.approx(270.0, abs=1e-9)
    assert second["params"][5] < 3.0
    assert len(first["params"]) == 7


@pytest.mark.parametrize(("lat", "lon"), [(91.0, 0.0), (89.5, 0.0), (0.0, 181.0), (float("nan"), 0.0)])
def test_an_origin_off_the_globe_is_refused(lat: float, lon: float) -> None:
    """So is one at a pole, where there is no east."""
    with pytest.raises(InputError, match="-89 to 89"):
        GeodeticOrigin(lat, lon)

"""Transects over a patch, and orbits round parts of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.scene.missions import MissionSettings, Route
from wakewise.scene.missions.transects import (
    MOST_ORDERED,
    PartOrbit,
    PatchTransects,
    orbits_route,
    ordered,
    transect_route,
)

MISSION = MissionSettings(standoff_m=0.6)
PATCH = PatchTransects(
    middle_m=np.zeros(2),
    size_m=np.array([2.0, 2.0]),
    depth_m=1.4,
    ahead_m=0.4,
    spacing_m=0.5,
    every_m=0.2,
    look_rad=math.radians(60.0),
)
ROUTE = transect_route(PATCH, MISSION, 3.0)
ORBITS = [
    PartOrbit(centre_W_m=np.array([x, y, 2.0]), elevation_rad=math.radians(40.0), range_m=0.6, views=12)
    for x, y in ((0.5, 0.5), (-0.5, -0.4), (0.6, -0.5))
]


def through(clear: bool) -> Route:
    """The orbits from the end of the transects."""
    end = ROUTE.legs[-1]
    assert end.centre_W_m is not None
    return orbits_route(ORBITS, end.centre_W_m + end.shift_W_m, end.end, 1.4, MISSION, 40, lambda _: clear)


def jumps(route: Route) -> list[float]:
    """How far the camera is at the end of each leg from where the next one begins, m and rad together."""
    found = []
    for begin in route.starts_s[1:].tolist():
        before, behind = route.camera(begin - 1e-9)[0], route.camera(begin + 1e-9)[0]
        found.append(float(np.linalg.norm(before.p_m - behind.p_m) + np.abs(before.R - behind.R).max()))
    return found


def test_transects_are_at_one_height_and_look_ahead_and_down() -> None:
    """All photographs are taken at the depth, half of them towards north and half towards south."""
    poses = ROUTE.X_WC_planned
    np.testing.assert_allclose([X_WC.p_m[2] for X_WC in poses], 1.4)
    axes = np.array([X_WC.R[:, 2] for X_WC in poses])
    np.testing.assert_allclose(axes[:, 2], math.sin(math.radians(60.0)))
    assert (axes[:, 0] > 0.0).sum() == (axes[:, 0] < 0.0).sum() == len(poses) / 2
    assert {round(float(X_WC.p_m[1]), 6) for X_WC in poses} == {-0.75, -0.25, 0.25, 0.75}


@pytest.mark.parametrize("route", [ROUTE, through(True), through(False)], ids=["transects", "direct", "over"])
def test_the_camera_never_jumps(route: Route) -> None:
    """Each leg begins where and as the one before ended; photographs are planned where the camera then is."""
    assert max(jumps(route)) < 1e-6
    for time_s, planned in zip(route.exposures_s, route.X_WC_planned, strict=True):
        np.testing.assert_allclose(route.camera(float(time_s))[0].p_m, planned.p_m, atol=1e-9)
        np.testing.assert_allclose(route.camera(float(time_s))[0].R, planned.R, atol=1e-9)


@pytest.mark.parametrize("route", [ROUTE, through(False)], ids=["transects", "over"])
def test_velocity_is_the_derivative_of_the_place(route: Route) -> None:
    """On transects, turns, ways and orbits, and no faster than the mission says."""
    for time_s in np.linspace(3.5, route.duration_s - 1.0, 41):
        h = 1e-5
        after, before = (route.camera(float(time_s) + d)[0].p_m for d in (h, -h))
        v_W = route.camera(float(time_s))[1]
        np.testing.assert_allclose(v_W, (after - before) / (2.0 * h), atol=1e-5)
        assert np.linalg.norm(v_W) < 1.05 * MISSION.speed_m_s


def test_orbits_have_their_views_and_look_at_their_parts() -> None:
    """Each orbit has its photographs all round, aimed at its middle, numbered on."""
    route = through(True)
    assert len(route.X_WC_planned) == 36
    assert route.exposure_names[0] == "040.png"
    for number, orbit in enumerate(ORBITS):
        for X_WC in route.X_WC_planned[12 * number : 12 * (number + 1)]:
            way = orbit.centre_W_m - X_WC.p_m
            assert np.linalg.norm(way) == pytest.approx(0.6)
            np.testing.assert_allclose(X_WC.R[:, 2], way / 0.6, atol=1e-9)


def test_what_is_not_clear_is_flown_over() -> None:
    """Where the direct way is not clear, the camera goes up to the transects' depth first; that is longer."""
    direct, over = through(True), through(False)
    assert sum(leg.length_m for leg in over.legs) > sum(leg.length_m for leg in direct.legs)
    assert any(leg.name.startswith("over") for leg in over.legs)
    assert not any(leg.name.startswith("over") for leg in direct.legs)


@given(places=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=MOST_ORDERED + 2))
def test_a_tour_has_every_orbit_once(places: list[tuple[float, float]]) -> None:
    """Few and many orbits are ordered without one lost."""
    orbits = [PartOrbit(centre_W_m=np.array([*at, 2.0]), elevation_rad=0.7, range_m=0.6, views=4) for at in places]
    tour = ordered(orbits, np.zeros(3))
    assert {id(orbit) for orbit in tour} == {id(orbit) for orbit in orbits}
    assert len(tour) == len(orbits)


def test_a_tour_is_short() -> None:
    """Parts in a row are visited along the row, few and many."""
    for count in (4, MOST_ORDERED + 3):
        row = [
            PartOrbit(centre_W_m=np.array([0.3 * k, 0.0, 2.0]), elevation_rad=0.7, range_m=0.6, views=4)
            for k in range(count)
        ]
        shuffled = [row[k] for k in np.random.default_rng(0).permutation(count)]
        assert [orbit.centre_W_m[0] for orbit in ordered(shuffled, np.array([-1.0, 0.0, 1.0]))] == [
            orbit.centre_W_m[0] for orbit in row
        ]

"""Views of what photographs have missed: coverage of a mapped surface, where to go next, and the way there."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.core.interfaces import TargetEstimate
from wakewise.operation.finding.missed_parts import LAST_S, PhotographedSurface, ViewChooser, route_through
from wakewise.perception.surface_map import CELL_M
from wakewise.scene.missions import CameraAim, MissionSettings, TankBounds
from wakewise.scene.missions.orbit import R_FC, camera_pose
from wakewise.scene.missions.point_surface import LEAST_POINTS
from wakewise.vision.imaging import PinholeCamera

CENTRE = np.array([0.0, 0.0, 1.0])
RADIUS = 0.06
MISSION = MissionSettings()


def ball_directions() -> Array:
    """Directions spread evenly, as many as a ball has points a cell of the map apart; shape (n, 3)."""
    n = round(4.0 * math.pi * RADIUS**2 / CELL_M**2)
    k = np.arange(n) + 0.5
    down, turn = np.arccos(1.0 - 2.0 * k / n), math.pi * (1.0 + math.sqrt(5.0)) * k
    return np.stack([np.cos(turn) * np.sin(down), np.sin(turn) * np.sin(down), np.cos(down)], axis=1)


OUT = ball_directions()
SURFACE = CENTRE + RADIUS * OUT


def estimate(**fields: Any) -> TargetEstimate:
    """A target that is a ball, with fields of its estimate replaced."""
    known: dict[str, Any] = {
        "time_s": 0.0,
        "status": "tracked",
        "centre_W_m": CENTRE,
        "covariance": 1e-6 * np.eye(3),
        "radius_m": RADIUS,
        "points_W_m": CENTRE + 0.05 * np.eye(3),
        "weights": np.ones(3),
        "distance_m": np.zeros(3),
        "surface_W_m": SURFACE,
        "towards_W": OUT,
    }
    return TargetEstimate(**(known | fields))


CHOOSER = ViewChooser(
    lens=PinholeCamera(1280, 960, math.radians(80.0)),
    aim=CameraAim(X_BC=camera_pose(np.zeros(3), math.pi, 0.0, 0.2)),
    size_m=np.full(3, 0.3),
    bounds=TankBounds(low_W_m=np.array([-3.0, -2.5, 0.0]), high_W_m=np.array([3.0, 2.5, 2.5])),
    mission=MISSION,
)


def at(azimuth_deg: float, elevation_deg: float = 20.0, range_m: float = 0.5) -> Pose:
    return camera_pose(CENTRE, math.radians(azimuth_deg), math.radians(elevation_deg), range_m)


def one_side(azimuth_deg: float) -> list[Pose]:
    """Poses of eighteen photographs from within 50 degrees of an azimuth, at two heights."""
    return [at(azimuth_deg + aside, elevation) for elevation in (20.0, 45.0) for aside in range(-50, 51, 12)]


@cache
def seen_from(azimuth_deg: float) -> PhotographedSurface:
    """The ball after photographs from one side: choosing views changes nothing of it."""
    return photographed(one_side(azimuth_deg))


def photographed(taken_from: list[Pose], chooser: ViewChooser = CHOOSER) -> PhotographedSurface:
    surface = chooser.photographed(estimate(), taken_from)
    assert surface is not None
    return surface


def apart_rad(one: float, other: float) -> float:
    """Least angle between two azimuths."""
    return abs(math.remainder(one - other, 2.0 * math.pi))


def test_a_mapped_surface_is_checked_and_read_only() -> None:
    """Points and directions are copied, three numbers each and as many of the one as of the other."""
    points, towards = SURFACE.copy(), OUT.copy()
    target = estimate(surface_W_m=points, towards_W=towards)
    points[:] = 0.0
    towards[:] = 0.0
    assert target.surface_W_m is not None
    assert target.towards_W is not None
    assert (target.surface_W_m == SURFACE).all()
    assert (target.towards_W == OUT).all()
    for held in (target.surface_W_m, target.towards_W):
        with pytest.raises(ValueError, match="read-only"):
            held[0, 0] = 1.0


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"towards_W": OUT[:-1]}, "towards_W"),
        ({"towards_W": OUT[:, :2]}, "towards_W"),
        ({"towards_W": None}, "towards_W"),
        ({"surface_W_m": SURFACE[:, :2]}, "surface_W_m"),
        ({"surface_W_m": SURFACE.ravel()}, "surface_W_m"),
    ],
)
def test_a_surface_of_a_wrong_shape_is_refused(fields: dict[str, Any], name: str) -> None:
    """Directions that are too few or missing, and points that are no points in space, are refused by their name."""
    with pytest.raises(InputError, match=name):
        estimate(**fields)


def test_without_a_mapped_surface_nothing_is_told() -> None:
    """No surface, or one of too few points, has no coverage; the least number of points has one."""
    few = LEAST_POINTS - 1
    for fields in (
        {"surface_W_m": None, "towards_W": None},
        {"surface_W_m": SURFACE[:few], "towards_W": OUT[:few]},
        {"surface_W_m": np.empty((0, 3)), "towards_W": np.empty((0, 3))},
    ):
        assert CHOOSER.photographed(estimate(**fields), one_side(0.0)) is None
    enough = estimate(surface_W_m=SURFACE[:LEAST_POINTS], towards_W=OUT[:LEAST_POINTS])
    assert CHOOSER.photographed(enough, one_side(0.0)) is not None


def test_photographs_from_one_side_show_that_side() -> None:
    """What faces them is seen well, the other side is not; without a photograph nothing is."""
    surface = seen_from(0.0)
    well, side = surface.coverage.covered, (at(0.0, 30.0).p_m - CENTRE) / 0.5
    assert well[OUT @ side > 0.6].all()
    assert not well[OUT @ side < -0.5].any()
    assert surface.coverage.photos == len(one_side(0.0))
    nothing = photographed([])
    assert nothing.coverage.share == 0.0
    assert nothing.as_dict()["unseen_pct"] == 100.0


def test_shares_are_told_in_percent_and_add_up() -> None:
    """What is seen well and the three kinds of gaps make the whole surface; photographs are counted."""
    for count in (0, 2, 7, 18):
        surface = photographed(one_side(0.0)[:count])
        told = surface.as_dict()
        assert told["seen_well_pct"] == pytest.approx(100.0 * surface.coverage.share)
        shares = [value for name, value in told.items() if name.endswith("_pct")]
        assert len(shares) == 4
        assert all(0.0 <= share <= 100.0 for share in shares)
        assert sum(shares) == pytest.approx(100.0)
        assert told["photographs"] == count
        assert all(isinstance(value, float) for value in told.values())


def test_the_surface_is_coloured_by_what_was_seen_well() -> None:
    """Points that are seen well have one colour, the others another."""
    surface = seen_from(0.0)
    cloud = surface.as_cloud()
    well = surface.coverage.covered
    assert (cloud.points_m == SURFACE).all()
    assert cloud.colours is not None
    colours = np.asarray(cloud.colours)
    assert len(np.unique(colours[well], axis=0)) == len(np.unique(colours[~well], axis=0)) == 1
    assert (colours[well][0] != colours[~well][0]).any()


@pytest.mark.parametrize("side_deg", [0.0, 60.0, 180.0, 290.0])
def test_the_first_further_view_is_on_the_other_side(side_deg: float) -> None:
    """After photographs from one side all further views show what they did not, the first from the other side."""
    taken = one_side(side_deg)
    surface = seen_from(side_deg)
    places = CHOOSER.further(surface, taken[-1], 8)
    assert len(places) == 8
    aside = [apart_rad(float(place[0]), math.radians(side_deg)) for place in places]
    assert aside[0] > math.radians(100.0)
    assert min(aside) > math.radians(75.0)


@pytest.mark.parametrize("most", [0, 1, 3, 12])
def test_further_views_are_different_ones_and_no_more_than_asked_for(most: int) -> None:
    """At most so many are named, each a view that the vehicle can reach, at the standoff; fewer are the first ones."""
    taken = one_side(0.0)
    surface = seen_from(0.0)
    places = CHOOSER.further(surface, taken[-1], most)
    assert len(places) <= most
    reachable = {tuple(place) for place in surface.coverage.views.places.tolist()}
    assert all(tuple(place.tolist()) in reachable for place in places)
    assert all(place[2] == MISSION.standoff_m for place in places)
    assert np.array_equal(places, CHOOSER.further(surface, taken[-1], 12)[:most])
    assert len({tuple(place.tolist()) for place in places}) == len(places)


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(-180.0, 180.0), st.floats(5.0, 75.0)), max_size=6), st.integers(1, 10))
@settings(max_examples=8, deadline=None)
def test_further_views_never_cover_less(taken: list[tuple[float, float]], most: int) -> None:
    """Wherever photographs were taken, those from the further views add to what is seen well or leave it."""
    taken_from = [at(*place) for place in taken]
    surface = photographed(taken_from)
    coverage = surface.coverage
    score = coverage.score.mean()
    for place in CHOOSER.further(surface, at(0.0), most):
        after = coverage.seen(camera_pose(CENTRE, *place.tolist()), CHOOSER.lens)
        assert after.share >= coverage.share
        assert after.score.mean() > coverage.score.mean()
        coverage = after
    assert coverage.score.mean() > score


def test_further_views_bring_much_after_one_side() -> None:
    """Eight views more raise what is seen well from half of a ball to more than three quarters."""
    taken = one_side(0.0)
    surface = seen_from(0.0)
    more = [camera_pose(CENTRE, *place.tolist()) for place in CHOOSER.further(surface, taken[-1], 8)]
    assert surface.coverage.share < 0.6
    assert photographed(taken + more).coverage.share > 0.75


def test_choosing_views_leaves_what_was_photographed() -> None:
    """The surface that views are chosen for is not changed by choosing them."""
    surface = seen_from(0.0)
    before = surface.as_dict(), surface.coverage.level.copy()
    CHOOSER.further(surface, at(0.0), 5)
    assert surface.as_dict() == before[0]
    assert (surface.coverage.level == before[1]).all()


def test_when_all_is_seen_well_there_is_no_further_view() -> None:
    """After photographs from every view within reach none is worth going to."""
    views = photographed([]).coverage.views
    everywhere = photographed([views.pose(number) for number in range(len(views.places))])
    assert everywhere.coverage.share > 0.85
    assert CHOOSER.further(everywhere, at(0.0), 8) == []


def test_no_view_is_chosen_beyond_a_wall() -> None:
    """Where a wall stands between, views of the missed side are those on this side of it."""
    wall = replace(CHOOSER.bounds, high_W_m=np.array([0.4, 2.5, 2.5]))
    walled = replace(CHOOSER, bounds=wall)
    surface = photographed(one_side(180.0), walled)
    places = walled.further(surface, at(180.0), 8)
    assert places
    assert all(camera_pose(CENTRE, *place.tolist()).p_m[0] < 0.4 - MISSION.clearance_m for place in places)
    free = CHOOSER.further(seen_from(180.0), at(180.0), 8)
    assert max(camera_pose(CENTRE, *place.tolist()).p_m[0] for place in free) > 0.4


def test_no_view_is_chosen_where_the_target_stands() -> None:
    """Where a part of the mapped surface stands in the way of the hull, the vehicle does not go."""
    down = np.arange(-0.6, 0.4, CELL_M)
    pole = CENTRE + np.stack([np.full(len(down), -0.4), np.zeros(len(down)), down], axis=1)
    with_pole = estimate(
        surface_W_m=np.concatenate([SURFACE, pole]),
        towards_W=np.concatenate([OUT, np.tile([1.0, 0.0, 0.0], (len(pole), 1))]),
    )
    surface = CHOOSER.photographed(with_pole, [])
    assert surface is not None
    low = math.radians(20.0)
    blocked = [apart_rad(float(place[0]), math.pi) < 0.01 and place[1] < low for place in surface.coverage.views.places]
    free = [
        apart_rad(float(place[0]), math.pi) < 0.01 and place[1] < low
        for place in photographed([]).coverage.views.places
    ]
    assert any(free)
    assert not any(blocked)


def test_with_no_room_for_a_view_there_is_none() -> None:
    """In a tank in which no view can be reached coverage is told, and nowhere is gone."""
    tight = replace(
        CHOOSER,
        bounds=TankBounds(low_W_m=np.array([-0.2, -0.2, 0.8]), high_W_m=np.array([0.2, 0.2, 1.2])),
    )
    surface = photographed(one_side(0.0), tight)
    assert surface.coverage.share == seen_from(0.0).coverage.share
    assert tight.further(surface, at(0.0), 8) == []


places_on_spheres = st.builds(
    lambda azimuth, elevation, range_m: np.array([azimuth, elevation, range_m]),
    st.floats(-4.0 * math.pi, 4.0 * math.pi),
    st.floats(math.radians(5.0), math.radians(85.0)),
    st.floats(0.2, 1.0),
)
lists_of_places = st.lists(places_on_spheres, min_size=1, max_size=6)


@given(places_on_spheres, lists_of_places)
@settings(max_examples=50, deadline=None)
def test_a_route_passes_all_views_in_order(here: Array, places: list[Array]) -> None:
    """It starts here and photographs once at each place, at the end of the leg that is named after it."""
    route = route_through(places, here, CENTRE, MISSION)
    assert len(route.legs) == len(route.exposures_s) == len(places)
    assert np.allclose(route.on_sphere(0.0)[0], here)
    assert route.legs[0].start == pytest.approx(here)
    assert [leg.name for leg in route.legs] == [f"view {number + 1}" for number in range(len(places))]
    for place, opens_s in zip(places, route.exposures_s, strict=True):
        pose, desired = route.camera(float(opens_s))[0], camera_pose(CENTRE, *place.tolist())
        assert np.allclose(pose.p_m, desired.p_m, atol=1e-6)
        assert np.allclose(pose.R, desired.R, atol=1e-6)
    assert (np.diff(route.exposures_s) >= 0.0).all()
    assert route.duration_s == pytest.approx(float(route.exposures_s[-1]) + LAST_S)


@given(places_on_spheres, lists_of_places)
@settings(max_examples=50, deadline=None)
def test_a_route_goes_the_short_way_round(here: Array, places: list[Array]) -> None:
    """No leg turns by more than half a circle, and each begins where and when the one before it ended."""
    route = route_through(places, here, CENTRE, MISSION)
    end, ends_s = here, 0.0
    for leg, starts_s in zip(route.legs, route.starts_s, strict=True):
        assert abs(leg.end[0] - leg.start[0]) <= math.pi + 1e-9
        assert np.allclose(leg.start, end)
        assert starts_s == pytest.approx(ends_s)
        end, ends_s = leg.end, starts_s + leg.duration_s


@given(places_on_spheres, lists_of_places)
@settings(max_examples=25, deadline=None)
def test_a_route_is_flown_without_a_jump(here: Array, places: list[Array]) -> None:
    """Between two instants the camera moves no farther than its speed allows, with a tenth to spare, and rests last."""
    route = route_through(places, here, CENTRE, MISSION)
    times = np.linspace(0.0, route.duration_s, 400)
    track = np.array([route.camera(time_s)[0].p_m for time_s in times])
    step_m = np.linalg.norm(np.diff(track, axis=0), axis=1).max()
    # Straight lines in azimuth, elevation and range are not flown at constant speed: the level circle shrinks.
    fastest = max(float(np.linalg.norm(route.camera(time_s)[1])) for time_s in np.linspace(0.0, route.duration_s, 2000))
    assert step_m <= 1.1 * fastest * times[1] + 1e-9
    assert np.linalg.norm(route.camera(float(route.exposures_s[-1]) + 1e-6)[1]) < 1e-3


@pytest.mark.parametrize(("here_deg", "place_deg"), [(170.0, -170.0), (-170.0, 170.0), (350.0, 10.0), (-10.0, 350.0)])
def test_half_a_circle_is_crossed_and_not_gone_round(here_deg: float, place_deg: float) -> None:
    """Across the azimuth at which angles wrap a way of twenty degrees, or none, is that long."""
    turn = math.remainder(math.radians(place_deg - here_deg), 2.0 * math.pi)
    low = math.radians(20.0)
    here, place = np.array([math.radians(here_deg), low, 0.5]), np.array([math.radians(place_deg), low, 0.5])
    leg = route_through([place], here, CENTRE, MISSION).legs[0]
    assert leg.length_m == pytest.approx(abs(turn) * 0.5 * math.cos(low), rel=1e-3, abs=1e-9)


def test_the_names_of_legs_say_which_view_is_flown_to() -> None:
    """Under way to a view its number is told, and the photographs are taken one after another."""
    places = [np.array([azimuth, 0.4, 0.5]) for azimuth in (0.5, 1.0, 2.0)]
    route = route_through(places, np.array([0.0, 0.4, 0.5]), CENTRE, MISSION)
    for number, (starts_s, opens_s) in enumerate(zip(route.starts_s, route.exposures_s, strict=True)):
        assert route.leg_name(0.5 * float(starts_s + opens_s)) == f"view {number + 1}"
        assert route.shutter_s(number, float(opens_s) - 0.01, 0.02) == pytest.approx(opens_s)
        assert route.shutter_s(number, float(opens_s) - 0.03, 0.02) is None
    assert route.shutter_s(3, route.duration_s, 0.02) is None


def test_a_route_leaves_its_places_as_they_were() -> None:
    """Azimuths that are unwrapped for the way are not those of the caller."""
    places = [np.array([6.0, 0.4, 0.5]), np.array([-6.0, 0.4, 0.5])]
    route_through(places, np.zeros(3) + 0.5, CENTRE, MISSION)
    assert [place[0] for place in places] == [6.0, -6.0]


AHEAD = replace(CHOOSER, aim=CameraAim(X_BC=Pose(np.array([0.2, 0.0, 0.0]), quat_from_matrix(R_FC))))
"""With the camera before the hull."""


@pytest.mark.parametrize("floor_z_m", [2.5, 1.2, 1.1, 1.05])
def test_an_orbit_is_raised_until_the_hull_is_clear_of_the_floor(floor_z_m: float) -> None:
    """No higher than needed, by the steps that are tried; as desired where that is clear, and then nothing is below."""
    chooser = replace(AHEAD, bounds=replace(AHEAD.bounds, high_W_m=np.array([3.0, 2.5, floor_z_m])))
    elevation_deg, below = chooser.clear_elevation_deg(estimate(), 20.0)

    def least(at_deg: float) -> float:
        poses = [at(azimuth, at_deg, MISSION.standoff_m) for azimuth in range(0, 360, 45)]
        return min(chooser.gaps(X_WC, SURFACE)["the floor"] for X_WC in poses)

    assert least(elevation_deg) >= MISSION.clearance_m
    assert (below == "the floor") is (elevation_deg > 20.0) is (least(20.0) < MISSION.clearance_m)
    assert elevation_deg == 20.0 or least(elevation_deg - 2.5) < MISSION.clearance_m


def test_an_orbit_that_is_clear_nowhere_is_as_high_as_is_tried() -> None:
    """About a target nearly as wide as the standoff, by its mapped surface or by its region alone."""
    wide = CENTRE + (MISSION.standoff_m - 0.01) * OUT
    for target in (estimate(surface_W_m=wide), region_alone(wide)):
        assert AHEAD.clear_elevation_deg(target, 40.0) == (80.0, "the target")


@pytest.mark.parametrize("surface", [None, np.zeros((0, 3))])
def test_of_a_target_that_is_not_mapped_yet_its_ball_counts(surface: Array | None) -> None:
    """A small swaying target is accepted with no point of a surface or a region; the orbit keeps clear of its ball."""
    empty = replace(region_alone(np.zeros((0, 3))), surface_W_m=surface, towards_W=surface)
    assert AHEAD.clear_elevation_deg(replace(empty, radius_m=0.05), 40.0) == (40.0, "")
    assert AHEAD.clear_elevation_deg(replace(empty, radius_m=MISSION.standoff_m), 40.0)[1] == "the target"


def region_alone(points_W_m: Array) -> TargetEstimate:
    """An estimate without a mapped surface."""
    n = len(points_W_m)
    fields = {"points_W_m": points_W_m, "weights": np.ones(n), "distance_m": np.zeros(n)}
    return estimate(surface_W_m=None, towards_W=None, **fields)

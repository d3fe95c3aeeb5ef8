"""The order of views: what changes with the current, and what must not."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.scene.missions import MissionSettings, Route, TankBounds, check_clearance, plan_route
from wakewise.scene.missions.orbit import LEAST_CURRENT_M_S, R_FC, layered_orbits, order_downstream_first

CENTRE = np.array([0.0, 0.0, 1.43])
PLAIN = MissionSettings()
ORDERED = PLAIN.model_copy(update={"order": "current"})
BEARINGS = st.floats(-math.pi, math.pi)


def current(heading_rad: float, speed_m_s: float = 0.05) -> np.ndarray:
    return speed_m_s * np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])


def views(route: Route) -> np.ndarray:
    """Places and directions of all photographs, in an order of their own."""
    rows = np.array([np.concatenate([X.p_m, X.R[:, 2]]) for X in route.X_WC_planned])
    return rows[np.lexsort(np.round(rows, 6).T)]


@given(heading=BEARINGS)
def test_the_views_are_the_same(heading: float) -> None:
    """Whatever the current, the same places are photographed in the same directions, each once."""
    ordered = plan_route(CENTRE, ORDERED, current(heading))
    np.testing.assert_allclose(views(ordered), views(plan_route(CENTRE, PLAIN)), atol=1e-9)
    assert ordered.exposure_names == plan_route(CENTRE, PLAIN).exposure_names


@given(heading=BEARINGS)
def test_settling_approach_and_climbs_lie_downstream(heading: float) -> None:
    """No leg but an orbit comes nearer to upstream than a step of the views and half a step of the next orbit allow."""
    route = plan_route(CENTRE, ORDERED, current(heading))
    step = 2 * math.pi / min(PLAIN.views)
    for leg in route.legs:
        if not leg.name.startswith("orbit"):
            for azimuth in (leg.start[0], leg.end[0]):
                assert abs(math.remainder(float(azimuth) - heading, 2 * math.pi)) <= step + 1e-9


@given(heading=BEARINGS)
def test_the_first_half_of_an_orbit_goes_up_against_the_current(heading: float) -> None:
    """Until it passes upstream, the camera moves against the current on every orbit."""
    flow = current(heading)
    for orbit in order_downstream_first(layered_orbits(PLAIN), flow):
        bearing = np.mod(orbit.azimuths_rad - heading, 2 * math.pi)
        up = orbit.azimuths_rad[bearing < math.pi - 1e-9]
        along = np.stack([-np.sin(up), np.cos(up)], axis=1)
        assert np.all(along @ flow[:2] <= 1e-12)


@given(heading=BEARINGS)
def test_each_leg_begins_where_the_one_before_ended(heading: float) -> None:
    """Azimuths go on without a jump, and never back."""
    route = plan_route(CENTRE, ORDERED, current(heading))
    for before, after in zip(route.legs, route.legs[1:], strict=False):
        np.testing.assert_allclose(after.start, before.end, atol=1e-12)
    assert np.all(np.diff([leg.end[0] for leg in route.legs]) > 0.0)
    np.testing.assert_array_less(0.0, np.diff(route.exposures_s))


@given(heading=BEARINGS)
def test_it_costs_two_seconds_a_climb_at_most(heading: float) -> None:
    """Climbs may slant by a step of the views more; all else takes as long."""
    plain, ordered = plan_route(CENTRE, PLAIN), plan_route(CENTRE, ORDERED, current(heading))
    climbs = len(PLAIN.views) - 1
    assert abs(ordered.duration_s - plain.duration_s) < 2.0 * climbs


@pytest.mark.parametrize("flow", [None, current(1.0, 0.5 * LEAST_CURRENT_M_S), np.array([0.0, 0.0, 0.2])])
def test_without_a_level_current_orbits_begin_as_listed(flow: np.ndarray | None) -> None:
    """Of no current, a weak one and one that sinks the route is the plain one."""
    assert plan_route(CENTRE, ORDERED, flow).exposures_s.tolist() == plan_route(CENTRE, PLAIN).exposures_s.tolist()
    assert plan_route(CENTRE, ORDERED, flow).legs[0].start.tolist() == plan_route(CENTRE, PLAIN).legs[0].start.tolist()


@pytest.mark.parametrize("heading", np.linspace(-3.0, 3.0, 5))
def test_clearances_hold(heading: float) -> None:
    """The hull clears bed, walls and target by what is asked for, from whichever side the mission begins."""
    bounds = TankBounds(low_W_m=np.array([-3.0, -2.5, 0.0]), high_W_m=np.array([3.0, 2.5, 1.5]))
    target = np.random.default_rng(0).uniform([-0.07, -0.07, 1.35], [0.07, 0.07, 1.5], (500, 3))
    X_BC = Pose(np.array([0.225, 0.0, 0.0]), quat_from_matrix(R_FC))
    route = plan_route(CENTRE, ORDERED, current(float(heading)))
    assert check_clearance(route, X_BC, np.array([0.45, 0.35, 0.28]), bounds, target, PLAIN.clearance_m) >= 0.05

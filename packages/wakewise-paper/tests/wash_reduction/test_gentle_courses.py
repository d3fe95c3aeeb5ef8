"""Courses of the gentle bench: where the camera is desired to be, and that the hull clears bed and target."""

import numpy as np
import pytest

from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.missions import CameraAim, check_clearance
from wakewise_paper.routes import (
    BRAKE_SPEED_M_S,
    CLEARANCE_M,
    gentle_route,
    held,
    looking_down,
    top_above_centre_m,
)
from wakewise_paper.wash_reduction.flight import parts_of
from wakewise_paper.wash_reduction.scenario_files import SCENARIOS, VEHICLES

VEHICLE = load_vehicle("paper")


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_course_clears_floor_target_and_surface(name, vehicle):
    """By the clearance of a mission, on one seed of each."""
    parts = parts_of(f"{name}/{vehicle}", "dp", 1)
    mesh = parts.surveyed_target.mesh.vertices_m
    assert check_clearance(parts.route, parts.aim, parts.vehicle.size_m, parts.bounds, mesh, CLEARANCE_M) >= CLEARANCE_M


def test_the_orbit_hovers_then_flies_an_arc_and_stays_at_its_standoff():
    """Camera at the standoff all along, at rest while it hovers, photographs on both legs."""
    route = gentle_route(np.array([0.0, 0.0, 1.43]), 0.5, 0.3)
    for time_s in np.linspace(0.0, route.duration_s, 40):
        X_WC, _, _ = route.camera(float(time_s))
        assert np.linalg.norm(X_WC.p_m - route.centre_W_m) == pytest.approx(0.5)
    assert np.linalg.norm(route.body(12.0, VEHICLE.X_BC).nu_B) == 0.0
    assert {route.leg_name(float(t)) for t in route.exposures_s} == {"hover", "orbit"}


def test_a_station_is_held_for_three_minutes_above_the_target():
    """The camera is 0.2 m above the target's top and looks at its centre."""
    parts = parts_of("station/paper", "dp", 1)
    X_WC, velocity, _ = parts.route.camera(100.0)
    top = parts.surveyed_target.mesh.vertices_m[:, 2].min()
    assert top - X_WC.p_m[2] == pytest.approx(0.2) and not velocity.any()
    assert parts.route.duration_s - parts.route.starts_s[0] > 180.0
    ahead = X_WC.R[:, 2]
    way = parts.surveyed_target.centre_W_m - X_WC.p_m
    assert ahead @ way == pytest.approx(np.linalg.norm(way))


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_transect_goes_straight_over_the_target_with_the_camera_down(vehicle):
    """Level body, camera down, over the centre half way, at the altitude drawn; its twist is that of the way."""
    parts = parts_of(f"nadir/{vehicle}", "dp", 1)
    route, target = parts.route, parts.surveyed_target
    middle = float(route.starts_s[0] + 0.5 * route.legs[0].duration_s)
    X_WC, velocity, omega = route.camera(middle)
    np.testing.assert_allclose(X_WC.p_m[:2], target.centre_W_m[:2], atol=1e-9)
    np.testing.assert_allclose(X_WC.R[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
    assert 0.4 <= target.centre_W_m[2] - X_WC.p_m[2] - top_above_centre_m(target) <= 0.6
    assert np.linalg.norm(velocity) == pytest.approx(0.1) and not omega.any()
    body = route.body(middle, parts.aim)
    np.testing.assert_allclose(body.X_WB.R[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
    after = route.body(middle + 1e-3, parts.aim)
    np.testing.assert_allclose((after.X_WB.p_m - body.X_WB.p_m) / 1e-3, body.X_WB.R @ body.nu_B[:3], atol=1e-6)
    np.testing.assert_allclose(body.X_WB.R[:, 0] @ velocity, 0.1)


def test_braking_ends_at_rest_before_the_target():
    """It arrives at 0.3 m/s and rests 0.4 m from the centre within 2 s."""
    parts = parts_of("brake/paper", "dp", 1)
    leg = parts.route.legs[0]
    assert leg.speed_m_s == BRAKE_SPEED_M_S
    at = [
        float(np.linalg.norm(parts.route.camera(t)[1])) for t in parts.route.starts_s[0] + leg.duration_s - [2.0, 0.0]
    ]
    assert at == pytest.approx([0.3, 0.0], abs=1e-9)
    X_WC, _, _ = parts.route.camera(float(parts.route.starts_s[1]) + 1.0)
    assert np.linalg.norm(X_WC.p_m - parts.surveyed_target.centre_W_m) == pytest.approx(0.4)


def test_a_route_that_is_held_waits_and_photographs_nothing():
    """Its start lasts longer, its legs are the same."""
    route = gentle_route(np.array([0.0, 0.0, 1.43]), 0.5, 0.3)
    late = held(route, 15.0)
    np.testing.assert_allclose(late.starts_s - route.starts_s, 15.0)
    assert not len(late.exposures_s) and late.leg_name(20.0) == "settle"
    np.testing.assert_allclose(late.camera(20.0)[0].p_m, route.camera(0.0)[0].p_m)


def test_a_camera_that_looks_down_has_no_joint():
    """Forward of the camera is down of the body, right is right."""
    turned = looking_down(load_vehicle("bluerov2-heavy"))
    assert turned.tilt is None and isinstance(CameraAim(X_BC=turned.X_BC), CameraAim)
    np.testing.assert_allclose(turned.X_BC.R[:, [0, 2]], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], atol=1e-12)


def test_a_cable_pulls_down_the_current_as_hard_as_drawn():
    """The tank's own law of a cable gives the pull that the seed drew, along the current, at the start."""
    from wakewise.simulation.tank.tether import Tether
    from wakewise.simulation.water import SteadyCurrent
    from wakewise_paper.wash_reduction.scenario_files import sample_conditions

    parts, what = parts_of("tether/paper", "dp", 2), sample_conditions("tether", 2)
    current = np.array(what.current_W_m_s)
    force = Tether.of(parts.scenario.tank).force_W_N(
        parts.start.X_WB, np.zeros(6), SteadyCurrent(velocity_W_m_s=current), 0.0
    )
    assert np.linalg.norm(force) == pytest.approx(what.pull_N, rel=0.02)
    assert force @ current == pytest.approx(np.linalg.norm(force) * np.linalg.norm(current), rel=1e-3)

"""The pilot `human`: goals by eye, for any method, of which none is the route's own."""

import numpy as np
import pytest

from wakewise.core.interfaces import BodyState
from wakewise.operation import Scenario, fly


@pytest.fixture(scope="module")
def parts():
    return Scenario.preset("quick", method="dp", pilot="human").parts()


def goals(pilot, route, X_BC, n=700, lag_steps=25):
    """Goals of a vehicle that is where the goal was half a second before."""
    seen = [route.body(0.0, X_BC)] * lag_steps
    out = []
    for k in range(n):
        out.append(pilot.goal(0.02 * k, seen[-lag_steps]))
        seen.append(BodyState(X_WB=out[-1].X_WB, nu_B=out[-1].nu_B))
    return out


def test_the_sticks_lead_near_the_route_and_never_on_it(parts):
    """After the approach has begun the goals are within 0.3 m of the route, and off it by more than a millimetre."""
    found = goals(parts.pilot, parts.route, parts.vehicle.X_BC, n=1000)
    off = [
        np.linalg.norm(goal.X_WB.p_m - parts.route.body(0.02 * k, parts.vehicle.X_BC).X_WB.p_m)
        for k, goal in enumerate(found)
    ]
    assert 1e-3 < np.mean(off[500:]) < 0.15 and max(off) < 0.3


def test_a_flight_begun_again_is_the_same(parts):
    """At time zero the person begins afresh; another person leads elsewhere."""
    first, second = (goals(parts.pilot, parts.route, parts.vehicle.X_BC, n=300) for _ in range(2))
    other = parts.replace(**{"control.operator_seed": 5}).pilot
    third = goals(other, parts.route, parts.vehicle.X_BC, n=300)
    assert all(np.array_equal(a.X_WB.p_m, b.X_WB.p_m) for a, b in zip(first, second, strict=True))
    assert any(not np.array_equal(a.X_WB.p_m, b.X_WB.p_m) for a, b in zip(first, third, strict=True))


def test_the_goals_move_as_a_vehicle_can(parts):
    """However the thumbs jump, the goals' velocity changes by at most 0.3 m/s2 and their turn by 0.8 rad/s2."""
    found = goals(parts.pilot, parts.route, parts.vehicle.X_BC)
    v = np.array([goal.X_WB.R @ goal.nu_B[:3] for goal in found])
    turn = np.array([(goal.X_WB.R @ goal.nu_B[3:])[2] for goal in found])
    assert np.linalg.norm(np.diff(v, axis=0), axis=1).max() < 0.3 * 0.02 and np.ptp(v) > 0.05
    assert np.abs(np.diff(turn)).max() < 0.8 * 0.02 + 1e-9


@pytest.mark.slow
def test_any_method_is_flown_by_a_person(parts):
    """`dp` follows the goals within millimetres, and so comes centimetres off the route."""
    flight = fly(parts.replace(**{"mission.settle_s": 6.0}), duration_s=12.0, water_every_s=np.inf)
    assert flight.figures["collisions"] == 0
    last = flight.steps.tail(1)
    true = last.select("true_x_m", "true_y_m", "true_z_m").to_numpy()[0]
    goal = last.select("goal_x_m", "goal_y_m", "goal_z_m").to_numpy()[0]
    assert np.linalg.norm(true - goal) < 0.06

"""A simulated operator at the sticks."""

import numpy as np
import pytest

from wakewise.core.interfaces import BodyState
from wakewise.operation import Scenario


@pytest.fixture(scope="module")
def parts():
    return Scenario.preset("quick", method="dp", pilot="assisted", **{"mission.settle_s": 2.0}).parts()


def flown(parts, n=600, lag=25):
    """Goals and sticks where the vehicle is where its goal was half a second before."""
    pilot, seen, goals, axes = parts.pilot, [parts.start] * lag, [], []
    for k in range(n):
        goals.append(pilot.goal(0.02 * k, seen[-lag]))
        axes.append(pilot.controls.axes)
        seen.append(BodyState(X_WB=goals[-1].X_WB, nu_B=goals[-1].nu_B))
    return goals, np.array(axes)


def test_a_person_flies_the_route_through_the_same_sticks(parts):
    """By sticks alone the goals stay within 0.3 m of the route, though the vehicle is half a second behind them."""
    goals, axes = flown(parts)
    off = [np.linalg.norm(g.X_WB.p_m - parts.route.body(0.02 * k, parts.aim).X_WB.p_m) for k, g in enumerate(goals)]
    assert max(off) < 0.3 and np.abs(axes).max() <= 1.0 and axes.any() and not axes[:, 4].any()


def test_a_flight_begun_again_is_the_same_and_another_persons_is_not(parts):
    """At time zero the person and the settings begin afresh."""
    first, again = flown(parts, 200)[0], flown(parts, 200)[0]
    other = flown(parts.replace(**{"control.operator_seed": 5}), 200)[0]
    assert all(np.array_equal(a.X_WB.p_m, b.X_WB.p_m) for a, b in zip(first, again, strict=True))
    assert any(not np.array_equal(a.X_WB.p_m, b.X_WB.p_m) for a, b in zip(first, other, strict=True))

"""The protected region of an assisted flight may change in flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wakewise.control.pipeline import Pipeline
from wakewise.core.interfaces import Goal
from wakewise.operation import Parts, Scenario
from wakewise.operation.teleop.assisted import switched_controller
from wakewise.operation.teleop.region_methods import RegionMethods, region_methods
from wakewise.scene.targets import Region

DT_S = 0.02


@pytest.fixture(scope="module")
def parts() -> Parts:
    return Scenario.preset("quick", world="paper").replace(**{"target.points": 60}).parts()


def below(parts: Parts) -> Region:
    """A region that lies before a thruster, where the scenario's is farther off."""
    region = parts.region
    way = parts.start.X_WB.p_m + np.array([0.0, 0.0, 0.5]) - region.points_W_m.mean(axis=0)
    return replace(region, points_W_m=region.points_W_m + way)


def flown(parts: Parts, methods: RegionMethods | None, regions: dict[int, Region | None]) -> np.ndarray:
    """Thrusts of twenty steps, shape (20, n), with the region that is set before some of them."""
    controller = switched_controller(parts, lambda: "wake-aware", methods)
    assert isinstance(controller, Pipeline)
    state, thrusts = controller.init(), []
    goal = Goal(X_WB=replace(parts.start.X_WB, p_m=parts.start.X_WB.p_m + np.array([0.05, 0.05, -0.05])))
    for k in range(20):
        if methods is not None and k in regions:
            methods.protect(regions[k])
        state, command = controller.step(state, DT_S, parts.start, goal)
        thrusts.append(command.thrusts_N)
    return np.array(thrusts)


def test_without_another_region_the_flight_is_the_same(parts: Parts) -> None:
    """To the bit; one that is set and given up before it flies changes nothing either."""
    plain = flown(parts, None, {})
    np.testing.assert_array_equal(flown(parts, region_methods(parts), {}), plain)
    methods = region_methods(parts)
    own = methods["wake-aware"]
    methods.protect(below(parts))
    assert methods["wake-aware"] is not own
    methods.protect(None)
    assert methods["wake-aware"] is own
    assert sorted(methods) == ["direct", "wake-aware"]
    np.testing.assert_array_equal(flown(parts, methods, {}), plain)


def test_another_region_is_spared_from_the_next_step_on(parts: Parts) -> None:
    """The thrusts change for its sake, with the same state, and not before."""
    plain, other = flown(parts, None, {}), flown(parts, region_methods(parts), {10: below(parts)})
    np.testing.assert_array_equal(other[:10], plain[:10])
    assert np.abs(other[10:] - plain[10:]).max() > 1e-3
    assert np.isfinite(other).all()

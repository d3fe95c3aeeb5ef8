"""Missions of `success`: the first draw of a seed that fits the water, so that no method fails for a shallow tank."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.operation import Scenario
from wakewise.operation.preflight import check_route
from wakewise_paper.reproduction import worlds
from wakewise_paper.reproduction.worlds import SPREAD, varied_mission, water

LOW = ("pump-tank", "plate", 3)
"""World, target and seed whose first draw comes up through the water surface."""


def first_draw(seed):
    return worlds._draw(np.random.default_rng([seed, 53]))


def parts(world, kind, mission, seed):
    told = water(world).told | {"target.kind": kind, "seed": seed} | dict(mission)
    return Scenario.preset("quick", **told).parts()


def test_a_first_draw_that_fits_is_taken_as_it_is():
    """And is one of the spread."""
    mission = varied_mission("pump-tank", "branching", 1)
    assert dict(mission) == first_draw(1)
    assert all(low <= mission[f"mission.{key}"] <= high for key, (low, high) in SPREAD.items())


def test_a_draw_that_comes_too_near_to_the_surface_is_drawn_again():
    """Seed 3 at a plate coral: its first draw is refused, the one that is flown is not."""
    world, kind, seed = LOW
    with pytest.raises(InputError, match="water surface"):
        check_route(parts(world, kind, first_draw(seed), seed))
    mission = varied_mission(*LOW)
    assert dict(mission) != first_draw(seed)
    check_route(parts(world, kind, mission, seed))


def test_water_that_no_draw_fits_is_refused_with_the_reason(monkeypatch):
    """After as many draws as are allowed."""
    monkeypatch.setattr(worlds, "TRIES", 1)
    with pytest.raises(InputError, match=r"no mission of 1 draws fits into pump-tank: .*water surface"):
        varied_mission.__wrapped__(*LOW)

"""Which world a seed of the operator's bench is: strata within what the library draws."""

import math

import pytest

from wakewise.core.errors import InputError
from wakewise.operation import Scenario
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper.operator_study.worlds import CONTROL, CURRENT, TRIM, TRIMS, TROUBLE, water_of


@pytest.mark.parametrize("world", [*TROUBLE, CONTROL])
def test_three_seeds_have_every_trim_and_course_once_and_nine_every_pair(world):
    """The squares stand upright on each other, sides of the current included where there is one."""
    drawn = [water_of(world, seed) for seed in range(1, 10)]
    for first in (0, 3, 6):
        assert {water.trim for water in drawn[first : first + 3]} == set(TRIMS)
        assert {water.course_number for water in drawn[first : first + 3]} == {0, 1, 2}
    assert len({(water.trim, water.course_number) for water in drawn}) == 9
    if drawn[0].side is not None:
        assert len({(water.trim, water.side) for water in drawn}) == 9
        assert len({(water.side, water.course_number) for water in drawn}) == 9


@pytest.mark.parametrize("world", world_names())
def test_a_water_lies_within_what_its_world_draws(world):
    """Trim in its own third of the range, current as fast as the world has it; other fields are the world's own."""
    draws = load_world(world).randomize
    low, high = (-1.0, 1.0) if TRIM not in draws else draws[TRIM].uniform
    for seed in (1, 2, 3):
        water = water_of(world, seed)
        third = (high - low) / 3.0
        begins = low + third * TRIMS.index(water.trim)
        assert begins - 1e-6 <= water.trim_N <= begins + third + 1e-6
        if CURRENT in draws:
            slow, fast = draws[CURRENT].horizontal
            assert slow - 1e-6 <= math.hypot(*water.current_W_m_s) <= fast + 1e-6
        else:
            assert water.current_W_m_s is None and CURRENT not in water.fields


def test_a_current_towards_the_target_comes_from_behind_the_vehicle():
    """Within a quarter turn about the way from the vehicle's azimuth to the target."""
    towards = [water_of("payload", seed) for seed in range(1, 10)]
    for water in (w for w in towards if w.side == "towards"):
        north, east, _ = water.current_W_m_s
        inward = math.atan2(math.sin(water.azimuth_rad + math.pi), math.cos(water.azimuth_rad + math.pi))
        assert abs(math.remainder(math.atan2(east, north) - inward, 2.0 * math.pi)) <= math.pi / 4 + 1e-6


def test_a_scenario_in_a_water_is_that_world_with_its_trim_and_current():
    """What was drawn here ends the world's own draw of the field."""
    water = water_of("payload", 2)
    scenario = Scenario.preset("quick", **water.fields).drawn()
    assert scenario.tank.mismatch.trim_N == pytest.approx(water.trim_N)
    assert scenario.tank.current.velocity_m_s == pytest.approx(water.current_W_m_s)
    assert scenario.target.kind == "soft-coral"


def test_an_unknown_world_is_refused():
    """In one line with those that are."""
    with pytest.raises(InputError, match="world 'mars'"):
        water_of("mars", 1)

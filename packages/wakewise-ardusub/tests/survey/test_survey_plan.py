"""Plans of a survey: speeds, turns, pauses, and what the current decides."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import fossen, load_vehicle
from wakewise_ardusub.survey.hold_current import current_of_hold
from wakewise_ardusub.survey.survey_plan import (
    MOST_CRAB_RAD,
    PlanProgress,
    SurveyPace,
    SurveyPlan,
    advance,
    crabbed,
    ordered,
    parallel_lines,
    plan_survey,
    resumed,
    target_of,
    time_left_s,
    upstream_side,
    warning_of,
    wrapped,
)

HERE, STILL = np.zeros(2), np.zeros(2)
DT_S = 0.1


def plan_of(lines: list[np.ndarray], current: np.ndarray = STILL, **pace: float) -> SurveyPlan:
    return plan_survey(lines, HERE, SurveyPace(**pace), current)


def lawnmower(width: float = 2.0, length: float = 3.0) -> SurveyPlan:
    return plan_of(parallel_lines(HERE, 0.3, width, length, 1.0, 1))


@given(st.floats(0.05, 0.3), st.floats(0.3, 30.0), st.floats(0.005, 0.1))
def test_a_line_goes_from_rest_to_rest_within_its_bounds(speed: float, length: float, acceleration: float) -> None:
    """Speed and acceleration stay within their bounds, the end is reached and not passed, in the time that was told."""
    line = [np.array([[0.0, 0.0], [length, 0.0]])]
    plan = plan_of(line, speed_m_s=speed, acceleration_m_s2=acceleration)
    at, speeds, steps = PlanProgress(heading_rad=0.0), [0.0], 0
    told_s = time_left_s(plan, at)
    while at.leg < 1 and steps < 20000:
        at = advance(plan, at, DT_S)
        speeds.append(at.speed_m_s)
        assert at.along_m <= length + 1e-9
        steps += 1
    assert at.leg == 1
    assert max(speeds) <= speed + 1e-9
    assert np.abs(np.diff(speeds)).max() <= 2.0 * acceleration * DT_S + 1e-3  # the last step
    assert at.flown_m == pytest.approx(length, abs=0.02)
    assert steps * DT_S <= told_s + 3.0


def test_a_lawnmower_turns_at_rest_and_counts_lines_alone() -> None:
    """Three lines of 3 m and two ways of 1 m: 9 m are flown on lines; while it turns it does not move."""
    plan = lawnmower()
    assert [leg.line for leg in plan.legs] == [True, False, True, False, True]
    assert plan.line_m == pytest.approx(9.0)
    at, places, headings = PlanProgress(heading_rad=0.3), [HERE], [0.3]
    for _ in range(6000):
        at = advance(plan, at, DT_S)
        places.append(target_of(plan, at)[0])
        headings.append(at.heading_rad)
    assert at.leg == len(plan.legs)
    assert at.flown_m == pytest.approx(9.0, abs=0.01)
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    turned = np.abs([wrapped(b - a) for a, b in pairwise(headings)])
    assert (moved[turned > 1e-3] < 1e-3).all()
    assert turned.max() <= 0.15 * DT_S + 1e-3
    assert moved.max() <= 0.1 * DT_S + 2e-3


def test_a_pause_brakes_within_the_bound_and_going_on_ends_at_the_same_place() -> None:
    """From 10 cm/s at 1 cm/s2 it stops after half a metre."""
    plan = plan_of([np.array([[0.0, 0.0], [5.0, 0.0]])])
    at = PlanProgress(heading_rad=0.0)
    for _ in range(200):
        at = advance(plan, at, DT_S)
    begun = at.along_m
    for _ in range(150):
        at = advance(plan, at, DT_S, go=False)
    assert at.speed_m_s == 0.0
    assert at.along_m - begun == pytest.approx(0.5, abs=0.02)
    for _ in range(1000):
        at = advance(plan, at, DT_S)
    assert target_of(plan, at)[0] == pytest.approx([5.0, 0.0])


def test_a_survey_that_was_ended_goes_on_where_it_ended() -> None:
    """From 2 m away: back to the place, then the rest; lines flown are not flown again."""
    plan = lawnmower()
    at = PlanProgress(heading_rad=0.3)
    for _ in range(600):
        at = advance(plan, at, DT_S)
    stop = target_of(plan, at)[0]
    rest, begin = resumed(plan, at, stop + np.array([2.0, 0.0]))
    assert not rest.legs[0].line
    assert rest.legs[1].start_W_m == pytest.approx(stop)
    assert begin.flown_m + rest.line_m == pytest.approx(plan.line_m, abs=1e-3)


def test_the_heading_goes_into_the_current_within_its_bound() -> None:
    """A current from the right turns the bow to the right; one that is faster along the line leaves it on the line."""
    north = np.array([1.0, 0.0])
    assert crabbed(north, 0.1, np.array([0.0, -0.05])) == pytest.approx(math.atan2(0.05, 0.1))
    assert crabbed(north, 0.1, np.array([0.0, -0.3])) == pytest.approx(MOST_CRAB_RAD)
    assert crabbed(north, 0.1, np.array([0.2, 0.05])) == 0.0
    assert crabbed(north, 0.1, np.array([0.0, 0.01])) == 0.0


def test_lines_are_ordered_against_the_current() -> None:
    """A single line is flown towards where the water comes from, a lawnmower line by line towards it."""
    line = [np.array([[0.0, 0.0], [10.0, 0.0]])]
    assert ordered(line, np.array([0.1, 0.0]))[0][0] == pytest.approx([10.0, 0.0])
    assert ordered(line, np.array([-0.1, 0.0]))[0][0] == pytest.approx([0.0, 0.0])
    lines = parallel_lines(HERE, 0.0, 4.0, 10.0, 1.0, 1)
    east = np.array([0.0, 0.1])
    assert ordered(lines, east)[0].mean(axis=0)[1] == pytest.approx(4.0)
    assert ordered(lines, -east)[0].mean(axis=0)[1] == pytest.approx(0.0)
    assert upstream_side(0.0, east) == -1
    assert upstream_side(0.0, -east) == 1


def test_a_current_faster_than_the_vehicle_is_told() -> None:
    """Along the line in words, across it not."""
    plan = plan_of([np.array([[0.0, 0.0], [10.0, 0.0]])])
    assert "on 1 of 1 lines the current is faster" in warning_of(plan, np.array([0.12, 0.0]))
    assert warning_of(plan, np.array([0.0, 0.12])) == ""


@pytest.mark.parametrize(
    ("pace", "words"),
    [
        ({"speed_m_s": 0.5}, "--speed 0.5: must be from 0.05 to 0.3"),
        ({"speed_m_s": math.nan}, "--speed nan"),
        ({"altitude_m": 0.1}, "--altitude 0.1: must be from 0.4 to 10"),
        ({"acceleration_m_s2": 0.0}, "a bound of 0"),
    ],
)
def test_a_pace_out_of_range_is_refused(pace: dict[str, float], words: str) -> None:
    """In one line that names the option."""
    with pytest.raises(InputError, match=words):
        SurveyPace(**pace)


def test_lines_that_are_none_are_refused() -> None:
    """No number, no length, too many, too long."""
    with pytest.raises(InputError, match="is not a number"):
        plan_of([np.array([[0.0, 0.0], [math.nan, 1.0]])])
    with pytest.raises(InputError, match=r"must be 0\.1 m or more"):
        plan_of([np.array([[0.0, 0.0], [0.0, 0.01]])])
    with pytest.raises(InputError, match="at most 500"):
        parallel_lines(HERE, 0.0, 1000.0, 10.0, 0.2, 1)
    with pytest.raises(InputError, match="at most 5000"):
        plan_of([np.array([[0.0, 0.0], [9000.0, 0.0]])])
    with pytest.raises(InputError, match="no line"):
        plan_of([])


def test_thrusts_that_hold_a_place_tell_the_current() -> None:
    """From the drag of a known current, at a heading of 1 rad, the same current comes out; a storm is unknown."""
    vehicle = load_vehicle("bluerov2-heavy")
    current, heading = np.array([0.08, -0.05]), 1.0
    c, s = math.cos(heading), math.sin(heading)
    nu = np.zeros(6)
    nu[:2] = -np.array([[c, s], [-s, c]]) @ current
    wrench = fossen.damping_matrix(vehicle, nu) @ nu
    thrusts = np.linalg.pinv(vehicle.allocation_matrix) @ np.array([*wrench[:2], 0.0, 0.0, 0.0, 0.0])
    felt = current_of_hold(vehicle, thrusts, heading)
    assert felt == pytest.approx(current, abs=0.005)
    assert current_of_hold(vehicle, 1000.0 * thrusts, heading) is None

"""Plans of orbits: length, tangent, heading to the centre, direction, layers and ways round the centre."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise_ardusub.survey.guided_messages import HEADING_LEAD_S, SurveyTarget
from wakewise_ardusub.survey.orbit_plan import OrbitLeg, OrbitRequest, with_current
from wakewise_ardusub.survey.survey_plan import (
    PlanProgress,
    SurveyPace,
    SurveyPlan,
    advance,
    plan_survey,
    resumed,
    target_of,
    time_left_s,
    turn_of,
    warning_of,
    wrapped,
)

HERE, STILL, DT_S = np.array([2.0, -1.0]), np.zeros(2), 0.1


def plan_of(request: OrbitRequest, heading: float = 0.4, current: np.ndarray = STILL, **pace: float) -> SurveyPlan:
    return plan_survey(request.legs(HERE, heading, current), HERE, SurveyPace(**pace), current)


@given(
    st.floats(0.5, 5.0), st.floats(0.2, 3.0), st.floats(-3.0, 3.0), st.sampled_from(["left", "right"]), st.floats(0, 1)
)
def test_an_orbit_has_the_length_of_its_turns_its_tangent_and_its_bow_to_the_centre(
    radius: float, turns: float, heading: float, direction: str, share: float
) -> None:
    """Length 2 pi r times turns; each place at the radius; tangent across the radius; heading towards the centre."""
    request = OrbitRequest(radius_m=radius, turns=turns, direction=direction)
    plan = plan_of(request, heading)
    (leg,) = plan.legs
    assert plan.line_m == pytest.approx(2.0 * math.pi * radius * turns)
    along = share * leg.length_m
    place, way = leg.place_at(along), leg.way_at(along)
    inwards = plan.centre_W_m - place
    assert math.hypot(*inwards) == pytest.approx(radius)
    assert float(way @ inwards) == pytest.approx(0.0, abs=1e-9)
    assert wrapped(leg.heading_at(along) - math.atan2(inwards[1], inwards[0])) == pytest.approx(0.0, abs=1e-9)
    right_of_bow = float(-math.sin(heading) * leg.way_at(0.0)[0] + math.cos(heading) * leg.way_at(0.0)[1])
    assert right_of_bow == pytest.approx(1.0 if direction == "right" else -1.0)
    assert leg.off(place + 0.1 * inwards / radius, along) == pytest.approx(
        (-0.1 if direction == "right" else 0.1, 0.0), abs=1e-9
    )
    assert leg.aim_from(place) == pytest.approx(leg.heading_at(along), abs=1e-6) or abs(leg.aim_from(place)) > 3.1


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.3), st.floats(2.0, 4.0))
def test_an_orbit_goes_from_rest_to_rest_and_its_target_is_continuous(speed: float, radius: float) -> None:
    """Place, velocity and heading are continuous; the acceleration is within the bound and speed^2 / radius together;
    the turn rate is speed / radius; it ends in the time that was told.
    """
    plan = plan_of(OrbitRequest(radius_m=radius), speed_m_s=speed)
    at, states, headings, steps = PlanProgress(heading_rad=0.4), [], [0.4], 0
    told_s = time_left_s(plan, at)
    while at.leg < 1 and steps < 20000:
        before = at
        at = advance(plan, at, DT_S)
        states.append(target_of(plan, at))
        headings.append(at.heading_rad)
        if at.leg < 1 and before.along_m > 0.0:
            turned = wrapped(at.heading_rad - before.heading_rad) / DT_S
            assert turned == pytest.approx(0.5 * (turn_of(plan, before) + turn_of(plan, at)), abs=1e-6)
            assert abs(turn_of(plan, at)) <= speed / radius + 1e-9
        steps += 1
    places, velocities, accelerations = (np.array(part) for part in zip(*states, strict=True))
    assert at.leg == 1
    assert steps * DT_S <= told_s + 3.0
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= speed * DT_S + 2e-3
    most = math.hypot(0.01, speed * speed / radius)
    assert np.linalg.norm(np.diff(velocities, axis=0), axis=1).max() <= most * DT_S + 2.5e-3  # the last step
    assert np.linalg.norm(accelerations[:-3], axis=1).max() <= most + 1e-6
    assert np.linalg.norm(velocities[0]) <= 0.01 * DT_S + 1e-9
    assert np.abs([wrapped(b - a) for a, b in pairwise(headings)]).max() <= speed / radius * DT_S + 1e-3
    assert at.flown_m == pytest.approx(plan.line_m, abs=0.02)


def test_layers_alternate_and_keep_the_place() -> None:
    """The second layer begins where the first ends, goes the other way, and has its own altitude."""
    plan = plan_of(OrbitRequest(turns=0.75, altitudes_m=(0.8, 1.3), direction="left"))
    first, second = plan.legs
    assert second.start_W_m == pytest.approx(first.end_W_m)
    assert (first.altitude_m, second.altitude_m) == (0.8, 1.3)
    assert first.bend_per_m == pytest.approx(-second.bend_per_m)
    assert first.bend_per_m > 0.0
    assert second.end_W_m == pytest.approx(first.start_W_m)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_auto_sets_out_with_the_current(heading: float, towards: float) -> None:
    """At its start an orbit never moves against a current; a weak one leaves it to the vehicle's right."""
    current = 0.1 * np.array([math.cos(towards), math.sin(towards)])
    plan = plan_of(OrbitRequest(), heading, current)
    assert float(plan.legs[0].way_at(0.0) @ current) >= -1e-9
    assert with_current(np.array([-1.0, 0.0]), 0.1 * current) == -1
    assert with_current(np.array([-1.0, 0.0]), np.array([0.0, -0.1])) == 1


@pytest.mark.parametrize(("north", "heading"), [(4.0, math.pi), (0.5, 0.0)])
def test_the_way_to_a_given_centre_is_radial_with_the_bow_to_it(north: float, heading: float) -> None:
    """From outside ahead, from inside backwards; then the circle begins at the nearest place."""
    request = OrbitRequest(radius_m=2.0, centre_W_m=(0.0, 0.0) if north > 2.0 else (1.0, 0.0))
    place = np.array([north, 0.0])
    way, leg = plan_survey(request.legs(place, 1.0, STILL), place, SurveyPace(), STILL).legs
    assert not way.line
    assert wrapped(way.heading_rad - heading) == pytest.approx(0.0)
    assert wrapped(leg.heading_rad - way.heading_rad) == pytest.approx(0.0)
    assert way.end_W_m == pytest.approx(leg.start_W_m)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.1, 6.0), st.floats(-math.pi, math.pi), st.integers(10, 900))
def test_an_orbit_goes_on_where_it_ended_and_the_way_back_keeps_off_the_centre(
    out: float, bearing: float, steps: int
) -> None:
    """From any place: no way comes nearer to the centre than its start or the radius; lines are flown once."""
    plan = plan_of(OrbitRequest(turns=2.0))
    at = PlanProgress(heading_rad=0.4)
    for _ in range(steps):
        at = advance(plan, at, DT_S)
    stop, centre = target_of(plan, at)[0], plan.centre_W_m
    place = centre + out * np.array([math.cos(bearing), math.sin(bearing)])
    rest, begin = resumed(plan, at, place)
    ways = [leg for leg in rest.legs if not leg.line]
    for leg in ways:
        near = min(math.dist(leg.place_at(k / 20 * leg.length_m), centre) for k in range(21))
        assert near >= min(out, 1.5) - 1e-6
    assert next(leg for leg in rest.legs if leg.line).start_W_m == pytest.approx(stop, abs=1e-3)
    assert begin.flown_m + rest.line_m == pytest.approx(plan.line_m, abs=1e-2)
    again, _ = resumed(rest, begin, place)  # ended on the way back: a way from here, and no line is lost
    assert again.line_m == pytest.approx(rest.line_m, abs=1e-6)


def test_the_sent_turn_rate_is_a_size_and_the_heading_leads() -> None:
    """ArduSub turns away from a heading for a negative rate: to the left the rate is positive, the heading is ahead."""
    straight = SurveyTarget(place_W_m=np.zeros(3), heading_rad=1.0)
    left = SurveyTarget(place_W_m=np.zeros(3), heading_rad=1.0, turn_rad_s=-0.1)
    told = left.message(None, takes_acceleration=False)
    assert straight.message(None, takes_acceleration=True)["type_mask"] == 0x800
    assert told["type_mask"] == 0x1C0
    assert told["yaw"] == pytest.approx(1.0 - HEADING_LEAD_S * 0.1)
    assert told["yaw_rate"] == pytest.approx(0.2)
    assert SurveyTarget(place_W_m=np.array([0.0, math.nan, 0.0])).message(None, takes_acceleration=True) is None


def test_a_current_faster_than_the_vehicle_is_told_of_a_circle() -> None:
    """From any side, because a part of the circle goes with it."""
    plan = plan_of(OrbitRequest())
    for angle in (0.0, 2.0, 4.0):
        current = 0.15 * np.array([math.cos(angle), math.sin(angle)])
        assert "on 1 of 1 lines the current is faster" in warning_of(plan, current)
        assert warning_of(plan, 0.5 * current) == ""


@pytest.mark.parametrize(
    ("request_of", "words"),
    [
        ({"radius_m": 0.6}, "must be 1.00 m or more, because it turns by at most 5.7 deg/s and 0.02 m/s2 inwards"),
        ({"radius_m": math.nan}, "--radius nan: must be from 0.5 to 20"),
        ({"turns": 0.0}, "--turns 0: must be from 0.1 to 20"),
        ({"altitudes_m": (0.8, 0.1)}, "--altitude 0.1: must be from 0.4 to 10"),
        ({"altitudes_m": (0.8,) * 11}, "11 layers, must be 1 to 10"),
    ],
)
def test_an_orbit_that_is_none_is_refused(request_of: dict[str, object], words: str) -> None:
    """In one line that names the option and what would be right."""
    with pytest.raises(InputError, match=words):
        OrbitRequest(**request_of).check(SurveyPace(), 0.46)


def test_a_hull_that_does_not_fit_and_a_vehicle_at_the_centre_are_refused() -> None:
    """A hull of 2 m at 1 m; a centre at the vehicle's place."""
    with pytest.raises(InputError, match=r"must be 1\.25 m or more, because the hull is 2\.00 m long"):
        OrbitRequest(radius_m=1.0).check(SurveyPace(), 2.0)
    with pytest.raises(InputError, match="--centre: the vehicle is there"):
        OrbitRequest(centre_W_m=(2.0, -1.0)).legs(HERE, 0.0, STILL)
    assert OrbitLeg.about(STILL, HERE, 1.0, altitude_m=None).radius_m == pytest.approx(math.sqrt(5.0))

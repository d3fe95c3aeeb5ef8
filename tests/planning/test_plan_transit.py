"""The planner chooses how long a transit takes: longer for farther, shorter where time is dear."""

import numpy as np
import pytest
from plan_cases import AROUND, CONE, REGION, VEHICLE

from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Goal
from wakewise.planning.problem import PlanSettings
from wakewise.planning.transit import plan_transit


def leg(distance_m, w_time, **options):
    start = BodyState(X_WB=Pose(np.array([-1.2, 0.6, 0.7])))
    goal = Goal(X_WB=Pose(np.array([-1.2 + distance_m, 0.6, 0.7])))
    settings = PlanSettings(w_time=w_time, w_twist=0.2)
    return plan_transit(VEHICLE, REGION, CONE, settings, start, goal, AROUND, search_s=0.2, **options)


def test_a_farther_place_takes_longer_and_dear_time_hurries():
    """Durations are inside the bounds, ordered, and the plan arrives."""
    near, far, hurried = leg(0.3, 1.0), leg(1.0, 1.0), leg(1.0, 10.0)
    assert 1.0 < near.duration_s < far.duration_s < 12.0
    assert hurried.duration_s < far.duration_s
    assert np.linalg.norm(far.plan.states[-1, :3] - [-0.2, 0.6, 0.7]) < 0.1


def test_bounds_that_make_no_sense_are_refused():
    """Least above most, or a leg longer than the horizon may be."""
    with pytest.raises(InputError, match="durations"):
        leg(0.3, 1.0, bounds_s=(3.0, 2.0))
    with pytest.raises(InputError, match="durations"):
        leg(0.3, 1.0, bounds_s=(3.0, 60.0))

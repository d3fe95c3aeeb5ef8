"""What the pilots of the operator's bench ask for, and where they begin."""

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import find_target
from wakewise_paper.operator_study.flight import (
    APPROACH_M,
    COURSES,
    LOOK_ARC_M,
    SPEED_M_S,
    CourseInput,
    look_route,
    operator_route,
    start_pose,
)
from wakewise_paper.routes import SETTLE_S

TARGET = find_target("soft-coral", 1.5)


def walked(course, dt_s=0.02):
    """Way asked for in the sticks' own frame, shape (3,)."""
    times = np.arange(0.0, SETTLE_S + course.duration_s, dt_s)
    return dt_s * sum(course.asked_m_s(t) for t in times)


def test_courses_rest_first_and_front_and_over_come_back():
    """Nothing is asked before the end of rest or after the end; two courses end where they began."""
    for course in COURSES.values():
        assert not course.asked_m_s(SETTLE_S - 0.01).any()
        assert not course.asked_m_s(SETTLE_S + course.duration_s + 0.01).any()
    assert np.abs(walked(COURSES["front"])).max() < 0.01
    assert np.abs(walked(COURSES["over"])).max() < 0.01
    assert walked(COURSES["look"]) == pytest.approx([APPROACH_M, LOOK_ARC_M, -0.2], abs=0.01)


def test_sticks_ask_for_what_the_course_says_at_any_gain():
    """Axes are shares of what full stick means."""
    for share in (0.5, 1.0):
        axes = CourseInput(COURSES["look"], share).read(SETTLE_S + 0.5).axes
        assert 0.5 * share * axes[0] == pytest.approx(SPEED_M_S) and not axes[1:].any()


def test_a_course_begins_with_the_camera_on_the_target_or_level_above_it():
    """At the standoff, farther off by the approach, or so high that hull and target do not touch."""
    X_BC = load_vehicle("paper").X_BC
    for name, away_m in (("front", 0.5), ("look", 0.5 + APPROACH_M)):
        X_WC = start_pose(COURSES[name], TARGET, 0.7, 0.5, X_BC) @ X_BC
        towards = TARGET.centre_W_m - X_WC.p_m
        assert np.linalg.norm(towards) == pytest.approx(away_m, abs=1e-6)
        assert X_WC.R[:, 2] @ towards == pytest.approx(away_m, abs=1e-6)
    above = start_pose(COURSES["over"], TARGET, 0.7, 0.5, X_BC)
    assert above.R[2, 2] == pytest.approx(1.0)
    assert above.p_m[2] + 0.14 <= TARGET.mesh.vertices_m[:, 2].min() - 0.2 + 1e-9


def test_what_the_human_would_like_to_see_is_look():
    """From outside to the standoff, round to the right, up; legs one after the other, with photographs."""
    route = look_route(TARGET.centre_W_m, 0.7, 0.5)
    assert [leg.name for leg in route.legs] == ["approach", "arc", "stop", "climb"] and len(route.exposures_s) > 3
    mount = Pose(np.zeros(3))
    first, after = (route.body(route.starts_s[1] + t, mount).X_WB for t in (0.0, 1.0))
    step = first.R.T @ (after.p_m - first.p_m)
    assert step[0] > 0.0 and abs(step[2]) < 0.01  # x of a camera is to the right
    assert np.linalg.norm(route.body(0.0, mount).X_WB.p_m - TARGET.centre_W_m) == pytest.approx(0.5 + APPROACH_M)
    assert operator_route(TARGET.centre_W_m, 16.0).leg_name(SETTLE_S + 1.0) == "operator"

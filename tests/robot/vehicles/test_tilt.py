"""The camera's tilt joint: where the camera is at an angle, stops and rate."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import draft_yaml, load_draft, load_vehicle
from wakewise.robot.vehicles.library import parse_vehicle
from wakewise.robot.vehicles.vehicle import TiltJoint

HEAVY = load_vehicle("bluerov2-heavy")
JOINT = TiltJoint(low_rad=-0.8, high_rad=0.6, rate_rad_s=1.0, p_BJ_m=np.array([0.15, 0.0, 0.01]))


@given(st.floats(-0.78, 0.78))
def test_a_positive_tilt_looks_up_by_its_angle(tilt_rad: float) -> None:
    """As a positive pitch does; the image stays upright, and without a pivot the camera stays where it is."""
    X_BC = HEAVY.X_BC_at(tilt_rad)
    assert math.asin(-X_BC.R[2, 2]) == pytest.approx(tilt_rad, abs=1e-12)
    assert X_BC.R[:, 0] == pytest.approx(HEAVY.X_BC.R[:, 0], abs=1e-12)
    assert X_BC.p_m == pytest.approx(HEAVY.X_BC.p_m, abs=1e-15)


@given(st.floats(-0.8, 0.6))
def test_the_camera_swings_about_its_pivot(tilt_rad: float) -> None:
    """Its distance to the hinge stays, and the hinge stays where it was in the camera."""
    X_BC = JOINT.mount(HEAVY.X_BC, tilt_rad)
    assert X_BC.inverse().apply(JOINT.p_BJ_m) == pytest.approx(HEAVY.X_BC.inverse().apply(JOINT.p_BJ_m), abs=1e-12)


def test_the_slide_is_the_derivative_of_the_place() -> None:
    """By central differences."""
    h = 1e-6
    after, before = (JOINT.mount(HEAVY.X_BC, 0.3 + d).p_m for d in (h, -h))
    assert JOINT.slide_m(HEAVY.X_BC, 0.3) == pytest.approx((after - before) / (2 * h), abs=1e-8)


@given(st.floats(-0.8, 0.6), st.floats(-3.0, 3.0), st.floats(0.0, 2.0))
def test_the_joint_keeps_its_rate_and_its_stops(tilt_rad: float, desired_rad: float, dt_s: float) -> None:
    """It goes towards the desired angle or the stop before it, no faster than it can, and never past it."""
    after = JOINT.towards(tilt_rad, desired_rad, dt_s)
    goal = min(max(desired_rad, -0.8), 0.6)
    assert abs(after - tilt_rad) <= dt_s + 1e-12
    assert abs(after - goal) == pytest.approx(max(abs(goal - tilt_rad) - dt_s, 0.0), abs=1e-12)


def test_a_camera_without_a_joint_stays_as_it_is_mounted() -> None:
    """The paper's vehicle has none; whatever is asked, the mount is the mount."""
    paper = load_vehicle("paper")
    assert paper.tilt is None
    assert paper.X_BC_at(0.5) is paper.X_BC


@pytest.mark.parametrize(
    ("old", "wrong", "words"),
    [
        ("[-45.0, 45.0]", "[10.0, 45.0]", "range 10 to 45 deg, must hold 0"),
        ("[-45.0, 45.0]", "[-45.0, 120.0]", "lie within -90 to 90"),
        ("rate_deg_s: 60.0", "rate_deg_s: 0.0", "camera_tilt.rate_deg_s"),
        ("rate_deg_s: 60.0", "rate_deg_s: .inf", "camera_tilt"),
    ],
)
def test_a_joint_that_cannot_be_is_refused(old: str, wrong: str, words: str) -> None:
    """One line names field and value."""
    text = draft_yaml(load_draft("bluerov2-heavy"))
    assert old in text
    with pytest.raises(InputError, match=words):
        parse_vehicle(text.replace(old, wrong), "x.yaml", "x")

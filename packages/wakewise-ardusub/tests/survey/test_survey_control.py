"""The controller of a survey that allocates thrusts, and its region that moves with the vehicle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wakewise.control.null_space_allocation import Allocator, allocation_context
from wakewise.control.pipeline import Pipeline
from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.survey import survey_control
from wakewise_ardusub.survey.guided_messages import SurveyTarget
from wakewise_ardusub.survey.moving_region import AHEAD_M, ASIDE_M, MovingRegionAllocator, bed_frame, bed_region
from wakewise_ardusub.survey.survey_control import (
    TILT_RAD,
    PassiveTiltPid,
    SurveyController,
    goal_of,
    settings_of,
    state_of_filter,
)

HEAVY = load_vehicle("bluerov2-heavy")


def at(place: list[float], heading_rad: float, speed_m_s: float = 0.0) -> BodyState:
    nu_B = np.array([speed_m_s, 0.0, 0.0, 0.0, 0.0, 0.0])
    X_WB = Pose(np.array(place), quat_from_euler(0.0, 0.0, heading_rad))
    current = 0.1 * np.array([math.cos(heading_rad + 1.0), math.sin(heading_rad + 1.0), 0.0])
    return BodyState(X_WB=X_WB, nu_B=nu_B, current_W_m_s=current)


def test_the_region_is_the_bed_under_and_ahead_of_the_vehicle() -> None:
    """Its points lie on the bed at any place and along any line, from behind the vehicle to ahead of it."""
    place, way = np.array([3.0, -2.0, 4.0]), 0.7
    points = bed_frame(place, 5.0, way).apply(bed_region().points_W_m)
    along = (points[:, :2] - place[:2]) @ np.array([math.cos(way), math.sin(way)])
    aside = (points[:, :2] - place[:2]) @ np.array([-math.sin(way), math.cos(way)])
    assert (along.min(), along.max()) == pytest.approx(AHEAD_M)
    assert (aside.min(), aside.max()) == pytest.approx(ASIDE_M)
    assert points[:, 2] == pytest.approx(4.98)


def test_thrusts_are_the_same_wherever_the_line_is() -> None:
    """One wrench at one altitude: place, depth and direction of the line change no thrust; the altitude does."""
    settings = settings_of()
    context = allocation_context(HEAVY, bed_region(), wake_model(settings.wake, 0.0), settings)
    wrench, found = np.array([3.0, 0.5, -2.0, 0.0, 0.1, 0.1]), []
    for place, bed, way in (([0.0, 0.0, 4.2], 5.0, 0.0), ([40.0, -7.0, 9.2], 10.0, 2.1), ([0.0, 0.0, 3.0], 5.0, 0.0)):
        moving = MovingRegionAllocator(inner=Allocator(layout=context.layout, context=context), bed_m=bed, way_rad=way)
        empty = Pipeline(name="none", layout=moving.layout, motion=PassiveTiltPid.of(HEAVY, settings, TILT_RAD)).blank()
        _, allocation = moving.allocate(empty, wrench, at(place, way, 0.1), 0.1)
        assert allocation is not None
        assert HEAVY.allocation_matrix @ allocation.thrusts_N == pytest.approx(wrench, abs=1e-6)
        found.append((allocation.thrusts_N, allocation.disturbance))
    assert found[1][0] == pytest.approx(found[0][0], abs=1e-6)
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-6)
    assert found[2][1] != pytest.approx(found[0][1], rel=0.1)


@pytest.mark.parametrize(("push_m", "at_rest"), [(0.02, True), (2.0, False)])
def test_vertical_thrusters_do_not_hold_against_the_level_ones_below_the_tilt_allowed(
    push_m: float, at_rest: bool
) -> None:
    """A push whose moment tilts the hull by less than 10 deg is left to it; of a harder one only that much is."""
    tracking = PassiveTiltPid.of(HEAVY, settings_of(), TILT_RAD)
    assert tracking.most_Nm == pytest.approx(1.3 * math.sin(TILT_RAD), rel=0.1)
    empty = Pipeline(name="none", layout=SurveyController(HEAVY)._pipeline.layout, motion=tracking).blank()
    here, goal = at([0.0, 0.0, 4.0], 0.0), Goal(X_WB=at([push_m, 0.0, 4.0], 0.0).X_WB)
    _, demand = tracking.step(empty, 0.1, here, goal)
    thrusts = np.linalg.pinv(HEAVY.allocation_matrix) @ demand.wrench_B
    vertical = np.abs(HEAVY.thruster_axes_B[:, 2]) > 0.7
    pitching = float(HEAVY.allocation_matrix[4, vertical] @ thrusts[vertical])
    assert abs(demand.wrench_B[4]) <= tracking.most_Nm[1] + 1e-9
    assert (abs(pitching) < 0.01) == at_rest


def test_without_a_bed_the_least_thrusts_are_flown() -> None:
    """A depth of the bed that is not known gives thrusts of the same wrench, all finite."""
    controller, target = SurveyController(HEAVY), SurveyTarget(place_W_m=np.array([0.5, 0.0, 4.0]))
    here = state_of_filter(np.array([0.0, 0.0, 4.0]), np.zeros(3), (0.0, 0.0, 0.0), (math.nan,) * 3, 0.05)
    thrusts = controller.thrusts_N(here, target, bed_m=math.nan, way_rad=0.0, dt_s=0.1)
    assert np.isfinite(thrusts).all()
    assert float((HEAVY.allocation_matrix @ thrusts)[0]) > 5.0


def test_a_target_becomes_a_goal_along_its_heading() -> None:
    """Velocity over ground is turned into the goal's body frame; the hull is upright."""
    target = SurveyTarget(
        place_W_m=np.array([1.0, 2.0, 3.0]), velocity_W_m_s=np.array([0.0, 0.1, 0.02]), heading_rad=0.5
    )
    goal = goal_of(target)
    assert goal.nu_B == pytest.approx([0.1 * math.sin(0.5), 0.1 * math.cos(0.5), 0.02, 0.0, 0.0, 0.0])
    assert goal.X_WB.R[2, 2] == pytest.approx(1.0)


def test_a_computer_that_is_too_slow_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that takes longer than half a control period: said with both times, before anything moves."""
    controller = SurveyController(HEAVY)
    monkeypatch.setattr(survey_control, "LONGEST_SHARE", 100.0)
    assert controller.warm_up() > 0.0
    monkeypatch.setattr(survey_control, "LONGEST_SHARE", 0.0)
    with pytest.raises(StageError, match=r"a control step takes .* ms on this computer, must be at most 0 ms"):
        controller.warm_up()

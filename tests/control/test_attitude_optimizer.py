"""A controller that chooses the body's attitude, round one that flies it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import polars as pl
import pytest
from attitude_helpers import CENTRE, HEAVY, OPEN, VEHICLE, believed, gap_m, looking, region

from wakewise.control import ControlSettings, make_controller
from wakewise.control.attitude_optimizer import RATE_RAD_S
from wakewise.control.pipeline import Demand, MotionStage
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.operation import Scenario, fly
from wakewise.planning import Surroundings
from wakewise.planning.problem import CLEARANCE_M
from wakewise.robot.vehicles import load_vehicle
from wakewise_paper.flights import camera_errors
from wakewise_paper.routes import gentle_route

DT = 0.02


def make(vehicle=HEAVY, method="allocation-only", **mechanisms):
    settings = ControlSettings(allocation={"advection": False, **mechanisms})
    return make_controller(method, vehicle, region(), believed(), settings, OPEN)


def loaded(goal, down_N):
    """An estimate that sits on its goal and is pulled down."""
    load = np.concatenate([goal.X_WB.R.T @ np.array([0.0, 0.0, down_N]), np.zeros(3)])
    return BodyState(X_WB=goal.X_WB, nu_B=goal.nu_B, load_B=load)


def flown(controller, goal_at, seconds, down_N):
    """The commands of a flight in which the vehicle is always where it should be."""
    state, posed, commands = controller.init(), goal_at(0.0), []
    for k in range(round(seconds / DT)):
        state, command = controller.step(state, DT, loaded(posed, down_N), goal_at(k * DT))
        posed = command.goal or goal_at(k * DT)
        commands.append(command)
    return state, commands


def test_only_a_camera_with_a_joint_is_posed_and_a_request_that_cannot_be_is_refused():
    """Null is where there is a joint; false nowhere; true on a fixed camera is refused by its field."""
    assert make().attitude is not None and make(optimize_attitude=True).attitude is not None
    assert make(optimize_attitude=False).attitude is None
    assert make(vehicle=load_vehicle("paper")).attitude is None
    with pytest.raises(InputError, match=r"control\.allocation\.optimize_attitude.*no joint"):
        make(vehicle=load_vehicle("paper"), optimize_attitude=True)


def test_heavy_it_leans_and_the_camera_keeps_its_pose_on_the_way():
    """To 1e-9 at every step; no faster than its rate; the joint within its stops; the goal's twist its own change."""
    goal = looking(HEAVY, np.radians(20.0))
    state, commands = flown(make(), lambda _: goal, 12.0, 5.0)
    assert abs(state.pitch_offset_rad) > np.radians(4.0)
    desired = goal.X_WB @ HEAVY.X_BC_at(goal.tilt_rad)
    for before, after in pairwise(commands):
        camera = after.goal.X_WB @ HEAVY.X_BC_at(after.goal.tilt_rad)
        np.testing.assert_allclose(camera.p_m, desired.p_m, atol=1e-9)
        np.testing.assert_allclose(camera.R, desired.R, atol=1e-9)
        assert HEAVY.tilt.low_rad <= after.goal.tilt_rad <= HEAVY.tilt.high_rad
        assert abs(after.goal.tilt_rad - before.goal.tilt_rad) <= RATE_RAD_S * DT + 1e-12
        moved = after.goal.X_WB.p_m - before.goal.X_WB.p_m
        mean_W = 0.5 * (before.goal.X_WB.R @ before.goal.nu_B[:3] + after.goal.X_WB.R @ after.goal.nu_B[:3])
        np.testing.assert_allclose(moved, DT * mean_W, atol=5e-6)  # the last step of a way is rounded


def test_a_lean_is_gone_before_the_mission_comes_near_a_roof():
    """Up at 5 cm/s to 4 cm below it: the leaning hull is never nearer than the clearance or the mission's."""
    low, begins_s, stops_s = looking(HEAVY, np.radians(20.0)), 12.0, 24.0
    up_W = np.array([0.0, 0.0, -0.05])
    highest = low.X_WB.p_m + (stops_s - begins_s) * up_W
    roof = float(highest[2] - 0.5 * HEAVY.size_m[2] - 0.04)
    around = Surroundings(planes=np.array([[0.0, 0.0, 1.0, roof]]))
    settings = ControlSettings(allocation={"advection": False})
    controller = make_controller("allocation-only", HEAVY, region(), believed(), settings, around)

    def goal_at(t):
        place = low.X_WB.p_m + np.clip(t - begins_s, 0.0, stops_s - begins_s) * up_W
        nu = np.concatenate([low.X_WB.R.T @ up_W, np.zeros(3)]) if begins_s <= t < stops_s else np.zeros(6)
        return replace(low, X_WB=Pose(place, low.X_WB.q), nu_B=nu)

    _, commands = flown(controller, goal_at, stops_s + 2.0, 5.0)
    leans, gaps, hull = [], [], controller.attitude.evaluator
    for k, command in enumerate(commands):
        goal = goal_at(k * DT)
        leans.append(command.goal.tilt_rad - goal.tilt_rad)
        gaps.append(gap_m(hull, command.goal) - min(CLEARANCE_M, gap_m(hull, goal)))
    assert max(np.abs(leans)) > np.radians(4.0)  # down there it leans
    assert min(gaps) > -0.002


def test_neutral_in_still_water_it_stays_level():
    """Whatever it weighs, the goal that it flies is the mission's."""
    goal = looking(VEHICLE, np.radians(40.0))
    state, commands = flown(make(VEHICLE), lambda _: goal, 4.5, 0.0)
    assert state.pitch_offset_rad == 0.0 and all(c.goal is goal for c in commands)


def test_a_mission_that_tilts_to_a_stop_takes_the_lean_with_it():
    """The joint stays between its stops while the mission's own tilt runs faster than a lean may change."""
    low = HEAVY.tilt.low_rad
    start = looking(HEAVY, 0.0, tilt=0.0)

    def goal_at(t):
        tilt = max(low, -0.2 * max(t - 8.0, 0.0))
        X_WC = start.X_WB @ HEAVY.X_BC_at(0.0)
        down = Pose(np.zeros(3), quat_from_euler(tilt, 0.0, 0.0))  # the camera's first axis is its right
        return Goal(X_WB=X_WC @ down @ HEAVY.X_BC_at(tilt).inverse(), tilt_rad=tilt)

    controller = make()
    pushed = replace(controller.init(), pitch_target_rad=low, attitude_search=None)
    state, tilts = pushed, []
    for k in range(700):
        goal = goal_at(k * DT)
        # It always asks for the lower stop.
        state, command = controller.step(
            replace(state, pitch_target_rad=low, attitude_search=None), DT, loaded(goal, 0.0), goal
        )
        tilts.append(command.goal.tilt_rad)
    assert (
        min(tilts) >= low - 1e-12 and tilts[-1] == pytest.approx(low) and state.pitch_offset_rad == pytest.approx(0.0)
    )


def test_what_is_not_finite_reaches_the_motion_stage_as_it_is():
    """A goal that is not finite is handed on; with an estimate that is not, the lean stays and nothing is chosen."""
    goal = looking(HEAVY, np.radians(20.0))
    controller = make()
    state, _ = flown(controller, lambda _: goal, 8.0, 5.0)
    lost = BodyState(X_WB=goal.X_WB)
    object.__setattr__(lost, "load_B", np.full(6, np.nan))
    after, command = controller.step(state, DT, lost, goal)
    assert after.pitch_target_rad == state.pitch_target_rad and command.goal is not None
    bad = Goal(X_WB=goal.X_WB, tilt_rad=goal.tilt_rad)
    object.__setattr__(bad, "nu_B", np.full(6, np.nan))
    _, command = controller.step(state, DT, loaded(goal, 5.0), bad)
    assert command.goal is None and "not finite" in command.fallback


@pytest.mark.parametrize("method", ["allocation-only", "wake-aware"])
def test_both_gentle_methods_are_posed_and_none_of_the_others(method):
    """`dp` and the planner that spares nothing fly the mission's own attitude."""
    assert make(method=method).attitude is not None and make(method=method).name == method
    for other in ("dp", "mpc", "no-forward-jets"):
        assert make(method=other).attitude is None


def test_the_motion_stage_sees_the_posed_goal():
    """What it is asked to fly is what the command tells the camera's joint."""

    class Notes(MotionStage):
        def __init__(self):
            self.goals = []

        def step(self, state, dt_s, estimate, goal):
            self.goals.append(goal)
            return state, Demand(wrench_B=np.zeros(6), thrusts_N=np.zeros(8))

    notes = Notes()
    controller = replace(make(), motion=notes, allocator=None)
    goal = looking(HEAVY, np.radians(20.0), range_m=0.5)
    _, commands = flown(controller, lambda _: goal, 6.0, 5.0)
    assert all(seen is told.goal for seen, told in zip(notes.goals, commands, strict=True))
    assert np.linalg.norm(goal.X_WB.p_m - CENTRE) > 0.5


def test_the_attitude_is_the_missions_where_it_says_so_or_a_person_flies():
    """Open with `auto` on a route; else false, and refused where it was asked for by name."""
    tilting = {"vehicle": "paper-tilting", "method": "allocation-only"}
    asked = {"control.allocation.optimize_attitude": True}
    assert Scenario.preset("quick", **tilting).parts().control.allocation.optimize_attitude is None
    for closed in ({"mission.aim": "tilt"}, {"mission.aim": "pitch"}, {"pilot": "human"}):
        assert Scenario.preset("quick", **tilting, **closed).parts().control.allocation.optimize_attitude is False
    with pytest.raises(InputError, match=r"control\.allocation\.optimize_attitude: true, but mission\.aim is pitch"):
        _ = Scenario.preset("quick", **tilting, **asked, **{"mission.aim": "pitch"}).parts().control
    assert (
        Scenario.preset("quick", **tilting, **asked, pilot="human").parts().control.allocation.optimize_attitude is True
    )


@pytest.mark.slow
def test_a_heavy_vehicle_that_leans_halves_the_wash_and_keeps_its_camera_in_place():
    """3.7 N heavy over silt (`payload`, seed 2), hovering: from the time it has leaned, against the same that may not.

    Less than half of the water's speed at the target and three quarters of the silt before it (what was lifted on the
    way still drifts there), at the camera error of the other.
    """
    seen = {}
    for posture in (None, False):
        fields = {
            "vehicle": "bluerov2-heavy",
            "method": "allocation-only",
            "control.allocation.optimize_attitude": posture,
        }
        parts = Scenario.preset("quick", world="payload", seed=2, **fields).parts()
        hover = gentle_route(parts.target.centre_W_m, parts.scenario.mission.standoff_m, -2.4)
        frame = fly(parts.replace(route=hover), checked=False, duration_s=18.0, water_every_s=0.25).steps
        frame = frame.filter(pl.col("time_s") > 14.0)
        error_mm = camera_errors(frame, parts.vehicle)["camera_rmse_mm"]
        seen[posture] = (frame["target_speed_mean_m_s"].mean(), frame["ray_optical_depth"].mean(), error_mm)
    leaned, level = seen[None], seen[False]
    assert leaned[0] < 0.5 * level[0]
    assert leaned[1] < 0.75 * level[1]
    assert leaned[2] < 1.05 * level[2] + 0.5

"""A body that leans under its camera: pose and twist of the camera, what a posture costs, and where it may not go."""

from dataclasses import replace

import numpy as np
import pytest
from attitude_helpers import HEAVY, OPEN, VEHICLE, believed, gap_m, looking, region

from wakewise.control import ControlSettings, make_controller
from wakewise.control.attitude_optimizer import (
    ACCELERATION_RAD_S2,
    AHEAD_S,
    INFEASIBLE,
    RATE_RAD_S,
    ROUND_S,
    STEP_RAD,
    AttitudeCost,
    AttitudeEvaluator,
    Hinge,
    HoldingTask,
    offset_step,
    return_profile,
    select,
)
from wakewise.control.null_space_allocation import STANDING_W
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler, quat_from_rotvec
from wakewise.core.interfaces import BodyState, Goal
from wakewise.planning import Surroundings
from wakewise.planning.problem import CLEARANCE_M, reference_of
from wakewise.robot.vehicles import TiltJoint
from wakewise.wake import InfluenceModel


def view(vehicle) -> InfluenceModel:
    return InfluenceModel.of(vehicle, region(), believed())


def scale(vehicle=VEHICLE, around=OPEN) -> AttitudeEvaluator:
    settings = ControlSettings()
    return AttitudeEvaluator.of(vehicle, vehicle.tilt, around, (settings.w_disturbance, settings.w_effort))


def held(goal, down_N=0.0, vehicle=VEHICLE, seen=None) -> HoldingTask:
    force = np.array([0.0, 0.0, down_N])
    seen = view(vehicle) if seen is None else seen
    return HoldingTask(
        goal=goal,
        force_W_N=force,
        moment_B_Nm=np.zeros(3),
        gram=lambda X_WB, _: seen.gram(X_WB),
        total_weight=seen.total_weight,
    )


WAYS = {"level": np.array([0.0, 0.1, 0.0]), "down": np.array([0.0, 0.0, 0.1])}
HINGES = [
    Hinge(X_BC=VEHICLE.X_BC, joint=VEHICLE.tilt),
    Hinge(
        X_BC=Pose(np.array([0.2, 0.03, -0.05]), quat_from_euler(0.3, -0.2, 1.4)),
        joint=TiltJoint(low_rad=-1.0, high_rad=0.8, rate_rad_s=1.0, p_BJ_m=np.array([0.14, 0.0, -0.09])),
    ),
]


@pytest.mark.parametrize("hinge", HINGES, ids=["through the lens", "beside it"])
def test_the_camera_keeps_its_pose_whatever_the_lean(hinge):
    """To 1e-12, wherever the hinge goes through and however the mission tilts."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        tilt, lean = rng.uniform(-0.7, 0.7), rng.uniform(-0.6, 0.6)
        goal = Goal(X_WB=Pose(rng.normal(size=3), quat_from_euler(*rng.uniform(-1, 1, 3))), tilt_rad=tilt)
        posed = hinge.with_offset(goal, lean)
        before = goal.X_WB @ hinge.joint.mount(hinge.X_BC, tilt)
        after = posed.X_WB @ hinge.joint.mount(hinge.X_BC, posed.tilt_rad)
        np.testing.assert_allclose(after.p_m, before.p_m, atol=1e-12)
        np.testing.assert_allclose(after.R, before.R, atol=1e-12)
        assert posed.tilt_rad == pytest.approx(tilt + lean)


@pytest.mark.parametrize("hinge", HINGES, ids=["through the lens", "beside it"])
def test_the_posed_twist_is_the_derivative_of_the_posed_pose(hinge):
    """Against central differences, while goal and lean both move."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        start = Pose(rng.normal(size=3), quat_from_euler(*rng.uniform(-1, 1, 3)))
        v_W, turn, lean, rate = rng.normal(size=3), rng.normal(size=3), rng.uniform(-0.5, 0.5), rng.normal()

        def at(t, start=start, v_W=v_W, turn=turn, lean=lean, rate=rate):
            R = start.R @ matrix_from_quat(quat_from_rotvec(turn * t))
            X = Pose.from_matrix(R, start.p_m + v_W * t)
            goal = Goal(X_WB=X, nu_B=np.concatenate([R.T @ v_W, turn]), tilt_rad=0.1)
            return hinge.with_offset(goal, lean + rate * t, rate)

        h, now = 1e-6, at(0.0)
        before, after = at(-h), at(h)
        np.testing.assert_allclose(now.nu_B[:3], now.X_WB.R.T @ (after.X_WB.p_m - before.X_WB.p_m) / (2 * h), atol=1e-7)
        change = now.X_WB.R.T @ (after.X_WB.R - before.X_WB.R) / (2 * h)
        np.testing.assert_allclose(now.nu_B[3:], [change[2, 1], change[0, 2], change[1, 0]], atol=1e-7)


def test_a_lean_is_reached_within_rate_and_acceleration_and_without_overshoot():
    """From rest, turned back on the way, and over less than one step's way; it then stays."""
    dt = 0.02
    for desired, back in ((0.6, 0.6), (-0.9, 0.1), (1e-5, 1e-5), (0.3, -0.2)):
        lean, rate, ways = 0.0, 0.0, []
        for k in range(1500):
            to = desired if k < 100 else back
            before, was = lean, rate
            lean, rate = offset_step(lean, rate, to, dt)
            ways.append(lean)
            assert abs(rate) <= RATE_RAD_S + 1e-12
            assert abs(rate - was) <= ACCELERATION_RAD_S2 * dt + 1e-12
            assert abs(lean - before) <= RATE_RAD_S * dt + 1e-12
        assert (lean, rate) == (back, 0.0)
        assert max(ways) <= max(desired, back, 0.0) + 1e-3 and min(ways) >= min(desired, back, 0.0) - 1e-3


def test_leans_stay_between_the_stops():
    """All of them, the present attitude among them, no two farther apart than a step."""
    for tilt in (-0.7, 0.0, 0.2, VEHICLE.tilt.low_rad, VEHICLE.tilt.high_rad):
        leans = np.array(scale().offsets(Goal(X_WB=Pose(np.zeros(3)), tilt_rad=tilt)))
        assert np.all((leans + tilt >= VEHICLE.tilt.low_rad - 1e-8) & (leans + tilt <= VEHICLE.tilt.high_rad + 1e-8))
        assert 0.0 in leans and np.all(np.diff(leans) <= STEP_RAD + 1e-8)


def prices(weighed, hold):
    leans = weighed.offsets(hold.goal)
    return leans, [weighed.cost(hold, lean) for lean in leans]


def test_a_neutral_vehicle_in_still_water_stays_level():
    """Nothing to carry but what rights it: level costs nothing, every lean something."""
    leans, found = prices(scale(), held(looking(VEHICLE, np.radians(40.0))))
    level = leans.index(0.0)
    assert select(found, level, level) == level and found[level].cost < 1e-12
    assert min(price.power_W for price in found[:level] + found[level + 1 :]) > 0.01


@pytest.mark.parametrize("vehicle", [VEHICLE, HEAVY], ids=["paper", "bluerov2"])
def test_a_heavy_vehicle_saves_by_a_lean(vehicle):
    """5 N heavy beside the target: the posture that is chosen costs less than half of the level one."""
    leans, found = prices(scale(vehicle), held(looking(vehicle, np.radians(20.0)), 5.0, vehicle))
    level = leans.index(0.0)
    assert found[select(found, level, level)].cost < 0.5 * found[level].cost


def test_among_postures_that_cost_about_the_least_the_one_of_least_power_is_taken():
    """A lean four times as dear is as good, a dearer one is not; the present one stays for a tenth and two watts."""
    least, cheap = AttitudeCost(cost=1.0, power_W=290.0), AttitudeCost(cost=3.9, power_W=200.0)
    assert select([AttitudeCost(cost=5.0, power_W=200.0), least, cheap], 0, 0) == 2
    for own, stays in (((4.2, 210.0), True), ((4.5, 210.0), False), ((1.0, 224.0), True), ((1.0, 225.0), False)):
        prices = [AttitudeCost(cost=own[0], power_W=own[1]), least, cheap]
        assert select(prices, 0, 0) == (0 if stays else 2)


def test_nobody_leans_for_a_watt():
    """In nearly perfect trim a lean of half the power is not gone for, nor is a wash four times as strong kept."""
    lean = AttitudeCost(cost=1.0, power_W=0.9)
    assert select([AttitudeCost(cost=1.0, power_W=1.8), lean], 0, 0) == 0
    assert select([AttitudeCost(cost=4.5, power_W=1.8), lean], 0, 0) == 1
    assert select([AttitudeCost(cost=1.0, power_W=0.9 + 2.0 * STANDING_W), lean], 0, 0) == 1


def test_a_lean_may_take_twice_the_power_and_no_more():
    """However gentle it seems to be; without any that can be had, the mission's own stays."""
    own = AttitudeCost(cost=100.0, power_W=1.5)
    assert select([own, AttitudeCost(cost=1.0, power_W=2.9)], 0, 0) == 1
    assert select([own, AttitudeCost(cost=1.0, power_W=3.1)], 0, 0) == 0
    assert select([own, AttitudeCost(cost=1.0, power_W=3.5)], 0, 1) == 0
    assert select([INFEASIBLE, INFEASIBLE], 0, 1) == 0


def test_a_posture_that_comes_too_near_is_refused_and_the_missions_own_never():
    """A floor just below the level hull: leans that lower it are infinite; level is not, however near it is."""
    goal = looking(VEHICLE, np.radians(30.0))
    low = float(goal.X_WB.p_m[2] + 0.5 * VEHICLE.size_m[2] + 0.03)
    weighed = scale(around=Surroundings(planes=np.array([[0.0, 0.0, -1.0, -low]])))
    leans, found = prices(weighed, held(goal, 5.0))
    gaps = [gap_m(weighed, weighed.hinge.with_offset(goal, lean)) for lean in leans]
    level = leans.index(0.0)
    refused = [price is INFEASIBLE for price in found]
    assert any(refused) and not refused[level]
    assert all(out or gap >= gaps[level] for out, gap in zip(refused, gaps, strict=True))


def test_a_lean_needs_room_where_the_mission_will_be_before_it_can_be_given_back():
    """Over a floor a quarter of a metre below: there is room at rest and on a level way, none on the way down."""
    goal = looking(VEHICLE, np.radians(30.0))
    low = float(goal.X_WB.p_m[2] + 0.5 * VEHICLE.size_m[2] + 0.25)
    weighed = scale(around=Surroundings(planes=np.array([[0.0, 0.0, -1.0, -low]])))
    lean = min(weighed.offsets(goal), key=lambda lean: gap_m(weighed, weighed.hinge.with_offset(goal, lean)))
    lean = float(np.clip(lean, -0.26, 0.26))
    R = goal.X_WB.R
    moving = {name: replace(goal, nu_B=np.concatenate([R.T @ v, np.zeros(3)])) for name, v in WAYS.items()}
    assert weighed.has_room(goal, lean) and weighed.has_room(moving["level"], lean)
    assert not weighed.has_room(moving["down"], lean) and weighed.has_room(moving["down"], 0.0)
    assert weighed.cost(held(moving["down"], 5.0), lean) is INFEASIBLE
    assert weighed.cost(held(goal, 5.0), lean) is not INFEASIBLE


def test_room_is_what_the_posed_hull_has_place_by_place():
    """As `posed` and `gap_m` say it of each place on the way, for floors at random depths and any twist."""
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(60):
        goal = looking(VEHICLE, np.radians(30.0))
        goal = replace(goal, nu_B=0.1 * rng.normal(size=6))
        low = float(goal.X_WB.p_m[2] + rng.uniform(0.1, 0.8))
        weighed = scale(around=Surroundings(planes=np.array([[0.0, 0.0, -1.0, -low]]), spheres=OPEN.spheres))
        lean = float(rng.choice(weighed.offsets(goal)))
        leans, has = return_profile(lean, ROUND_S), True
        for row, then in zip(reference_of(goal, len(leans) - 1, AHEAD_S), leans, strict=True):
            there = replace(goal, X_WB=Pose(row[:3], row[3:7]))
            own = gap_m(weighed, there)
            has = has and gap_m(weighed, weighed.hinge.with_offset(there, then)) >= min(CLEARANCE_M, own) - 1e-12
        seen.add(has)
        assert weighed.has_room(goal, lean, ROUND_S) == has
    assert seen == {True, False}


def test_a_lean_is_given_back_no_faster_than_it_may_change():
    """Held as long as asked, then level within its rate."""
    leans = np.array(return_profile(0.4, ROUND_S))
    rest = round(ROUND_S / AHEAD_S)
    assert np.all(leans[: rest + 1] == 0.4) and leans[-1] == 0.0
    assert np.all(np.abs(np.diff(leans)) <= RATE_RAD_S * AHEAD_S + 1e-12)
    assert return_profile(0.0) == (0.0,)


def test_a_posture_that_the_thrusters_cannot_hold_is_not_to_be_had():
    """A load beyond their limits, whatever the lean."""
    _, found = prices(scale(), held(looking(VEHICLE, np.radians(30.0)), 1000.0))
    assert all(price is INFEASIBLE for price in found)


def test_the_cost_is_what_the_allocator_would_pay_there():
    """Level and loaded, it is the weighed D and effort of the thrusts that `allocation-only` finds for its own
    wrench.
    """
    settings = ControlSettings(
        allocation=dict.fromkeys(("merging_jets", "advection", "optimize_attitude", "power_limit"), False)
    )
    controller = make_controller("allocation-only", VEHICLE, region(), believed(), settings)
    goal = looking(VEHICLE, np.radians(40.0))
    R, context = goal.X_WB.R, controller.allocator.context
    load = np.concatenate([R.T @ [0.0, 0.0, 3.0], np.zeros(3)])
    state = controller.init()
    for _ in range(200):  # until the price on change has nothing left to say
        state, command = controller.step(state, 0.02, BodyState(X_WB=goal.X_WB, load_B=load), goal)
    T, total = command.thrusts_N, context.view.total_weight
    paid = settings.w_disturbance * command.disturbance / total + settings.w_effort * float(T @ T)
    weighed = scale().cost(held(goal, 3.0, seen=context.view), 0.0).cost
    assert weighed == pytest.approx(paid, rel=0.02)

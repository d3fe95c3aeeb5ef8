"""A wrench to thrusts within limits, with failed thrusters, around a target."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.ros import ProtectedPoints, ThrustAllocator, failed_thrusters

HEAVY = load_vehicle("bluerov2-heavy")
NAMES = tuple(thruster.name for thruster in HEAVY.thrusters)
HERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
PLACES = np.array([[0.6, -0.33, 0.1], [0.6, 0.33, 0.1], [0.65, 0.35, 0.12]])
AHEAD = ProtectedPoints(points_m=PLACES, weights=np.ones(3))
BACK = np.array([-20.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def allocator() -> ThrustAllocator:
    return ThrustAllocator(vehicle=HEAVY, wake=wake_model("jet"))


def test_a_target_ahead_is_spared_for_the_same_wrench(allocator: ThrustAllocator) -> None:
    """Backing off from it, the same wrench stirs it less than the least thrusts do."""
    blind, seeing = allocator(BACK), allocator(BACK, AHEAD, HERE)
    assert blind.disturbance is None
    assert blind.way == "least thrusts: no target"
    np.testing.assert_allclose(seeing.wrench_B, BACK, atol=1e-8)
    np.testing.assert_allclose(blind.wrench_B, BACK, atol=1e-8)
    assert seeing.saved_pct is not None
    assert seeing.saved_pct > 5.0
    assert seeing.way == "gentle"


def test_points_that_are_fixed_to_the_body_need_no_pose(allocator: ThrustAllocator) -> None:
    """Given in the body they give what the same points give in the world; in the world without a pose nothing can."""
    elsewhere = Pose(np.array([5.0, 2.0, 3.0]), np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)]))
    in_body = ProtectedPoints(points_m=AHEAD.points_m, weights=AHEAD.weights, on_body=True)
    in_world = ProtectedPoints(points_m=elsewhere.apply(AHEAD.points_m), weights=AHEAD.weights)
    np.testing.assert_allclose(
        allocator(BACK, in_body).thrusts_N, allocator(BACK, in_world, elsewhere).thrusts_N, atol=1e-6
    )
    assert "no fresh pose" in allocator(BACK, in_world).way


def test_failed_thrusters_give_nothing_and_limits_hold() -> None:
    """Whatever is asked: zero from the failed, no more than the share of the limits from the others."""
    failed = failed_thrusters("1, front left vertical", NAMES)
    assert failed == (0, 5)
    allocator = ThrustAllocator(vehicle=HEAVY, wake=wake_model("jet"), failed=failed, share=0.5, priority="ZKMN,XY")
    rng = np.random.default_rng(57)
    for wrench in rng.normal(size=(20, 6)) * [60.0, 60.0, 60.0, 5.0, 5.0, 10.0]:
        for answer in (allocator(wrench), allocator(wrench, AHEAD, HERE)):
            assert not np.any(answer.thrusts_N[list(failed)])
            assert np.all(answer.thrusts_N <= 0.5 * HEAVY.thrust_upper_N + 1e-9)
            assert np.all(answer.thrusts_N >= 0.5 * HEAVY.thrust_lower_N - 1e-9)


def test_points_within_the_hull_are_its_own(allocator: ThrustAllocator) -> None:
    """A sonar sees the vehicle itself; with nothing else there is no target; many points count as few heavier ones."""
    own = ProtectedPoints(points_m=np.zeros((5, 3)), weights=np.ones(5))
    assert "within the vehicle" in allocator(BACK, own, HERE).way
    many = ProtectedPoints(points_m=np.repeat(AHEAD.points_m, 1000, axis=0), weights=np.ones(3000))
    ratio = allocator(BACK, many, HERE).least_disturbance / allocator(BACK, AHEAD, HERE).least_disturbance
    assert ratio == pytest.approx(1000.0, rel=1e-6)


def test_what_cannot_be_is_refused() -> None:
    """Thrusters that are not there, shares that are none, points nowhere."""
    with pytest.raises(InputError, match="1 to 8"):
        failed_thrusters("9", NAMES)
    with pytest.raises(InputError, match="limit_share"):
        ThrustAllocator(vehicle=HEAVY, wake=wake_model("jet"), share=0.0)
    with pytest.raises(InputError, match="finite"):
        ProtectedPoints(points_m=np.array([[np.nan, 0.0, 0.0]]), weights=np.ones(1))

"""The controllers by name: same wrench, gentler water, and no exception whatever comes in."""

import numpy as np
import pytest

from wakewise.control import METHODS, ControlSettings, make_controller
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import disturbance, wake_model

VEHICLE = load_vehicle("paper")
CENTRE = np.array([0.0, 0.0, 1.4])
INSTANT = ("dp", "allocation-only")
"""Methods that allocate one instant at a time; the others plan and follow."""


def small_region() -> Region:
    rng = np.random.default_rng(0)
    points = CENTRE + rng.uniform(-0.1, 0.1, size=(120, 3))
    distance = rng.uniform(0.0, 0.1, 120)
    return Region(points_W_m=points, weights=np.exp(-distance / 0.05), distance_m=distance)


def spoil(record, name: str, value: Array) -> None:
    """Put NaN into a record that would have refused it, as a broken sensor driver might."""
    object.__setattr__(record, name, value)


def station(eye, shift=(0.0, 0.0, 0.0)):
    pose = Pose.from_matrix(look_at(eye, CENTRE), eye)
    return BodyState(X_WB=pose), Goal(X_WB=Pose(pose.p_m + np.array(shift), pose.q))


@pytest.mark.parametrize("wake", ["jet", "paper"])
def test_the_same_wrench_at_less_disturbance(wake):
    """At equal wrench, from rest, the gentle one disturbs no more than its effort weight pays for; often far less."""
    region, settings = (
        small_region(),
        ControlSettings(allocation={"null_space": False, "merging_jets": False, "advection": False}),
    )
    dp, gentle = (make_controller(m, VEHICLE, region, wake_model(wake), settings) for m in INSTANT)
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(25):
        direction = rng.normal(size=3) * np.array([1.0, 1.0, 0.4]) - np.array([0.0, 0.0, 0.5])
        eye = CENTRE + 0.45 * direction / np.linalg.norm(direction)
        estimate, goal = station(eye, rng.normal(size=3) * 0.02)
        _, first = dp.step(dp.init(), 0.02, estimate, goal)
        _, second = gentle.step(gentle.init(), 0.02, estimate, goal)
        np.testing.assert_allclose(first.wrench_B, second.wrench_B)
        np.testing.assert_allclose(VEHICLE.allocation_matrix @ second.thrusts_N, second.wrench_B, atol=1e-9)
        weight = region.weights.sum()
        # From rest the price on change is one on thrust, five times that on effort.
        costs = [150.0 * c.disturbance / weight + 6e-3 * c.thrusts_N @ c.thrusts_N for c in (first, second)]
        assert costs[1] <= costs[0] * (1 + 1e-9)
        if first.disturbance > 1e-6:
            ratios.append(second.disturbance / first.disturbance)
    assert ratios and np.median(ratios) <= 1.0


def test_reported_disturbance_is_that_of_the_thrusts():
    """D in the command is s' G s at the estimated pose, by the belief that shares are chosen by."""
    estimate, goal = station(np.array([0.05, 0.0, 0.95]), (0.0, 0.0, -0.03))
    for method in INSTANT:
        controller = make_controller(method, VEHICLE, small_region(), wake_model("jet"))
        _, command = controller.step(controller.init(), 0.02, estimate, goal)
        allocator, thrusts = controller.allocator, command.thrusts_N
        context = allocator.context
        G = allocator.view.gram(estimate.X_WB) if context is None else context.influence(estimate, thrusts).gram
        expected = disturbance(G, thrusts)
        assert command.disturbance == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("spoilt", ["estimate twist", "goal twist", "estimate pose"])
def test_a_nan_gives_the_last_thrusts_fading(method, spoilt):
    """NaN in estimate or goal: thrusts shrink step by step, the command says why, nothing is raised."""
    controller = make_controller(method, VEHICLE, small_region(), wake_model("jet"))
    estimate, goal = station(np.array([-0.4, 0.0, 1.1]), (0.05, 0.0, 0.0))
    state, before = controller.step(controller.init(), 0.02, estimate, goal)
    if spoilt == "estimate twist":
        spoil(estimate, "nu_B", np.full(6, np.nan))
    elif spoilt == "goal twist":
        spoil(goal, "nu_B", np.full(6, np.nan))
    else:
        spoil(estimate.X_WB, "p_m", np.full(3, np.nan))
    state, command = controller.step(state, 0.02, estimate, goal)
    if method != "pseudo-inverse":  # which fades the thrusts of the planner whose wrench it makes
        np.testing.assert_allclose(command.thrusts_N, before.thrusts_N * np.exp(-0.02 / 0.5))
    assert command.fallback is not None and spoilt.split()[0] in command.fallback
    for _ in range(500):
        state, command = controller.step(state, 0.02, estimate, goal)
    assert np.abs(command.thrusts_N).max() < 1e-6


def test_a_wake_model_that_fails_is_done_without():
    """A Gram matrix with NaN falls back on least thrusts and says so."""

    class Broken:
        name = "broken"

        def unit_velocity(self, points_W_m, origins_W_m, directions_W, area_m2):
            return np.full((len(origins_W_m), len(points_W_m), 3), np.nan)

    estimate, goal = station(np.array([-0.4, 0.0, 1.1]), (0.05, 0.0, 0.0))
    controller = make_controller("allocation-only", VEHICLE, small_region(), Broken())
    baseline = make_controller("dp", VEHICLE, small_region(), wake_model("jet"))
    _, command = controller.step(controller.init(), 0.02, estimate, goal)
    _, expected = baseline.step(baseline.init(), 0.02, estimate, goal)
    np.testing.assert_allclose(command.thrusts_N, expected.thrusts_N)
    assert command.fallback is not None and "wake model" in command.fallback
    assert command.disturbance is None


@pytest.mark.parametrize("method", INSTANT)
def test_a_far_goal_saturates_within_limits_and_says_so(method):
    """A goal 20 m away asks for more than there is: limits hold and the command tells the share."""
    controller = make_controller(method, VEHICLE, small_region(), wake_model("jet"))
    estimate, goal = station(np.array([-0.4, 0.0, 1.1]), (20.0, 3.0, 0.0))
    state, command = controller.step(controller.init(), 0.02, estimate, goal)
    assert np.all(command.thrusts_N >= VEHICLE.thrust_lower_N) and np.all(command.thrusts_N <= VEHICLE.thrust_upper_N)
    assert command.fallback is not None and "saturated" in command.fallback
    assert state.saturated


def test_the_state_holds_everything():
    """The same state, estimate and goal give the same command, whatever was computed between."""
    controller = make_controller("wake-aware", VEHICLE, small_region(), wake_model("jet"))
    estimate, goal = station(np.array([0.1, 0.0, 0.95]), (0.01, 0.0, -0.02))
    state, _ = controller.step(controller.init(), 0.02, estimate, goal)
    _, first = controller.step(state, 0.02, estimate, goal)
    controller.step(state, 0.02, *station(np.array([0.3, 0.3, 1.0])))
    _, second = controller.step(state, 0.02, estimate, goal)
    np.testing.assert_array_equal(first.thrusts_N, second.thrusts_N)


def test_an_unknown_method_is_refused_with_the_known_ones():
    """The error lists what is allowed."""
    with pytest.raises(InputError, match=r"'psychic'.*dp, .*wake-aware"):
        make_controller("psychic", VEHICLE, small_region(), wake_model("jet"))

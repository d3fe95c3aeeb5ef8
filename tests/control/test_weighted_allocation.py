"""The weighted pseudo-inverse as a method: a rival without a wake model."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.allocation import min_norm_allocation
from wakewise.control import ControlSettings, make_controller
from wakewise.control.weighted_allocation import EXTRA_W, POWER_RATIO, weighted_allocator
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import find_target, sample_region
from wakewise.wake import wake_model

NAMES = ["paper", "bluerov2-heavy"]


def _made(name):
    vehicle = load_vehicle(name)
    region = sample_region(find_target("soft-coral", 1.5, 1), 60, np.random.default_rng(0))
    return vehicle, region, weighted_allocator(vehicle, region, wake_model("jet"), ControlSettings())


def _at(region, shift_m):
    centre = region.weights @ region.points_W_m / region.weights.sum()
    return BodyState(X_WB=Pose(p_m=centre + shift_m))


def _hover(region, distance_m):
    return _at(region, np.array([-distance_m, 0.0, 0.0]))


def _state(vehicle, region):
    return make_controller("weighted-pseudo-inverse", vehicle, region, wake_model("jet")).init()


@pytest.mark.parametrize("name", NAMES)
def test_every_wrench_of_a_hover_is_made_within_limits_and_power(name):
    """Whatever the price, thrusts make the wrench, keep the limits, and take at most 1.3 times the least power."""
    vehicle, region, allocator = _made(name)
    state, estimate = _state(vehicle, region), _hover(region, 0.7)
    rng, other = np.random.default_rng(1), 0
    for _ in range(60):
        wrench = rng.uniform(-1.0, 1.0, 6) * [3.0, 3.0, 5.0, 0.2, 0.5, 0.3]
        _, found = allocator.allocate(state, wrench, estimate, 0.02)
        least = min_norm_allocation(allocator.layout, wrench).thrusts_N
        assert vehicle.allocation_matrix @ found.thrusts_N == pytest.approx(wrench, abs=1e-9)
        assert np.all((found.thrusts_N >= allocator.layout.lower_N) & (found.thrusts_N <= allocator.layout.upper_N))
        most_W = POWER_RATIO * float(allocator.law.power_W(least)) + EXTRA_W
        assert float(allocator.law.power_W(found.thrusts_N)) <= most_W + 1e-9
        other += not np.allclose(found.thrusts_N, least)
    assert other > 20


@pytest.mark.parametrize("name", NAMES)
def test_a_target_astern_is_priced_as_one_ahead_and_one_far_below_as_neither(name):
    """The rule goes by where the target is, not by the bow."""
    vehicle, region, allocator = _made(name)
    level = np.abs(vehicle.thruster_axes_B[:, 2]) < 0.5
    ahead = allocator.aims(_hover(region, 0.7)).max(axis=0)[level]
    astern = allocator.aims(_hover(region, -0.7)).max(axis=0)[level]
    bow = vehicle.thruster_positions_B_m[level, 0] > 0.0
    assert np.all(ahead[bow] == 1.0) and np.all(ahead[~bow] < 1.0)
    assert np.all(astern[~bow] == 1.0) and np.all(astern[bow] < 1.0)
    over = _at(region, np.array([0.0, 0.0, -3.0]))
    assert np.all(allocator.aims(over).max(axis=0)[level] == 0.0)


def test_a_push_that_blows_away_from_the_target_costs_nothing_more():
    """Where the least thrusts send less than the onset at the target, they are flown."""
    vehicle, region, allocator = _made("paper")
    small = np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0])
    _, found = allocator.allocate(_state(vehicle, region), small, _hover(region, 0.7), 0.02)
    assert np.array_equal(found.thrusts_N, min_norm_allocation(allocator.layout, small).thrusts_N)


def test_a_push_astern_is_taken_from_the_bow_pair():
    """Astern push sends less thrust at the target than the least thrusts do, by more than a half."""
    vehicle, region, allocator = _made("paper")
    estimate, wrench = _hover(region, 0.7), np.array([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    aims = allocator.aims(estimate)

    def sent_N(thrusts):
        return float((np.maximum(thrusts, 0.0) * aims[0] + np.maximum(-thrusts, 0.0) * aims[1]).sum())

    free = replace(
        allocator, law=replace(allocator.law, forward=0.0 * allocator.law.forward, reverse=0.0 * allocator.law.reverse)
    )
    least = min_norm_allocation(allocator.layout, wrench).thrusts_N
    _, found = free.allocate(_state(vehicle, region), wrench, estimate, 0.02)
    assert sent_N(found.thrusts_N) < 0.5 * sent_N(least)


def test_thrusters_that_cannot_make_all_axes_still_make_the_wrenches_that_they_can():
    """Four thrusters make every wrench of their own, whatever the price."""
    vehicle, region, _ = _made("paper")
    fewer = replace(vehicle, thrusters=vehicle.thrusters[:4])
    allocator = weighted_allocator(fewer, region, wake_model("jet"), ControlSettings())
    rng = np.random.default_rng(2)
    for _ in range(20):
        wrench = fewer.allocation_matrix @ rng.uniform(-1.0, 1.0, 4)
        _, found = allocator.allocate(_state(vehicle, region), wrench, _hover(region, 0.7), 0.02)
        assert found.wrench_B == pytest.approx(wrench, abs=1e-6)

"""What is given up when a wrench cannot be made: direction kept, or axes in order, never what could be had."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.allocation import Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.allocation.layout import AXES, parse_priority
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle

PAPER = load_vehicle("paper")


def layout(lower=-40.0, upper=51.0, failed=()):
    low, high = np.full(8, float(lower)), np.full(8, float(upper))
    low[list(failed)] = high[list(failed)] = 0.0
    return compile_layout(PAPER.allocation_matrix, low, high)


def test_priority_gives_up_surge_and_keeps_heave_and_attitude():
    """A surge far beyond the limits leaves heave and moments whole when they come first, and is all that is lost."""
    wrench = np.array([300.0, 0.0, 20.0, 0.5, -0.5, 1.0])
    found = min_norm_allocation(layout(), wrench, priority="ZKMN,XY")
    assert set(found.given_up) == {"X"}
    np.testing.assert_allclose(found.wrench_B[2:], wrench[2:], atol=1e-5)
    kept = min_norm_allocation(layout(), wrench)
    np.testing.assert_allclose(kept.wrench_B, kept.scale * wrench, atol=1e-8)
    assert kept.scale < 1.0 and set(kept.given_up) == {"X", "Z", "K", "M", "N"}


def test_what_comes_first_is_never_paid_for_by_what_comes_later():
    """The first axis gets as much as it gets alone, whatever else is asked for."""
    for axis in AXES:
        alone, among = np.zeros(6), np.array([200.0, 150.0, 250.0, 30.0, 40.0, 50.0])
        i = AXES.index(axis)
        alone[i] = among[i]
        first = min_norm_allocation(layout(), alone, priority=axis).wrench_B[i]
        assert min_norm_allocation(layout(), among, priority=axis).wrench_B[i] == pytest.approx(
            first, rel=1e-4, abs=1e-4
        )


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 300.0), st.lists(st.integers(0, 7), max_size=3))
def test_gentle_thrusts_give_up_what_least_thrusts_give_up(seed, size, failed):
    """Both make the same wrench within limits under any priority, with any thrusters failed."""
    rng = np.random.default_rng(seed)
    here = layout(-5.0 - 10 * rng.random(), 20.0, failed)
    wrench, order = rng.normal(size=6) * size, ",".join(rng.permutation(list(AXES)))
    A = rng.normal(size=(16, 5))
    for priority in (None, order):
        least = min_norm_allocation(here, wrench, priority=priority)
        gentle = min_wash_allocation(here, wrench, A @ A.T, Weights(effort=1e-2), priority=priority, budget=60)
        np.testing.assert_allclose(gentle.wrench_B, least.wrench_B, atol=1e-7 * (1.0 + size))
        for found in (least, gentle):
            assert np.all((found.thrusts_N >= here.lower_N) & (found.thrusts_N <= here.upper_N))
            assert np.all(found.thrusts_N[list(failed)] == 0.0)


def test_a_wrench_that_can_be_made_needs_no_priority():
    """Within limits the priority changes nothing."""
    wrench = np.array([3.0, -2.0, 4.0, 0.1, 0.1, 0.2])
    np.testing.assert_array_equal(
        min_norm_allocation(layout(), wrench, priority="N").thrusts_N, min_norm_allocation(layout(), wrench).thrusts_N
    )


def test_lost_rank_is_reported_by_axis():
    """Without the two front horizontals a pure sway cannot be made without yaw: what is missing is named."""
    here = layout(failed=(0, 1))
    assert here.rank == 5
    found = min_norm_allocation(here, np.array([0.0, 5.0, 2.0, 0.0, 0.0, 0.0]))
    assert set(found.given_up) and "Z" not in found.given_up
    first = min_norm_allocation(here, np.array([0.0, 5.0, 2.0, 0.0, 0.0, 0.0]), priority="Y,ZKM")
    assert "Y" not in first.given_up and "N" in first.given_up


def test_all_thrusters_failed_make_nothing():
    """With no thruster left everything is given up and nothing breaks."""
    found = min_norm_allocation(layout(failed=range(8)), np.ones(6), priority="Z")
    assert set(found.given_up) == set(AXES) and not np.any(found.thrusts_N)


@pytest.mark.parametrize(("text", "words"), [("Q", "unknown"), ("XX", "twice"), ("X,YX", "twice"), (" ,", "no axes")])
def test_a_priority_that_is_no_list_of_axes_is_refused(text, words):
    """Unknown and repeated letters raise in one line."""
    with pytest.raises(InputError, match=words):
        parse_priority(text)


def test_axes_not_named_come_last():
    """A priority is completed by the axes left out."""
    assert parse_priority("zK, n") == ((2, 3), (5,), (0, 1, 4))

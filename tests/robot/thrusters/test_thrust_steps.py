"""Least thrust and steps of the command: what a thruster can hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters import ThrustSteps, library_curve
from wakewise.robot.thrusters.thrust_curve import nearest

T200 = library_curve("t200")
AT_16_V = ThrustSteps.of_curve(T200, 16.0)
AT_16_V.delivered_N(0.0)  # compiled before a test is timed


@pytest.mark.parametrize(("volts", "forward", "reverse"), [(10.0, 0.40, 0.31), (14.0, 0.44, 0.31), (16.0, 0.40, 0.36)])
def test_the_least_thrust_is_the_first_running_row_of_the_table(volts: float, forward: float, reverse: float) -> None:
    """At each voltage it is what the maker's own table begins with."""
    steps = ThrustSteps.of_curve(T200, volts)
    assert (steps.least_forward_N, steps.least_reverse_N) == pytest.approx((forward, reverse), abs=1e-12)


def test_between_two_voltages_the_least_thrust_lies_between() -> None:
    """15 V has the mean of 14 and 16 V, as the curve itself has."""
    assert ThrustSteps.of_curve(T200, 15.0).least_forward_N == pytest.approx(0.42, abs=1e-12)


def test_a_microsecond_is_a_twentieth_of_a_newton_near_the_least_thrust() -> None:
    """(2.41 - 0.40) N over the 33 us from 1532 to 1565 at 16 V."""
    forward = AT_16_V.levels_N[AT_16_V.levels_N > 0.0]
    assert np.diff(forward)[:10] == pytest.approx(np.full(10, 2.01 / 33), rel=1e-9)


@given(st.floats(-60.0, 60.0))
def test_what_is_delivered_is_none_or_a_pulse_of_whole_microseconds(desired: float) -> None:
    """None inside the gap; outside it a thrust of the curve at a whole pulse, no farther off than half a step."""
    given_N = float(AT_16_V.delivered_N(desired))
    if -0.36 + 1e-9 < desired < 0.40 - 1e-9:
        assert given_N == 0.0
        return
    pulse = float(T200.pwm_us(given_N, 16.0))
    assert pulse == pytest.approx(round(pulse), abs=1e-6)
    assert given_N * desired > 0.0
    low, high = T200.limits_N(16.0)
    slope = 0.30  # N per us, the steepest of the table at 16 V is 0.23
    assert abs(given_N - min(max(desired, low), high)) <= 0.5 * slope


def test_a_step_that_is_given_is_given_again() -> None:
    """Rounding twice is rounding once."""
    demands = np.linspace(-60.0, 60.0, 4001)
    once = AT_16_V.delivered_N(demands)
    assert np.array_equal(AT_16_V.delivered_N(once), once)


ONE_WAY = ThrustSteps(least_forward_N=0.4, least_reverse_N=0.3, levels_N=np.array([0.4, 0.9, 1.7]))
LEVELS = (AT_16_V, ONE_WAY, ThrustSteps(least_forward_N=0.4, least_reverse_N=0.3))


@pytest.mark.parametrize("steps", LEVELS)
@pytest.mark.parametrize("shape", [(), (8,), (2, 3, 4)])
def test_what_is_delivered_is_its_twin(steps: ThrustSteps, shape: tuple[int, ...]) -> None:
    """The compiled loop is the nearest running thrust outside the gap and none inside it, of any shape."""
    for seed in range(20):
        desired = np.random.default_rng(seed).normal(0.0, 2.0, shape).round(1)
        runs = (desired >= steps.least_forward_N - 1e-9) | (desired <= -steps.least_reverse_N + 1e-9)
        delivered = steps.delivered_N(desired)
        assert delivered.shape == shape
        assert np.array_equal(delivered, np.where(runs, steps.nearest_N(desired), 0.0))


def test_the_nearest_step_of_one_is_that_of_many() -> None:
    """Of demands within the levels and beyond, for thrusters that run both ways, one way, and by one step alone."""
    one_step = ThrustSteps(least_forward_N=0.5, least_reverse_N=0.5, levels_N=np.array([-0.6]))
    for steps in (*LEVELS, one_step):
        demands = np.concatenate([np.linspace(-70.0, 70.0, 1001), np.linspace(-1.0, 1.0, 401)])
        found = [nearest(float(w), steps.least_forward_N, steps.least_reverse_N, steps.levels) for w in demands]
        np.testing.assert_array_equal(found, steps.nearest_N(demands))


def test_without_levels_only_the_gap_is_left_out() -> None:
    """Beyond the least thrust every demand is met to the bit."""
    steps = ThrustSteps(least_forward_N=0.4, least_reverse_N=0.3)
    assert steps.delivered_N([-2.2, -0.3, -0.29, 0.0, 0.39, 0.4, 7.7]).tolist() == [-2.2, -0.3, 0, 0, 0, 0.4, 7.7]


def test_a_thruster_that_runs_one_way_is_never_reversed() -> None:
    """A demand for reverse gives nothing."""
    steps = ThrustSteps(least_forward_N=0.4, least_reverse_N=0.0, levels_N=np.array([0.4, 0.5, 0.6]))
    assert steps.delivered_N([-3.0, 0.52]).tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"least_forward_N": -0.1, "least_reverse_N": 0.0}, "least_forward_N: -0.1"),
        ({"least_forward_N": 0.0, "least_reverse_N": float("nan")}, "least_reverse_N: nan"),
        ({"least_forward_N": 0.4, "least_reverse_N": 0.3, "levels_N": np.array([0.2, 0.5])}, "levels_N"),
    ],
)
def test_steps_that_cannot_be_are_refused(wrong: dict, words: str) -> None:
    """One line names the field."""
    with pytest.raises(InputError, match=words):
        ThrustSteps(**wrong)

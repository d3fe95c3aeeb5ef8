"""Thrusts that no thruster can hold, sent as pulses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.control import vehicle_layout, with_pwm
from wakewise.control.pipeline import pipeline_of
from wakewise.control.thruster_pwm import ThrusterPwm, pulsed
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.thrusters import ThrustSteps, library_curve
from wakewise.robot.vehicles import load_vehicle

T200 = ThrustSteps.of_curve(library_curve("t200"), 16.0)
PLAIN = ThrustSteps(least_forward_N=0.4, least_reverse_N=0.3)
DT_S = 0.02
LEVEL = Pose(np.zeros(3))


def flown(demands_N, steps=T200, shortest_s=0.1, dt_s=DT_S):
    """Thrusts and what is owed, each shape (steps, n)."""
    demands = np.atleast_2d(np.asarray(demands_N, dtype=float).T).T
    n = demands.shape[1]
    direction, owing, thrusts, owed = np.zeros(n), np.zeros(n), [], []
    for row in demands:
        direction, owing, given_N = pulsed(direction, owing, row, dt_s, steps, np.full(n, shortest_s))
        thrusts.append(given_N)
        owed.append(owing)
    return np.array(thrusts), np.array(owed)


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=400), st.floats(0.0, 0.5))
@settings(max_examples=60, deadline=None)
def test_the_mean_of_the_pulses_is_the_demand(demands: list[float], shortest_s: float) -> None:
    """Whatever is desired, the impulse given stays within one pulse and one step of the impulse desired."""
    thrusts, owed = flown(demands, shortest_s=shortest_s)
    missing = DT_S * np.cumsum(np.array(demands) - thrusts[:, 0])
    assert owed[:, 0] == pytest.approx(missing, abs=1e-9)
    # Above the least thrust half a step of the command may be owed beside it, 0.12 N at 3 N.
    assert np.abs(missing).max() <= 0.40 * (max(shortest_s, DT_S) + DT_S) + 0.12 * max(shortest_s, DT_S)


@given(st.lists(st.floats(-60.0, 60.0), min_size=1, max_size=100))
@settings(max_examples=60, deadline=None)
def test_every_pulse_is_a_thrust_that_can_be_held(demands: list[float]) -> None:
    """None, or a step of the thruster: the plant gives it as it was sent."""
    thrusts, _ = flown(demands)
    assert np.array_equal(T200.delivered_N(thrusts), thrusts)


@pytest.mark.parametrize("demand", [0.05, 0.1, 0.2, 0.3, -0.05, -0.15, -0.25])
def test_pulses_and_pauses_last_as_the_law_says(demand: float) -> None:
    """L t / (L - w) and L t / w, to what a step at either end adds; neither is shorter than the shortest pulse."""
    thrusts, _ = flown(np.full(6000, demand), PLAIN, shortest_s=0.2)
    least = 0.4 if demand > 0 else 0.3
    assert set(np.unique(np.abs(thrusts))) == {0.0, least}
    turns = np.flatnonzero(np.diff(np.abs(thrusts[:, 0])) != 0.0)
    lengths = DT_S * np.diff(turns)
    first_is_pulse = thrusts[turns[0] + 1, 0] != 0.0
    pulses, pauses = (lengths[0::2], lengths[1::2]) if first_is_pulse else (lengths[1::2], lengths[0::2])
    assert pulses.mean() == pytest.approx(least * 0.2 / (least - abs(demand)), rel=0.1)
    assert pauses.mean() == pytest.approx(least * 0.2 / abs(demand), rel=0.1)
    assert min(pulses.min(), pauses.min()) >= 0.2 - 1e-9


def test_a_thrust_that_can_be_held_is_held() -> None:
    """A step of the thruster goes through untouched, from the first instant on."""
    step = float(T200.nearest_N(2.5))
    thrusts, owed = flown(np.full(50, step))
    assert np.array_equal(thrusts, np.full((50, 1), step))
    assert np.array_equal(owed, np.zeros((50, 1)))


def test_a_thruster_that_is_not_wanted_rests() -> None:
    """No demand, no pulse."""
    thrusts, _ = flown(np.zeros((100, 3)))
    assert not thrusts.any()


def test_a_thruster_never_runs_against_a_demand_that_can_be_held() -> None:
    """Debts from before do not turn it."""
    thrusts, _ = flown([-0.25] * 40 + [0.5] * 40, PLAIN, shortest_s=0.5)
    assert np.all(thrusts[40:] > 0.0)


class Asking:
    """A controller that wants the same small thrusts at each step."""

    name = "asking"

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        return state + 1, Command(thrusts_N=np.linspace(-0.3, 0.35, 8), wrench_B=np.zeros(6), fallback="as ever")


def test_any_controller_flies_in_pulses_and_keeps_its_words() -> None:
    """Name, fallback and its own state go through; thrusts become steps of the vehicle's thrusters."""
    vehicle = load_vehicle("paper")
    controller = with_pwm(pipeline_of(Asking(), vehicle_layout(vehicle)), vehicle)
    state, given_N = controller.init(), []
    for _ in range(2000):
        state, command = controller.step(state, DT_S, BodyState(X_WB=LEVEL), Goal(X_WB=LEVEL))
        given_N.append(command.thrusts_N)
    assert (controller.name, command.fallback, state.plugin) == ("asking", "as ever", 2000)
    assert set(np.unique(given_N)) <= {-0.36, 0.0, 0.40}
    assert np.mean(given_N, axis=0) == pytest.approx(np.linspace(-0.3, 0.35, 8), abs=0.003)


def test_where_thrust_is_continuous_the_controller_is_left_alone() -> None:
    """No stage, no change."""
    ideal = load_vehicle("paper").with_ideal_thrusters()
    assert with_pwm(pipeline_of(Asking(), vehicle_layout(ideal)), ideal).pwm is None


def test_a_pulse_lasts_a_lag_unless_told_otherwise() -> None:
    """The lag of each thruster is its shortest pulse."""
    vehicle = load_vehicle("bluerov2-heavy")
    assert ThrusterPwm.of(vehicle).shortest_s == pytest.approx(np.full(8, 0.0287))
    assert ThrusterPwm.of(vehicle, 0.3).shortest_s == pytest.approx(np.full(8, 0.3))


def pulsed_twin(before, owed, desired_N, dt_s, steps, shortest_s):
    """`pulsed` as whole arrays."""
    span_s = np.maximum(shortest_s, dt_s)
    forward_N, reverse_N = steps.least_forward_N, steps.least_reverse_N
    holdable = np.where(desired_N >= forward_N, 1.0, np.where(desired_N <= -reverse_N, -1.0, 0.0))
    starts = np.where(owed >= forward_N * span_s, 1.0, np.where(owed <= -reverse_N * span_s, -1.0, 0.0))
    goes_on = np.where(before * owed > 0.0, before, starts)
    running = np.where(holdable != 0.0, holdable, goes_on)
    least, demand = np.where(running > 0.0, forward_N, -reverse_N), desired_N + owed / span_s
    level = steps.nearest_N(np.where(demand * running > 0.0, demand, least))
    thrusts = np.where(holdable != 0.0, level, np.where(running != 0.0, least, 0.0))
    return running, owed + (desired_N - thrusts) * dt_s, thrusts


@pytest.mark.parametrize("steps", [T200, PLAIN], ids=["steps", "any"])
def test_pulses_are_those_of_the_rule_as_whole_arrays(steps) -> None:
    """Over a thousand steps of demands below the least thrusts and above, either way: the same to the last digits."""
    rng, direction, owed = np.random.default_rng(8), np.zeros(8), np.zeros(8)
    shortest_s = np.array([0.0, 0.01, 0.05, 0.1, 0.1, 0.2, 0.3, 0.5])
    for _ in range(1000):
        demands = rng.normal(size=8) * rng.choice([0.1, 0.4, 5.0])
        wanted = pulsed_twin(direction, owed, demands, DT_S, steps, shortest_s)
        direction, owed, thrusts = pulsed(direction, owed, demands, DT_S, steps, shortest_s)
        for found, want in zip((direction, owed, thrusts), wanted, strict=True):
            np.testing.assert_allclose(found, want, rtol=1e-12, atol=1e-15)

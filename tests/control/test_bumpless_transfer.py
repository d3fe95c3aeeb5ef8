"""Two methods under one switch: each flies as it does alone, and no switch is felt."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from wakewise.allocation import compile_layout
from wakewise.control import make_controller, vehicle_layout
from wakewise.control.bumpless_transfer import FADE_S, switched, transferred
from wakewise.control.pipeline import pipeline_of
from wakewise.core.geometry import Pose, look_at
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import find_target, sample_region
from wakewise.wake import wake_model

LAYOUT = compile_layout(np.eye(6, 6), np.full(6, -50.0), np.full(6, 50.0))


@dataclass
class Constant:
    """Always the same thrust; counts its steps in its state."""

    name: str
    thrust_N: float

    def init(self):
        return 0

    def step(self, state, dt_s, estimate, goal):
        thrusts = np.full(6, self.thrust_N)
        return state + 1, Command(thrusts_N=thrusts, wrench_B=thrusts)


def flown(methods, wanted, steps, layout=LAYOUT, estimate=None, goal=None):
    now = [""]
    pipelines = {name: pipeline_of(method, layout) for name, method in methods.items()}
    controller = switched("both", pipelines, lambda: now[0], layout)
    now[0] = wanted(0)
    state, sent = controller.init(), []
    for k in range(steps):
        now[0] = wanted(k)
        state, command = controller.step(state, 0.02, estimate or BodyState(X_WB=Pose(np.zeros(3))), goal)
        sent.append(command)
    return state, sent


def test_thrusts_go_over_without_a_step():
    """The first thrusts after a switch are the last before it; the difference fades with its time constant."""
    methods = {"low": Constant("low", 1.0), "high": Constant("high", 11.0)}
    state, sent = flown(methods, lambda k: "low" if k < 5 else "high", 60)
    thrusts = np.array([command.thrusts_N[0] for command in sent])
    assert np.all(thrusts[:6] == 1.0) and np.abs(np.diff(thrusts)).max() < 10.0 * 0.02 / FADE_S
    assert thrusts[5 + 25] == pytest.approx(11.0 - 10.0 * np.exp(-1.0), rel=1e-6)
    assert all(np.array_equal(command.thrusts_N, command.wrench_B) for command in sent)
    assert state.method == "high" and state.plugin == 55


def test_a_name_that_is_none_flies_the_first_method():
    """What the switch gives is no reason to fail."""
    state, _ = flown({"one": Constant("one", 1.0), "two": Constant("two", 2.0)}, lambda k: "three", 2)
    assert state.method == "one"


def test_limits_hold_while_a_difference_fades():
    """Thrusts stay within the thrusters' limits."""
    methods = {"low": Constant("low", -50.0), "high": Constant("high", 50.0)}
    _, sent = flown(methods, lambda k: "low" if (k // 7) % 2 else "high", 60)
    assert np.abs([command.thrusts_N for command in sent]).max() <= 50.0


@pytest.fixture(scope="module")
def pair():
    vehicle = load_vehicle("paper")
    coral = find_target("soft-coral", 1.5, 1)
    region = sample_region(coral, 60, np.random.default_rng(1))
    wake = wake_model("paper")
    return vehicle, {
        name: make_controller(method, vehicle, region, wake)
        for name, method in (("wake-aware", "wake-aware"), ("direct", "dp"))
    }


def test_what_one_method_learned_the_other_goes_on_with(pair):
    """The PID's integral and last thrusts survive the way there and back, and so does what the failsafe remembers."""
    _, methods = pair
    gentle, direct = methods["wake-aware"], methods["direct"]
    state = direct.init()
    goal = Goal(X_WB=Pose(np.array([1.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0])))
    for _ in range(50):
        state, command = direct.step(state, 0.02, BodyState(X_WB=Pose(goal.X_WB.p_m + 0.05, goal.X_WB.q)), goal)
    assert np.linalg.norm(state.pid.force_W_N) > 0.5
    there = transferred(replace(state, sent_N=np.ones(8), failed_s=0.3), gentle)
    back = transferred(there, direct)
    for after in (there, back):
        np.testing.assert_array_equal(after.pid.force_W_N, state.pid.force_W_N)
        np.testing.assert_array_equal(after.pid.goal_nu, goal.nu_B)
        np.testing.assert_array_equal(after.thrusts_N, command.thrusts_N)
        np.testing.assert_array_equal(after.sent_N, np.ones(8))
        assert after.failed_s == 0.3


def test_the_wrench_does_not_jump_when_methods_change(pair):
    """Loaded by 5 N and five centimetres off its goal, switched every 0.4 s: no step of the wrench above a newton."""
    vehicle, methods = pair
    place = np.array([-0.7, 0.0, 1.1])
    goal = Goal(X_WB=Pose.from_matrix(look_at(place, np.array([0.0, 0.0, 1.3])), place))
    body = BodyState(
        X_WB=Pose(place + np.array([0.03, 0.0, 0.04]), goal.X_WB.q), load_B=np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    )
    layout = vehicle_layout(vehicle)
    _, sent = flown(methods, lambda k: ("direct", "wake-aware")[(k // 20) % 2], 140, layout, body, goal)
    wrenches = np.array([layout.B @ command.thrusts_N for command in sent])
    steps = np.abs(np.diff(wrenches, axis=0))[19:]
    at = np.arange(19, 19 + len(steps))
    switching = (at + 1) % 20 == 0
    assert steps[switching, :3].max() < 1.0 and steps[switching, 3:].max() < 0.3

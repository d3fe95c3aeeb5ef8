"""The failsafe of a control step: each kind of trouble leaves thrusts that can be flown, in time, and is told."""

import time

import numpy as np
import pytest

from wakewise.control import ControlSettings, with_failsafe
from wakewise.control.failsafe import RESTART_S
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import load_vehicle

pytestmark = pytest.mark.usefixtures("fallbacks_fly")

VEHICLE = load_vehicle("paper")
SETTINGS = ControlSettings()
HERE = BodyState(X_WB=Pose(np.zeros(3)), load_B=np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
GOAL = Goal(X_WB=Pose(np.array([0.02, 0.0, 0.0])))
GOOD = np.full(8, 0.5)


class Troubled:
    """Answers well, but for the steps on which `trouble` does something else; its state counts its steps."""

    name = "troubled"

    def __init__(self, trouble, on=(2,)):
        self.trouble, self.on, self.begun = trouble, on, 0

    def init(self):
        self.begun += 1
        return 0

    def step(self, state, dt_s, estimate, goal):
        if state in self.on:
            answer = self.trouble()
            if answer is not None:
                return state + 1, answer
        return state + 1, Command(thrusts_N=GOOD, wrench_B=VEHICLE.allocation_matrix @ GOOD)


def raises():
    raise ZeroDivisionError("a corner that nobody saw")


def not_finite():
    command = Command(thrusts_N=GOOD, wrench_B=np.zeros(6))
    object.__setattr__(command, "thrusts_N", np.full(8, np.nan))
    return command


def too_much():
    return Command(thrusts_N=np.full(8, 400.0), wrench_B=np.zeros(6))


def too_few():
    return Command(thrusts_N=np.ones(3), wrench_B=np.zeros(6))


def flights(trouble, steps=6, estimate=HERE, on=(2,), inner=None, **options):
    inner = Troubled(trouble, on) if inner is None else inner
    guard = with_failsafe(inner, VEHICLE, SETTINGS, **options)
    state, commands = guard.init(), []
    for _ in range(steps):
        state, command = guard.step(state, 0.02, estimate, GOAL)
        commands.append(command)
    return guard.failsafe.incidents.counts, commands


@pytest.mark.parametrize(
    ("trouble", "kind", "words"),
    [
        (raises, "failed", "ZeroDivisionError: a corner"),
        (lambda: Command(thrusts_N=np.full(8, np.nan), wrench_B=np.zeros(6)), "failed", "NaN"),
        (not_finite, "failed", "NaN"),
        (too_much, "limits", "349.0 N beyond their limits"),
        (too_few, "failed", "must answer a Command of 8 thrusts"),
        (lambda: "push", "failed", "must answer a Command"),
    ],
)
def test_whatever_is_answered_thrusts_that_can_be_flown_go_out(trouble, kind, words):
    """The least thrusts of the PID's wrench are sent, the command says why, the kind is counted."""
    state_trouble = (2, 3) if trouble is raises else (2,)
    counts, commands = flights(trouble, on=state_trouble)
    bad = commands[2]
    assert words in bad.fallback and "least thrusts" in bad.fallback and counts[kind] >= 1
    np.testing.assert_allclose(VEHICLE.allocation_matrix @ bad.thrusts_N, bad.wrench_B, atol=1e-9)
    assert bad.wrench_B[2] < -1.0 and bad.wrench_B[0] > 0.5
    assert commands[1].fallback is None and np.array_equal(commands[1].thrusts_N, GOOD)


def test_it_goes_on_after_a_trouble_that_passes():
    """One bad answer costs one step: the next is the method's own, and no second trouble is counted."""
    counts, commands = flights(too_much)
    assert [c.fallback is None for c in commands] == [True, True, False, True, True, True]
    assert counts == {"limits": 1}


def test_a_method_that_fails_on_its_own_memory_begins_anew():
    """After a second without an answer it is given a first state again, and answers."""
    steps = round(RESTART_S / 0.02)
    inner = Troubled(raises)
    counts, commands = flights(raises, steps=steps + 4, inner=inner)
    assert inner.begun == 2 and counts["restarted"] == 1 and counts["failed"] == steps
    assert commands[steps + 1].fallback is not None and commands[steps + 2].fallback is None


def test_without_an_estimate_the_last_thrusts_fade():
    """Where the PID cannot say a wrench either, the thrusts that were sent last are held, less each step."""
    inner = Troubled(raises, on=range(1, 100))
    guard = with_failsafe(inner, VEHICLE, SETTINGS)
    lost = BodyState(X_WB=Pose(np.zeros(3)))
    object.__setattr__(lost, "nu_B", np.full(6, np.nan))
    state, _ = guard.step(guard.init(), 0.02, HERE, GOAL)
    for k in range(1, 4):
        state, command = guard.step(state, 0.02, lost, GOAL)
        np.testing.assert_allclose(command.thrusts_N, GOOD * np.exp(-0.02 * k / 0.5))
        assert "holding the last thrusts, fading" in command.fallback
    assert guard.failsafe.incidents.counts["held"] == 3


def test_where_the_world_waits_a_late_answer_is_counted_and_flown(caplog):
    """The same seed must give the same flight on a busy machine: the command is untouched, only the count tells."""
    clock = iter(np.arange(0.0, 100.0, 0.03))
    counts, commands = flights(lambda: None, steps=4)
    assert counts == {}
    slow = with_failsafe(Troubled(lambda: None), VEHICLE, SETTINGS)
    slow.failsafe.clock = lambda: float(next(clock))
    caplog.set_level("DEBUG", logger="wakewise")
    state = slow.init()
    for command in commands:
        state, late = slow.step(state, 0.02, HERE, GOAL)
        assert np.array_equal(late.thrusts_N, command.thrusts_N) and late.fallback is None
    assert slow.failsafe.incidents.counts == {"late": 3}
    assert [record.levelname for record in caplog.records if "late" in record.message] == ["INFO", "DEBUG", "DEBUG"]


def test_where_it_does_not_wait_the_deadline_holds_by_the_wall_clock():
    """Nobody waits for a method that sleeps for three periods: least thrusts go out in time, then it is asked again."""
    inner = Troubled(lambda: time.sleep(0.3), on=(2,))
    guard = with_failsafe(inner, VEHICLE, SETTINGS, enforce=True)
    state, commands, spans = guard.init(), [], []
    for _ in range(8):
        began = time.perf_counter()
        state, command = guard.step(state, 0.1, HERE, GOAL)
        spans.append(time.perf_counter() - began)
        commands.append(command)
        time.sleep(max(0.1 - spans[-1], 0.0))
    late = [k for k, c in enumerate(commands) if c.fallback is not None]
    assert late[0] == 2 and 2 <= len(late) <= 4 and guard.failsafe.incidents.counts["late"] == len(late)
    assert all("late" in commands[k].fallback and "least thrusts" in commands[k].fallback for k in late)
    assert max(spans) < 0.15
    assert commands[-1].fallback is None and state.plugin == 8 - len(late) + 1

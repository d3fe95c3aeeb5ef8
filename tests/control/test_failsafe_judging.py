"""What the failsafe of a control step judges and remembers: both limits, when a failure ends, and saturation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wakewise.control import ControlSettings, Pipeline, with_failsafe
from wakewise.control.failsafe import RESTART_S
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import load_vehicle

VEHICLE = load_vehicle("paper")
HERE = BodyState(X_WB=Pose(np.zeros(3)))
DT_S = 0.02
LOWER = np.array([-thruster.max_reverse_N for thruster in VEHICLE.thrusters])
UPPER = np.array([thruster.max_forward_N for thruster in VEHICLE.thrusters])


class Scripted:
    """A method that answers given thrusts step by step, again from the first; counts how often it began."""

    name = "scripted"

    def __init__(self, *thrusts_N: np.ndarray) -> None:
        self.thrusts_N, self.begun = thrusts_N, 0

    def init(self) -> int:
        self.begun += 1
        return 0

    def step(self, state: int, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[int, Command]:
        return state + 1, Command(thrusts_N=self.thrusts_N[state % len(self.thrusts_N)], wrench_B=np.zeros(6))


def flown(guard: Pipeline, steps: int, ahead_m: float = 0.0) -> list[Command]:
    state, commands, goal = guard.init(), [], Goal(X_WB=Pose(np.array([ahead_m, 0.0, 0.0])))
    for _ in range(steps):
        state, command = guard.step(state, DT_S, HERE, goal)
        commands.append(command)
    return commands


@pytest.mark.parametrize("thruster", range(len(VEHICLE.thrusters)))
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_thrust_beyond_either_limit_of_any_thruster_is_not_flown(thruster: int, side: str) -> None:
    """At the limit it is; a newton beyond, forward or reverse, the least thrusts go out and the overshoot is said."""
    at = np.zeros(len(LOWER))
    at[thruster] = LOWER[thruster] if side == "lower" else UPPER[thruster]
    beyond = at + np.sign(at)
    guard = with_failsafe(Scripted(at, beyond), VEHICLE, ControlSettings())
    within, out = flown(guard, 2)
    assert within.fallback is None
    np.testing.assert_array_equal(within.thrusts_N, at)
    assert out.fallback is not None
    assert "1.0 N beyond their limits" in out.fallback
    assert (out.thrusts_N >= LOWER - 1e-6).all()
    assert (out.thrusts_N <= UPPER + 1e-6).all()
    assert guard.failsafe.incidents.counts == {"limits": 1}


def test_a_good_answer_ends_a_failure() -> None:
    """Only a second of trouble without a break begins the method anew: twice nine tenths of it does not."""
    bad, good = np.full(len(LOWER), 400.0), np.zeros(len(LOWER))
    steps = round(0.9 * RESTART_S / DT_S)
    inner = Scripted(*[bad] * steps, good)
    guard = with_failsafe(inner, VEHICLE, ControlSettings())
    flown(guard, 4 * (steps + 1))
    assert guard.failsafe.incidents.counts == {"limits": 4 * steps}
    assert inner.begun == 1


@pytest.mark.parametrize(("ahead_m", "saturates"), [(0.001, False), (50.0, True)])
def test_the_pid_is_told_that_its_wrench_was_not_made(ahead_m: float, saturates: bool) -> None:
    """Of the step before: else its integral winds up while the thrusters give all they have."""
    bad = np.full(len(LOWER), 400.0)
    guard = with_failsafe(Scripted(bad), VEHICLE, ControlSettings())
    told: list[bool] = []
    failsafe = guard.failsafe
    assert failsafe is not None
    pid = failsafe.pid
    plain = pid.wrench

    class Listening:
        init = pid.init

        def wrench(self, *args: Any, saturated: bool, **kwargs: Any) -> Any:
            told.append(saturated)
            state, wrench = plain(*args, saturated=saturated, **kwargs)
            return state, wrench if not saturates else 1e3 * np.eye(6)[0] + 0.0 * wrench

    listening: Any = Listening()
    heard = replace(guard, failsafe=replace(failsafe, pid=listening))
    flown(heard, 4, ahead_m)
    assert told == [False, saturates, saturates, saturates]

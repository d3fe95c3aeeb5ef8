"""Strict guards: a mistake of the program ends a simulated flight, what is foreseen is flown around as ever."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wakewise.control import ControlSettings, with_failsafe
from wakewise.control.failsafe import PlanFailsafe
from wakewise.core.errors import STRICT, InputError, is_strict
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal
from wakewise.robot.vehicles import load_vehicle

VEHICLE = load_vehicle("paper")
HERE = BodyState(X_WB=Pose(np.zeros(3)))
GOAL = Goal(X_WB=Pose(np.zeros(3)))


class Method:
    """Answers what it is told to answer, or raises it."""

    name = "method"

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def init(self) -> None:
        return None

    def step(self, *_: Any) -> tuple[None, Any]:
        if isinstance(self.answer, Exception):
            raise self.answer
        return None, self.answer


class Asked:
    """A planner that raises what it is told."""

    def __init__(self, fault: Exception) -> None:
        self.fault = fault

    model = SimpleNamespace(settings=SimpleNamespace(stage_s=0.1))

    def plan(self, *_: Any, **__: Any) -> None:
        raise self.fault

    def holding(self, _: Any) -> None:
        return None


def stepped(answer: Any, **options: Any) -> Command:
    guard = with_failsafe(Method(answer), VEHICLE, ControlSettings(), **options)
    return guard.step(guard.init(), 0.02, HERE, GOAL)[1]


def planned(fault: Exception, **options: Any) -> str | None:
    planner: Any = Asked(fault)
    problem: Any = None
    return PlanFailsafe(planner=planner, deadline_s=1.0, **options).ask(lambda: problem, None, 0.0).trouble


def flown(fault: Exception, strict: bool) -> Command:
    return stepped(fault, strict=strict, foreign=True)


@pytest.mark.parametrize("work", [stepped, planned, flown])
def test_a_mistake_of_the_program_is_raised_where_guards_are_strict_and_flown_around_where_not(
    work: Callable[..., Any],
) -> None:
    """Of a method, of a planner, of a controller from outside."""
    mistake = IndexError("a corner that nobody saw")
    options = {"enforce": False} if work is planned else {}
    with pytest.raises(IndexError, match="nobody saw"):
        work(mistake, **options, strict=True)
    told = work(mistake, **options, strict=False)
    assert "IndexError: a corner" in str(told if work is planned else told.fallback)


@pytest.mark.parametrize("work", [stepped, planned, flown])
def test_what_is_foreseen_is_flown_around_by_strict_guards_too(work: Callable[..., Any]) -> None:
    """An error of Wakewise says that a question cannot be answered, as a lost estimate."""
    told = work(InputError("no estimate"), **({"enforce": False} if work is planned else {}), strict=True)
    assert "no estimate" in str(told if work is planned else told.fallback)


@pytest.mark.parametrize("answer", ["push", Command(thrusts_N=np.ones(3), wrench_B=np.zeros(6))])
def test_an_answer_of_the_wrong_kind_is_a_mistake(answer: Any) -> None:
    """Thrusts beyond their limits are none: they are flown around."""
    with pytest.raises(TypeError, match="must answer a Command of 8 thrusts"):
        stepped(answer, strict=True)
    assert stepped(Command(thrusts_N=np.full(8, 400.0), wrench_B=np.zeros(6)), strict=True).fallback


def test_a_vehicle_in_the_water_keeps_its_thrusts_whatever_is_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The variable is for simulated worlds, which wait; where the deadline is enforced it is not heeded."""
    planner: Any = Asked(KeyError())
    for value, desired in (("1", True), ("0", False), ("", False)):
        monkeypatch.setenv(STRICT, value)
        assert is_strict() is desired
        assert with_failsafe(Method(None), VEHICLE, ControlSettings()).failsafe.strict is desired
        assert with_failsafe(Method(None), VEHICLE, ControlSettings(), enforce=True).failsafe.strict is False
        assert PlanFailsafe(planner=planner, deadline_s=1.0).strict is False
    monkeypatch.setenv(STRICT, "1")
    assert "IndexError" in str(stepped(IndexError("x"), enforce=True).fallback)


def test_tests_are_strict() -> None:
    """Unless one says otherwise."""
    assert is_strict()

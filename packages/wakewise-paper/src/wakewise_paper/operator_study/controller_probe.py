"""Listens to a controller: what the plan within it expects now, however deep it lies."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from wakewise.control import PlanningController
from wakewise.control.receding import PlanState
from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat
from wakewise.core.interfaces import BodyState, Command, Controller, Goal

T = TypeVar("T")
DEEPEST = 6


@dataclass(eq=False)
class ControllerProbe:
    """A controller, and what was asked of it and what its plan expects at the last step; implements `Controller`.

    `asked_W_m_s`, shape (3,); `planned_W_m_s`, shape (3,), None where nothing is planned.
    """

    inner: Controller[Any]
    asked_W_m_s: Array | None = None
    planned_W_m_s: Array | None = None

    @property
    def name(self) -> str:
        """Name of the controller within."""
        return self.inner.name

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide, and remember what was asked and what the plan expects by then."""
        state, command = self.inner.step(state, dt_s, estimate, goal)
        self.asked_W_m_s = goal.X_WB.R @ goal.nu_B[:3]
        planner, plan = find_record(self.inner, PlanningController), find_record(state, PlanState)
        expected = None if planner is None or plan is None else planner.expected(plan)
        self.planned_W_m_s = None if expected is None else matrix_from_quat(expected[3:7]) @ expected[7:10]
        return state, command


def find_record(record: Any, kind: type[T], deep: int = DEEPEST) -> T | None:
    """The record itself or the first of that kind in its fields, in those of its fields, and so on; None if none is."""
    if isinstance(record, kind):
        return record
    if deep == 0 or not is_dataclass(record):
        return None
    for one in fields(record):
        value = getattr(record, one.name, None)
        if is_dataclass(value) and not isinstance(value, np.ndarray):
            found = find_record(value, kind, deep - 1)
            if found is not None:
                return found
    return None

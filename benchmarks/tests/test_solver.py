"""Violations of a plan: commands beyond limits and places too near, of plans made up for the purpose."""

from types import SimpleNamespace

import numpy as np
import pytest

from wakewise.core.geometry import quat_from_euler
from wakewise_benchmarks.solver import beyond, clearance_m, touching

TABLE = SimpleNamespace(
    lower=np.full(2, -40.0),
    upper=np.full(2, 51.0),
    half_size=np.array([0.2, 0.1, 0.1]),
    planes=np.array([[0.0, 0.0, -1.0, -1.5]]),
    spheres=np.array([[0.0, 0.0, 1.4, 0.1]]),
)
MODEL = SimpleNamespace(table=TABLE)


def _state(x, y, z, yaw=0.0):
    return np.concatenate([[x, y, z], quat_from_euler(0.0, 0.0, yaw), np.zeros(6)])


def test_commands_beyond_a_limit_are_counted_one_by_one():
    """At the limit is within it, to rounding."""
    commands = np.array([[51.0, -40.0], [51.0 + 1e-9, -41.0], [60.0, 0.0]])
    assert beyond(commands, MODEL) == 2


def test_clearance_is_of_the_turned_box():
    """To the floor below and the ball beside it, along and across the hull."""
    assert clearance_m(_state(2.0, 0.0, 1.0), MODEL) == pytest.approx(0.4)
    level = clearance_m(_state(0.5, 0.0, 1.39), MODEL)
    assert level == pytest.approx(min(1.5 - 1.39 - 0.1, 0.5 - 0.2 - 0.1))
    across = clearance_m(_state(0.5, 0.0, 1.2, np.pi / 2), MODEL)
    assert across == pytest.approx(min(0.2, np.hypot(0.4, 0.1) - 0.1))


def test_stages_that_touch_are_counted_but_for_where_the_plan_begins():
    """The state of now is no plan."""
    states = np.array([_state(0.0, 0.0, 1.4), _state(0.0, 0.0, 1.3), _state(2.0, 0.0, 1.0)])
    assert touching(states, MODEL) == 1

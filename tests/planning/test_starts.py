"""Where a plan begins."""

import numpy as np
from plan_cases import VEHICLE, model, problem

from wakewise.geometry import matrix_from_quat
from wakewise.planning.planner import Planner
from wakewise.planning.starts import shifted

START = np.zeros((20, 8))


def test_shifting_drops_stages_and_holds_the_last():
    """Two stages on, the third command comes first and the last is repeated."""
    plan = Planner(model(iterations=1)).plan(problem(), START)
    moved = shifted(plan, 2)
    np.testing.assert_array_equal(moved[:18], plan.commands_N[2:])
    np.testing.assert_array_equal(moved[18:], plan.commands_N[[-1, -1]])


def test_thrusts_that_hold_carry_the_load():
    """3 N heavy: the same in every stage, and their wrench is the load's, turned into the body, with the other sign."""
    case = problem(weight_N=3.0)
    held = Planner(model()).holding(case)
    assert held.shape == START.shape and (held == held[0]).all()
    force_B = matrix_from_quat(case.state[3:7]).T @ case.force_W_N
    wanted = -np.concatenate([force_B, case.moment_B_Nm])
    np.testing.assert_allclose(VEHICLE.allocation_matrix @ held[0], wanted, atol=1e-9)

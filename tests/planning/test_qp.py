"""The planner's quadratic problem: where it starts from the next time, and what it says where no solver answers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import daqp
import numpy as np
import pytest
from plan_cases import REGION, VEHICLE, model, problem

from wakewise.control.failsafe import PlanFailsafe
from wakewise.core.errors import InputError
from wakewise.planning import check_start
from wakewise.planning import qp as qp_module
from wakewise.planning.obstacles import Surroundings
from wakewise.planning.planner import Planner
from wakewise.planning.problem import Horizon
from wakewise.planning.qp import BoxQP

SIZE = 24


def posed(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """H, g, bounds that about half of the unknowns meet, and steps that open no hinge."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(SIZE, SIZE))
    H = A @ A.T + SIZE * np.eye(SIZE)
    g = 60.0 * rng.normal(size=SIZE)
    free = np.linalg.solve(H, -g)
    reach = np.quantile(np.abs(free), 0.5)
    return H, g, np.full(SIZE, -reach), np.full(SIZE, 1.5 * reach), np.zeros(SIZE)


@pytest.mark.parametrize("seed", range(3))
def test_the_active_set_of_a_problem_starts_the_next_one(seed: int) -> None:
    """DAQP needs fewer steps from it than from nothing, since it says which bound of which unknown is met."""
    H, g, low, high, steps = posed(seed)
    solver = BoxQP(SIZE, 2, 1e9, 1.0)
    answer = solver.solve(H, g, low, high, steps)
    assert answer.solved
    assert answer.solver == "daqp"
    at_low, at_high = np.isclose(answer.z, low), np.isclose(answer.z, high)
    assert at_low.any()
    assert at_high.any()
    rows = np.zeros((0, SIZE))

    def steps_from(sense: np.ndarray) -> int:
        z, _, flag, info = daqp.solve(H, g, rows, high, low, sense.copy())
        assert flag > 0
        np.testing.assert_allclose(z, answer.z, atol=1e-7)
        return int(info["iterations"])

    assert steps_from(solver._sense) < steps_from(np.zeros(SIZE, dtype=np.int32))
    np.testing.assert_array_equal(solver._sense == 3, at_low)
    np.testing.assert_array_equal(solver._sense == 1, at_high)


def test_where_no_solver_answers_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interior point that did not come to its end is no solution, though there are numbers."""
    monkeypatch.setattr(qp_module, "MANY_ACTIVE", -1)
    monkeypatch.setattr(qp_module.piqp, "PIQP_SOLVED", object())
    answer = BoxQP(SIZE, 2, 1e9, 1.0).solve(*posed(0))
    assert (answer.solver, answer.solved) == ("piqp", False)
    assert not answer.z.any()


@pytest.mark.parametrize(("side", "breaks"), [("lower", True), ("upper", True), ("lower", False), ("upper", False)])
def test_a_plan_beyond_either_limit_is_not_flown(side: str, breaks: bool) -> None:
    """At a thruster's limit it is; beyond, forward or reverse, it is counted as breaking limits."""

    class Bold(Planner):
        def plan(self, *args: Any, **how: Any) -> Horizon:
            plan = super().plan(*args, **how)
            commands = np.array(plan.commands_N)
            limit = getattr(self.model.table, side)[0]
            commands[1, 0] = limit * (1.01 if breaks else 1.0)
            return replace(plan, commands_N=commands)

    failsafe = PlanFailsafe(planner=Bold(model(iterations=1)), deadline_s=1e9)
    found = failsafe.ask(problem, None, 0.0)
    assert (found.plan is None) == breaks
    assert failsafe.incidents.counts == ({"limits": 1} if breaks else {})


def test_a_start_nearer_to_something_than_the_clearance_is_refused() -> None:
    """Not only one that touches: the same place is a start where less is asked for."""
    state = np.zeros(13)
    state[2], state[3] = 1.0, 1.0
    lowest = 1.0 + 0.5 * VEHICLE.size_m[2]
    around = Surroundings(planes=((0.0, 0.0, -1.0, -(lowest + 0.10)),))
    check_start(VEHICLE, REGION, state, around, clearance_m=0.05)
    with pytest.raises(InputError, match=r"comes within 0\.\d+ m of plane 1, allowed is 0\.15 m"):
        check_start(VEHICLE, REGION, state, around, clearance_m=0.15)

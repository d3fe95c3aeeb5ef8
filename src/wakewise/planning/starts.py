"""Where the search for a plan begins: at the plan before, moved on, or at thrusts that hold the vehicle."""

from __future__ import annotations

import numpy as np

from wakewise.allocation.allocate import Layout
from wakewise.arrays import Array
from wakewise.planning.kernels import PlanTable
from wakewise.planning.problem import Horizon, PlanProblem


def shifted(plan: Horizon, stages: int) -> Array:
    """Commands of a plan, moved on by whole stages; the last one is held."""
    by = min(max(stages, 0), len(plan.commands_N))
    return np.vstack([plan.commands_N[by:], np.repeat(plan.commands_N[-1:], by, axis=0)])


def holding_commands(layout: Layout, table: PlanTable, problem: PlanProblem, stages: int) -> Array:
    """Least thrusts that carry the load where the vehicle is, in every stage, shape (N, n)."""
    q = problem.state[3:7]
    t = 2.0 * np.cross(-q[1:], problem.force_W_N)
    force_B = problem.force_W_N + q[0] * t + np.cross(-q[1:], t)
    wanted = -np.concatenate([force_B, problem.moment_B_Nm])
    return np.tile(np.clip(layout.inverse @ wanted, table.lower, table.upper), (stages, 1))

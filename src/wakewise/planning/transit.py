"""How long a transit should take: where nobody asks for a duration, the planner chooses it.

With a fixed horizon w_time T is a constant. On a leg between two places it is not: the leg's duration is the one
unknown of a search along a line, each of whose values is the whole problem (disturbance, effort, clearance, arrival)
planned over that duration. Only the end is tracked, so that the way there is free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.interfaces import BodyState, Goal, WakeModel
from wakewise.planning.planner import Planner, compile_plan, holding_thrusts
from wakewise.planning.problem import Horizon, PlanProblem, PlanSettings, state_of
from wakewise.planning.surroundings import Surroundings
from wakewise.targets import Region
from wakewise.vehicles import Vehicle

LONGEST_STAGE_S = 0.2
"""Runge-Kutta steps of a small vehicle under way are stable and accurate up to here."""
MOST_STAGES = 60


@dataclass(frozen=True, eq=False)
class Transit:
    """A leg: its duration in s, its cost with w_time T, and the plan that flies it."""

    duration_s: float
    cost: float
    plan: Horizon


def plan_transit(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: PlanSettings,
    start: BodyState,
    goal: Goal,
    surroundings: Surroundings | None = None,
    *,
    bounds_s: tuple[float, float] = (1.0, 12.0),
    search_s: float = 0.1,
) -> Transit:
    """Leg from `start` to `goal` of least cost, its duration within `bounds_s` found to `search_s`.

    Raises
    ------
    InputError
        If the bounds are not 0 < least < most <= 12 s, or as `compile_plan`.
    """
    least, most = bounds_s
    if not 0.0 < least < most <= LONGEST_STAGE_S * MOST_STAGES:
        raise InputError(
            f"transit: durations {least:g} to {most:g} s, allowed 0 < least < most <= {LONGEST_STAGE_S * MOST_STAGES:g}"
        )
    found: dict[float, Transit] = {}

    def cost(duration_s: float) -> float:
        leg = _leg(vehicle, region, wake, settings, start, goal, surroundings, duration_s)
        found[duration_s] = leg
        return leg.cost

    minimize_scalar(cost, bounds=bounds_s, method="bounded", options={"xatol": search_s})
    return min(found.values(), key=lambda leg: leg.cost)


def _leg(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: PlanSettings,
    start: BodyState,
    goal: Goal,
    surroundings: Surroundings | None,
    duration_s: float,
) -> Transit:
    stages = min(max(int(np.ceil(duration_s / 0.1)), 10), MOST_STAGES)
    own = settings.model_copy(
        update={"stages": stages, "stage_s": duration_s / stages, "w_path": 0.0, "iterations": 20, "tolerance": 1e-4}
    )
    model = compile_plan(vehicle, region, wake, own, surroundings)
    n = model.thrusters
    end: Array = np.concatenate([goal.X_WB.p_m, goal.X_WB.q, goal.nu_B])
    problem = PlanProblem(
        state=state_of(start),
        thrusts_N=np.zeros(n),
        command_N=np.zeros(n),
        reference=np.tile(end, (stages + 1, 1)),
        quiet=np.ones(stages),
        force_W_N=start.X_WB.R @ start.load_B[:3],
        moment_B_Nm=start.load_B[3:],
    )
    plan = Planner(model).plan(problem, np.tile(holding_thrusts(model, problem), (stages, 1)))
    return Transit(duration_s, plan.cost + settings.w_time * duration_s, plan)

"""What the paper's table of its solver asks of ours and of its own recipe: time, convergence, violations, restarts.

The problems are those of the planner bench (`planner.py`), both scenarios; every planner starts from its own last plan.
Work of a campaign for `wakewise reproduce solver`; names of figures are "PLANNER/FIGURE".
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Progress
from wakewise.experiments.trials.timing import timed_us
from wakewise.planning.planner import PlanModel, Planner
from wakewise.planning.problem import Horizon, shifted
from wakewise.wake import InfluenceModel, WakeSettings, disturbance, wake_model
from wakewise_benchmarks.planner import SCENARIOS, WARM_UP, MismatchedPlant, plan_model, restart_spread
from wakewise_benchmarks.registry import VEHICLE

OURS, RECIPE = "wake-aware", "the paper's recipe"
LATE_MS = 50.0
BEYOND_N = 1e-6
RESTARTS_AT = (20, 60)


def solve_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, float | None]:
    """Fly the plans of ours through both scenarios and have both planners solve each problem on the way.

    `instants`: how many problems a scenario has.
    """
    from wakewise_benchmarks.paper_planner import PaperPlanner

    instants = int(settings.get("instants", 100))
    model = plan_model(5)
    found: dict[str, dict[str, list[float]]] = {}
    spreads: list[float] = []
    for number, weight_N in enumerate(SCENARIOS.values()):
        planners: dict[str, Planner] = {OURS: Planner(model), RECIPE: PaperPlanner(plan_model(5))}
        _scenario(planners, model, weight_N, instants, found, spreads, progress, number)
    answer: dict[str, float | None] = {}
    for name, kept in found.items():
        ms = np.array(kept["ms"])
        answer |= {
            f"{name}/ms_mean": float(ms.mean()),
            f"{name}/ms_sd": float(ms.std(ddof=1)),
            f"{name}/ms_median": float(np.median(ms)),
            f"{name}/ms_p99": float(np.percentile(ms, 99)),
            f"{name}/late_pct": 100.0 * float((ms > LATE_MS).mean()),
            f"{name}/late": float((ms > LATE_MS).sum()),
            f"{name}/converged_pct": 100.0 * float(np.mean(kept["converged"])),
            f"{name}/converged": float(np.sum(kept["converged"])),
            f"{name}/thrusts_beyond": float(np.sum(kept["beyond"])),
            f"{name}/clearance_broken": float(np.sum(kept["touching"])),
            f"{name}/plans": float(len(ms)),
        }
    answer[f"{OURS}/restart_spread_pct"] = max(spreads) if spreads else None
    answer[f"{OURS}/disturbance_ms"] = _disturbance_ms(model)
    return answer


def _scenario(
    planners: Mapping[str, Planner],
    model: PlanModel,
    weight_N: float,
    instants: int,
    found: dict[str, dict[str, list[float]]],
    spreads: list[float],
    progress: Progress,
    number: int,
) -> None:
    shape = (20, len(VEHICLE.thrusters))
    plans: dict[str, Horizon] = {}
    plant = MismatchedPlant(weight_N)
    problem = plant.problem
    for instant in range(instants):
        progress(number * instants + instant, len(SCENARIOS) * instants, f"scenario {number + 1}")
        for name, planner in planners.items():
            start = shifted(plans[name], 1) if name in plans else np.zeros(shape)
            began = time.thread_time_ns()
            plan = plans[name] = planner.plan(problem, start)
            ms = (time.thread_time_ns() - began) / 1e6
            if instant < WARM_UP:
                continue
            kept = found.setdefault(name, {"ms": [], "converged": [], "beyond": [], "touching": []})
            kept["ms"].append(ms)
            kept["converged"].append(float(plan.converged))
            kept["beyond"].append(float(beyond(plan.commands_N, model)))
            kept["touching"].append(float(touching(plan.states, model)))
        if instant in RESTARTS_AT:
            spreads.append(restart_spread(problem)[0])
        problem = plant.flown(plans[OURS].commands_N[0])


def beyond(commands_N: Array, model: PlanModel) -> int:
    """How many commands, shape (N, n), lie outside their thruster's range."""
    low, high = model.table.lower - BEYOND_N, model.table.upper + BEYOND_N
    return int(((commands_N < low) | (commands_N > high)).sum())


def touching(states: Array, model: PlanModel) -> int:
    """At how many stages the hull, by the planner's own account of it, would touch something; states (N + 1, 13)."""
    return int(sum(clearance_m(state, model) < 0.0 for state in states[1:]))


def clearance_m(state: Array, model: PlanModel) -> float:
    """Least distance of the hull, a box at the pose of a state (13,), from anything solid; negative where they meet."""
    pose, half = Pose(state[:3], state[3:7]), np.asarray(model.table.half_size)
    gaps = [
        float(plane[:3] @ pose.p_m - plane[3] - np.abs(pose.R.T @ plane[:3]) @ half) for plane in model.table.planes
    ]
    for sphere in model.table.spheres:
        over = np.maximum(np.abs(pose.R.T @ (sphere[:3] - pose.p_m)) - half, 0.0)
        gaps.append(float(np.linalg.norm(over) - sphere[3]))
    return min(gaps, default=np.inf)


def _disturbance_ms(model: PlanModel) -> float:
    """Thread CPU of D once, Gram matrix included."""
    wake = wake_model(WakeSettings(model="paper-calibrated", edge_width_deg=3.0, floor=False))
    view = InfluenceModel.of(VEHICLE, model.region, wake)
    pose, thrusts = Pose(np.array([0.0, 0.0, 1.0])), np.linspace(-3.0, 3.0, len(VEHICLE.thrusters))
    return timed_us(lambda: disturbance(view.gram(pose), thrusts), 200)["median_us"] / 1e3

"""Whether the planner's deadline holds on the wall's clock while every core is busy with something else."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np

from wakewise.planning.guard import Guard
from wakewise.planning.planner import PlanModel, Planner
from wakewise.planning.problem import PLAN_EVERY_S, PlanProblem

PLANS = 100


def deadline_misses(model: PlanModel, problem: PlanProblem) -> tuple[int, float]:
    """Late plans of `PLANS`, ten per second, and the longest time in ms, with one busy process per core."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        guard = Guard(planner=Planner(model), deadline_s=PLAN_EVERY_S)
        plan, longest = None, 0.0
        guard.ask(lambda: problem, None, 0.0)
        guard.counts.clear()
        for _ in range(PLANS):
            began = time.perf_counter()
            plan = guard.ask(lambda: problem, plan, model.settings.stage_s).plan
            longest = max(longest, time.perf_counter() - began)
            time.sleep(max(0.02 - (time.perf_counter() - began), 0.0))
        return guard.counts.get("late", 0), float(np.round(1e3 * longest, 2))
    finally:
        for process in busy:
            process.kill()
            process.wait()

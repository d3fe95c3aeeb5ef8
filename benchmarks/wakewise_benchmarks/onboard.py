"""An onboard computer: allocation at 50 Hz and a plan at 10 Hz on one thread, in a process of its own.

The child process has one thread for each library (OpenMP, OpenBLAS, Numba) and flies the bench of the planner for
`SECONDS`: each 20 ms the Gram matrix and the allocation of that instant's wrench, each 100 ms a plan, the vehicle 3 N
heavy, with 15 % more drag than the plan believes. Times are CPU of the thread, after `WARM_UP_S`. `threads`: those of
the process that took more than 1 % of its CPU. `memory_MB`: the most that the process held, models and Python included.

`projected_5x` is a projection for a core five times slower, not a measurement: every time multiplied by 5, and the
share of ticks in which allocation and plan together then take longer than 20 ms. Caches and memory of a smaller
computer are not in it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import typer

from wakewise.allocation import Weights, compile_layout, min_wash_allocation
from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.planning.planner import Planner
from wakewise.wake import WakeSettings, wake_model
from wakewise.wake.influence import InfluenceModel
from wakewise_benchmarks.peak_memory import peak_memory_MB
from wakewise_benchmarks.planner import MismatchedPlant, plan_model
from wakewise_benchmarks.registry import VEHICLE, bench_region

SECONDS, WARM_UP_S = 60.0, 3.0
WEIGHT_N = 3.0
SLOWER = 5.0
ALLOCATIONS = 5
TICK_MS = 20.0
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run(options: BenchOptions) -> dict[str, Any]:
    """Figures of the child process, and the projection."""
    options.progress(0, 1, "one thread")
    code = "import json, sys; from wakewise_benchmarks.onboard import fly; print(json.dumps(fly(float(sys.argv[1]))))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(SECONDS)],
        capture_output=True,
        text=True,
        env=os.environ | ONE_THREAD,
        check=False,
    )
    if done.returncode:
        raise StageError(f"bench onboard: the process ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    told: dict[str, Any] = json.loads(done.stdout)
    options.progress(1, 1, "")
    return told


def fly(seconds: float) -> dict[str, Any]:
    """Times of allocation and plan in this process, its threads and its memory; `run` calls it in a child."""
    planner, plant = Planner(plan_model(1)), MismatchedPlant(WEIGHT_N)
    layout = compile_layout(VEHICLE.allocation_matrix, VEHICLE.thrust_lower_N, VEHICLE.thrust_upper_N)
    view = InfluenceModel.of(VEHICLE, bench_region(), wake_model(WakeSettings(model="paper-calibrated", floor=False)))
    weights = Weights(disturbance=1.0 / view.total_weight, effort=1e-3)
    rng = np.random.default_rng(0)
    start, problem = np.zeros((20, len(VEHICLE.thrusters))), plant.problem
    allocated, planned, ticks = list[float](), list[float](), list[float]()
    for step in range(round(10.0 * seconds)):
        began = time.thread_time_ns()
        plan = planner.plan(problem, start)
        plan_ms = 1e-6 * (time.thread_time_ns() - began)
        wrench, pose = VEHICLE.allocation_matrix @ plan.commands_N[0], Pose(problem.state[:3], problem.state[3:7])
        spans = list[float]()
        for _ in range(ALLOCATIONS):
            asked = wrench + rng.normal(0.0, 0.05, 6)
            began = time.thread_time_ns()
            min_wash_allocation(layout, asked, view.gram(pose), weights)
            spans.append(1e-6 * (time.thread_time_ns() - began))
        if step >= 10.0 * WARM_UP_S:
            planned.append(plan_ms)
            allocated += spans
            ticks += [plan_ms + spans[0], *spans[1:]]
        start = np.vstack([plan.commands_N[1:], plan.commands_N[-1:]])
        problem = plant.flown(plan.commands_N[0])
    times = {
        "allocator_us_median": 1e3 * float(np.median(allocated)),
        "allocator_us_p99": 1e3 * float(np.percentile(allocated, 99)),
        "plan_ms_median": float(np.median(planned)),
        "plan_ms_p99": float(np.percentile(planned, 99)),
    }
    late = {"late_pct": 100.0 * float(np.mean(np.array(ticks) > TICK_MS))}
    slower = {"late_pct": 100.0 * float(np.mean(SLOWER * np.array(ticks) > TICK_MS))}
    return {
        **times,
        **late,
        "memory_MB": peak_memory_MB(),
        "threads": busy_threads(),
        f"projected_{SLOWER:g}x": {name: SLOWER * value for name, value in times.items()} | slower,
    }


def busy_threads() -> int | None:
    """Threads of this process with more than 1 % of its CPU time; None where /proc does not tell."""
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return None
    taken = [sum(map(int, (task / "stat").read_text().rsplit(")", 1)[1].split()[11:13])) for task in tasks.iterdir()]
    return sum(one > 0.01 * sum(taken) for one in taken)


def show_onboard(told: dict[str, Any]) -> None:
    """Three lines: here, memory, and five times slower."""
    slower = told[f"projected_{SLOWER:g}x"]
    for where, row in (("here", told), (f"{SLOWER:g} times slower (projected)", slower)):
        typer.echo(
            f"{where}: allocation {row['allocator_us_median']:.0f} us (p99 {row['allocator_us_p99']:.0f}), plan "
            f"{row['plan_ms_median']:.2f} ms (p99 {row['plan_ms_p99']:.2f}), {row['late_pct']:.2f} % of ticks late"
        )
    typer.echo(f"{told['memory_MB']:.0f} MB, {told['threads']} thread")

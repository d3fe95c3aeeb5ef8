"""How long a control step takes as it is flown: plan, tracker, jets that meet, floor and exact shares together.

The orbit of the planner's bench with its vehicle 3 N heavy, the wake model and mechanisms of a scenario's default (free
jets in the plan, floor and meeting jets in the shares), 50 steps a second. The plant has 15 % more drag than is
believed and tells its true state. Times are the thread's CPU, after a second of warm-up; a `planning` step is one in
ten that also plans or searches.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from wakewise.control import ControlSettings, make_controller
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.vehicles import compile_body
from wakewise.robot.vehicles.kernels import rk4_kernel
from wakewise.wake import wake_model
from wakewise_benchmarks.registry import VEHICLE, bench_region, bench_target

METHODS = ("wake-aware", "allocation-only", "mpc", "dp")
SECONDS, WARM_UP_S, DT_S = 11.0, 1.0, 0.02
CURRENT_M_S = np.array([0.05, 0.02, 0.0])
"""What the estimate says of the water, so that points upstream are watched, too."""


def flown_step(method: str, goal_at: Callable[[float], Goal], weight_N: float) -> dict[str, Any]:
    """Times of a method's control steps in ms: median, 99th percentile, and that of the slowest tenth's median."""
    settings = ControlSettings()
    wake = wake_model(settings.wake, bench_target().bed_z_m)
    controller = make_controller(method, VEHICLE, bench_region(), wake, settings)
    plant = np.array(compile_body(VEHICLE).packed)
    plant[12:19] *= 1.15
    goal = goal_at(0.0)
    x, thrusts = np.concatenate([goal.X_WB.p_m, goal.X_WB.q, goal.nu_B]), np.zeros(len(VEHICLE.thrusters))
    state, spans = controller.init(), []
    for k in range(round(SECONDS / DT_S)):
        goal, X_WB = goal_at(k * DT_S), Pose(x[:3], x[3:7])
        load_B = np.concatenate([X_WB.R.T @ [0.0, 0.0, weight_N], np.zeros(3)])
        estimate = BodyState(X_WB=X_WB, nu_B=x[7:], load_B=load_B, current_W_m_s=CURRENT_M_S)
        began = time.thread_time_ns()
        state, command = controller.step(state, DT_S, estimate, goal)
        spans.append((time.thread_time_ns() - began) / 1e6)
        thrusts = thruster_lag(thrusts, command.thrusts_N, VEHICLE.time_constants_s, DT_S)
        wrench = VEHICLE.allocation_matrix @ thrusts
        wrench += load_B
        rk4_kernel(plant, x, np.concatenate([wrench, CURRENT_M_S]), DT_S)
    late = np.array(spans[round(WARM_UP_S / DT_S) :])
    slow = np.sort(late)[-len(late) // 10 :]
    return {
        "ms_median": float(np.median(late)),
        "ms_p99": float(np.percentile(late, 99)),
        "ms_planning_median": float(np.median(slow)),
    }

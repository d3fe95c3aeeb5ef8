"""`dp-paper`: dynamic positioning as the paper's baseline states it, a plain PID with its gains.

Section Gentle Stability: a PID per degree of freedom with Kp 150, Kd 80, Ki 20. The paper gives no units, no gains of
moments and no feed-forward. Here forces have these gains in N/m, N s/m and N/(m s), moments those of the same
bandwidth. There is no feed-forward: the integral alone holds the vehicle against weight and current. Gains are not
slowed for the delay of estimates and thrusters, as `dp` does. Thrusts are the least that make the wrench.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wakewise.control import ControlTask, Pipeline
from wakewise.control.null_space_allocation import least_thrust_allocator, vehicle_layout
from wakewise.control.pid import Pid, make_pid
from wakewise.control.pipeline import Demand, MotionStage, PipelineState, hold
from wakewise.core.interfaces import BodyState, Goal

KP_N_M, KD_N_S_M, KI_N_M_S = 150.0, 80.0, 20.0
"""Section Gentle Stability."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlainPidStage(MotionStage):
    """PID without feed-forward."""

    pid: Pid

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds."""
        pid, wrench = self.pid.correction(state.pid, dt_s, estimate, goal, saturated=state.saturated)
        if not np.isfinite(wrench.sum()):
            return hold(state, dt_s, "wrench not finite")
        return replace(state, pid=pid, goal_nu=goal.nu_B), Demand(wrench_B=wrench)


def make_dp_paper(task: ControlTask) -> Pipeline:
    """The paper's dynamic positioning, for any vehicle: gains scaled to its mass."""
    gains = {"kp_N_m": KP_N_M, "kd_N_s_m": KD_N_S_M, "ki_N_m_s": KI_N_M_S}
    settings = task.settings.model_copy(update=gains)
    layout = vehicle_layout(task.vehicle)
    return Pipeline(
        name="dp-paper",
        layout=layout,
        motion=PlainPidStage(pid=make_pid(task.vehicle, settings, slowed=False)),
        allocator=least_thrust_allocator(layout, task.vehicle, task.region, task.wake, settings),
    )

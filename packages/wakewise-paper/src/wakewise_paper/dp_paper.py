"""`dp-paper`: dynamic positioning as the paper's baseline states it, a plain PID with its gains.

Section Gentle Stability: a PID per degree of freedom with Kp 150, Kd 80, Ki 20. The paper gives no units, no gains of
moments and no feed-forward. Here forces have these gains in N/m, N s/m and N/(m s), moments those of the same
bandwidth. There is no feed-forward: the integral alone holds the vehicle against weight and current. Gains are not
slowed for the delay of estimates and thrusters, as `dp` does. Thrusts are the least that make the wrench.
"""

from __future__ import annotations

from wakewise.control import ControlTask, Pipeline
from wakewise.control.null_space_allocation import least_thrust_allocator, vehicle_layout
from wakewise.control.pid import make_pid
from wakewise.control.pipeline import TrackingStage

KP_N_M, KD_N_S_M, KI_N_M_S = 150.0, 80.0, 20.0
"""Section Gentle Stability."""


def make_dp_paper(task: ControlTask) -> Pipeline:
    """The paper's dynamic positioning, for any vehicle: gains scaled to its mass."""
    gains = {"kp_N_m": KP_N_M, "kd_N_s_m": KD_N_S_M, "ki_N_m_s": KI_N_M_S}
    settings = task.settings.model_copy(update=gains)
    layout = vehicle_layout(task.vehicle)
    return Pipeline(
        name="dp-paper",
        layout=layout,
        motion=TrackingStage(pid=make_pid(task.vehicle, settings, slowed=False), feed_forward=False),
        allocator=least_thrust_allocator(layout, task.vehicle, task.region, task.wake, settings),
    )

"""A rehearsal: the whole chain decides a few times for nobody, so that nothing is slow when thrusts count."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from wakewise.allocation import min_norm_allocation
from wakewise.control import make_tracker, vehicle_layout
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.interfaces import Goal, Measurement
from wakewise.operation.loop import Step
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.controls import Controls
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise_ardusub.session.control_handover import EngagedController
from wakewise_ardusub.session.link_join import VehicleFlight


class _Patience:
    """A world that waits for its controller: what takes long the first time is not cut short."""

    name, waits = "rehearsal", True

    def begin(self) -> Any:
        raise NotImplementedError  # nobody flies in it


class _Waving:
    """Sticks that are moved a little, for a rehearsal."""

    def read(self, time_s: float) -> Controls:  # noqa: ARG002
        return Controls(axes=np.array([0.0, 0.1, 0.1, 0.1, 0.0]))


def run_warm_up(sea: VehicleFlight, steps: int = 12) -> float:
    """Let the whole chain decide a few times for nobody, so that its kernels are there when thrusts count.

    Returns
    -------
    float
        The longest of the last steps, in s: what takes longer than a control period is not flown.
    """
    parts, start = sea.parts, sea.parts.start
    dt_s, layout = 1.0 / parts.control.rate_hz, vehicle_layout(parts.vehicle)
    chain = assisted(sea.bare.replace(world=_Patience()), _Waving(), OperatorState(), OperatorSettings(mode="operator"))
    resting = sea.parts.controller
    assert isinstance(resting, EngagedController)  # see `join.at_sea`
    flying, filtering, method = chain.flying, chain.estimator, resting.inner
    state, own, known, estimate, took_s = flying.init(), method.init(), filtering.init(start), start, 0.0
    for k in range(steps):
        began = time.perf_counter()
        goal = chain.pilot.goal(k * dt_s, estimate)
        state, command = flying.step(state, dt_s, estimate, goal)
        seen = Measurement(
            time_s=(k + 1) * dt_s,
            X_WB=start.X_WB,
            omega_B_rad_s=np.zeros(3),
            force_B_m_s2=np.array([0.0, 0.0, -GRAVITY_M_S2]),
        )
        known, estimate = filtering.step(known, dt_s, (seen,), command.thrusts_N)
        sea.figures(Step(time_s=k * dt_s, goal=goal, estimate=start, command=command, truth=None, solve_s=0.0))
        took_s = max(took_s, time.perf_counter() - began) if k >= steps // 2 else 0.0
        own, _ = method.step(own, dt_s, estimate, goal)  # what it keeps beside its state
    tracker = make_tracker(parts.vehicle, parts.control)
    min_norm_allocation(layout, tracker.wrench(tracker.init(), dt_s, start, Goal(X_WB=start.X_WB))[1])
    sea.figures.begin()
    return took_s

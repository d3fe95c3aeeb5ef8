"""The whole chain of a flight, run a few times without output, so that its first step is not slow."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from wakewise.allocation import min_norm_allocation
from wakewise.control import make_pid, vehicle_layout
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.interfaces import Goal, Measurement
from wakewise.operation.loop import Step
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.controls import Controls
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise_ardusub.session.engagement import EngagedController
from wakewise_ardusub.session.vehicle_flight import VehicleFlight


class _WaitingWorld:
    """A world that waits for its controller: what takes long the first time is not cut short."""

    name, waits = "rehearsal", True

    def begin(self) -> Any:
        raise NotImplementedError  # nobody flies in it


class _MovingInput:
    """Sticks that are moved a little, for a rehearsal."""

    def read(self, _time_s: float) -> Controls:
        return Controls(axes=np.array([0.0, 0.1, 0.1, 0.1, 0.0]))


def run_warm_up(sea: VehicleFlight, steps: int = 12) -> float:
    """Let the whole chain decide a few times for nobody, so that its kernels are there when thrusts count.

    Gives the longest of the last steps, in s: what takes longer than a control period is not flown.
    """
    parts, start = sea.parts, sea.parts.start
    dt_s, layout = 1.0 / parts.control.rate_hz, vehicle_layout(parts.vehicle)
    chain = assisted(
        sea.bare.replace(world=_WaitingWorld()), _MovingInput(), OperatorState(), OperatorSettings(mode="operator")
    )
    resting = sea.parts.controller
    assert isinstance(resting, EngagedController)  # see `join_vehicle`
    flying, filtering, method = chain.pipeline, chain.estimator, resting.inner
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
    tracker = make_pid(parts.vehicle, parts.control)
    min_norm_allocation(layout, tracker.wrench(tracker.init(), dt_s, start, Goal(X_WB=start.X_WB))[1])
    sea.figures.begin()
    return took_s

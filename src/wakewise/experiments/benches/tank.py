"""The world of a trial: eight thrusters at work over silt, everything measured at 10 Hz."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from wakewise.experiments.benches.cases import TARGET, VEHICLE
from wakewise.experiments.benches.timing import BenchOptions
from wakewise.interfaces import BodyState
from wakewise.missions import MissionSettings, plan_route
from wakewise.tank import Tank, TankSettings


def run(options: BenchOptions) -> dict[str, Any]:
    """The world of a trial: eight thrusters at work over silt, everything measured at 10 Hz."""
    seconds = 20.0
    route = plan_route(TARGET.centre_W_m, MissionSettings())
    start = BodyState(X_WB=route.body(0.0, VEHICLE.X_BC).X_WB)
    tank = Tank(VEHICLE, TARGET, TankSettings(), start, np.random.default_rng(0))
    phases = np.arange(8)

    def fly(duration_s: float) -> None:
        for k in range(round(duration_s / 0.02)):
            tank.step(0.7 * np.sin(0.3 * k * 0.02 + phases), 0.02)
            if k % 5 == 0:
                tank.measure()

    fly(2.0)
    wall, cpu = time.perf_counter(), time.process_time()
    fly(seconds)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {"realtime_factor": seconds / wall, "cpu_s_per_s": cpu / seconds}

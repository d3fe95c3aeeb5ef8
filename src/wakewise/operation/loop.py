"""The fixed-rate loop: goal, controller, plant, estimator, recorder. The same code for the tank and for the sea."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wakewise.arrays import Array
from wakewise.interfaces import BodyState, Command, Controller, Estimator, Goal, Pilot, Plant, ScalarGrid, no_progress


@dataclass(frozen=True, kw_only=True)
class WaterTruth:
    """What the water did, in the figures that a trial is judged by; speeds are the excess over the unthrusted flow.

    Pressures, shear and the speed of tracers are of the whole water; NaN where a witness does not know them.
    """

    target_speed_mean_m_s: float
    target_speed_p95_m_s: float
    bed_speed_p95_m_s: float
    turbidity_per_m: float
    target_pressure_mean_Pa: float = math.nan
    target_pressure_p95_Pa: float = math.nan
    bed_shear_p95_Pa: float = math.nan
    tracer_speed_mean_m_s: float = math.nan
    ray_optical_depth: float = math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What really was at one instant, for the record only: no controller sees it."""

    state: BodyState
    thrusts_N: Array
    power_W: float
    collision: bool


class Witness(Protocol):
    """Knows the truth of a simulated world; there is none at sea."""

    def observe(self) -> Truth:
        """Vehicle, thrusters and collisions now."""
        ...

    def water(self) -> WaterTruth:
        """Water at the target now; dearer than `observe`, so asked less often."""
        ...

    def silt(self) -> ScalarGrid:
        """Silt concentration around the target now, kg/m3."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One step of the loop, as it is handed to a recorder."""

    time_s: float
    goal: Goal
    estimate: BodyState
    command: Command
    truth: Truth | None
    solve_s: float


Recorder = Callable[[Step], None]


def fly(
    *,
    pilot: Pilot,
    controller: Controller[Any],
    estimator: Estimator[Any],
    plant: Plant,
    witness: Witness | None,
    start: BodyState,
    thrusters: int,
    duration_s: float,
    dt_s: float,
    record: Recorder,
    progress: Callable[..., None] = no_progress,
) -> None:
    """Run the loop for `duration_s` at a fixed step.

    At each step the estimate of now, which is all a controller may know, meets the goal of now; the resulting thrusts
    are held for `dt_s`. `start` is the first guess of the estimator. Solve times are thread CPU.
    """
    control_state, filter_state = controller.init(), estimator.init(start)
    estimate, thrusts = start, np.zeros(thrusters)
    steps = round(duration_s / dt_s)
    for k in range(steps):
        now_s = k * dt_s
        goal = pilot.goal(now_s, estimate)
        began = time.thread_time()
        control_state, command = controller.step(control_state, dt_s, estimate, goal)
        solve_s = time.thread_time() - began
        truth = witness.observe() if witness is not None else None
        record(Step(time_s=now_s, goal=goal, estimate=estimate, command=command, truth=truth, solve_s=solve_s))
        thrusts = command.thrusts_N
        measurements = plant.step(thrusts, dt_s)
        filter_state, estimate = estimator.step(filter_state, dt_s, measurements, thrusts)
        if k % 25 == 0:
            progress(k, steps, f"{now_s:.0f} of {duration_s:.0f} s flown")
    progress(steps, steps, f"{duration_s:.0f} s flown")

"""The fixed-rate loop: goal, controller, plant, estimator, recorder. The same code for the tank and for the sea."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, NotFinite
from wakewise.core.errors import StageError
from wakewise.core.interfaces import (
    BodyState,
    Command,
    Controller,
    Estimator,
    Goal,
    Pilot,
    Plant,
    Truth,
    TruthProvider,
    no_progress,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One step of the loop, as it is handed to a recorder."""

    time_s: float
    goal: Goal
    estimate: BodyState
    command: Command
    truth: Truth | None
    solve_s: float
    tilt_rad: float = 0.0
    """Angle of the camera's joint as it was last measured."""


Recorder = Callable[[Step], None]


def never() -> bool:
    """Say no: what ends no loop."""
    return False


def no_wait(time_s: float) -> None:
    """Wait for nothing: the pace of a simulated flight."""


def no_listener(time_s: float) -> None:
    """Take no note of when thrusts are sent."""


DIVERGED = 100.0
"""Speed of a vehicle, in m/s or rad/s, at which what moves it has diverged."""


@contextmanager
def _finite(part: str, time_s: float) -> Iterator[None]:
    """Say of a part, and when, that it diverged, where numbers without end come of it."""
    try:
        yield
    except (NotFinite, np.linalg.LinAlgError, OverflowError, FloatingPointError) as fault:
        raise StageError(f"the simulation diverged at t = {time_s:.2f} s in the {part}: {fault}") from fault


def _slow(part: str, time_s: float, nu_B: Array) -> None:
    """Refuse to go on where a part says that the vehicle moves as no vehicle does."""
    speed = max(map(abs, nu_B.tolist()))
    if speed > DIVERGED:
        raise StageError(
            f"the simulation diverged at t = {time_s:.2f} s in the {part}: the vehicle moves or turns at {speed:.3g} "
            f"m/s or rad/s, at most {DIVERGED:g}"
        )


def run_loop(
    *,
    pilot: Pilot,
    controller: Controller[Any],
    estimator: Estimator[Any],
    plant: Plant,
    truth_provider: TruthProvider | None,
    start: BodyState,
    thrusters: int,
    duration_s: float | None,
    dt_s: float,
    record: Recorder,
    tilt_rad: float = 0.0,
    progress: Callable[..., None] = no_progress,
    stop: Callable[[], bool] = never,
    pace: Callable[[float], None] = no_wait,
    sent: Callable[[float], None] = no_listener,
) -> None:
    """Run the loop for `duration_s` at a fixed step, without end where that is None, or until `stop` says so.

    At each step the estimate of now, which is all a controller may know, meets the goal of now; the resulting thrusts
    are held for `dt_s`. A controller may answer with another goal of the same camera pose (`Command.goal`): that one is
    recorded, and the camera is aimed by it. `start` is the first guess of the estimator, `tilt_rad` that of the tilt of
    the camera. Solve times are thread CPU.

    Before each step `stop` is asked, then `pace` may wait until that time of the flight has come; `sent` is called
    when a step's thrusts go to the plant. What a flight is does not hang on any of them.

    Raises StageError if the simulation diverges: a part gives numbers that are not finite, or a vehicle faster than
    any; which part, and when, is named.
    """
    control_state, filter_state = controller.init(), estimator.init(start)
    estimate, thrusts, aim = start, np.zeros(thrusters), getattr(plant, "aim", None)
    steps = math.inf if duration_s is None else round(duration_s / dt_s)
    k = 0
    while k < steps and not stop():
        now_s = k * dt_s
        pace(now_s)
        _slow("estimator", now_s, estimate.nu_B)
        with _finite("pilot", now_s):
            goal = pilot.goal(now_s, estimate)
        began = time.thread_time()
        with _finite("controller", now_s):
            control_state, command = controller.step(control_state, dt_s, estimate, goal)
        solve_s = time.thread_time() - began
        goal = goal if command.goal is None else command.goal
        truth = None
        if truth_provider is not None:
            with _finite("vehicle's motion", now_s):
                truth = truth_provider.observe()
            _slow("vehicle's motion", now_s, truth.state.nu_B)
        record(
            Step(
                time_s=now_s,
                goal=goal,
                estimate=estimate,
                command=command,
                truth=truth,
                solve_s=solve_s,
                tilt_rad=tilt_rad,
            )
        )
        thrusts = command.thrusts_N
        if aim is not None:
            aim(goal.tilt_rad)
        sent(now_s)
        with _finite("vehicle's motion", now_s):
            measurements = plant.step(thrusts, dt_s)
        for measured in measurements:
            tilt_rad = tilt_rad if measured.tilt_rad is None else measured.tilt_rad
        with _finite("estimator", now_s):
            filter_state, estimate = estimator.step(filter_state, dt_s, measurements, thrusts)
        if k % 25 == 0 and duration_s is not None:
            progress(k, steps, f"{now_s:.0f} of {duration_s:.0f} s flown")
        k += 1
    progress(k, k, f"{k * dt_s:.0f} s flown")

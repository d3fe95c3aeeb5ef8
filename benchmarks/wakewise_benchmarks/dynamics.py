"""One step of the vehicle, with and without Jacobians, compiled and from Python; of many at once; public programs."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.constants import TRIM_WATER_KG_M3 as RHO_KG_M3
from wakewise.core.geometry import quat_from_euler
from wakewise.core.jit.njit import njit
from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise.robot.vehicles import (
    RigidBody,
    acceleration,
    compile_body,
    fossen,
    load_vehicle,
    pack_bodies,
    step_batch,
    step_rk4,
    step_rk4_jacobians,
    step_semi_implicit,
    step_semi_implicit_jacobians,
)
from wakewise.robot.vehicles.dynamics import pack
from wakewise.robot.vehicles.kernels import rk4_jacobian_kernel, rk4_kernel
from wakewise.robot.vehicles.semi_implicit import semi_implicit_jacobian_kernel, semi_implicit_kernel

DT_S = 0.005
ORACLE = "oracle_fossen_bluerov2heavy_200.csv"
ORACLE_GRAVITY_M_S2 = 9.82


def run(options: BenchOptions) -> dict[str, Any]:
    """One step of the vehicle, with and without Jacobians, against the readable twin and three public programs.

    Compiled steps are timed in compiled loops in which each step starts from the last one's result.
    """
    vehicle = load_vehicle("paper")
    body = compile_body(vehicle, RHO_KG_M3, GRAVITY_M_S2)
    p, q, nu = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.05, 0.0, 0.0, 0.1, 0.2])
    wrench, current = np.array([1.0, 0.0, 0.5, 0.0, 0.1, 0.0]), np.array([0.03, 0.02, 0.0])
    there = (p, q, nu, wrench, current, DT_S)

    step_us = _loop_us(_march_rk4, body.packed, there)
    twin = timed_us(lambda: fossen.step_rk4(vehicle, RHO_KG_M3, GRAVITY_M_S2, *there), 500)
    return {
        "step_us": step_us,
        "step_with_jacobians_us": _loop_us(_march_rk4_jacobians, body.packed, there),
        "semi_implicit_us": _loop_us(_march_semi_implicit, body.packed, there),
        "semi_implicit_with_jacobians_us": _loop_us(_march_semi_implicit_jacobians, body.packed, there),
        "twin_ratio": twin["median_us"] / step_us,
        "twin": twin,
        "called_from_python": {
            "step": timed_us(lambda: step_rk4(body, *there), 5000),
            "step_with_jacobians": timed_us(lambda: step_rk4_jacobians(body, *there), 5000),
            "semi_implicit": timed_us(lambda: step_semi_implicit(body, *there), 5000),
            "semi_implicit_with_jacobians": timed_us(lambda: step_semi_implicit_jacobians(body, *there), 5000),
        },
        **batch_figures(body),
        **oracle_figures(options.data),
    }


def batch_figures(body: RigidBody, vehicles: int = 16384, rounds: int = 41) -> dict[str, Any]:
    """Vehicle steps a second of `step_batch`, by the clock on all cores and by thread CPU on one, and the peer's.

    The peer is a Python loop over `step_rk4` in the same process; every vehicle has a body and a current of its own.
    Other work on the machine lowers what the clock says, so its best round is given too, and the steps for each second
    of processor time that all threads together took.
    """
    rng = np.random.default_rng(0)
    states = np.zeros((vehicles, 13))
    states[:, 3], states[:, 7:] = 1.0, 0.1 * rng.standard_normal((vehicles, 6))
    wrenches, currents = rng.standard_normal((vehicles, 6)), 0.1 * rng.standard_normal((vehicles, 3))
    bodies = pack_bodies([body] * vehicles)
    after = np.empty_like(states)

    def march() -> None:
        step_batch(bodies, states, wrenches, DT_S, currents_W_m_s=currents, out=after)

    def loop() -> None:
        for row, wrench, current in zip(states[:500], wrenches, currents, strict=False):
            step_rk4(body, row[:3], row[3:7], row[7:], wrench, current, DT_S)

    before = numba.get_num_threads()
    march()
    both = [vehicles / _span_s(time.perf_counter, march) for _ in range(rounds)]
    worked = [vehicles / max(_span_s(time.process_time, march), 1e-9) for _ in range(rounds)]
    try:
        numba.set_num_threads(1)
        one, peer = [], []
        for _ in range(rounds):  # by turns, so that both meet the same machine
            one.append(vehicles / _span_s(time.thread_time, march))
            peer.append(500 / _span_s(time.thread_time, loop))
    finally:
        numba.set_num_threads(before)
    return {
        "batch_steps_per_s": float(np.median(both)),
        "batch_steps_per_s_best": float(np.max(both)),
        "batch_threads": before,
        "batch_steps_per_cpu_s": float(np.median(worked)),
        "batch_steps_per_s_1_thread": float(np.median(one)),
        "batch_ratio": float(np.median(np.divide(one, peer))),
        "python_loop_steps_per_s": float(np.median(peer)),
    }


def _span_s(clock: Callable[[], float], work: Callable[[], None]) -> float:
    began = clock()
    work()
    return clock() - began


def oracle_figures(data: Path | None) -> dict[str, Any]:
    """Largest error of an acceleration against public programs, relative to its largest component, or why none.

    200 states of the set von_benzon_2022 (density 1000 kg/m3, gravity 9.82 m/s2), in the folder of reference data.
    """
    path = data / "dynamics" / ORACLE if data else None
    if path is None or not path.is_file():
        missing = "no folder of reference data" if path is None else f"no file {path}"
        return {"oracle_rel_error_max": None, "why": {"oracle_rel_error_max": f"{missing}; name it with --data"}}
    body = compile_body(load_vehicle("bluerov2-heavy"), RHO_KG_M3, ORACLE_GRAVITY_M_S2)
    worst = 0.0
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            angles, nu, wrench, expected = (
                np.array([float(row[name]) for name in names.split()])
                for names in ("phi theta psi", "u v w p q r", "tauX tauY tauZ tauK tauM tauN", "du dv dw dp dq dr")
            )
            got = acceleration(body, quat_from_euler(*angles), nu, wrench, np.zeros(3))
            worst = max(worst, float(np.abs(got - expected).max() / np.abs(expected).max()))
    return {"oracle_rel_error_max": worst}


def _loop_us(march: Callable[..., None], packed: Array, there: tuple[Any, ...], steps: int = 1000) -> float:
    # Median over blocks of the thread CPU of one step; the first, short block compiles.
    state, inputs = pack(*there[:5])
    by_state, by_wrench = np.empty((12, 12)), np.empty((12, 6))
    march(packed, state, inputs, DT_S, by_state, by_wrench, 1)
    blocks = np.empty(101)
    for k in range(len(blocks)):
        began = time.thread_time_ns()
        march(packed, state, inputs, DT_S, by_state, by_wrench, steps)
        blocks[k] = (time.thread_time_ns() - began) / (1e3 * steps)
    return float(np.median(blocks))


# Not cached: numba would keep loops compiled with kernels that have changed since in another file.
@njit
def _march_rk4(packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array, steps: int) -> None:
    for _ in range(steps):
        rk4_kernel(packed, state, inputs, dt_s)


@njit
def _march_rk4_jacobians(
    packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array, steps: int
) -> None:
    for _ in range(steps):
        rk4_jacobian_kernel(packed, state, inputs, dt_s, A, B)


@njit
def _march_semi_implicit(
    packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array, steps: int
) -> None:
    factors, velocities, turns = np.empty((2, 6, 6)), np.empty((4, 6, 1)), np.empty((2, 4))
    for _ in range(steps):
        semi_implicit_kernel(packed, state, inputs, dt_s, factors, velocities, turns)


@njit
def _march_semi_implicit_jacobians(
    packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array, steps: int
) -> None:
    for _ in range(steps):
        semi_implicit_jacobian_kernel(packed, state, inputs, dt_s, A, B)

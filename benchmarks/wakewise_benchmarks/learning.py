"""Environments for learning: steps per second, and a small policy beside `dp`, in the jet model and in the tank.

The protocol below was fixed before its results. Training sees the jet model alone. Both policies then fly the same
fresh episodes, and differences are tested in pairs.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numba
import numpy as np
from gymnasium.vector import SyncVectorEnv

from wakewise.core.arrays import Array
from wakewise.experiments.campaigns.statistics import mean_interval, paired_test
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.learning import (
    DpPolicy,
    ResidualPolicy,
    StationKeepingEnv,
    StationKeepingTask,
    StationKeepingVectorEnv,
    rollout,
    train,
)

ASKED_STEPS_PER_S = 20_000
ENVIRONMENTS, ROUNDS = 1024, 9
TRAINING_SEED, GENERATIONS, CANDIDATES, EPISODES, EPISODE_S, BUDGET_S = 0, 150, 64, 16, 5.0, 900.0
JET_SEED, JET_EPISODES = 2000, 256
TANK_SEED = 5000


def run(options: BenchOptions) -> dict[str, Any]:
    """Speed, then training and comparison; `options.seeds` is the number of episodes in the tank."""
    task = StationKeepingTask()
    speed = speed_figures(task)
    began, worked = time.monotonic(), time.process_time()
    env = StationKeepingVectorEnv(CANDIDATES * EPISODES, replace(task, episode_s=EPISODE_S))
    rng, goes = np.random.default_rng(TRAINING_SEED), options.progress
    parameters = train(env, rng, generations=GENERATIONS, episodes=EPISODES, budget_s=BUDGET_S, progress=goes)
    spent = {"training_s": time.monotonic() - began, "training_cpu_s": time.process_time() - worked}
    return {"speed": speed, **spent, **policy_figures(task, parameters, options.seeds)}


def speed_figures(task: StationKeepingTask, count: int = ENVIRONMENTS, rounds: int = ROUNDS) -> dict[str, Any]:
    """Environment steps per second of the vector environment, median of rounds, and of one tank.

    By the clock on all threads, by the clock and by thread CPU on one thread. Actions are drawn beforehand.
    """
    env, before = StationKeepingVectorEnv(count, task), numba.get_num_threads()
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (50, count, len(task.robot.thrusters)))
    env.step(actions[0])
    clocks: dict[str, list[float]] = {"clock": [], "clock_1_thread": [], "cpu_1_thread": []}
    try:
        for _ in range(rounds):  # by turns, so that all meet the same machine
            numba.set_num_threads(before)
            clocks["clock"].append(_rate(env, actions)[0])
            numba.set_num_threads(1)
            wall, cpu = _rate(env, actions)
            clocks["clock_1_thread"].append(wall)
            clocks["cpu_1_thread"].append(cpu)
    finally:
        numba.set_num_threads(before)
    tank, began = StationKeepingEnv(task), 0.0
    for _ in range(2):  # the first time its kernels are loaded
        tank.reset(seed=0)
        began = time.process_time()
        for action in actions[:, 0]:
            tank.step(action.astype(np.float32))
    return {
        "environments": count,
        "threads": before,
        "asked_steps_per_s": ASKED_STEPS_PER_S,
        **{f"steps_per_s_{name}": float(np.median(values)) for name, values in clocks.items()},
        "tank_steps_per_cpu_s": len(actions) / (time.process_time() - began),
    }


def policy_figures(task: StationKeepingTask, parameters: Array, tanks: int) -> dict[str, Any]:
    """Means with 95 % intervals of `dp` and the trained policy, and their differences in pairs, in both worlds."""
    jet = StationKeepingVectorEnv(JET_EPISODES, task)
    water = SyncVectorEnv([lambda: StationKeepingEnv(task)] * tanks)
    return {"jet": _compared(jet, task, parameters, JET_SEED), "tank": _compared(water, task, parameters, TANK_SEED)}


def _compared(env: Any, task: StationKeepingTask, parameters: Array, seed: int) -> dict[str, Any]:
    dp, learned = (rollout(env, policy, seed=seed) for policy in (DpPolicy(task), ResidualPolicy(task, parameters)))
    rows: dict[str, Any] = {"episodes": len(dp["return"])}
    for name in ("return", "wash_m_s", "position_rmse_m", "energy_J"):
        test = paired_test(learned[name], dp[name])
        rows[name] = {
            "dp": mean_interval(dp[name]),
            "learned": mean_interval(learned[name]),
            "difference": (test.mean, (test.low, test.high)),
            "p_wilcoxon": test.p_wilcoxon,
            "larger": int((learned[name] > dp[name]).sum()),
        }
    return rows


def _rate(env: StationKeepingVectorEnv, actions: Array) -> tuple[float, float]:
    """Environment steps per second by the clock and by this thread's CPU."""
    began, worked = time.perf_counter(), time.thread_time()
    for action in actions:
        env.step(action)
    steps = len(actions) * env.num_envs
    return steps / (time.perf_counter() - began), steps / (time.thread_time() - worked)

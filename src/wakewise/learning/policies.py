"""Policies on observations: `dp`, a small network beside it, and rollouts that give the figures of episodes.

A policy is a function with memory: `init(n)` gives the memory of n vehicles, `act(memory, observations)` the memory
after a step and the actions, shape (n, thrusters). Nothing is hidden.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from gymnasium.vector import VectorEnv

from wakewise.control import ControlSettings, make_pid
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise.learning.task import StationKeepingTask
from wakewise.robot.vehicles import restoring_wrench

HIDDEN = 16
"""Units of the hidden layer."""
SCALES = np.array([0.02] * 3 + [0.05] * 3 + [0.1] * 3 + [0.2] * 3 + [0.5] * 3)
"""What errors, twist and the target's place are divided by for the network: errors that cost 1, usual values."""
ACTION_SCALE = 0.2
"""What actions of `dp` are divided by for the network, and what its outputs are multiplied by: 2 of 10 N."""


class Policy(Protocol):
    """From observations to actions, with a memory that goes in and comes out."""

    def init(self, n: int) -> Array:
        """Memory of n vehicles before the first step."""

    def act(self, memory: Array, observations: Array) -> tuple[Array, Array]:
        """Memory after the step, and actions, shape (n, thrusters)."""


class DpPolicy:
    """The method `dp` on observations: PID with feed-forward in six degrees of freedom and the pseudo-inverse.

    Gains, limits and feed-forward are those of `wakewise.control.pid` at the task's rate, and the observed load is held
    against. Where an action would exceed 1, all thrusts of a vehicle shrink alike and its integral does not grow. The
    memory, shape (n, 7), is the integral, force in the goal's frame and moment in B, and whether actions were limited.
    """

    def __init__(self, task: StationKeepingTask) -> None:
        robot = task.robot
        self._pid = make_pid(robot, ControlSettings(rate_hz=task.rate_hz))
        self._dt_s = task.dt_s
        self._feed = -restoring_wrench(self._pid.body, np.array([1.0, 0.0, 0.0, 0.0]))  # goals are level
        self._unmix = np.linalg.pinv(robot.allocation_matrix).T / task.max_thrust_N

    def init(self, n: int) -> Array:
        """Nothing learned yet."""
        return np.zeros((n, 7))

    def act(self, memory: Array, observations: Array) -> tuple[Array, Array]:
        """Memory after the step, and actions."""
        seen, pid = np.asarray(observations, dtype=np.float64), self._pid
        error, twist, load = seen[:, :6], seen[:, 6:12], seen[:, 12:18]
        R_BG = matrix_from_quat(quat_from_rotvec(error[:, 3:]))
        feed, integral = np.tile(self._feed, (len(seen), 1)), memory[:, :6].copy()
        feed[:, :3] = np.einsum("kij,kj->ki", R_BG, feed[:, :3])
        integral[:, :3] = np.einsum("kij,kj->ki", R_BG, integral[:, :3])
        base = pid.kp * error - pid.kd * twist + feed
        step = pid.ki * error * self._dt_s
        grown = np.clip(integral + step, -pid.integral_limit, pid.integral_limit)
        kept = (memory[:, 6:] > 0.0) & (step * (base + integral) > 0.0)
        integral = np.where(kept, integral, grown)
        wrench = base + integral - np.clip(load, -pid.load_limit, pid.load_limit)
        actions = wrench @ self._unmix
        largest = np.abs(actions).max(axis=1, keepdims=True)
        after = np.hstack([integral, largest > 1.0])
        after[:, :3] = np.einsum("kji,kj->ki", R_BG, integral[:, :3])
        return after, actions / np.maximum(largest, 1.0)


class ResidualPolicy:
    """A network with one hidden layer whose output is added to the actions of `dp`.

        a = a_dp + s W2 (tanh(W1 (a_dp / s, o / scales, 1)), 1),  s = 0.2

    o are the observed errors, twist and place of the target. `parameters`, shape (size,), or (m, size) of m networks:
    vehicle k of n is then flown by network k m / n. Zeros are `dp` itself. Raises InputError if the number of
    parameters differs.
    """

    def __init__(self, task: StationKeepingTask, parameters: Array) -> None:
        inputs, outputs, size = _layers(task)
        given = np.atleast_2d(np.asarray(parameters, dtype=np.float64))
        if given.ndim != 2 or given.shape[1] != size:
            raise InputError(f"parameters: shape {np.shape(parameters)}, allowed ({size},) or (m, {size})")
        self.dp = DpPolicy(task)
        split = inputs * HIDDEN
        self._first = given[:, :split].reshape(-1, inputs, HIDDEN)
        self._second = given[:, split:].reshape(-1, HIDDEN + 1, outputs)

    @staticmethod
    def start(task: StationKeepingTask, rng: np.random.Generator) -> Array:
        """Parameters before training, shape (size,): first layer drawn, second layer zero, which is `dp`."""
        inputs, _, size = _layers(task)
        drawn = rng.standard_normal(inputs * HIDDEN) / np.sqrt(inputs)
        return np.concatenate([drawn, np.zeros(size - len(drawn))])

    def init(self, n: int) -> Array:
        """Memory of `dp`."""
        return self.dp.init(n)

    def act(self, memory: Array, observations: Array) -> tuple[Array, Array]:
        """Memory after the step, and actions."""
        seen = np.asarray(observations, dtype=np.float64)
        after, base = self.dp.act(memory, seen)
        about = np.hstack([seen[:, :12], seen[:, -3:]]) / SCALES
        inputs = np.hstack([base / ACTION_SCALE, about, np.ones((len(seen), 1))])
        inputs = inputs.reshape(len(self._first), -1, inputs.shape[1])
        hidden = np.tanh(inputs @ self._first)
        more = hidden @ self._second[:, :-1] + self._second[:, -1:]
        return after, np.clip(base + ACTION_SCALE * more.reshape(base.shape), -1.0, 1.0)


def _layers(task: StationKeepingTask) -> tuple[int, int, int]:
    """Inputs, outputs and parameters of the network."""
    n = len(task.robot.thrusters)
    return n + 16, n, (n + 16) * HIDDEN + (HIDDEN + 1) * n


def rollout(
    env: VectorEnv[Any, Any, Any], policy: Policy, *, seed: int | None = None, options: dict[str, Any] | None = None
) -> dict[str, Array]:
    """Fly one episode in each environment, of one of ours or several in a Gymnasium `SyncVectorEnv`.

    Returns arrays of shape (N,): `return`, the sum of rewards; `position_rmse_m` and `wash_m_s`, means over the
    episode; `energy_J`; `steps`.
    """
    seen, _ = env.reset(seed=seed, options=options)
    flying, memory = np.ones(env.num_envs, dtype=np.bool_), policy.init(env.num_envs)
    total, square, wash, energy, steps = (np.zeros(env.num_envs) for _ in range(5))
    while flying.any():
        memory, actions = policy.act(memory, seen)
        seen, rewards, terminated, truncated, infos = env.step(actions)
        steps += flying
        total += flying * rewards
        square += flying * infos["position_error_m"] ** 2
        wash += flying * infos["wash_m_s"]
        energy += flying * infos["energy_J"]
        flying &= ~(terminated | truncated)
    return {
        "return": total,
        "position_rmse_m": np.sqrt(square / steps),
        "wash_m_s": wash / steps,
        "energy_J": energy,
        "steps": steps,
    }

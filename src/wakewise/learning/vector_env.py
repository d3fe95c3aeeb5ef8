"""Many vehicles that hold their place, as a Gymnasium vector environment on the batched dynamics with a jet model."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.checks import whole_number
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.learning.hold_kernels import HoldCase, hold_kernel
from wakewise.learning.task import StationKeepingTask, checked_actions, draw_episode, reward
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle, compile_body, pack_bodies, perturbed
from wakewise.wake import wake_model
from wakewise.wake.jets import AxialJet, own_constants

Observations = NDArray[np.float32]

VEHICLES = 256
"""Vehicles with parameters of their own, drawn once with a fixed seed; an episode draws one of them."""
STEP_S = 0.01
"""Longest step of the motion: half the longest stable one of the library's vehicles."""
BIAS = np.array([0.003] * 3 + [0.002] * 3 + [0.0] * 6)
"""Error of observations 0 to 11 that lasts for an episode, one sigma: what a camera-based pose has left after fusion
(see `SensorSettings` of the tank)."""
NOISE = np.array([0.001] * 3 + [0.001] * 3 + [0.003] * 3 + [0.002] * 3)
"""White noise of observations 0 to 11, one sigma: millimetres and the gyro's noise, as of the tank's sensors."""


class StationKeepingVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """N vehicles, each of which holds a pose in front of the target; see `wakewise.learning.task`.

    Thrusters have lag, limits and gains of their own; there is no dead zone, no wall, no bed and no silt. The wash is
    that of the task's wake model. An environment that is done is reset by the next step, whose action is ignored
    (`AutoresetMode.NEXT_STEP`).

    `reset(options={"episodes": m})` gives environment k episode k mod m: m episodes, each seen by N / m policies.

    Raises InputError if the wake model has no law of a single jet, or the number of environments is not positive.
    """

    def __init__(self, num_envs: int = 64, task: StationKeepingTask | None = None) -> None:
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}
        self.num_envs = whole_number(num_envs, "num_envs", 1)
        self.task = StationKeepingTask() if task is None else task
        self._bound = self.task.observation_bounds()
        bound, n = self._bound.astype(np.float32), len(self.task.robot.thrusters)
        self.single_observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (n,), dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._case = _case(self.task)
        self._which = np.zeros(num_envs, dtype=np.int64)
        self._goals, self._currents = np.zeros((num_envs, 7)), np.zeros((num_envs, 3))
        self._states, self._motors, self._loads = (
            np.zeros((num_envs, 13)),
            np.zeros((num_envs, n)),
            np.zeros((num_envs, 6)),
        )
        self._bias, self._actions = np.zeros((num_envs, 12)), np.zeros((num_envs, n))
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._done: BoolArray | None = None
        self._figures, self._observed = np.zeros((num_envs, 4)), np.zeros((num_envs, 21))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Draw all episodes anew; see the class for `options`.

        Raises InputError if the number of episodes does not divide that of the environments.
        """
        if isinstance(seed, list):
            raise InputError(f"seed: a list of {len(seed)}, allowed one number for all environments")
        super().reset(seed=seed)
        episodes = whole_number((options or {}).get("episodes", self.num_envs), "episodes", 1, self.num_envs)
        if self.num_envs % episodes:
            raise InputError(f"episodes: {episodes}, allowed a divisor of {self.num_envs} environments")
        self._draw(np.arange(episodes))
        for array in (self._which, self._goals, self._currents, self._states, self._bias):
            array[:] = array[np.arange(self.num_envs) % episodes]
        self._motors[:], self._loads[:], self._actions[:], self._elapsed[:] = 0.0, 0.0, 0.0, 0
        self._done = np.zeros(self.num_envs, dtype=np.bool_)
        self._hold(0)
        return self._observations(), self._infos()

    def step(self, actions: NDArray[np.float32]) -> tuple[Observations, Array, BoolArray, BoolArray, dict[str, Any]]:
        """Hold actions, shape (N, n), for one step; see `wakewise.learning.task` for what is returned.

        Raises InputError if there was no reset, the shape differs, or an action is not finite.
        """
        if self._done is None:
            raise InputError("step: the environment was not reset, call reset first")
        self._actions[:] = checked_actions(actions, self._actions.shape)
        again = np.flatnonzero(self._done)
        self._hold(max(1, -(-round(1e6 * self.task.dt_s) // round(1e6 * STEP_S))))
        self._elapsed += 1
        left_s = np.multiply(self.task.dt_s, self.task.steps - self._elapsed, dtype=np.float64)
        rewards, terminated = reward(self.task, self._figures, left_s)
        truncated = (self._elapsed >= self.task.steps) & ~terminated
        if len(again):
            self._draw(again)
            for array in (self._motors, self._loads, self._actions, self._elapsed):
                array[again] = 0
            self._hold(0)
            rewards[again], terminated[again], truncated[again] = 0.0, False, False
        self._done = terminated | truncated
        return self._observations(), rewards, terminated, truncated, self._infos()

    def _draw(self, rows: IntArray) -> None:
        """Draw episodes of some environments."""
        rng = self.np_random
        for k in rows:
            episode = draw_episode(self.task, self._case.centre, rng)
            self._which[k] = rng.integers(len(self._case.bodies))
            self._goals[k], self._currents[k] = _packed(episode.goal), episode.current_W_m_s
            self._states[k, :7], self._states[k, 7:] = _packed(episode.start), 0.0
            self._bias[k] = BIAS * rng.standard_normal(12)

    def _hold(self, steps: int) -> None:
        """Advance by that many steps of the motion and measure; none only measures."""
        commands_N, step_s = self._actions * self.task.max_thrust_N, self.task.dt_s / max(steps, 1)
        drawn, changed = (self._which, self._goals, self._currents), (self._states, self._motors, self._loads)
        hold_kernel(self._case, *drawn, commands_N, step_s, steps, *changed, self._figures, self._observed)

    def _observations(self) -> Observations:
        seen = np.hstack([self._observed[:, :18], self._actions, self._observed[:, 18:]])
        seen[:, :12] += self._bias + NOISE * self.np_random.standard_normal((self.num_envs, 12))
        return np.clip(seen, -self._bound, self._bound).astype(np.float32)

    def _infos(self) -> dict[str, Any]:
        place, attitude, wash, power = self._figures.T.copy()
        energy = self.task.dt_s * power
        return {
            "position_error_m": place,
            "attitude_error_rad": attitude,
            "wash_m_s": wash,
            "power_W": power,
            "energy_J": energy,
        }


def _packed(pose: Pose) -> Array:
    return np.concatenate([pose.p_m, pose.q])


def _drawn(task: StationKeepingTask) -> list[Vehicle]:
    rng = np.random.default_rng(0)
    trims = rng.uniform(-task.trim_N, task.trim_N, VEHICLES)
    return [perturbed(task.robot, rng, trim_N=float(trim), **task.mismatch) for trim in trims]


@cache
def _case(task: StationKeepingTask) -> HoldCase:
    robot, (target, region) = task.robot, task.scene()
    drawn, model = _drawn(task), wake_model(task.wake)
    if not isinstance(model, AxialJet):
        raise InputError(f"wake: {task.wake!r} has no law of a single jet, allowed such as 'jet' or 'paper'")
    areas, n = np.array(robot.disk_areas_m2), len(robot.thrusters)
    return HoldCase(
        bodies=pack_bodies([compile_body(vehicle) for vehicle in drawn]),
        gains=np.array([vehicle.thrust_gains for vehicle in drawn]),
        nominal=np.array(compile_body(robot).packed),
        allocation=np.array(robot.allocation_matrix),
        arms=np.array(robot.thruster_positions_B_m),
        axes=np.array(robot.thruster_axes_B),
        lags_s=np.array(robot.time_constants_s),
        watts=np.stack([electrical_power_W(np.full(n, thrust), areas) for thrust in (1.0, -1.0)], axis=1),
        kind=int(model.law.kind),
        numbers=np.array(model.law.parameters),
        own=own_constants(int(model.law.kind), model.law.parameters, areas),
        points=np.array(region.points_W_m),
        weights=np.array(region.weights / region.weights.sum()),
        centre=np.array(target.centre_W_m),
    )

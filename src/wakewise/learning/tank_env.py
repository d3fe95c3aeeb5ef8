"""One vehicle that holds its place in the simulated tank of a trial, as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from wakewise.control.thruster_pwm import pulsed
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState
from wakewise.learning.task import StationKeepingTask, checked_actions, draw_episode, reward
from wakewise.operation import Parts, Scenario
from wakewise.robot.vehicles import Vehicle
from wakewise.simulation.tank import Tank

Observation = NDArray[np.float32]

WASH_EVERY_S = 0.05
"""How often the water's speed is taken: the time step of the tank's water."""


class StationKeepingEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A vehicle in the simulated tank holds a pose in front of the target; see `wakewise.learning.task`.

    Observations come from the tank's sensors and the state estimator (EKF) of a trial. Reward and `info` come from the
    truth: the wash is the velocity that the vehicle adds to the tank's water at the task's points. Thrusts in the dead
    zone are sent as pulses, as for every method. The bed is clean of silt.
    """

    def __init__(self, task: StationKeepingTask | None = None) -> None:
        self.task = StationKeepingTask() if task is None else task
        self._bound = self.task.observation_bounds()
        bound, n = self._bound.astype(np.float32), len(self.task.robot.thrusters)
        self.observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n,), dtype=np.float32)
        self._flight: _Flight | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Draw an episode: goal, start, current, the true vehicle, the noise of sensors and water."""
        super().reset(seed=seed, options=options)
        self._flight = _Flight(self.task, self.np_random)
        return self._observation(self._flight), self._info(self._flight)

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for one step; see `wakewise.learning.task` for what is returned.

        Raises InputError if there was no reset, the shape differs, or the action is not finite.
        """
        if self._flight is None:
            raise InputError("step: the environment was not reset, call reset first")
        flight = self._flight
        flight.step(checked_actions(action, self.action_space.shape or ()))
        left_s = np.array([self.task.episode_s - flight.elapsed * self.task.dt_s])
        rewards, out = reward(self.task, flight.figures()[None], np.maximum(left_s, 0.0))
        truncated = flight.elapsed >= self.task.steps and not out[0]
        return self._observation(flight), float(rewards[0]), bool(out[0]), bool(truncated), self._info(flight)

    def _observation(self, flight: _Flight) -> Observation:
        return np.clip(flight.observed(), -self._bound, self._bound).astype(np.float32)

    def _info(self, flight: _Flight) -> dict[str, Any]:
        place, attitude, wash, power = (float(value) for value in flight.figures())
        return {
            "position_error_m": place,
            "attitude_error_rad": attitude,
            "wash_m_s": wash,
            "power_W": power,
            "energy_J": self.task.dt_s * power,
            "collision": flight.tank.collision,
        }


class _Flight:
    """One episode: tank, estimator and thruster model."""

    def __init__(self, task: StationKeepingTask, rng: np.random.Generator) -> None:
        target, region = task.scene()
        episode = draw_episode(task, target.centre_W_m, rng)
        self.task, self.centre, self.points = task, target.centre_W_m, region.points_W_m
        self.weights, self.goal = region.weights / region.weights.sum(), BodyState(X_WB=episode.goal)
        parts = _parts(task, episode.current_W_m_s, int(rng.integers(2**31))).replace(target=target, start=self.goal)
        plant, _ = parts.world.begin()
        if not isinstance(plant, Tank):
            raise InputError(f"world: {type(plant).__name__}, the environment needs the tank")
        self.tank, self.estimator = plant, parts.estimator
        self.memory = self.estimator.init(self.goal)
        self.estimate: BodyState = self.goal
        n, self.elapsed = len(task.robot.thrusters), 0
        self.action, self.running, self.owed = np.zeros(n), np.zeros(n), np.zeros(n)
        self.every, self.wash = max(1, round(WASH_EVERY_S / task.dt_s)), 0.0

    def step(self, action: Array) -> None:
        task, robot = self.task, self.task.robot
        self.action = action
        sent = self._pulses(robot, action * task.max_thrust_N)
        measured = self.tank.step(sent, task.dt_s)
        self.memory, self.estimate = self.estimator.step(self.memory, task.dt_s, measured, sent)
        self.elapsed += 1
        if self.elapsed % self.every == 0:
            speeds = np.asarray(self.tank.excess_velocity(self.points))
            self.wash = float(np.sqrt(self.weights @ (speeds**2).sum(axis=1)))

    def _pulses(self, robot: Vehicle, desired_N: Array) -> Array:
        if robot.thrust_steps is None:
            return desired_N
        self.running, self.owed, sent = pulsed(
            self.running, self.owed, desired_N, self.task.dt_s, robot.thrust_steps, robot.time_constants_s
        )
        return np.clip(sent, robot.thrust_lower_N, robot.thrust_upper_N)

    def figures(self) -> Array:
        """Errors of position and attitude, wash and power, true."""
        errors = _errors(self.tank.state, self.goal)
        return np.array([np.linalg.norm(errors[:3]), np.linalg.norm(errors[3:]), self.wash, self.tank.power_W])

    def observed(self) -> Array:
        """Observation by the estimate."""
        estimate, X_WB = self.estimate, self.estimate.X_WB
        towards = (self.centre - X_WB.p_m) @ X_WB.R
        return np.concatenate([_errors(estimate, self.goal), estimate.nu_B, estimate.load_B, self.action, towards])


def _errors(state: BodyState, goal: BodyState) -> Array:
    """Position of the goal from the vehicle and rotation vector to its attitude, shape (6,), in B."""
    turn = rotvec_from_quat(quat_multiply(quat_conjugate(state.X_WB.q), goal.X_WB.q))
    return np.concatenate([(goal.X_WB.p_m - state.X_WB.p_m) @ state.X_WB.R, turn])


def _parts(task: StationKeepingTask, current_W_m_s: Array, seed: int) -> Parts:
    """Parts of a flight in the tank with the task's mismatch and current; their route and pilot are not flown."""
    mismatch = {f"tank.mismatch.{name}": value for name, value in task.mismatch.items()}
    settings: dict[str, Any] = {
        "vehicle": task.vehicle,
        "seed": seed,
        "tank.size_m": [6.0, 5.0, task.depth_m],
        "tank.current.velocity_m_s": [float(speed) for speed in current_W_m_s],
        "tank.silt.load_kg_m2": 0.0,
        "tank.mismatch.trim_range_N": task.trim_N,
        "control.rate_hz": task.rate_hz,
    }
    return Scenario().replace(**settings, **mismatch).parts()

"""Policies on observations, rollouts, and training by evolution strategies."""

import re
from pathlib import Path

import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from wakewise.allocation import min_norm_allocation
from wakewise.control import ControlSettings, make_pid, vehicle_layout
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import BodyState, Goal
from wakewise.learning import (
    DpPolicy,
    ResidualPolicy,
    StationKeepingEnv,
    StationKeepingTask,
    StationKeepingVectorEnv,
    rollout,
    train,
)

SHORT = StationKeepingTask(episode_s=0.3, points=12)


def test_dp_on_observations_is_the_method_dp():
    """Over thirty steps thrusts are those of the PID and the pseudo-inverse for the same states."""
    task, rng = StationKeepingTask(), np.random.default_rng(0)
    policy, pid = DpPolicy(task), make_pid(task.robot, ControlSettings())
    goal = Goal(X_WB=Pose(np.array([1.0, 0.5, 1.2]), quat_from_euler(0.0, 0.0, 2.0)))
    layout, memory, state = vehicle_layout(task.robot), policy.init(1), pid.init()
    for _ in range(30):
        turn, nu, load = 0.1 * rng.standard_normal(3), 0.02 * rng.standard_normal(6), 0.1 * rng.standard_normal(6)
        q_WB = quat_multiply(goal.X_WB.q, quat_from_rotvec(-turn))
        X_WB = Pose(goal.X_WB.p_m + 0.01 * rng.standard_normal(3), q_WB)
        state, wrench = pid.wrench(state, 0.02, BodyState(X_WB=X_WB, nu_B=nu, load_B=load), goal)
        expected = min_norm_allocation(layout, wrench).thrusts_N
        seen = np.concatenate([(goal.X_WB.p_m - X_WB.p_m) @ X_WB.R, turn, nu, load, np.zeros(11)])
        memory, actions = policy.act(memory, seen[None])
        np.testing.assert_allclose(10.0 * actions[0], expected, atol=1e-9)


def test_dp_shrinks_thrusts_alike_where_it_is_limited():
    """No action exceeds 1, the direction of the wrench is kept, and the integral rests."""
    policy = DpPolicy(SHORT)
    seen = np.zeros((1, 29))
    seen[0, 0] = 2.0
    memory, actions = policy.act(policy.init(1), seen)
    wrench = SHORT.robot.allocation_matrix @ actions[0]
    assert np.abs(actions).max() == pytest.approx(1.0) and wrench[0] > 0.0
    assert np.abs(wrench[1:]).max() < 0.1 * wrench[0]
    assert np.array_equal(policy.act(memory, seen)[0], memory)


def test_the_untrained_network_is_dp():
    """Its output is zero before training."""
    task = SHORT
    policy, dp = ResidualPolicy(task, ResidualPolicy.start(task, np.random.default_rng(0))), DpPolicy(task)
    seen = 0.01 * np.random.default_rng(1).standard_normal((4, 29))
    assert np.array_equal(policy.act(policy.init(4), seen)[1], dp.act(dp.init(4), seen)[1])


def test_stacked_networks_fly_their_own_vehicles():
    """Of m networks and n vehicles, network k flies vehicles k n / m and on, as it does alone."""
    rng = np.random.default_rng(0)
    size = len(ResidualPolicy.start(SHORT, rng))
    parameters, seen = rng.standard_normal((2, size)), 0.01 * rng.standard_normal((6, 29))
    both = ResidualPolicy(SHORT, parameters)
    acted = both.act(both.init(6), seen)[1]
    for k in range(2):
        alone = ResidualPolicy(SHORT, parameters[k])
        np.testing.assert_allclose(alone.act(alone.init(3), seen[3 * k : 3 * k + 3])[1], acted[3 * k : 3 * k + 3])
    with pytest.raises(InputError, match="parameters: shape"):
        ResidualPolicy(SHORT, np.zeros(3))


def test_a_rollout_adds_up_one_episode():
    """Its return is the sum of rewards until the first end; later rewards do not count."""
    env, policy = StationKeepingVectorEnv(3, SHORT), DpPolicy(SHORT)
    figures = rollout(env, policy, seed=1)
    seen, _ = env.reset(seed=1)
    memory, total = policy.init(3), np.zeros(3)
    for _ in range(15):
        memory, actions = policy.act(memory, seen)
        seen, rewards, *_ = env.step(actions)
        total += rewards
    assert np.array_equal(figures["return"], total) and figures["steps"].tolist() == [15.0] * 3


def test_a_rollout_flies_the_tank_too():
    """Several tanks in a `SyncVectorEnv` give the same figures by name."""
    task = StationKeepingTask(episode_s=0.1, points=12)
    figures = rollout(SyncVectorEnv([lambda: StationKeepingEnv(task)] * 2), DpPolicy(task), seed=1)
    assert figures["steps"].tolist() == [5.0, 5.0] and np.all(figures["return"] < 0.0)


@pytest.mark.slow
def test_a_few_generations_beat_dp():
    """Thirty generations of short episodes raise the mean return on episodes that were not trained on."""
    task = StationKeepingTask(episode_s=3.0, points=20)
    parameters = train(StationKeepingVectorEnv(256, task), np.random.default_rng(0), generations=30, episodes=8)
    env = StationKeepingVectorEnv(128, task)
    dp, learned = (rollout(env, policy, seed=9) for policy in (DpPolicy(task), ResidualPolicy(task, parameters)))
    assert learned["return"].mean() > dp["return"].mean()


def test_training_is_reproduced_by_its_seed_and_stops_at_its_budget():
    """Same generator, same parameters; without time it returns the start."""
    env = StationKeepingVectorEnv(8, StationKeepingTask(episode_s=0.1, points=12))
    one, two = (train(env, np.random.default_rng(0), generations=2, episodes=2) for _ in range(2))
    assert np.array_equal(one, two)
    none = train(env, np.random.default_rng(0), generations=2, episodes=2, budget_s=0.0)
    assert np.array_equal(none, ResidualPolicy.start(env.task, np.random.default_rng(0)))


def test_the_python_of_docs_learning_runs(capsys):
    """Pasted, it flies `dp` and prints a return below zero."""
    page = (Path(__file__).parents[2] / "docs" / "learning.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(shown, {})
    assert float(capsys.readouterr().out.split()[0]) < 0.0

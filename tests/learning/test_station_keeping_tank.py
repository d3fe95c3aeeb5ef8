"""The environment of one vehicle in the tank, and both by their Gymnasium ids."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from wakewise.core.errors import InputError
from wakewise.learning import DpPolicy, StationKeepingEnv, StationKeepingTask, StationKeepingVectorEnv

SHORT = StationKeepingTask(episode_s=0.5, points=12)


def test_the_tank_passes_the_check_of_gymnasium():
    """`check_env` has nothing to say, warnings included."""
    check_env(StationKeepingEnv(SHORT), skip_render_check=True)


def test_environments_are_made_by_their_ids():
    """`gymnasium.make` and `gymnasium.make_vec` give ours; observations have one layout in both."""
    one = gymnasium.make("wakewise/StationKeeping-v0", task=SHORT)
    many = gymnasium.make_vec("wakewise/StationKeepingJet-v0", num_envs=3, task=SHORT)
    assert isinstance(one.unwrapped, StationKeepingEnv) and isinstance(many.unwrapped, StationKeepingVectorEnv)
    assert one.observation_space == many.single_observation_space and one.action_space == many.single_action_space
    assert many.num_envs == 3


def test_a_seed_reproduces_the_tank_and_an_episode_is_truncated():
    """Same seed, same actions, same observations and rewards; the episode ends after its steps."""
    env, rows = StationKeepingEnv(SHORT), []
    for _ in range(2):
        seen, _ = env.reset(seed=5)
        row = [seen]
        for k in range(1, 26):
            seen, gained, terminated, truncated, _ = env.step(np.full(8, 0.2, dtype=np.float32))
            row += [seen, gained]
            assert not terminated and truncated == (k == 25)
        rows.append(np.hstack(row))
    assert np.array_equal(*rows)


def test_thrusts_are_felt_by_the_water_of_the_tank():
    """At rest there is no wash; jets make some, and cost power."""
    env = StationKeepingEnv(StationKeepingTask(episode_s=1.5, points=12, current_m_s=0.0))
    _, start = env.reset(seed=2)
    assert start["wash_m_s"] == 0.0 and start["power_W"] == 0.0
    for _ in range(60):
        info = env.step(np.ones(8, dtype=np.float32) * 0.5)[4]
    assert info["wash_m_s"] > 1e-4 and info["power_W"] > 1.0


def test_dp_holds_its_place_in_the_tank():
    """Two seconds after the start, the error is below 4 cm; the observed error agrees to 2 cm."""
    env = StationKeepingEnv(StationKeepingTask(episode_s=2.0, points=12))
    policy = DpPolicy(env.task)
    seen, _ = env.reset(seed=1)
    memory = policy.init(1)
    for _ in range(100):
        memory, actions = policy.act(memory, seen[None])
        seen, _, _, _, info = env.step(actions[0])
    assert info["position_error_m"] < 0.04
    assert abs(np.linalg.norm(seen[:3]) - info["position_error_m"]) < 0.02


@pytest.mark.parametrize(
    ("given", "said"),
    [(np.zeros(7), r"action: shape \(7,\), allowed \(8,\)"), (np.full(8, np.inf), "action: holds NaN or infinity")],
)
def test_wrong_actions_are_refused(given, said):
    """Shape and value are named."""
    env = StationKeepingEnv(SHORT)
    with pytest.raises(InputError, match="call reset first"):
        env.step(np.zeros(8))
    env.reset(seed=1)
    with pytest.raises(InputError, match=said):
        env.step(given)

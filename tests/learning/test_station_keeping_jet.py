"""The vector environment: batched dynamics, a jet model, episodes that end and begin anew."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.learning import StationKeepingTask, StationKeepingVectorEnv
from wakewise.learning import vector_env as module
from wakewise.learning.task import OUT_OF_RANGE_M, reward
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import compile_body, step_rk4
from wakewise.wake import velocity, wake_model

SHORT = StationKeepingTask(episode_s=0.1, points=12)


def flown(count, seed, steps=5, task=SHORT):
    """Observations, rewards and errors of some steps under drawn actions."""
    env, rng = StationKeepingVectorEnv(count, task), np.random.default_rng(7)
    seen, _ = env.reset(seed=seed)
    rows = [(seen, np.zeros(count))]
    for _ in range(steps):
        seen, rewards, *_ = env.step(rng.uniform(-1.0, 1.0, (count, 8)))
        rows.append((seen, rewards))
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("wake", ["jet", "paper"])
def test_one_vehicle_moves_as_the_single_dynamics_and_washes_as_the_wake_model(wake):
    """Motion, wash, power, errors and observation of a batch of one are those of the readable twin."""
    task = StationKeepingTask(episode_s=0.4, points=12, wake=wake)
    env = StationKeepingVectorEnv(1, task)
    env.reset(seed=4)  # of a start from which these thrusts blow at the target
    robot, case, drawn = task.robot, env._case, module._drawn(task)[int(env._which[0])]
    body, action = compile_body(drawn), np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.2, 0.5, -0.1])
    state, motors, goal = env._states[0].copy(), np.zeros(8), Pose(env._goals[0, :3], env._goals[0, 3:])
    p, q, nu = state[:3], state[3:7], state[7:]
    model, areas, speeds = wake_model(wake), np.array(robot.disk_areas_m2), []
    for _ in range(10):
        _, rewards, _, _, infos = env.step(action[None])
        for _ in range(2):
            turned = 10.0 * action + np.exp(-0.01 / robot.time_constants_s) * (motors - 10.0 * action)
            thrusts = drawn.thrust_gains * 0.5 * (motors + turned)
            p, q, nu = step_rk4(body, p, q, nu, robot.allocation_matrix @ thrusts, env._currents[0], 0.01)
            motors = turned
        thrusts, X_WB = drawn.thrust_gains * motors, Pose(p, q)
        places = (X_WB.apply(robot.thruster_positions_B_m), robot.thruster_axes_B @ X_WB.R.T)
        water = velocity(model, case.points, *places, areas, thrusts)
        errors = np.concatenate([(goal.p_m - p) @ X_WB.R, rotvec_from_quat(quat_multiply(quat_conjugate(q), goal.q))])
        expected = np.array(
            [
                np.linalg.norm(errors[:3]),
                np.linalg.norm(errors[3:]),
                np.sqrt(case.weights @ (water**2).sum(axis=1)),
                electrical_power_W(thrusts, areas).sum(),
            ]
        )
        np.testing.assert_allclose(env._figures[0], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(env._observed[0, :6], errors, atol=1e-12)
        np.testing.assert_allclose(env._observed[0, 18:], (case.centre - p) @ X_WB.R, atol=1e-12)
        assert rewards[0] == pytest.approx(reward(task, expected[None], np.zeros(1))[0][0], rel=1e-9)
        speeds.append(infos["wash_m_s"][0])
    assert max(speeds) > 0.0


def test_a_vehicle_does_not_depend_on_the_others():
    """The motion of a vehicle in a batch is that of the same vehicle alone, to the last bit."""
    many, one = StationKeepingVectorEnv(70, SHORT), StationKeepingVectorEnv(1, SHORT)
    many.reset(seed=1)
    one.reset(seed=2)
    for name in ("_which", "_goals", "_currents", "_states"):
        getattr(one, name)[:] = getattr(many, name)[69:]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (70, 8))
    for _ in range(4):
        many.step(actions)
        one.step(actions[69:])
    assert np.array_equal(many._states[69], one._states[0])


def test_a_vehicle_whose_thrusters_are_off_washes_nothing():
    """Without thrust, wash and power are zero, and the reward is that of the errors."""
    env = StationKeepingVectorEnv(8, SHORT)
    env.reset(seed=1)
    _, rewards, _, _, infos = env.step(np.zeros((8, 8)))
    assert not infos["wash_m_s"].any() and not infos["power_W"].any()
    cost = np.minimum((infos["position_error_m"] / 0.02) ** 2 + (infos["attitude_error_rad"] / 0.05) ** 2, 25.0)
    np.testing.assert_allclose(rewards, -0.02 * cost)


def test_more_wash_and_more_power_cost_more():
    """The reward falls in each of its four figures."""
    least = np.array([[0.01, 0.02, 0.001, 5.0]])
    costs = [reward(SHORT, least + step, np.zeros(1))[0][0] for step in 0.001 * np.vstack([np.zeros(4), np.eye(4)])]
    assert all(cost < costs[0] for cost in costs[1:])


def test_an_early_end_never_pays():
    """The step that terminates costs as much as the largest errors until the end of the episode."""
    rewards, out = reward(SHORT, np.array([[OUT_OF_RANGE_M + 0.1, 0.0, 0.0, 0.0]]), np.array([4.0]))
    assert out[0] and rewards[0] == pytest.approx(-25.0 * (4.0 + 0.02))


def test_a_seed_reproduces_an_environment():
    """The same seed and actions give the same observations and rewards; another seed gives others."""
    first, again, other = flown(3, 1), flown(3, 1), flown(3, 2)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0], other[0])


def test_an_environment_that_is_done_is_reset_by_the_next_step():
    """Truncation after an episode's steps; the next step gives a start, whatever its action, with reward 0."""
    env = StationKeepingVectorEnv(2, SHORT)
    env.reset(seed=1)
    for k in range(1, 6):
        _, _, terminated, truncated, _ = env.step(np.full((2, 8), 0.1))
        assert not terminated.any() and truncated.all() == (k == 5)
    before = env._goals.copy()
    seen, rewards, terminated, truncated, _ = env.step(np.ones((2, 8)))
    assert not rewards.any() and not terminated.any() and not truncated.any()
    assert not np.array_equal(env._goals, before) and not env._motors.any() and not seen[:, 18:26].any()
    assert env.step(np.zeros((2, 8)))[1].all()


def test_only_the_environment_that_is_done_is_reset():
    """A vehicle out of range is terminated and begins anew; the other goes on."""
    env = StationKeepingVectorEnv(2, StationKeepingTask(episode_s=1.0, points=12))
    env.reset(seed=1)
    env._states[0, 0] += 2.0
    _, rewards, terminated, truncated, _ = env.step(np.zeros((2, 8)))
    assert terminated.tolist() == [True, False] and not truncated.any() and rewards[0] < -24.0
    goals = env._goals.copy()
    env.step(np.zeros((2, 8)))
    assert not np.array_equal(env._goals[0], goals[0]) and np.array_equal(env._goals[1], goals[1])
    assert env._elapsed.tolist() == [0, 2]


def test_policies_can_meet_the_same_episodes():
    """With m episodes, environment k has episode k mod m."""
    env = StationKeepingVectorEnv(6, SHORT)
    env.reset(seed=1, options={"episodes": 2})
    for name in ("_which", "_goals", "_currents", "_states", "_bias"):
        rows = getattr(env, name)
        assert np.array_equal(rows[:2], rows[2:4]) and np.array_equal(rows[:2], rows[4:])
    assert not np.array_equal(env._goals[0], env._goals[1])


def test_the_observed_load_becomes_that_of_current_and_trim():
    """Held fast for three seconds, the observed load is near the wrench that the nominal vehicle does not explain."""
    task = StationKeepingTask(
        episode_s=10.0, points=12, mass_pct=0.0, damping_pct=0.0, added_mass_pct=0.0, thrust_pct=0.0
    )
    env = StationKeepingVectorEnv(1, task)
    env.reset(seed=4)
    env._currents[0] = 0.0
    trim_N = 1000.0 * 9.80665 * (module._drawn(task)[int(env._which[0])].displaced_volume_m3 - 0.0045)
    for _ in range(150):
        env.step(np.zeros((1, 8)))
    assert env._loads[0, 2] == pytest.approx(-trim_N * (1.0 - np.exp(-3.0)), rel=0.1, abs=0.02)


def test_observations_lie_within_their_space():
    """Observations are float32 within the bounds, also of a vehicle that is far off."""
    env = StationKeepingVectorEnv(4, SHORT)
    seen, _ = env.reset(seed=1)
    assert seen in env.observation_space
    env._states[:, 0] += 100.0
    assert env.step(np.zeros((4, 8)))[0] in env.observation_space


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros((3, 8)), r"action: shape \(3, 8\), allowed \(2, 8\)"),
        (np.zeros(8), r"action: shape \(8,\), allowed \(2, 8\)"),
        (np.full((2, 8), np.nan), "action: holds NaN or infinity"),
    ],
)
def test_wrong_actions_are_refused_in_one_line(given, said):
    """Shape and value are named."""
    env = StationKeepingVectorEnv(2, SHORT)
    env.reset(seed=1)
    with pytest.raises(InputError, match=said) as refusal:
        env.step(given)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: StationKeepingVectorEnv(0), "num_envs"),
        (lambda: StationKeepingVectorEnv(2, StationKeepingTask(wake="learned")), "wake: 'learned'"),
        (lambda: StationKeepingTask(max_thrust_N=90.0), "max_thrust_N: 90"),
        (lambda: StationKeepingTask(episode_s=0.0), "episode_s"),
        (lambda: StationKeepingTask(standoff_m=(0.9, 0.6)), "standoff_m: from 0.9 to 0.6"),
        (lambda: StationKeepingVectorEnv(2).step(np.zeros((2, 8))), "call reset first"),
        (lambda: StationKeepingVectorEnv(2).reset(seed=[1, 2]), "seed: a list of 2"),
        (lambda: StationKeepingVectorEnv(4).reset(options={"episodes": 3}), "episodes: 3"),
    ],
)
def test_wrong_settings_are_refused(make, said):
    """The message names the field and the value."""
    with pytest.raises(InputError, match=said):
        make()

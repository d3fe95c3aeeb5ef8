"""An operator's command as a goal: at the vehicle's place, moving as asked, looking where asked."""

import numpy as np
import pytest

from wakewise.control.velocity_reference import (
    LEASH_M,
    VelocityCommand,
    advance_reference,
    goal_of,
    limit_acceleration,
    limit_jerk,
    scaled_tracking,
)
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.planning import PlanSettings
from wakewise.planning.problem import reference_of

HERE = BodyState(X_WB=Pose(np.array([0.5, -0.2, 1.0]), quat_from_euler(0.1, -0.2, 2.0)))


def test_the_target_is_where_the_vehicle_will_be_at_the_commanded_velocity():
    """p_target = p_now + v_des T, whatever the attitude."""
    velocity = np.array([0.08, -0.03, 0.02])
    goal = goal_of(VelocityCommand(velocity_W_m_s=velocity, heading_rad=1.0), HERE.X_WB.p_m)
    reference = reference_of(goal, 20, 0.1)
    np.testing.assert_allclose(reference[-1, :3], HERE.X_WB.p_m + 2.0 * velocity, atol=1e-12)


def test_the_watched_point_stays_ahead_while_the_goal_moves():
    """A tenth of a second on, the goal's forward axis still points at it, to second order."""
    watch = np.array([0.0, 0.0, 1.4])
    goal = goal_of(VelocityCommand(velocity_W_m_s=np.array([0.0, 0.1, 0.0]), watch_W_m=watch), HERE.X_WB.p_m)
    later = reference_of(goal, 1, 0.1)[-1]
    ahead = Pose(later[:3], later[3:7]).R[:, 0]
    sight = (watch - later[:3]) / np.linalg.norm(watch - later[:3])
    assert np.arccos(np.clip(ahead @ sight, -1.0, 1.0)) < 2e-4
    np.testing.assert_allclose(goal.X_WB.R @ goal.nu_B[:3], [0.0, 0.1, 0.0], atol=1e-12)


def test_obedience_scales_all_weights_of_tracking():
    """5 is the planner's own setting; 20 is four times as strict and leaves the other weights alone."""
    plan = PlanSettings()
    assert scaled_tracking(plan, 5.0) == plan
    strict = scaled_tracking(plan, 20.0)
    assert strict.w_track == pytest.approx(4.0 * plan.w_track) and strict.w_path == pytest.approx(4.0 * plan.w_path)
    assert strict.w_attitude == plan.w_attitude and strict.w_change == plan.w_change


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_an_obedience_that_means_nothing_is_refused(bad):
    """Zero, negative, not finite."""
    with pytest.raises(InputError, match="w_track"):
        scaled_tracking(PlanSettings(), bad)


def test_a_command_is_reached_at_bounded_acceleration():
    """Never faster than allowed, and there in the end."""
    v, desired = np.zeros(3), np.array([0.1, 0.0, -0.05])
    for _ in range(200):
        new = limit_acceleration(v, desired, 0.02, 0.1)
        assert np.linalg.norm(new - v) <= 0.1 * 0.02 + 1e-12
        v = new
    np.testing.assert_allclose(v, desired)


def test_the_commanded_place_waits_for_a_vehicle_that_is_held_up():
    """It moves as commanded while the vehicle follows, and never farther than the leash from one that does not."""
    place, velocity = HERE.X_WB.p_m, np.array([0.1, 0.0, 0.0])
    np.testing.assert_allclose(advance_reference(place, velocity, HERE, 0.02), place + 0.02 * velocity)
    for _ in range(200):
        place = advance_reference(place, velocity, HERE, 0.02)
    assert np.linalg.norm(place - HERE.X_WB.p_m) == pytest.approx(LEASH_M)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_shaped_velocity_keeps_both_bounds_and_arrives(seed):
    """Commands that change at random: acceleration and jerk stay within bounds, and a command that stays is reached."""
    rng, dt_s, hardest, jerk = np.random.default_rng(seed), 0.02, 0.2, 0.8
    v, a, desired = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in range(600):
        if k < 300 and k % 15 == 0:
            desired = rng.uniform(-0.3, 0.3, 3)
        before, (v, new) = v, limit_jerk(v, a, desired, dt_s, hardest, jerk)
        assert np.linalg.norm(v - before) <= hardest * dt_s * (1.0 + 1e-9)
        assert np.linalg.norm(new - a) <= jerk * dt_s * (1.0 + 1e-6)
        a = new
    assert np.array_equal(v, desired) and not a.any()


def test_a_shaped_velocity_does_not_overshoot():
    """From rest to 0.1 m/s it grows and stays there, but for the twentieth of a millimetre a second of a last step."""
    v, a, desired, way = np.zeros(3), np.zeros(3), np.array([0.1, 0.0, 0.0]), [0.0]
    for _ in range(60):
        v, a = limit_jerk(v, a, desired, 0.02, 0.2, 0.8)
        way.append(v[0])
    assert np.all(np.diff(way) > -5e-5) and max(way) < 0.1 + 5e-5 and way[-1] == 0.1

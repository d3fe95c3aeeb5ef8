"""The tracker's wrench: signs, frames, feed-forward and an integral that does not wind up."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.control import ControlSettings, make_pid
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import acceleration, coriolis_wrench, damping_wrench, load_vehicle, restoring_wrench

VEHICLE = load_vehicle("paper")
TRACKER = make_pid(VEHICLE, ControlSettings())


def plain_wrench(tracker, dt, estimate, goal, force_W, moment_B):
    """The PID as it is written on paper, in the same order of arguments as its parts."""
    R_WB, R_WG = estimate.X_WB.R, goal.X_WB.R
    R_BG = R_WB.T @ R_WG
    conjugate = estimate.X_WB.q * np.array([1.0, -1.0, -1.0, -1.0])
    error = np.r_[R_WB.T @ (goal.X_WB.p_m - estimate.X_WB.p_m), rotvec_from_quat(quat_multiply(conjugate, goal.X_WB.q))]
    twist = np.r_[R_BG @ goal.nu_B[:3], R_BG @ goal.nu_B[3:]]
    feed = -restoring_wrench(tracker.body, goal.X_WB.q)
    bend = coriolis_wrench(tracker.body, twist)
    feed = np.r_[R_BG @ feed[:3], feed[3:]] - damping_wrench(tracker.body, twist) - bend
    integral = np.r_[R_WB.T @ force_W, moment_B] + tracker.ki * error * dt
    integral = np.clip(integral, -tracker.integral_limit, tracker.integral_limit)
    return tracker.kp * error + tracker.kd * (twist - estimate.nu_B) + feed + integral, integral


def random_case(rng):
    def pose():
        q = rng.normal(size=4)
        return Pose(rng.normal(size=3), q)

    return BodyState(X_WB=pose(), nu_B=rng.normal(size=6)), Goal(X_WB=pose(), nu_B=rng.normal(size=6))


def test_the_kernel_equals_its_twin():
    """Any estimate and goal: compiled and written-out PID agree, and the integral is carried in world and body."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        estimate, goal = random_case(rng)
        state, _ = TRACKER.wrench(TRACKER.init(), 0.02, *random_case(rng))
        new, found = TRACKER.wrench(state, 0.02, estimate, goal)
        wrench, integral = plain_wrench(TRACKER, 0.02, estimate, goal, state.force_W_N, state.moment_B_Nm)
        np.testing.assert_allclose(found, wrench, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(new.force_W_N, estimate.X_WB.R @ integral[:3], atol=1e-9)
        np.testing.assert_allclose(new.moment_B_Nm, integral[3:], atol=1e-12)


def test_at_the_goal_only_the_feed_forward_is_left():
    """On the goal, moving as desired, the wrench is just what keeps the twist as it is: no acceleration is left."""
    X, nu = Pose(np.array([1.0, 2.0, 0.5]), quat_from_euler(0.1, -0.3, 1.0)), np.array([0.1, 0, 0, 0, 0, 0.2])
    _, wrench = TRACKER.wrench(TRACKER.init(), 0.02, BodyState(X_WB=X, nu_B=nu), Goal(X_WB=X, nu_B=nu))
    np.testing.assert_allclose(acceleration(TRACKER.body, X.q, nu, wrench, np.zeros(3)), 0.0, atol=1e-12)


@pytest.mark.parametrize("axis", range(6))
def test_the_wrench_points_at_the_goal(axis):
    """A goal displaced or turned along one axis asks for a wrench along that axis, whichever way the vehicle faces."""
    q = quat_from_euler(0.0, 0.0, 2.0)
    step = np.zeros(6)
    step[axis] = 0.01
    turn = np.r_[1.0, 0.5 * step[3:]]
    goal = Goal(X_WB=Pose(matrix_from_quat(q) @ step[:3], quat_multiply(q, turn)))
    still = Goal(X_WB=Pose(np.zeros(3), q))
    here = BodyState(X_WB=Pose(np.zeros(3), q))
    _, wrench = TRACKER.wrench(TRACKER.init(), 0.02, here, goal)
    _, rest = TRACKER.wrench(TRACKER.init(), 0.02, here, still)
    feed = restoring_wrench(TRACKER.body, still.X_WB.q) - restoring_wrench(TRACKER.body, goal.X_WB.q)
    change = wrench - rest - feed
    assert change[axis] > 0.0
    assert np.all(np.abs(np.delete(change, axis)) < 1e-3 * change[axis] + 1e-6)


def test_a_world_force_stays_put_while_the_vehicle_turns():
    """An integral gathered facing north still pushes north when the vehicle faces east."""
    north, east = np.array([1.0, 0, 0, 0]), quat_from_euler(0.0, 0.0, np.pi / 2)
    state = TRACKER.init()
    for _ in range(200):
        state, _ = TRACKER.wrench(
            state, 0.02, BodyState(X_WB=Pose(np.zeros(3), north)), Goal(X_WB=Pose(np.array([0.1, 0, 0]), north))
        )
    turned = BodyState(X_WB=Pose(np.zeros(3), east))
    _, wrench = TRACKER.wrench(state, 0.02, turned, Goal(X_WB=Pose(np.zeros(3), east)))
    np.testing.assert_allclose(matrix_from_quat(east) @ wrench[:3], state.force_W_N, atol=1e-9)
    assert state.force_W_N[0] > 0.5


def test_the_integral_stops_growing_while_saturated_and_may_still_fall():
    """With the allocation cut short the integral holds; an error of the other sign unloads it."""
    level = np.array([1.0, 0, 0, 0])
    here = BodyState(X_WB=Pose(np.zeros(3), level))
    ahead, behind = (Goal(X_WB=Pose(np.array([x, 0, 0]), level)) for x in (0.5, -0.01))
    state, _ = TRACKER.wrench(TRACKER.init(), 0.02, here, ahead)
    held, _ = TRACKER.wrench(state, 0.02, here, ahead, saturated=True)
    assert held.force_W_N[0] == pytest.approx(state.force_W_N[0])
    wound = TRACKER.wrench(state, 1.0, here, ahead)[0]
    unloaded, _ = TRACKER.wrench(wound, 0.02, here, behind, saturated=True)
    assert unloaded.force_W_N[0] < wound.force_W_N[0]


def test_the_integral_is_clamped():
    """However long the error lasts, the integral stays within its share of what the thrusters can do."""
    level = np.array([1.0, 0, 0, 0])
    state = TRACKER.init()
    for _ in range(100):
        state, _ = TRACKER.wrench(
            state, 5.0, BodyState(X_WB=Pose(np.zeros(3), level)), Goal(X_WB=Pose(np.array([1.0, -1.0, 1.0]), level))
        )
    np.testing.assert_allclose(np.abs(state.force_W_N), TRACKER.integral_limit[:3])


@pytest.mark.parametrize("axis", range(6))
def test_a_goal_that_speeds_up_is_followed_by_what_it_takes(axis):
    """On a goal whose twist grows at a steady rate, the wrench gives the vehicle that very rate, without any error."""
    rate = np.zeros(6)
    rate[axis] = 0.02
    X, nu, dt = Pose(np.zeros(3), quat_from_euler(0.05, -0.1, 1.0)), np.zeros(6), 0.02
    state, _ = TRACKER.wrench(TRACKER.init(), dt, BodyState(X_WB=X, nu_B=nu), Goal(X_WB=X, nu_B=nu))
    after = nu + rate * dt
    _, wrench = TRACKER.wrench(state, dt, BodyState(X_WB=X, nu_B=after), Goal(X_WB=X, nu_B=after))
    np.testing.assert_allclose(acceleration(TRACKER.body, X.q, after, wrench, np.zeros(3)), rate, atol=1e-6)


def test_a_ramp_needs_no_integral():
    """Without an integral the lag stays within a tenth of M a / kp, which a ramp leaves without feed-forward."""
    tracker = replace(TRACKER, ki=np.zeros(6))
    level, dt, rate = np.array([1.0, 0, 0, 0]), 0.005, 0.05
    state, x, u, worst = tracker.init(), 0.0, 0.0, 0.0
    for k in range(1000):
        t = k * dt
        goal = Goal(X_WB=Pose(np.array([0.5 * rate * t * t, 0, 0]), level), nu_B=np.array([rate * t, 0, 0, 0, 0, 0]))
        here = BodyState(X_WB=Pose(np.array([x, 0, 0]), level), nu_B=np.array([u, 0, 0, 0, 0, 0]))
        worst = max(worst, abs(goal.X_WB.p_m[0] - x))
        state, wrench = tracker.wrench(state, dt, here, goal)
        u += dt * acceleration(tracker.body, level, here.nu_B, wrench, np.zeros(3))[0]
        x += dt * u
    lag = tracker.body.mass_matrix[0, 0] * rate / tracker.kp[0]
    assert np.all(state.force_W_N == 0.0)
    assert lag > 0.005
    assert worst < 0.1 * lag


def test_a_load_is_held_against_up_to_what_the_thrusters_can_do():
    """Twice the integral's bound is met in full, a load that no thruster could make is not."""
    here = Goal(X_WB=Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), nu_B=np.zeros(6))
    most = TRACKER.load_limit
    reach = np.abs(VEHICLE.allocation_matrix) @ np.minimum(-VEHICLE.thrust_lower_N, VEHICLE.thrust_upper_N)
    assert (most <= reach + 1e-9).all() and most[4] == pytest.approx(reach[4])
    for load, met in ((2.0 * TRACKER.integral_limit, 2.0 * TRACKER.integral_limit), (10.0 * reach, most)):
        calm = BodyState(X_WB=Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), nu_B=np.zeros(6))
        pulled = replace(calm, load_B=load)
        wrench = [TRACKER.wrench(TRACKER.init(), 0.02, estimate, here)[1] for estimate in (calm, pulled)]
        assert wrench[0] - wrench[1] == pytest.approx(met)

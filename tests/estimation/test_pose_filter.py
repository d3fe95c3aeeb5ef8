"""The pose filter alone: its gains, and what it makes of sensors that are noisy, late, silent or broken."""

import numpy as np
import pytest

from wakewise.estimation import FilterSettings, PoseFilter, filter_gains, steady_gain
from wakewise.geometry import Pose, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.interfaces import BodyState, Measurement
from wakewise.vehicles import compile_body, load_vehicle, step_rk4, thruster_lag

VEHICLE = load_vehicle("paper")
BODY = compile_body(VEHICLE)
DT = 0.02


def record(*, seconds, latency_s=0.03, offset_m=0.0, gyro_bias=0.0, noise=1.0, silent=(np.inf, np.inf), settings=None):
    """Fly the nominal vehicle on thrusts that wander, filter its sensors, and return errors per step.

    Columns: position, velocity, attitude, rate (each three), and the final state of the filter beside them.
    """
    rng = np.random.default_rng(0)
    filter_ = PoseFilter(VEHICLE, settings)
    p, q, nu = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0, 0, 0]), np.zeros(6)
    state = filter_.init(BodyState(X_WB=Pose(p + offset_m * np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0), q)))
    thrusts, command, queue, errors, pose_due = np.zeros(8), np.zeros(8), [], [], 1.0 / 62.0
    for k in range(round(seconds / DT)):
        if k % 25 == 0:
            command = rng.normal(size=8) * 0.8
        now = (k + 1) * DT
        for sub in range(4):
            thrusts = thruster_lag(thrusts, command, VEHICLE.time_constants_s, DT / 4)
            p, q, nu = step_rk4(BODY, p, q, nu, VEHICLE.allocation_matrix @ thrusts, np.zeros(3), DT / 4)
            t = k * DT + (sub + 1) * DT / 4
            if t >= pose_due - 1e-9:
                pose_due += 1.0 / 62.0
                turned = quat_multiply(q, quat_from_rotvec(noise * np.radians(0.2) * rng.normal(size=3)))
                seen = Pose(p + noise * 0.002 * rng.normal(size=3), turned)
                if not silent[0] <= t < silent[1]:
                    queue.append((t + latency_s, Measurement(time_s=t, X_WB=seen)))
        arrived = tuple(m for due, m in queue if due <= now + 1e-9)
        queue = [(due, m) for due, m in queue if due > now + 1e-9]
        gyro = nu[3:] + gyro_bias + noise * 0.002 * rng.normal(size=3)
        depth = float(p[2] + noise * 0.005 * rng.normal())
        arrived += (Measurement(time_s=now, omega_B_rad_s=gyro, depth_m=depth),)
        state, estimate = filter_.step(state, DT, arrived, command)
        tilt = rotvec_from_quat(quat_multiply(quat_conjugate(q), estimate.X_WB.q))
        errors.append(np.r_[estimate.X_WB.p_m - p, estimate.nu_B[:3] - nu[:3], tilt, estimate.nu_B[3:] - nu[3:]])
    return np.array(errors), state


def rms(errors):
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def test_steady_gain_is_the_fixed_point_of_the_recursion():
    """Running the Kalman recursion long enough reaches the Riccati solution."""
    F, Q, H, R = np.array([[1.0, 0.1], [0.0, 1.0]]), np.diag([1e-4, 1e-2]), np.array([1.0, 0.0]), 0.04
    gain, P = steady_gain(F, Q, H, R)
    covariance = np.eye(2)
    for _ in range(500):
        K = covariance @ H / (H @ covariance @ H + R)
        covariance = F @ (covariance - np.outer(K, H @ covariance)) @ F.T + Q
    np.testing.assert_allclose(P, covariance, rtol=1e-6)
    np.testing.assert_allclose(gain, covariance @ H / (H @ covariance @ H + R), rtol=1e-6)


@pytest.mark.parametrize("model", ["vehicle", "constant-velocity"])
def test_the_corrections_are_stable(model):
    """Errors of position and of attitude shrink under the steady gains: all eigenvalues lie inside the unit circle."""
    settings = FilterSettings(motion_model=model)
    gains, dt = filter_gains(settings), 1.0 / settings.pose_rate_hz
    size = 3 if model == "vehicle" else 2
    F = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])[:size, :size]
    left = F @ (np.eye(size) - np.outer(gains.move[:size], np.eye(size)[0]))
    turning = np.array([[1.0, -dt], [0.0, 1.0]]) @ (np.eye(2) - np.outer(gains.turn, [1.0, 0.0]))
    assert np.abs(np.linalg.eigvals(left)).max() < 1.0
    assert np.abs(np.linalg.eigvals(turning)).max() < 1.0
    assert 0.0 < gains.gyro < 1.0 and gains.turn[1] < 0.0


def test_better_than_the_raw_poses_and_than_constant_velocity():
    """Position beats the 3.5 mm of a raw pose by half, attitude beats 0.35 deg, and the vehicle's model pays."""
    errors, _ = record(seconds=15.0)
    plain, _ = record(seconds=15.0, settings=FilterSettings(motion_model="constant-velocity"))
    late = errors[250:]
    assert rms(late[:, :3]) < 0.5 * 0.002 * np.sqrt(3.0)
    assert rms(late[:, 3:6]) < 0.015
    assert rms(late[:, 6:9]) < 0.25 * np.radians(0.2) * np.sqrt(3.0)
    assert rms(late[:, 9:]) < 0.006
    assert rms(late[:, :3]) < 0.7 * rms(plain[250:, :3])
    assert rms(late[:, 3:6]) < 0.5 * rms(plain[250:, 3:6])


def test_exact_sensors_and_model_leave_next_to_no_error():
    """Without noise what is left is the age correction's neglect of acceleration."""
    errors, _ = record(seconds=6.0, noise=0.0)
    assert rms(errors[100:, :3]) < 5e-4
    assert rms(errors[100:, 6:9]) < 1e-3


def test_a_start_five_centimetres_off_is_forgotten():
    """Within two seconds the first guess does not matter any more."""
    errors, _ = record(seconds=4.0, offset_m=0.05)
    assert np.linalg.norm(errors[0, :3]) > 0.02
    assert rms(errors[100:, :3]) < 0.003


def test_a_gyro_bias_is_found():
    """0.02 rad/s of bias ends up in the bias estimate and not in attitude or rate."""
    errors, state = record(seconds=30.0, gyro_bias=0.02)
    np.testing.assert_allclose(state.gyro_bias_rad_s, 0.02, atol=0.002)
    assert rms(errors[-500:, 6:9]) < np.radians(0.15)
    assert rms(errors[-500:, 9:]) < 0.006


def test_a_second_without_poses_is_bridged():
    """From 5 to 6 s no pose arrives: the estimate runs on with a few centimetres at most, and then returns."""
    errors, _ = record(seconds=9.0, silent=(5.0, 6.0))
    assert np.abs(errors[250:305, :3]).max() < 0.05
    assert rms(errors[400:, :3]) < 0.003


def test_latency_is_taken_back():
    """A pose 60 ms old, twice the usual, costs less than half as much error again as a fresh one."""
    fresh, _ = record(seconds=10.0, latency_s=0.0)
    late, _ = record(seconds=10.0, latency_s=0.06)
    assert rms(late[200:, :3]) < 1.5 * rms(fresh[200:, :3])


def test_what_is_broken_or_too_old_is_left_out():
    """NaN in gyro, depth or thrusts, and a pose from long ago, change nothing: same estimate as silence."""
    filter_ = PoseFilter(VEHICLE)
    start = filter_.init(BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.0]))))
    old = Measurement(time_s=-5.0, X_WB=Pose(np.array([9.0, 9.0, 9.0])))
    nonsense = Measurement(time_s=0.02, omega_B_rad_s=np.full(3, np.nan), depth_m=float("nan"))
    first, silent = filter_.step(start, DT, (), np.zeros(8))
    second, noisy = filter_.step(start, DT, (old, nonsense), np.full(8, np.nan))
    np.testing.assert_array_equal(silent.X_WB.p_m, noisy.X_WB.p_m)
    np.testing.assert_array_equal(first.mean, second.mean)
    assert np.isfinite(second.mean).all()


def test_without_a_gyro_poses_alone_give_the_rate():
    """A steady turn of 0.3 rad/s seen by poses only is found."""
    filter_ = PoseFilter(VEHICLE, FilterSettings(motion_model="constant-velocity"))
    state = filter_.init(BodyState(X_WB=Pose(np.zeros(3))))
    for k in range(300):
        now = (k + 1) * DT
        pose = Pose(np.zeros(3), quat_from_rotvec(np.array([0.0, 0.0, 0.3 * now])))
        state, estimate = filter_.step(state, DT, (Measurement(time_s=now, X_WB=pose),), np.zeros(8))
    np.testing.assert_allclose(estimate.nu_B[3:], [0.0, 0.0, 0.3], atol=0.01)

"""The filter's compiled steps against geometry's readable functions."""

import numpy as np

from wakewise.estimation.kernels import body_twist, predict, take_depth, take_pose, turn, turn_between, turned_by
from wakewise.geometry import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)

RNG = np.random.default_rng(0)


def unit_quaternion():
    q = RNG.normal(size=4)
    return q / np.linalg.norm(q)


def random_mean():
    mean = RNG.normal(size=19)
    mean[9:13] = unit_quaternion()
    return mean


def test_turning_equals_the_rotation_matrix():
    """Both senses of `turn`, and the body twist built from them, are those of R(q)."""
    for _ in range(20):
        mean = random_mean()
        R, v = matrix_from_quat(mean[9:13]), RNG.normal(size=3)
        np.testing.assert_allclose(turn(mean[9:13], v, 1.0), R @ v, atol=1e-12)
        np.testing.assert_allclose(turn(mean[9:13], v, -1.0), R.T @ v, atol=1e-12)
        np.testing.assert_allclose(body_twist(mean), np.r_[R.T @ mean[3:6], mean[13:16]], atol=1e-12)


def test_turned_by_and_turn_between_are_inverse():
    """Turning q by a rotation vector shorter than pi, and asking for the turn between, gives it back."""
    for size in (1e-14, 1e-6, 0.1, 2.0, 3.1):
        q, v = unit_quaternion(), RNG.normal(size=3)
        v *= size / np.linalg.norm(v)
        other = turned_by(q, v)
        np.testing.assert_allclose(other, quat_multiply(q, quat_from_rotvec(v)), atol=1e-12)
        np.testing.assert_allclose(turn_between(q, -other), v, atol=1e-9)
        np.testing.assert_allclose(
            turn_between(q, other), rotvec_from_quat(quat_multiply(quat_conjugate(q), other)), atol=1e-12
        )


def test_prediction_is_uniform_acceleration_in_the_world():
    """With the twist's rate -omega x v the body coasts: position and velocity follow the unmodelled part alone."""
    mean = random_mean()
    before, dt = mean.copy(), 0.02
    v_B = turn(mean[9:13], mean[3:6], -1.0)
    rate = np.r_[-np.cross(mean[13:16], v_B), np.zeros(3)]
    predict(mean, rate, dt, np.zeros(3), False, 0.5)
    np.testing.assert_allclose(mean[3:6], before[3:6] + before[6:9] * dt, atol=1e-12)
    np.testing.assert_allclose(mean[:3], before[:3] + before[3:6] * dt + before[6:9] * dt**2 / 2, atol=1e-12)
    np.testing.assert_allclose(mean[9:13], turned_by(before[9:13], before[13:16] * dt), atol=1e-12)


def test_a_late_measurement_is_compared_with_the_past():
    """What a vehicle at constant velocity and rate was measured to be 0.1 s ago leaves a right estimate alone."""
    mean = random_mean()
    before, age = mean.copy(), 0.1
    p_then, q_then = mean[:3] - age * mean[3:6], turned_by(mean[9:13], -age * mean[13:16])
    take_pose(mean, p_then, q_then, age, np.array([0.3, 2.0, 1.0]), np.array([0.2, -0.1]), 0.4, np.zeros(3))
    take_depth(mean, float(p_then[2]), age, np.array([0.3, 2.0, 1.0]), np.zeros(3))
    np.testing.assert_allclose(mean, before, atol=1e-9)


def test_gains_of_one_take_the_measurement_as_it_is():
    """With unit gains and no age the estimate becomes the measured pose."""
    mean, p, q = random_mean(), RNG.normal(size=3), unit_quaternion()
    take_pose(mean, p, q, 0.0, np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0]), 0.0, np.zeros(3))
    np.testing.assert_allclose(mean[:3], p, atol=1e-12)
    np.testing.assert_allclose(np.abs(mean[9:13] @ q), 1.0, atol=1e-12)

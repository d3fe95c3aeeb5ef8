"""Each kind of measurement corrects mean and covariance as a readable twin does, and beyond the gate not at all."""

import numpy as np
import pytest
from estimation_helpers import (
    ALLOCATION,
    ERRORS,
    PACKED,
    REST,
    difference,
    moved,
    random_covariance,
    random_mean,
    unit_quaternion,
)

from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.geometry import matrix_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.estimation.corrections import NOTHING, correct, correct_by_force, correct_by_pose, correct_by_sum
from wakewise.estimation.eskf_kernels import GAINS, GYRO, specific_force


def test_correction_is_the_kalman_update():
    """Mean and covariance after a correction are those of the information form; beyond the gate nothing changes."""
    rng = np.random.default_rng(0)
    mean, root = random_mean(rng), 0.1 * rng.normal(size=(ERRORS, ERRORS))
    P, H = root @ root.T + 1e-3 * np.eye(ERRORS), rng.normal(size=(3, ERRORS))
    R, residual = 0.01 * np.eye(3), 0.01 * rng.normal(size=3)
    expected_P = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
    change = expected_P @ H.T @ np.linalg.inv(R) @ residual
    found_mean, found_P = mean.copy(), P.copy()
    distance = correct(found_mean, found_P, H, residual, 0.1, np.inf)
    np.testing.assert_allclose(found_P, expected_P, atol=1e-9)
    np.testing.assert_allclose(difference(found_mean, mean), change, atol=1e-9)
    np.testing.assert_allclose(distance, residual @ np.linalg.solve(H @ P @ H.T + R, residual), rtol=1e-9)
    kept_mean, kept_P = mean.copy(), P.copy()
    assert correct(kept_mean, kept_P, H, residual, 0.1, 0.5 * distance) == distance
    np.testing.assert_array_equal(kept_mean, mean)
    np.testing.assert_array_equal(kept_P, P)
    np.testing.assert_array_equal(found_P, found_P.T)


def updated(mean, P, H, residual, std):
    """Readable twin: gain, mean and covariance by the textbook."""
    S = H @ P @ H.T + np.diag(np.broadcast_to(std, len(H)) ** 2)
    K = P @ H.T @ np.linalg.inv(S)
    return moved(mean, K @ residual), P - K @ S @ K.T, residual @ np.linalg.solve(S, residual)


def selecting(first, second, size):
    H = np.zeros((size, ERRORS))
    for i in range(size):
        H[i, first + i] = 1.0
        if second != NOTHING:
            H[i, second + i] = 1.0
    return H


@pytest.mark.parametrize(("first", "second", "size"), [(0, NOTHING, 3), (0, GAINS, 3), (2, GAINS + 4, 1), (9, GYRO, 3)])
def test_a_sum_of_two_errors_is_taken_as_the_textbook_has_it(first, second, size):
    """A place, a depth, a rate, with a slow error or without: the same as with the Jacobian written out."""
    rng = np.random.default_rng(0)
    mean, P, H = random_mean(rng), random_covariance(rng), selecting(first, second, size)
    measured = rng.normal(size=size)
    entries = np.concatenate([mean[:3], np.zeros(3), mean[7:]])
    expected = updated(mean, P, H, measured - H @ entries, 0.02)
    distance = correct_by_sum(mean, P, measured, first, second, 0.02, np.inf)
    for one, other in zip((mean, P, distance), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("slow", [NOTHING, GAINS])
def test_a_pose_is_taken_as_the_textbook_has_it_and_heeded(slow):
    """The camera's slow shift and turn are part of what is expected; the noise follows the normalised innovations."""
    rng = np.random.default_rng(0)
    mean, P, H = random_mean(rng), random_covariance(rng), selecting(0, slow, 6)
    p_m, q, innovation_mean = rng.normal(size=3), unit_quaternion(rng), 0.1 * rng.normal(size=6)
    bent = np.zeros(6) if slow == NOTHING else mean[slow + 1 : slow + 7]
    expected_q = quat_multiply(mean[3:7], quat_from_rotvec(bent[3:]))
    turned = rotvec_from_quat(quat_multiply(quat_conjugate(expected_q), q))
    residual, std = np.concatenate([p_m - mean[:3] - bent[:3], turned]), np.repeat([0.003, 0.005], 3)
    expected = updated(mean, P, H, residual, std)
    innovation = residual / np.sqrt(np.diag(H @ P @ H.T) + std**2)
    leant = innovation_mean + (np.clip(innovation, -3.0, 3.0) - innovation_mean) / 15
    louder = 2.0 * np.exp(0.1 * (min((leant**2).max() / (9.0 / 29.0), 10.0) - 1.0))
    distance, scale = correct_by_pose(mean, P, p_m, q, slow, 0.003, 0.005, np.inf, innovation_mean, 2.0)
    for one, other in zip((mean, P, distance, innovation_mean, scale), (*expected, leant, louder), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_noise_is_bounded_both_ways():
    """Poses that agree bring the scale back to 1 and not below; those that do not, to 300 and not above."""
    for far, scale, bound in ((0.0, 1.001, 1.0), (9.0, 299.0, 300.0)):
        mean, P, innovation_mean = np.zeros(ERRORS + 1), 1e-6 * np.eye(ERRORS), np.full(6, far / 3.0)
        mean[3] = 1.0
        p_m, q = np.full(3, far), np.array([1.0, 0.0, 0.0, 0.0])
        assert correct_by_pose(mean, P, p_m, q, NOTHING, 0.003, 0.005, 1.0, innovation_mean, scale)[1] == bound


def test_an_accelerometer_is_taken_as_the_textbook_has_it():
    """With the Jacobian and the expectation of `specific_force`, gravity turned into the body."""
    rng = np.random.default_rng(0)
    mean, P, thrusts, H = random_mean(rng), random_covariance(rng), rng.normal(size=8), np.empty((3, ERRORS))
    down_B = matrix_from_quat(mean[3:7]).T @ np.array([0.0, 0.0, GRAVITY_M_S2])
    residual = 0.1 * rng.normal(size=3)
    measured = specific_force(PACKED, ALLOCATION, mean, thrusts, REST, down_B, H) + residual
    expected = updated(mean, P, H, residual, 0.07)
    distance = correct_by_force(PACKED, ALLOCATION, mean, P, thrusts, REST, measured, 0.07, np.inf)
    for one, other in zip((mean, P, distance), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9)

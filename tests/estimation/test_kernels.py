"""The filter's compiled steps against geometry's readable functions and against finite differences."""

import numpy as np

from wakewise.estimation.kernels import ERRORS, STATES, correct, predict, turn, turn_between, turned_by
from wakewise.geometry import matrix_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.vehicles import compile_body, load_vehicle

RNG = np.random.default_rng(0)
PACKED = compile_body(load_vehicle("paper")).packed
SILENT = np.zeros(6)


def unit_quaternion():
    q = RNG.normal(size=4)
    return q / np.linalg.norm(q)


def random_mean():
    mean = 0.3 * RNG.normal(size=STATES)
    mean[3:7] = unit_quaternion()
    return mean


def moved(mean, error):
    """The mean shifted by an error as the filter counts it."""
    out = mean.copy()
    out[:3] += error[:3]
    out[3:7] = quat_multiply(mean[3:7], quat_from_rotvec(error[3:6]))
    out[7:] += error[6:]
    return out


def difference(mean, other):
    turned = rotvec_from_quat(quat_multiply(quat_conjugate(other[3:7]), mean[3:7]))
    return np.concatenate([mean[:3] - other[:3], turned, mean[7:] - other[7:]])


def test_turning_equals_the_rotation_matrix():
    """Both senses of `turn` are those of R(q)."""
    for _ in range(20):
        q, v = unit_quaternion(), RNG.normal(size=3)
        R = matrix_from_quat(q)
        np.testing.assert_allclose(turn(q, v, 1.0), R @ v, atol=1e-12)
        np.testing.assert_allclose(turn(q, v, -1.0), R.T @ v, atol=1e-12)


def test_turned_by_and_turn_between_are_inverse():
    """Turning q by a rotation vector shorter than pi, and asking for the turn between, gives it back."""
    for size in (1e-14, 1e-6, 0.1, 2.0, 3.1):
        q, v = unit_quaternion(), RNG.normal(size=3)
        v *= size / np.linalg.norm(v)
        other = turned_by(q, v)
        np.testing.assert_allclose(other, quat_multiply(q, quat_from_rotvec(v)), atol=1e-12)
        np.testing.assert_allclose(turn_between(q, -other), v, atol=1e-9)


def test_the_covariance_moves_as_the_mean_does():
    """Without noise P becomes F P F', F by central differences of the moved mean, loads included."""
    mean, wrench, dt = random_mean(), RNG.normal(size=6), 0.02
    root = RNG.normal(size=(ERRORS, ERRORS))
    P = root @ root.T

    def after(start):
        out, unused = start.copy(), np.zeros((ERRORS, ERRORS))
        predict(PACKED, out, unused, wrench, dt, SILENT)
        return out

    F, step = np.empty((ERRORS, ERRORS)), 1e-5
    for j in range(ERRORS):
        error = np.zeros(ERRORS)
        error[j] = step
        F[:, j] = difference(after(moved(mean, error)), after(moved(mean, -error))) / (2 * step)
    found = P.copy()
    predict(PACKED, mean.copy(), found, wrench, dt, SILENT)
    expected = F @ P @ F.T
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_array_equal(found, found.T)


def test_noise_adds_up_over_steps():
    """Two steps of 10 ms give the covariance of one of 20 ms, within what the motion's curvature leaves."""
    mean, noise = random_mean(), np.array([0.02, 0.2, 0.1, 0.01, 1e-3, 1e-2])
    once, twice = np.zeros((ERRORS, ERRORS)), np.zeros((ERRORS, ERRORS))
    predict(PACKED, mean.copy(), once, np.zeros(6), 0.02, noise)
    walker = mean.copy()
    for _ in range(2):
        predict(PACKED, walker, twice, np.zeros(6), 0.01, noise)
    np.testing.assert_allclose(np.diag(twice), np.diag(once), rtol=0.06)
    assert np.linalg.eigvalsh(twice).min() > -1e-15


def test_correction_is_the_kalman_update():
    """Mean and covariance after a correction are those of the information form; beyond the gate nothing changes."""
    mean, root = random_mean(), 0.1 * RNG.normal(size=(ERRORS, ERRORS))
    P, H, R = root @ root.T + 1e-3 * np.eye(ERRORS), RNG.normal(size=(3, ERRORS)), 0.01 * np.eye(3)
    residual = 0.01 * RNG.normal(size=3)
    expected_P = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
    change = expected_P @ H.T @ np.linalg.inv(R) @ residual
    found_mean, found_P = mean.copy(), P.copy()
    distance = correct(found_mean, found_P, H, residual, R, np.inf)
    np.testing.assert_allclose(found_P, expected_P, atol=1e-9)
    np.testing.assert_allclose(difference(found_mean, mean), change, atol=1e-9)
    np.testing.assert_allclose(distance, residual @ np.linalg.solve(H @ P @ H.T + R, residual), rtol=1e-9)
    kept_mean, kept_P = mean.copy(), P.copy()
    assert correct(kept_mean, kept_P, H, residual, R, 0.5 * distance) == distance
    np.testing.assert_array_equal(kept_mean, mean)
    np.testing.assert_array_equal(kept_P, P)

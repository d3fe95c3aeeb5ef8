"""The filter's compiled steps against geometry's readable functions and against finite differences."""

import numpy as np
import pytest

from wakewise.estimation.kernels import CURRENT, GAINS, correct, felt, predict, turn_between, turned_by, unexplained
from wakewise.estimation.resting import DRAG, at_rest, turn
from wakewise.geometry import matrix_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.vehicles import acceleration, compile_body, load_vehicle

RNG = np.random.default_rng(0)
VEHICLE = load_vehicle("paper")
BODY = compile_body(VEHICLE)
PACKED, ALLOCATION = BODY.packed, np.array(VEHICLE.allocation_matrix)
ERRORS, GRAVITY = GAINS + 8, np.array([0.0, 0.0, 9.80665])
STEADY = np.zeros(ERRORS - CURRENT), np.full(ERRORS - CURRENT, 1e12)
SILENT = np.zeros(6)
REST = np.array([0.8, 0.2, -0.4, 0.4])


@pytest.fixture(autouse=True)
def _same_draws_whatever_ran_before():
    RNG.bit_generator.state = np.random.default_rng(0).bit_generator.state


def unit_quaternion():
    q = RNG.normal(size=4)
    return q / np.linalg.norm(q)


def random_mean():
    mean = 0.3 * RNG.normal(size=ERRORS + 1)
    mean[3:7] = unit_quaternion()
    mean[1 + CURRENT :] *= 0.3
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


def jacobian(function, mean, step=1e-5):
    """By central differences in the error of the mean."""
    columns = []
    for j in range(ERRORS):
        error = np.zeros(ERRORS)
        error[j] = step
        columns.append((function(moved(mean, error)) - function(moved(mean, -error))) / (2 * step))
    return np.array(columns).T


@pytest.mark.slow
def test_the_covariance_moves_as_the_mean_does():
    """Without noise P becomes F P F', F by differences of the moved mean: exact, but 1 % for what varies in a step."""
    mean, thrusts, dt = random_mean(), RNG.normal(size=8), 0.01
    root = RNG.normal(size=(ERRORS, ERRORS))
    root[CURRENT:GAINS] *= 0.1
    P = root @ root.T

    def after(start):
        out, unused = start.copy(), np.zeros((ERRORS, ERRORS))
        predict(PACKED, ALLOCATION, out, unused, thrusts, REST, dt, SILENT, *STEADY)
        return out

    middle = after(mean)
    F = jacobian(lambda start: difference(after(start), middle), mean)
    for kept, tolerance in ((np.r_[0:CURRENT, GAINS:ERRORS], 1e-7), (np.arange(ERRORS), 0.01)):
        part = np.zeros_like(P)
        part[np.ix_(kept, kept)] = P[np.ix_(kept, kept)]
        expected, found = F @ part @ F.T, part.copy()
        predict(PACKED, ALLOCATION, mean.copy(), found, thrusts, REST, dt, SILENT, *STEADY)
        np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())
        np.testing.assert_array_equal(found, found.T)


@pytest.mark.slow
def test_every_unknown_moves_the_vehicle_as_the_jacobian_says():
    """Column by column, twist after a step by current, drag and inertia: within 3 % of differences."""
    mean, thrusts, dt = random_mean(), 0.3 * RNG.normal(size=8), 0.005
    mean[7:13] *= 0.5

    def after(start):
        out, unused = start.copy(), np.zeros((ERRORS, ERRORS))
        predict(PACKED, ALLOCATION, out, unused, thrusts, REST, dt, SILENT, *STEADY)
        return out[7:13]

    expected, found = jacobian(after, mean), np.zeros((ERRORS, ERRORS))
    for j in range(CURRENT, GAINS):
        found = np.zeros((ERRORS, ERRORS))
        found[j, j] = 1.0
        predict(PACKED, ALLOCATION, mean.copy(), found, thrusts, REST, dt, SILENT, *STEADY)
        column = expected[:, j]
        np.testing.assert_allclose(found[6:12, j], column, atol=0.03 * np.abs(column).max() + 1e-6)


def test_what_an_accelerometer_feels_and_its_jacobian():
    """dv/dt + omega x v - g + bias of the plain equations; its Jacobian equals differences."""
    mean, thrusts = random_mean(), RNG.normal(size=8)

    def feel(at):
        down = matrix_from_quat(at[3:7]).T @ GRAVITY
        return felt(PACKED, ALLOCATION, at, thrusts, REST, down, np.empty((3, ERRORS)))

    H = np.empty((3, ERRORS))
    felt(PACKED, ALLOCATION, mean, thrusts, REST, matrix_from_quat(mean[3:7]).T @ GRAVITY, H)
    expected = jacobian(feel, mean, 1e-4)
    np.testing.assert_allclose(H, expected, atol=1e-4 * np.abs(expected).max())
    plain = mean.copy()
    plain[1 + DRAG :] = 0.0
    # The load is that at rest: with the current's drag and Munk moment there.
    plain[13:19] -= at_rest(PACKED, plain, REST)
    wrench = ALLOCATION @ thrusts
    wrench[:3] += matrix_from_quat(mean[3:7]).T @ mean[13:16]
    wrench[3:] += mean[16:19]
    rate = acceleration(BODY, mean[3:7], mean[7:13], wrench, mean[25:28])
    down = matrix_from_quat(mean[3:7]).T @ GRAVITY
    by_hand = rate[:3] + np.cross(mean[10:13], mean[7:10]) - down + mean[22:25]
    np.testing.assert_allclose(feel(plain), by_hand, atol=1e-6)


def test_what_the_nominal_vehicle_lacks_is_the_wrench_of_all_unknowns():
    """Given the wrench on top, the nominal vehicle in still water feels the forces of one with gains, drag and current.

    But for the inertia, which acts on acceleration only, and the small Coriolis force of the current at low rates.
    """
    mean, thrusts = random_mean(), RNG.normal(size=8)
    mean[10:13] = 0.0
    mean[34:40] = 0.0
    lacking = unexplained(PACKED, ALLOCATION, mean, thrusts, REST)
    nominal = acceleration(BODY, mean[3:7], mean[7:13], ALLOCATION @ thrusts + lacking, np.zeros(3))
    out, unused = mean.copy(), np.zeros((ERRORS, ERRORS))
    predict(PACKED, ALLOCATION, out, unused, thrusts, REST, 1e-6, SILENT, *STEADY)
    np.testing.assert_allclose(nominal[:3], (out[7:10] - mean[7:10]) / 1e-6, atol=1e-4)


def test_lasting_errors_keep_their_spread():
    """Without measurements a Gauss-Markov error forgets what was known of it and ends at its stated spread."""
    spread, lasts_s = np.full(ERRORS - CURRENT, 0.2), np.full(ERRORS - CURRENT, 0.1)
    mean, P = random_mean(), np.zeros((ERRORS, ERRORS))
    for _ in range(100):
        predict(PACKED, ALLOCATION, mean, P, np.zeros(8), REST, 0.01, SILENT, spread, lasts_s)
    np.testing.assert_allclose(np.sqrt(np.diag(P)[CURRENT:]), 0.2, rtol=1e-6)
    assert np.abs(mean[1 + CURRENT :]).max() < 1e-3


def test_noise_adds_up_over_steps():
    """Two steps of 10 ms give the covariance of one of 20 ms, within what the motion's curvature leaves."""
    mean, noise = random_mean(), np.array([0.02, 0.2, 0.1, 0.01, 1e-3, 1e-2])
    once, twice = np.zeros((ERRORS, ERRORS)), np.zeros((ERRORS, ERRORS))
    predict(PACKED, ALLOCATION, mean.copy(), once, np.zeros(8), REST, 0.02, noise, *STEADY)
    walker = mean.copy()
    for _ in range(2):
        predict(PACKED, ALLOCATION, walker, twice, np.zeros(8), REST, 0.01, noise, *STEADY)
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

"""The filter's compiled motion against geometry's readable functions and against finite differences."""

import numpy as np
from estimation_helpers import (
    ALLOCATION,
    BODY,
    ERRORS,
    PACKED,
    REST,
    SILENT,
    STEADY,
    jacobian,
    random_mean,
    unit_quaternion,
)

from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec, quat_multiply
from wakewise.estimation.eskf_kernels import (
    DRAG,
    drag_at_rest,
    predict,
    quat_minus,
    quat_plus,
    residual_wrench,
    specific_force,
    turn,
)
from wakewise.robot.vehicles import acceleration

GRAVITY = np.array([0.0, 0.0, 9.80665])


def test_turning_equals_the_rotation_matrix():
    """Both senses of `turn` are those of R(q)."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, v = unit_quaternion(rng), rng.normal(size=3)
        R = matrix_from_quat(q)
        np.testing.assert_allclose(turn(q, v, 1.0), R @ v, atol=1e-12)
        np.testing.assert_allclose(turn(q, v, -1.0), R.T @ v, atol=1e-12)


def test_turned_by_and_turn_between_are_inverse():
    """Turning q by a rotation vector shorter than pi, and asking for the turn between, gives it back."""
    rng = np.random.default_rng(0)
    for size in (1e-14, 1e-6, 0.1, 2.0, 3.1):
        q, v = unit_quaternion(rng), rng.normal(size=3)
        v *= size / np.linalg.norm(v)
        other = quat_plus(q, v)
        np.testing.assert_allclose(other, quat_multiply(q, quat_from_rotvec(v)), atol=1e-12)
        np.testing.assert_allclose(quat_minus(q, -other), v, atol=1e-9)


def test_what_an_accelerometer_feels_and_its_jacobian():
    """dv/dt + omega x v - g + bias of the plain equations; its Jacobian equals differences."""
    rng = np.random.default_rng(0)
    mean, thrusts = random_mean(rng), rng.normal(size=8)

    def feel(at):
        down = matrix_from_quat(at[3:7]).T @ GRAVITY
        return specific_force(PACKED, ALLOCATION, at, thrusts, REST, down, np.empty((3, ERRORS)))

    H = np.empty((3, ERRORS))
    specific_force(PACKED, ALLOCATION, mean, thrusts, REST, matrix_from_quat(mean[3:7]).T @ GRAVITY, H)
    expected = jacobian(feel, mean, 1e-4)
    np.testing.assert_allclose(H, expected, atol=1e-4 * np.abs(expected).max())
    plain = mean.copy()
    plain[1 + DRAG :] = 0.0
    # The load is that at rest: with the current's drag and Munk moment there.
    plain[13:19] -= drag_at_rest(PACKED, plain, REST)
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
    rng = np.random.default_rng(0)
    mean, thrusts = random_mean(rng), rng.normal(size=8)
    mean[10:13] = 0.0
    mean[34:40] = 0.0
    lacking = residual_wrench(PACKED, ALLOCATION, mean, thrusts, REST)
    nominal = acceleration(BODY, mean[3:7], mean[7:13], ALLOCATION @ thrusts + lacking, np.zeros(3))
    out, unused = mean.copy(), np.zeros((ERRORS, ERRORS))
    predict(PACKED, ALLOCATION, out, unused, thrusts, REST, 1e-6, SILENT, *STEADY)
    np.testing.assert_allclose(nominal[:3], (out[7:10] - mean[7:10]) / 1e-6, atol=1e-4)

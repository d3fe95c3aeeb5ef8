"""What the tests of the filter's compiled steps share: a vehicle, random means, and differences by the error."""

import numpy as np

from wakewise.core.geometry import quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from wakewise.estimation.eskf_kernels import CURRENT, GAINS
from wakewise.robot.vehicles import compile_body, load_vehicle

VEHICLE = load_vehicle("paper")
BODY = compile_body(VEHICLE)
PACKED, ALLOCATION = BODY.packed, np.array(VEHICLE.allocation_matrix)
ERRORS = GAINS + 8
STEADY = np.zeros(ERRORS - CURRENT), np.full(ERRORS - CURRENT, 1e12)
SILENT = np.zeros(6)
REST = np.array([0.8, 0.2, -0.4, 0.4])


def unit_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_mean(rng):
    mean = 0.3 * rng.normal(size=ERRORS + 1)
    mean[3:7] = unit_quaternion(rng)
    mean[1 + CURRENT :] *= 0.3
    return mean


def random_covariance(rng):
    root = 0.1 * rng.normal(size=(ERRORS, ERRORS))
    return root @ root.T + 1e-3 * np.eye(ERRORS)


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


def jacobian(function, mean, step=1e-5):
    """By central differences in the error of the mean."""
    columns = []
    for j in range(ERRORS):
        error = np.zeros(ERRORS)
        error[j] = step
        columns.append((function(moved(mean, error)) - function(moved(mean, -error))) / (2 * step))
    return np.array(columns).T

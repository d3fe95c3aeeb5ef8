"""The load of a current at rest: what it is, its derivatives, and that hovering says nothing of the current."""

import numpy as np
import pytest

from wakewise.core.geometry import matrix_from_quat
from wakewise.estimation.eskf_kernels import (
    CURRENT,
    DRAG,
    GAINS,
    INERTIA,
    adapted_parameters,
    drag_at_rest,
    drag_at_rest_jacobian,
    propagate_mean,
)
from wakewise.robot.vehicles import acceleration, compile_body, load_vehicle

VEHICLE = load_vehicle("paper")
BODY = compile_body(VEHICLE)
PACKED, ALLOCATION = BODY.packed, np.array(VEHICLE.allocation_matrix)
REST = np.array([0.8, 0.2, -0.4, 0.4])


def _mean(rng, *, attitude=None):
    mean = 0.2 * rng.normal(size=GAINS + 9)
    q = rng.normal(size=4) if attitude is None else attitude
    mean[3:7] = q / np.linalg.norm(q)
    return mean


def test_it_is_what_keeps_the_vehicle_at_rest():
    """With the negative of it as a load, a vehicle at rest in this attitude does not begin to move in a current."""
    mean = _mean(np.random.default_rng(1), attitude=REST)
    found = drag_at_rest(PACKED, mean, REST)
    load = np.concatenate([matrix_from_quat(REST).T @ found[:3], found[3:]])
    still = acceleration(BODY, REST, np.zeros(6), np.zeros(6), np.zeros(3))
    held = acceleration(BODY, REST, np.zeros(6), load, mean[25:28])
    assert held == pytest.approx(still, abs=1e-9)


def test_its_derivatives_are_those_of_differences():
    """By current, drag and inertia, force in the body."""
    rng = np.random.default_rng(2)
    mean, step = _mean(rng), 1e-5
    R = matrix_from_quat(mean[3:7])

    def wrench(at):
        found = drag_at_rest(adapted_parameters(PACKED, at), at, REST)
        return np.concatenate([R.T @ found[:3], found[3:]])

    expected = np.empty((6, 15))
    for k, place in enumerate([*range(25, 28), *range(1 + DRAG, 1 + GAINS)]):
        more, less = mean.copy(), mean.copy()
        more[place] += step
        less[place] -= step
        expected[:, k] = (wrench(more) - wrench(less)) / (2 * step)
    np.testing.assert_allclose(drag_at_rest_jacobian(adapted_parameters(PACKED, mean), mean, REST), expected, atol=1e-6)


def test_hovering_says_nothing_of_current_and_drag():
    """At rest in its first attitude the motion does not change with them, whatever they are believed to be."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        mean = _mean(rng, attitude=REST)
        mean[7:13] = 0.0
        mean[13:19] = 0.0
        thrusts = np.zeros(8)
        F = propagate_mean(PACKED, ALLOCATION, mean.copy(), thrusts, mean[3:7], 1e-4, GAINS + 8)
        by_load = np.abs(F[6:12, 12:18]).max()
        assert by_load > 1e-6
        assert np.abs(F[6:12, CURRENT:INERTIA]).max() < 1e-3 * by_load

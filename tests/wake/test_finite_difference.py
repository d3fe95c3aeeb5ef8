"""A wake model without derivatives is as good as one with them, only slower."""

from dataclasses import dataclass

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import gauss_newton, gram_with_derivatives, wake_model
from wakewise.wake.finite_difference import thinned

VEHICLE = load_vehicle("paper")
X_WB = Pose(np.array([-0.6, 0.05, 1.0]), quat_from_euler(0.02, -0.35, 0.05))
RNG = np.random.default_rng(3)
POINTS, WEIGHTS = np.array([0.0, 0.0, 1.35]) + RNG.uniform(-0.12, 0.12, (60, 3)), RNG.uniform(0.2, 1.0, 60)
POINTS.flags.writeable = WEIGHTS.flags.writeable = False  # as a region's are
BODY = (VEHICLE.thruster_positions_B_m, VEHICLE.thruster_axes_B, VEHICLE.disk_areas_m2)
THRUSTS_N = np.array([1.2, -0.7, -2.0, 0.4, 0.9, -1.1, 0.3, 2.0])


@dataclass(frozen=True)
class Foreign:
    """What a package from outside brings: a name and velocities, here those of our own jet."""

    name: str = "foreign"

    def unit_velocity(self, points, origins, directions, areas):
        return wake_model("jet").unit_velocity(points, origins, directions, areas)


@pytest.mark.parametrize("superposition", ["coherent", "incoherent"])
def test_differences_are_the_compiled_derivatives(superposition):
    """D to rounding, its gradient and Gauss-Newton matrix to a ten-thousandth of their largest entry."""
    ours = gauss_newton(wake_model("jet"), POINTS, WEIGHTS, X_WB, *BODY, THRUSTS_N, superposition=superposition)
    theirs = gauss_newton(Foreign(), POINTS, WEIGHTS, X_WB, *BODY, THRUSTS_N, superposition=superposition)
    assert ours.value > 0.0 and theirs.value == pytest.approx(ours.value, rel=1e-9)
    np.testing.assert_allclose(theirs.gradient, ours.gradient, atol=1e-4 * np.abs(ours.gradient).max())
    np.testing.assert_allclose(theirs.hessian, ours.hessian, atol=1e-4 * np.abs(ours.hessian).max())


def test_the_gram_matrix_and_its_slopes_agree_too():
    """The matrix G and how it changes with the pose."""
    ours = gram_with_derivatives(wake_model("jet"), POINTS, WEIGHTS, X_WB, *BODY)
    theirs = gram_with_derivatives(Foreign(), POINTS, WEIGHTS, X_WB, *BODY)
    np.testing.assert_allclose(theirs.gram, ours.gram, atol=1e-12)
    np.testing.assert_allclose(theirs.by_pose, ours.by_pose, atol=1e-4 * np.abs(ours.by_pose).max())


def test_velocities_of_a_wrong_shape_are_refused():
    """A model that leaves out a point is named, with what it gave and what it must give."""

    class Short(Foreign):
        def unit_velocity(self, points, origins, directions, areas):
            return np.zeros((len(origins), len(points) - 1, 3))

    with pytest.raises(InputError, match=r"foreign: gave shape \(16, 59, 3\), must give \(16, 60, 3\)"):
        gauss_newton(Short(), POINTS, WEIGHTS, X_WB, *BODY, THRUSTS_N)


def test_fewer_points_weigh_as_much():
    """Thinned points keep the total weight, and few points stay as they are."""
    points, weights = thinned(POINTS, WEIGHTS, 20)
    assert len(points) == 20 and weights.sum() == pytest.approx(WEIGHTS.sum())
    assert thinned(POINTS, WEIGHTS, 60)[0] is POINTS

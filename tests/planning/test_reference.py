"""What a goal asks of the next seconds, held against slow readable twins."""

import numpy as np
import pytest

from wakewise.core.geometry import (
    Pose,
    quat_conjugate,
    quat_from_euler,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)
from wakewise.core.interfaces import Goal
from wakewise.planning.problem import RAMP_S, between, reference_of

GOAL = Goal(
    X_WB=Pose(np.array([1.0, 2.0, 3.0]), quat_from_euler(0.1, -0.2, 0.7)),
    nu_B=np.array([0.1, 0.2, -0.1, 0.3, -0.2, 0.5]),
)


def finely(goal, change, seconds, steps=4000):
    """Integrate the pose in many small steps."""
    p, q, dt = np.array(goal.X_WB.p_m), np.array(goal.X_WB.q), seconds / steps
    for k in range(steps):
        nu = goal.nu_B + change * RAMP_S * (1.0 - np.exp(-(k + 0.5) * dt / RAMP_S))
        q_half = quat_multiply(q, quat_from_rotvec(0.5 * dt * nu[3:]))
        p = p + dt * Pose(p, q_half).R @ nu[:3]
        q = quat_multiply(q, quat_from_rotvec(dt * nu[3:]))
    return p, q


def test_a_constant_twist_is_carried_on_exactly():
    """Stage by stage the reference is a screw, whatever the length of the stages."""
    coarse, fine = reference_of(GOAL, 2, 0.5), reference_of(GOAL, 20, 0.05)
    np.testing.assert_allclose(coarse[1:], fine[[10, 20]], atol=1e-12)
    p, q = finely(GOAL, np.zeros(6), 1.0)
    np.testing.assert_allclose(coarse[-1, :3], p, atol=1e-7)
    np.testing.assert_allclose(coarse[-1, 3:7], q, atol=1e-7)


def test_a_change_of_twist_is_carried_on_and_fades():
    """Against fine steps of the same law; after the ramp's time the speed has gained change x RAMP_S."""
    change = np.array([0.1, -0.05, 0.08, 0.05, 0.0, -0.1])
    reference = reference_of(GOAL, 20, 0.1, change)
    p, q = finely(GOAL, change, 2.0)
    np.testing.assert_allclose(reference[-1, :3], p, atol=2e-4)
    np.testing.assert_allclose(reference[-1, 3:7], q, atol=2e-4)
    np.testing.assert_allclose(reference[-1, 7:], GOAL.nu_B + RAMP_S * (1.0 - np.exp(-2.0 / RAMP_S)) * change)
    np.testing.assert_allclose(reference[1, 7:] - reference[0, 7:], 0.1 * change, rtol=0.15)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_between_two_states_the_pose_follows_the_turn(share):
    """The compiled one equals rotation vectors written out, whichever sign the quaternions have."""
    a, b = reference_of(GOAL, 1, 1.5)
    for sign in (1.0, -1.0):
        far = b.copy()
        far[3:7] *= sign
        found = between(a, far, share)
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(a[3:7]), b[3:7]))
        expected = quat_multiply(a[3:7], quat_from_rotvec(share * turn))
        assert abs(abs(found[3:7] @ expected) - 1.0) < 1e-12
        np.testing.assert_allclose(np.delete(found, range(3, 7)), np.delete((1 - share) * a + share * b, range(3, 7)))

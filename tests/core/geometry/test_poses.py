"""Poses: monogram algebra and the look-at frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at, quat_from_rotvec

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)
poses = st.builds(lambda p, v: Pose(p, quat_from_rotvec(v)), vectors, vectors)


@given(poses, poses, vectors)
def test_adjacent_letters_cancel(X_AB: Pose, X_BC: Pose, p_CQ: np.ndarray) -> None:
    """Applying X_AB after X_BC is applying X_AC = X_AB @ X_BC; X_AB @ X_BA is the identity."""
    np.testing.assert_allclose((X_AB @ X_BC).apply(p_CQ), X_AB.apply(X_BC.apply(p_CQ)), atol=1e-10)
    np.testing.assert_allclose((X_AB @ X_AB.inverse()).apply(p_CQ), p_CQ, atol=1e-10)


@given(vectors, vectors)
def test_look_at_points_forward_and_stays_level(eye: np.ndarray, target: np.ndarray) -> None:
    """Forward meets the target, right is horizontal, down points down, and the axes are a right-handed rotation."""
    if np.linalg.norm(target - eye) < 1e-6:
        return
    R = look_at(eye, target)
    np.testing.assert_allclose(R @ [np.linalg.norm(target - eye), 0, 0], target - eye, atol=1e-9)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert abs(R[2, 1]) < 1e-9
    assert R[2, 2] >= -1e-9


def test_a_pose_cannot_be_changed_and_refuses_nonsense() -> None:
    """Fields are read-only copies; NaN, a wrong shape and a zero quaternion are refused by name."""
    p = np.zeros(3)
    pose = Pose(p)
    p[0] = 1.0
    assert pose.p_m[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        pose.p_m[0] = 1.0
    for bad, word in (
        ((np.array([0, np.nan, 0]),), "p_m"),
        ((np.zeros(2),), "p_m"),
        ((np.zeros(3), np.zeros(4)), "zero"),
    ):
        with pytest.raises(InputError, match=word):
            Pose(*bad)
    with pytest.raises(InputError, match="coincide"):
        look_at(np.ones(3), np.ones(3))

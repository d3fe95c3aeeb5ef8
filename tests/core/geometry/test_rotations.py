"""Rotations: each representation says the same thing as the others."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.geometry import (
    euler_from_quat,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_matrix,
    quat_from_rotvec,
    quat_integrate,
    quat_multiply,
    rotvec_from_quat,
    skew,
)

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)
angles = st.floats(-3.1, 3.1)


@given(roll=angles, pitch=st.floats(-1.5, 1.5), yaw=angles)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    """Away from the pole, angles -> quaternion -> angles changes nothing; the matrix is Rz Ry Rx (Fossen eq. 2.31)."""
    q = quat_from_euler(roll, pitch, yaw)
    np.testing.assert_allclose(euler_from_quat(q), [roll, pitch, yaw], atol=1e-7)
    c, s = np.cos, np.sin
    Rz = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    Ry = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    Rx = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    np.testing.assert_allclose(matrix_from_quat(q), Rz @ Ry @ Rx, atol=1e-12)


@given(st.lists(st.tuples(*[st.floats(0.1, 2.0)] * 4), min_size=1, max_size=5).map(np.array))
def test_one_quaternion_has_the_angles_that_it_has_among_many(many: np.ndarray) -> None:
    """One by one, in plain numbers, as all at once, there and back; of any length."""
    angles = euler_from_quat(many)
    np.testing.assert_allclose([euler_from_quat(q) for q in many], angles, atol=1e-13)
    np.testing.assert_allclose([quat_from_euler(*one) for one in angles], quat_from_euler(*angles.T), atol=1e-15)


@given(vectors)
def test_matrix_and_quaternion_agree_both_ways(rotvec: np.ndarray) -> None:
    """Quaternion -> matrix -> quaternion gives the same rotation, for every angle, half turns included."""
    q = quat_from_rotvec(rotvec)
    back = quat_from_matrix(matrix_from_quat(q))
    np.testing.assert_allclose(abs(np.dot(q, back)), 1.0, atol=1e-12)


@given(vectors)
def test_a_rotation_vector_comes_back(v: np.ndarray) -> None:
    """Vector -> quaternion -> vector is the identity for angles below pi."""
    v = v * min(1.0, 3.0 / max(np.linalg.norm(v), 1e-9))
    np.testing.assert_allclose(rotvec_from_quat(quat_from_rotvec(v)), v, atol=1e-7)


@given(vectors, vectors)
def test_products_compose(a: np.ndarray, b: np.ndarray) -> None:
    """The matrix of a product is the product of the matrices; the conjugate is the inverse."""
    qa, qb = quat_from_rotvec(a), quat_from_rotvec(b)
    np.testing.assert_allclose(
        matrix_from_quat(quat_multiply(qa, qb)), matrix_from_quat(qa) @ matrix_from_quat(qb), atol=1e-12
    )
    np.testing.assert_allclose(quat_multiply(qa, quat_conjugate(qa)), [1, 0, 0, 0], atol=1e-12)


@given(vectors)
def test_integration_is_exact_for_a_constant_rate(omega: np.ndarray) -> None:
    """Many small steps and one big one end in the same place; the derivative of R is R S(omega)."""
    q = quat_from_euler(0.3, -0.2, 1.0)
    small = q
    for _ in range(10):
        small = quat_integrate(small, omega, 0.01)
    np.testing.assert_allclose(small, quat_integrate(q, omega, 0.1), atol=1e-10)
    h = 1e-6
    R, R_dot = matrix_from_quat(q), (matrix_from_quat(quat_integrate(q, omega, h)) - matrix_from_quat(q)) / h
    np.testing.assert_allclose(R_dot, R @ skew(omega), atol=1e-4)

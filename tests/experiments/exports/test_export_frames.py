"""Frames of other tools: what points where, and the way back."""

import numpy as np

from wakewise.core.geometry import matrix_from_quat, quat_from_euler, quat_from_matrix
from wakewise.experiments.exports.records import enu_of, flu_of, opengl_camera, ros_body, ros_optical

RNG = np.random.default_rng(18)
Q = RNG.normal(size=(20, 4))
Q /= np.linalg.norm(Q, axis=1, keepdims=True)
P = RNG.normal(size=(20, 3))


def test_north_east_down_is_east_north_up() -> None:
    """A point 1 m north, 2 m east, 3 m deep is at (2, 1, -3) in ENU, and comes back."""
    np.testing.assert_array_equal(enu_of([1.0, 2.0, 3.0]), [2.0, 1.0, -3.0])
    np.testing.assert_array_equal(enu_of(enu_of(P)), P)
    np.testing.assert_array_equal(flu_of([1.0, 2.0, 3.0]), [1.0, -2.0, -3.0])


def test_a_heading_of_north_is_a_yaw_of_90_degrees() -> None:
    """REP 103: yaw 0 faces east and grows counter-clockwise; a nose that rises is a negative pitch in FLU."""
    _, north = ros_body(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0))
    np.testing.assert_allclose(north, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-15)
    _, east = ros_body(np.zeros(3), quat_from_euler(0.0, 0.0, np.pi / 2))
    np.testing.assert_allclose(east, [1.0, 0.0, 0.0, 0.0], atol=1e-15)
    _, climbing = ros_body(np.zeros(3), quat_from_euler(0.0, 0.3, np.pi / 2))
    np.testing.assert_allclose(matrix_from_quat(climbing)[:, 0], [np.cos(0.3), 0.0, np.sin(0.3)], atol=1e-15)


def test_a_point_of_the_body_stays_where_it_is() -> None:
    """A point fixed in the body has one place in the world, reckoned in either set of frames; both ways to 1e-12."""
    point_B = RNG.normal(size=3)
    p, q = ros_body(P, Q)
    there = enu_of(P + matrix_from_quat(Q) @ point_B)
    np.testing.assert_allclose(p + matrix_from_quat(q) @ flu_of(point_B), there, atol=1e-12)
    p_back, q_back = ros_body(p, q)
    np.testing.assert_allclose(p_back, P, atol=1e-12)
    np.testing.assert_allclose(matrix_from_quat(q_back), matrix_from_quat(Q), atol=1e-12)


def test_optical_frames_keep_the_axes_of_the_camera() -> None:
    """A point in the camera's own axes has one place in the world; the way back leads to where it began."""
    point_C = np.array([0.1, -0.2, 0.7])
    p, q = ros_optical(P, Q)
    there = enu_of(P + matrix_from_quat(Q) @ point_C)
    np.testing.assert_allclose(p + matrix_from_quat(q) @ point_C, there, atol=1e-12)
    p_back, q_back = ros_optical(p, q)
    np.testing.assert_allclose(p_back, P, atol=1e-12)
    np.testing.assert_allclose(matrix_from_quat(q_back), matrix_from_quat(Q), atol=1e-12)


def test_an_opengl_camera_looks_along_minus_z_with_y_up() -> None:
    """A level camera that faces north looks along +x of the z-up world, its y axis is up."""
    R_WC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # right is east, down is down, forward north
    (matrix,) = opengl_camera(np.array([[0.0, 0.0, 1.0]]), quat_from_matrix(R_WC)[None])
    np.testing.assert_allclose(-matrix[:3, 2], [1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(matrix[:3, 1], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(matrix[:3, 3], [0.0, 0.0, -1.0], atol=1e-15)

"""ROS's frames are ours after one turn, and come back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler
from wakewise_ardusub.ros import body_points, pose_of, read_frame, world_points, wrench_for, wrench_of

SIX = arrays(np.float64, 6, elements=st.floats(-1e3, 1e3))
STILL = np.zeros(6)


@given(SIX)
def test_a_wrench_comes_back(wrench: np.ndarray) -> None:
    """Into FRD and out again is the same wrench, in either frame."""
    for frame in ("flu", "fsd"):
        np.testing.assert_array_equal(wrench_for(wrench_of(wrench, frame, STILL), frame), wrench)


def test_up_is_up() -> None:
    """FLU: force up and to the left, yaw to the left are negative Z, Y and N; FSD is FRD."""
    np.testing.assert_array_equal(wrench_of([1, 2, 3, 4, 5, 6], "flu", STILL), [1, -2, -3, 4, -5, -6])
    np.testing.assert_array_equal(wrench_of([1, 2, 3, 4, 5, 6], "fsd", STILL), [1, 2, 3, 4, 5, 6])


def test_an_axis_that_is_nan_stays_as_it_was() -> None:
    """As auv_controllers' controllers read ~/reference."""
    before = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    told = [np.nan, 7.0, np.nan, np.nan, np.nan, np.nan]
    np.testing.assert_array_equal(wrench_of(told, "flu", before), [1, -7, 3, 4, 5, 6])


def test_a_vehicle_that_heads_east_points_along_ros_x() -> None:
    """ENU/FLU with no turn is heading east, level; two up is two above; NED is as it stands."""
    pose = pose_of((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), "flu")
    np.testing.assert_allclose(pose.p_m, [2.0, 1.0, -3.0])
    np.testing.assert_allclose(pose.R @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pose.R @ [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], atol=1e-12)
    q = quat_from_euler(0.1, -0.2, 0.3)
    pose = pose_of((1.0, 2.0, 3.0), q[[1, 2, 3, 0]], "fsd")
    np.testing.assert_allclose(pose.p_m, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(pose.q, q)


@given(arrays(np.float64, (3, 3), elements=st.floats(-50, 50)), st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_a_point_of_the_body_is_the_same_point_of_the_world(points: np.ndarray, yaw: float, pitch: float) -> None:
    """ROS places a FLU point in ENU by its own pose; we place the turned point by the turned pose: the same place."""
    from wakewise.core.geometry import matrix_from_quat

    q = quat_from_euler(0.2, pitch, yaw)
    p = np.array([3.0, -1.0, -2.0])
    pose = pose_of(p, q[[1, 2, 3, 0]], "flu")
    in_world = points @ matrix_from_quat(q).T + p
    np.testing.assert_allclose(pose.apply(body_points(points, "flu")), world_points(in_world, "flu"), atol=1e-9)


@pytest.mark.parametrize("bad", [(0, 0, 0, 0), (0, 0, 0, 2), (0, 0, float("nan"), 1), (0, 0, 1)])
def test_what_is_no_attitude_is_refused(bad: tuple[float, ...]) -> None:
    """A quaternion of another length, or of ROS's empty message, is said, not flown by."""
    with pytest.raises(InputError, match="quaternion"):
        pose_of((0.0, 0.0, 0.0), bad, "flu")


def test_other_nonsense_is_refused() -> None:
    """A frame that is not known, infinite forces, a place that is nowhere."""
    with pytest.raises(InputError, match="flu, fsd"):
        read_frame("ned")
    with pytest.raises(InputError, match="six finite"):
        wrench_of([np.inf, 0, 0, 0, 0, 0], "flu", STILL)
    with pytest.raises(InputError, match="position"):
        pose_of((np.nan, 0.0, 0.0), (0, 0, 0, 1), "flu")

"""ROS 2 without ROS: what the node in `packages/wakewise-ardusub/ros2/wakewise_ros` does, on plain numbers.

Start reading in `allocator.py` (a wrench, a pose and a target become thrusts). `mapping.py` turns ENU/FLU or NED/FSD
into our frames and back, `mapping.py` reads the bytes of a PointCloud2.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise_ardusub.ros.allocator import NodeAllocation, ProtectedPoints, ThrustAllocator, failed_thrusters
    from wakewise_ardusub.ros.mapping import (
        PointField,
        body_points,
        cloud_points,
        pose_of,
        read_frame,
        world_points,
        wrench_for,
        wrench_of,
    )

__all__ = [
    "NodeAllocation",
    "PointField",
    "ProtectedPoints",
    "ThrustAllocator",
    "body_points",
    "cloud_points",
    "failed_thrusters",
    "pose_of",
    "read_frame",
    "world_points",
    "wrench_for",
    "wrench_of",
]

lazy_attributes(__name__)

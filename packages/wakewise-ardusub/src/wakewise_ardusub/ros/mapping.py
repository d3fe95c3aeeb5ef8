"""Wrenches, poses and point clouds of ROS 2 in our frames, and back.

ROS has ENU worlds and FLU bodies (REP 103, https://www.ros.org/reps/rep-0103.html); marine packages also publish NED
and forward-starboard-down, our own frames, as `map_ned` and `base_link_fsd` (after REP 105's names,
https://www.ros.org/reps/rep-0105.html). Quaternions of ROS are (x, y, z, w).

`cloud_points` decodes a sensor_msgs/PointCloud2
(https://docs.ros2.org/latest/api/sensor_msgs/msg/PointCloud2.html): x, y and z are required, `weight` or `intensity` is
the weight of a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.experiments.exports.records import enu_of, flu_of, ros_body

Frame = Literal["flu", "fsd"]
FRAMES: dict[Frame, str] = {
    "flu": "bodies forward-left-up in worlds east-north-up, as ROS has them",
    "fsd": "bodies forward-starboard-down in worlds north-east-down",
}
_UNIT = 1e-2
"""How far from 1 a quaternion's length may be; more is no rounding, but another thing."""


def read_frame(word: str) -> Frame:
    """The frame that a parameter names."""
    for frame in FRAMES:
        if word == frame:
            return frame
    raise InputError(f"frame: '{word}', allowed are {', '.join(FRAMES)}")


def wrench_of(values: Sequence[float], frame: Frame, before_B: Array) -> Array:
    """Wrench in FRD, shape (6,), of force x, y, z and torque x, y, z.

    An axis that is NaN stays as it was (`before_B`, shape (6,)), as auv_controllers' own controllers have it.

    Raises
    ------
    InputError
        If there are not six numbers, or one is infinite.
    """
    told = np.asarray(values, dtype=np.float64)
    if told.shape != (6,) or np.isinf(told).any():
        raise InputError(f"wrench: {' '.join(f'{value:g}' for value in told.ravel())}, must be six finite numbers")
    known = _turned(told, frame)
    return np.where(np.isnan(known), before_B, known)


def wrench_for(wrench_B: Array, frame: Frame) -> Array:
    """Force and torque for ROS, shape (6,), of a wrench in FRD."""
    return _turned(wrench_B, frame)


def pose_of(position: Sequence[float], quaternion_xyzw: Sequence[float], frame: Frame) -> Pose:
    """Pose X_WB of the FRD body in NED of a pose of ROS.

    Raises
    ------
    InputError
        If a number is not finite, or the quaternion is none.
    """
    p, q = np.asarray(position, dtype=np.float64), np.asarray(quaternion_xyzw, dtype=np.float64)
    if p.shape != (3,) or not np.isfinite(p).all():
        raise InputError(f"pose: position {' '.join(f'{x:g}' for x in p.ravel())}, must be three finite numbers")
    if q.shape != (4,) or not abs(float(np.linalg.norm(q)) - 1.0) <= _UNIT:
        raise InputError(f"pose: quaternion {' '.join(f'{x:g}' for x in q.ravel())}, its length must be 1")
    wxyz = q[[3, 0, 1, 2]] / np.linalg.norm(q)
    if frame == "flu":
        p, wxyz = ros_body(p, wxyz)
    return Pose(p, wxyz)


def world_points(xyz: ArrayLike, frame: Frame) -> Array:
    """Points of ROS's world, shape (n, 3), in NED."""
    return enu_of(xyz) if frame == "flu" else np.asarray(xyz, dtype=np.float64)


def body_points(xyz: ArrayLike, frame: Frame) -> Array:
    """Points that are fixed to ROS's body, shape (n, 3), in FRD."""
    return flu_of(xyz) if frame == "flu" else np.asarray(xyz, dtype=np.float64)


def _turned(wrench: Array, frame: Frame) -> Array:
    if frame == "fsd":
        return np.asarray(wrench, dtype=np.float64)
    signs = np.array([1.0, -1.0, -1.0])
    return np.asarray(wrench * np.tile(signs, 2) + 0.0)


NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""`datatype` of sensor_msgs/PointField as NumPy has it."""
_LARGEST = 4096
"""Bytes of a point; more are no cloud."""


@dataclass(frozen=True, kw_only=True)
class PointField:
    """A number of each point, as sensor_msgs/PointField has it."""

    name: str
    offset: int
    datatype: int


def cloud_points(
    fields: Sequence[PointField], point_step: int, row_step: int, width: int, height: int, big_endian: bool, data: bytes
) -> tuple[Array, Array]:
    """Places, shape (n, 3), in the cloud's own frame, and weights, shape (n,).

    Points with a number that is not finite, which sensors send for what they did not see, are left out. Weights are 1
    where the cloud has none.

    Raises
    ------
    InputError
        If x, y or z are missing, sizes do not agree, or a weight is negative.
    """
    named = {field.name: field for field in fields}
    lacking = [axis for axis in "xyz" if axis not in named]
    if lacking:
        raise InputError(f"cloud: has no {', '.join(lacking)}, only {', '.join(named) or 'nothing'}")
    if not 0 < point_step <= _LARGEST or width < 0 or height < 0 or row_step < width * point_step:
        raise InputError(f"cloud: {width} x {height} points of {point_step} bytes in rows of {row_step}, do not agree")
    if len(data) != row_step * height:
        raise InputError(f"cloud: {len(data)} bytes, must be {row_step * height}, {height} rows of {row_step}")
    rows = np.frombuffer(data, dtype=np.uint8).reshape(height, row_step)[:, : width * point_step]
    points = np.ascontiguousarray(rows).reshape(width * height, point_step)
    order = ">" if big_endian else "<"
    places = np.stack([_column(points, named[axis], order) for axis in "xyz"], axis=1)
    weight = next((named[name] for name in ("weight", "intensity") if name in named), None)
    weights = np.ones(len(places)) if weight is None else _column(points, weight, order)
    seen = np.isfinite(places).all(axis=1) & np.isfinite(weights)
    if np.any(weights[seen] < 0.0):
        raise InputError(f"cloud: a weight is {weights[seen].min():g}, none may be negative")
    return places[seen], weights[seen]


def _column(points: NDArray[np.uint8], field: PointField, order: str) -> Array:
    if field.datatype not in NUMBERS:
        raise InputError(f"cloud: field {field.name} is of type {field.datatype}, known are {min(NUMBERS)} to 8")
    kind = np.dtype(order + NUMBERS[field.datatype])
    if not 0 <= field.offset <= points.shape[1] - kind.itemsize:
        raise InputError(f"cloud: field {field.name} lies at byte {field.offset}, beyond points of {points.shape[1]}")
    part = np.ascontiguousarray(points[:, field.offset : field.offset + kind.itemsize])
    return part.view(kind)[:, 0].astype(np.float64)

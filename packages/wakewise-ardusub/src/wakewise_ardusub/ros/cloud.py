"""Points from the bytes of a sensor_msgs/PointCloud2.

A cloud says where in each point's bytes its numbers are
(https://docs.ros2.org/latest/api/sensor_msgs/msg/PointCloud2.html); x, y and z are needed, `weight` or `intensity` is
taken for how much a point counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

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

"""The points of a sparse model (COLMAP's points3D.bin and images.bin), read without COLMAP."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.experiments.exports.records import SparsePoints

_POINT = struct.Struct("<Q3d3BdQ")
_IMAGE = struct.Struct("<I7dI")
OBSERVATION = np.dtype([("pixel", "<f8", 2), ("point", "<u8")])
"""What images.bin holds of each observation; its point is the largest number where it belongs to none."""


def read_points(path: Path) -> SparsePoints:
    """Points, colours and errors of a points3D.bin, and where photographs saw them if images.bin lies beside it.

    Raises
    ------
    InputError
        If a file holds less than it promises.
    """
    data = path.read_bytes()
    at, numbers, points, colours, errors = 8, [], [], [], []
    try:
        (count,) = struct.unpack_from("<Q", data)
        for _ in range(count):
            number, *values, error, track = _POINT.unpack_from(data, at)
            numbers.append(number)
            points.append(values[:3])
            colours.append(values[3:])
            errors.append(error)
            at += _POINT.size + 8 * track
    except struct.error:
        raise InputError(f"{path}: ends before the points that it promises; reconstruct the trial anew") from None
    beside = path.with_name("images.bin")
    return SparsePoints(
        points_W_m=np.array(points, dtype=np.float64).reshape(-1, 3),
        colours=np.array(colours, dtype=np.uint8).reshape(-1, 3),
        errors_px=np.array(errors, dtype=np.float64),
        seen=_observations(beside, np.array(numbers, dtype=np.uint64)) if beside.is_file() else {},
    )


def _observations(path: Path, numbers: IntArray) -> dict[str, tuple[Array, IntArray]]:
    """By photograph: pixels, and which of the points by their `numbers` was seen at each; the rest is left out."""
    data = path.read_bytes()
    order = np.argsort(numbers)
    ascending = numbers[order]
    seen: dict[str, tuple[Array, IntArray]] = {}
    at = 8
    try:
        (count,) = struct.unpack_from("<Q", data)
        for _ in range(count):
            _IMAGE.unpack_from(data, at)
            end = data.index(b"\0", at + _IMAGE.size)
            name = data[at + _IMAGE.size : end].decode("utf-8")
            (held,) = struct.unpack_from("<Q", data, end + 1)
            rows = np.frombuffer(data, OBSERVATION, held, end + 9)
            at = end + 9 + rows.nbytes
            place = np.minimum(np.searchsorted(ascending, rows["point"]), max(len(ascending) - 1, 0))
            found = ascending[place] == rows["point"] if len(ascending) else np.zeros(held, dtype=np.bool_)
            seen[name] = (rows["pixel"][found].astype(np.float64), order[place[found]].astype(np.int64))
    except (struct.error, ValueError):
        raise InputError(f"{path}: ends before the images that it promises; reconstruct the trial anew") from None
    return seen

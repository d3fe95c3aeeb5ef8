"""The points of a sparse model (COLMAP's points3D.bin), read without COLMAP."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from wakewise.errors import InputError
from wakewise.links.exports.records import Cloud

_POINT = struct.Struct("<Q3d3BdQ")


def read_points(path: Path) -> Cloud:
    """Points, colours and errors of a points3D.bin; tracks are passed over.

    Raises
    ------
    InputError
        If it holds less than it promises.
    """
    data = path.read_bytes()
    at, points, colours, errors = 8, [], [], []
    try:
        (count,) = struct.unpack_from("<Q", data)
        for _ in range(count):
            _, *numbers, error, track = _POINT.unpack_from(data, at)
            points.append(numbers[:3])
            colours.append(numbers[3:])
            errors.append(error)
            at += _POINT.size + 8 * track
    except struct.error:
        raise InputError(f"{path}: ends before the points that it promises; reconstruct the trial anew") from None
    return Cloud(
        points_W_m=np.array(points).reshape(-1, 3),
        colours=np.array(colours, dtype=np.uint8).reshape(-1, 3),
        errors_px=np.array(errors),
    )

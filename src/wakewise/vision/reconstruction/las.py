"""Points as LAS 1.2, point format 2, which surveyors' programs read: places as whole numbers, colours of 16 bits.

American Society for Photogrammetry and Remote Sensing, LAS Specification Version 1.2, 2008, tables 3, 4 and 9.
"""

from __future__ import annotations

import struct
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np

from wakewise.core.files import whole_file
from wakewise.vision.reconstruction.clouds import OrientedPointCloud

HEADER_BYTES, FORMAT, RECORD_BYTES = 227, 2, 26
_RECORD = np.dtype(
    [("xyz", "<i4", 3), ("intensity", "<u2"), ("returns", "u1"), ("kind", "u1"), ("angle", "i1"), ("user", "u1"),
     ("source", "<u2"), ("rgb", "<u2", 3)]
)  # fmt: skip
_ONE_RETURN = 0b00001001  # the first of one
_NEVER_CLASSIFIED = 0


def write_las(path: Path, cloud: OrientedPointCloud, day: date | None = None) -> None:
    """Write points, whole or not at all; steps are a ten-thousandth of the spread, rounded to a power of ten or finer.

    Parameters
    ----------
    day : date, optional
        Day of creation; today if not given.
    """
    points = cloud.points_m
    low, high = points.min(axis=0), points.max(axis=0)
    step = 10.0 ** np.floor(np.log10(max(float((high - low).max()), 1e-9) * 1e-5))
    offset = np.floor(low / step) * step
    rows = np.zeros(len(points), dtype=_RECORD)
    rows["xyz"] = np.rint((points - offset) / step)
    rows["returns"] = _ONE_RETURN
    rows["kind"] = _NEVER_CLASSIFIED
    rows["rgb"] = np.clip(np.rint(65535 * cloud.colours), 0, 65535)
    day = datetime.now(UTC).date() if day is None else day
    header = struct.pack(
        "<4sHH16sBB32s32sHHHIIBHI5I3d3d6d",
        b"LASF", 0, 0, bytes(16), 1, 2, b"EXTRACTION", b"Wakewise",
        day.timetuple().tm_yday, day.year, HEADER_BYTES, HEADER_BYTES, 0, FORMAT, RECORD_BYTES, len(rows),
        len(rows), 0, 0, 0, 0, step, step, step, *offset, high[0], low[0], high[1], low[1], high[2], low[2],
    )  # fmt: skip
    with whole_file(path) as temporary:
        temporary.write_bytes(header + rows.tobytes())

"""LAS files: header and records where the specification has them, read back field by field."""

import struct
from datetime import date

import numpy as np
import pytest

from wakewise.vision.reconstruction import OrientedPointCloud
from wakewise.vision.reconstruction.outputs.clouds import write_las


def test_points_and_colours_come_back(tmp_path):
    """Places to a ten-thousandth of the spread or better, colours to 16 bits, bounds and counts as they are."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-3.0, 5.0, (1000, 3)) * [1.0, 0.2, 0.1] + [1000.0, -20.0, 3.0]
    colours = rng.uniform(0.0, 1.0, (1000, 3))
    path = tmp_path / "a.las"
    write_las(path, OrientedPointCloud(points_m=points, normals=np.zeros((1000, 3)), colours=colours), date(2026, 2, 3))
    data = path.read_bytes()
    # LAS 1.2, table 3: offsets in bytes from the beginning of the file.
    assert data[:4] == b"LASF"
    assert data[24:26] == bytes([1, 2])
    assert struct.unpack_from("<HH", data, 90) == (34, 2026)
    header, start, extra = struct.unpack_from("<HII", data, 94)
    kind, length, count = struct.unpack_from("<BHI", data, 104)
    assert (header, start, extra, kind, length, count) == (227, 227, 0, 2, 26, 1000)
    assert struct.unpack_from("<5I", data, 111) == (1000, 0, 0, 0, 0)
    step, offset = np.array(struct.unpack_from("<3d", data, 131)), np.array(struct.unpack_from("<3d", data, 155))
    bounds = struct.unpack_from("<6d", data, 179)
    assert bounds == pytest.approx([v for k in range(3) for v in (points[:, k].max(), points[:, k].min())])
    assert len(data) == 227 + 26 * 1000
    # Table 9: x, y, z, intensity, returns, class, angle, user, source, red, green, blue.
    rows = [struct.unpack_from("<3iHBBbBH3H", data, 227 + 26 * k) for k in range(1000)]
    read = np.array([row[:3] for row in rows]) * step + offset
    assert np.abs(read - points).max() <= 0.51 * step[0]
    assert step[0] <= 1e-4 * 8.0
    assert {row[4] for row in rows} == {0b1001}
    assert np.abs(np.array([row[9:] for row in rows]) / 65535.0 - colours).max() < 1e-5


def test_one_point_is_a_file(tmp_path):
    """No spread, no division by it."""
    write_las(
        tmp_path / "a.las",
        OrientedPointCloud(points_m=np.ones((1, 3)), normals=np.zeros((1, 3)), colours=np.ones((1, 3))),
    )
    assert (tmp_path / "a.las").stat().st_size == 253

"""Point and mesh files: binary PLY, and LAS 1.2 with point format 2.

American Society for Photogrammetry and Remote Sensing, LAS Specification Version 1.2, 2008, tables 3, 4 and 9.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import trimesh

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.checks import path_of
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file
from wakewise.core.size_limits import broken_ply


@dataclass(frozen=True, kw_only=True, eq=False)
class OrientedPointCloud:
    """Points in m with unit normals and colours (red, green, blue, 0 to 1), each of shape (n, 3)."""

    points_m: Array
    normals: Array
    colours: Array

    def __post_init__(self) -> None:
        freeze(self, points_m=(None, 3), normals=(None, 3), colours=(None, 3))

    def only(self, kept: BoolArray) -> OrientedPointCloud:
        """The points that a mask of shape (n,) keeps."""
        return OrientedPointCloud(points_m=self.points_m[kept], normals=self.normals[kept], colours=self.colours[kept])


_FIELDS = [(k, "<f4") for k in ("x", "y", "z", "nx", "ny", "nz")] + [(k, "u1") for k in ("red", "green", "blue")]


def write_cloud(path: Path, cloud: OrientedPointCloud) -> None:
    """Write a binary PLY file, whole or not at all."""
    rows = np.empty(len(cloud.points_m), dtype=_FIELDS)
    for k, name in enumerate(("x", "y", "z")):
        rows[name] = cloud.points_m[:, k]
        rows["n" + name] = cloud.normals[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        rows[name] = np.clip(np.rint(255 * cloud.colours[:, k]), 0, 255)
    words = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {words[kind]} {name}\n" for name, kind in _FIELDS)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    with whole_file(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + rows.tobytes())


def read_cloud(path: Path) -> OrientedPointCloud:
    """Read points from a PLY file or any other that holds points or a mesh; grey and without normals where none are.

    Raises InputError if the file is missing, is no point file, or holds no finite points.
    """
    path = path_of(path, "cloud")
    if not path.is_file():
        raise InputError(f"{path}: does not exist; a file of points is needed (.ply)")
    try:
        broken = broken_ply(path)
        loaded = trimesh.load(path, process=False) if broken is None else None
    except (ValueError, KeyError, IndexError, TypeError, NotImplementedError, OSError):
        raise InputError(f"{path}: is no file of points that can be read; a PLY file is one, for example") from None
    if broken is not None:
        raise InputError(f"{path}: was cut short, {broken}")
    points = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), dtype=np.float64).reshape(-1, 3)
    if len(points) == 0:
        raise InputError(f"{path}: holds no points, at least one is needed")
    if wrong := int((~np.isfinite(points)).any(axis=1).sum()):
        raise InputError(f"{path}: {wrong} of {len(points)} points are NaN or infinite; remove them")
    normals, colours = (_raw(loaded, names, len(points)) for names in (("nx", "ny", "nz"), ("red", "green", "blue")))
    return OrientedPointCloud(
        points_m=points,
        normals=np.zeros((len(points), 3)) if normals is None or not np.isfinite(normals).all() else normals,
        colours=np.full((len(points), 3), 0.5) if colours is None else colours / 255.0,
    )


def _raw(loaded: object, names: tuple[str, ...], count: int) -> Array | None:
    """Columns of a PLY file's vertex table, if they are there."""
    metadata = getattr(loaded, "metadata", {}).get("_ply_raw", {})
    table = metadata.get("vertex", {}).get("data")
    if table is None or getattr(table, "dtype", None) is None or table.dtype.names is None:
        return None
    if not set(names) <= set(table.dtype.names) or len(table) != count:
        return None
    return np.stack([np.asarray(table[name], dtype=np.float64).reshape(-1) for name in names], axis=1)


def read_surface(path: Path) -> tuple[Array, IntArray]:
    """Vertices and faces of a mesh file. Raises StageError if it is missing or holds no triangles."""
    mesh = trimesh.load(path, process=False) if path.is_file() else None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise StageError(f"{path}: holds no triangles")
    # Plain arrays: trimesh's own keep a record of every element that is read.
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def write_mesh(path: Path, vertices_m: Array, faces: IntArray, colours: Array) -> None:
    """Write a coloured triangle mesh as binary PLY, whole or not at all; colours 0 to 1, shape (n, 3)."""
    opaque = np.concatenate([np.clip(np.rint(255 * colours), 0, 255), np.full((len(colours), 1), 255)], axis=1)
    mesh = trimesh.Trimesh(vertices_m, faces, vertex_colors=opaque.astype(np.uint8), process=False)
    data = mesh.export(file_type="ply")
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


HEADER_BYTES, FORMAT, RECORD_BYTES = 227, 2, 26
_RECORD = np.dtype(
    [("xyz", "<i4", 3), ("intensity", "<u2"), ("returns", "u1"), ("kind", "u1"), ("angle", "i1"), ("user", "u1"),
     ("source", "<u2"), ("rgb", "<u2", 3)]
)  # fmt: skip
_ONE_RETURN = 0b00001001  # the first of one
_NEVER_CLASSIFIED = 0


def write_las(path: Path, cloud: OrientedPointCloud, day: date | None = None) -> None:
    """Write points, whole or not at all; steps are a ten-thousandth of the spread, rounded to a power of ten or finer.

    `day`: day of creation; today if not given.
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

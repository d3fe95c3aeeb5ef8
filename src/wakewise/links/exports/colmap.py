"""Photographs with known poses as a COLMAP model: `sparse/0/*.bin`, the same in text, and `images/` beside them.

Format: https://colmap.github.io/format.html. Poses there are world-to-camera; camera axes and pixel centres are ours,
and the world stays NED. The binary model holds every number exactly.
"""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

from wakewise.arrays import Array
from wakewise.geometry import Pose
from wakewise.links.exports.records import Cloud, Photographs

_OPENCV = 4  # COLMAP's number of the camera model


def write_colmap(folder: Path, photographs: Photographs, cloud: Cloud | None = None) -> None:
    """Write images/, sparse/0/ (binary) and sparse_text/ into a folder that is there and empty.

    Points come without tracks: what saw them belongs to other poses than these.
    """
    (folder / "images").mkdir()
    for file in photographs.files:
        shutil.copyfile(file, folder / "images" / file.name)
    poses = _world_to_camera(photographs)
    _write_binary(folder / "sparse" / "0", photographs, poses, cloud)
    _write_text(folder / "sparse_text", photographs, poses, cloud)


def _world_to_camera(photographs: Photographs) -> list[tuple[Array, Array]]:
    """Quaternion and translation of each photograph's X_CW."""
    track = photographs.track
    inverses = [Pose(p, q).inverse() for p, q in zip(track.p_W_m, track.q, strict=True)]
    return [(X_CW.q, X_CW.p_m) for X_CW in inverses]


def _write_binary(
    folder: Path, photographs: Photographs, poses: list[tuple[Array, Array]], cloud: Cloud | None
) -> None:
    folder.mkdir(parents=True)
    size = (photographs.width, photographs.height)
    (folder / "cameras.bin").write_bytes(struct.pack("<QIiQQ8d", 1, 1, _OPENCV, *size, *photographs.params))
    with (folder / "images.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(poses)))
        for k, (q, t) in enumerate(poses):
            name = photographs.files[k].name.encode("utf-8")
            file.write(struct.pack("<I7dI", k + 1, *q, *t, 1) + name + b"\0" + struct.pack("<Q", 0))
    with (folder / "points3D.bin").open("wb") as file:
        file.write(struct.pack("<Q", 0 if cloud is None else len(cloud.points_W_m)))
        if cloud is not None:
            for k, (point, colour, error) in enumerate(
                zip(cloud.points_W_m, cloud.colours, cloud.errors_px, strict=True)
            ):
                file.write(struct.pack("<Q3d3BdQ", k + 1, *point, *colour.tolist(), error, 0))


def _write_text(folder: Path, photographs: Photographs, poses: list[tuple[Array, Array]], cloud: Cloud | None) -> None:
    folder.mkdir(parents=True)
    camera = f"1 OPENCV {photographs.width} {photographs.height} {_numbers(photographs.params)}\n"
    (folder / "cameras.txt").write_text(f"# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n{camera}", encoding="utf-8")
    lines = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points (none)"]
    for k, (q, t) in enumerate(poses):
        lines += [f"{k + 1} {_numbers(q)} {_numbers(t)} 1 {photographs.files[k].name}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = ["# POINT3D_ID X Y Z R G B ERROR TRACK"]
    if cloud is not None:
        for k, point in enumerate(cloud.points_W_m):
            red, green, blue = cloud.colours[k].tolist()
            rows.append(f"{k + 1} {_numbers(point)} {red} {green} {blue} {cloud.errors_px[k]:.17g}")
    (folder / "points3D.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.17g}" for value in values)

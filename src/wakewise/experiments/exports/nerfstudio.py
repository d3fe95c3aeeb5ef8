"""Photographs with their poses as nerfstudio's `transforms.json`, which trainers of radiance fields and splats read.

Format: https://docs.nerf.studio/quickstart/data_conventions.html. Poses are camera-to-world with OpenGL's axes; pixel
centres are at +0.5 there as here. Poses and points stand in one world, x north, y west, z up: `applied_transform` is
left out, since readers of different age apply it to the points or do not.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np

from wakewise.experiments.exports.frames import flu_of, opengl_camera
from wakewise.experiments.exports.records import Photographs, SparsePoints

_NAMES = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")


def write_nerfstudio(folder: Path, photographs: Photographs, cloud: SparsePoints | None = None) -> None:
    """Write transforms.json, images/ and, with a cloud, sparse_pc.ply into a folder that is there and empty."""
    (folder / "images").mkdir()
    frames = []
    matrices = opengl_camera(photographs.track.p_W_m, photographs.track.q)
    for file, matrix in zip(photographs.files, matrices, strict=True):
        shutil.copyfile(file, folder / "images" / file.name)
        frames.append({"file_path": f"images/{file.name}", "transform_matrix": matrix.tolist()})
    head = {
        "camera_model": "OPENCV",
        "w": photographs.width,
        "h": photographs.height,
        **dict(zip(_NAMES, photographs.params.tolist(), strict=True)),
    }
    if cloud is not None:
        _write_ply(folder / "sparse_pc.ply", cloud)
        head["ply_file_path"] = "sparse_pc.ply"
    text = json.dumps({**head, "frames": frames}, indent=2, allow_nan=False)
    (folder / "transforms.json").write_text(text + "\n", encoding="utf-8")


def _write_ply(path: Path, cloud: SparsePoints) -> None:
    row = np.dtype([("p", "<f8", 3), ("c", "u1", 3)])
    rows = np.empty(len(cloud.points_W_m), row)
    rows["p"], rows["c"] = flu_of(cloud.points_W_m), cloud.colours
    properties = [f"property double {axis}" for axis in "xyz"] + [
        f"property uchar {c}" for c in ("red", "green", "blue")
    ]
    head = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}", *properties, "end_header"]
    )
    path.write_bytes(head.encode("ascii") + b"\n" + rows.tobytes())

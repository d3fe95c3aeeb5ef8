"""Photographs with known poses as a COLMAP model: `sparse/0/*.bin`, the same in text, and `images/` beside them.

Format: https://colmap.github.io/format.html. Poses there are world-to-camera; camera axes and pixel centres are ours,
and the world stays NED. The binary model holds every number exactly.

The points of a sparse model (COLMAP's points3D.bin and images.bin), read without COLMAP.

Photographs with their poses as nerfstudio's `transforms.json`, which trainers of radiance fields and splats read.

Format: https://docs.nerf.studio/quickstart/data_conventions.html. Poses are camera-to-world with OpenGL's axes; pixel
centres are at +0.5 there as here. Poses and points stand in one world, x north, y west, z up: `applied_transform` is
left out, since readers of different age apply it to the points or do not.

A trajectory as text lines `timestamp tx ty tz qx qy qz qw`, which evo and the TUM RGB-D tools read.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.core.geometry import Pose
from wakewise.experiments.exports.records import Photographs, SparsePoints, Trajectory, flu_of, opengl_camera
from wakewise.experiments.exports.training_data import place_picture
from wakewise.vision.reconstruction.photos.lenses import distort

_POINT = struct.Struct("<Q3d3BdQ")
_IMAGE = struct.Struct("<I7dI")
OBSERVATION = np.dtype([("pixel", "<f8", 2), ("point", "<u8")])
"""What images.bin holds of each observation; its point is the largest number where it belongs to none."""


def read_points(path: Path) -> SparsePoints:
    """Points, colours and errors of a points3D.bin, and where photographs saw them if images.bin lies beside it.

    Raises InputError if a file holds less than it promises.
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


_PINHOLE, _OPENCV = 1, 4  # COLMAP's numbers of the camera models
_NONE = (np.zeros((0, 2)), np.zeros(0, dtype=np.int64))


@dataclass(frozen=True)
class _Model:
    """What both forms of the model say: poses, and of each photograph and each point what belongs together.

    `pixels[k]` and `points[k]` are the observations of photograph k; `tracks[i]` the (photograph, observation) pairs of
    point i, from 0; `errors_px[i]` its mean reprojection error with these poses, -1 (COLMAP: not known) without any.
    """

    poses: list[tuple[Array, Array]]
    pixels: list[Array]
    points: list[IntArray]
    tracks: list[list[tuple[int, int]]]
    errors_px: Array


def write_colmap(
    folder: Path, photographs: Photographs, cloud: SparsePoints | None = None, held_out: Sequence[str] = ()
) -> int:
    """Write images/, sparse/0/ (binary) and sparse_text/ into a folder that is there.

    Returns how many observations of points it holds. Errors of points are those of the poses and the camera written
    here, not of the model that the points are from. A camera without distortion is a PINHOLE. Held-out photographs are
    named in sparse/0/test.txt, where trainers of splats look for them.
    """
    (folder / "images").mkdir(exist_ok=True)
    for file in photographs.files:
        place_picture(file, folder / "images" / file.name)
    model = _model(photographs, cloud)
    _write_binary(folder / "sparse" / "0", photographs, model, cloud)
    _write_text(folder / "sparse_text", photographs, model, cloud)
    if held_out:
        (folder / "sparse" / "0" / "test.txt").write_text("\n".join(held_out) + "\n", encoding="utf-8")
    return sum(map(len, model.points))


def _model(photographs: Photographs, cloud: SparsePoints | None) -> _Model:
    track = photographs.track
    inverses = [Pose(p, q).inverse() for p, q in zip(track.p_W_m, track.q, strict=True)]
    count = 0 if cloud is None else len(cloud.points_W_m)
    tracks: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    sums, pixels, points = np.zeros(count), [], []
    for k, (file, X_CW) in enumerate(zip(photographs.files, inverses, strict=True)):
        at, which = _NONE if cloud is None else cloud.seen.get(file.name, _NONE)
        if cloud is not None and len(which):
            seen_C = X_CW.apply(cloud.points_W_m[which])
            ahead = seen_C[:, 2] > 0.0
            at, which = at[ahead], which[ahead]
            np.add.at(sums, which, np.linalg.norm(_projected(seen_C[ahead], photographs.params) - at, axis=1))
            for j, i in enumerate(which.tolist()):
                tracks[i].append((k, j))
        pixels.append(at)
        points.append(which)
    lengths = np.array([len(track) for track in tracks])
    errors = np.where(lengths > 0, sums / np.maximum(lengths, 1), -1.0)
    return _Model([(X_CW.q, X_CW.p_m) for X_CW in inverses], pixels, points, tracks, errors)


def _camera(photographs: Photographs) -> tuple[str, Array]:
    """COLMAP's camera model and its parameters."""
    distorted = bool(photographs.params[4:].any())
    return ("OPENCV", photographs.params) if distorted else ("PINHOLE", photographs.params[:4])


def _projected(points_C_m: Array, params: Array) -> Array:
    """Pixels, shape (n, 2), of points before a camera with OpenCV's distortion."""
    return distort(points_C_m[:, :2] / points_C_m[:, 2:], params[4:], fisheye=False) * params[:2] + params[2:4]


def _write_binary(folder: Path, photographs: Photographs, model: _Model, cloud: SparsePoints | None) -> None:
    folder.mkdir(parents=True)
    size = (photographs.width, photographs.height)
    model_name, params = _camera(photographs)
    kind = _PINHOLE if model_name == "PINHOLE" else _OPENCV
    (folder / "cameras.bin").write_bytes(struct.pack(f"<QIiQQ{len(params)}d", 1, 1, kind, *size, *params))
    with (folder / "images.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(model.poses)))
        for k, (q, t) in enumerate(model.poses):
            name = photographs.files[k].name.encode("utf-8")
            rows = np.empty(len(model.points[k]), OBSERVATION)
            rows["pixel"], rows["point"] = model.pixels[k], model.points[k] + 1
            head = struct.pack("<I7dI", k + 1, *q, *t, 1) + name + b"\0" + struct.pack("<Q", len(rows))
            file.write(head + rows.tobytes())
    with (folder / "points3D.bin").open("wb") as file:
        file.write(struct.pack("<Q", 0 if cloud is None else len(cloud.points_W_m)))
        if cloud is not None:
            for i, (point, colour) in enumerate(zip(cloud.points_W_m, cloud.colours, strict=True)):
                track = np.array(model.tracks[i], dtype="<u4").reshape(-1, 2) + np.array([1, 0], dtype="<u4")
                head = struct.pack("<Q3d3BdQ", i + 1, *point, *colour.tolist(), model.errors_px[i], len(track))
                file.write(head + track.tobytes())


def _write_text(folder: Path, photographs: Photographs, model: _Model, cloud: SparsePoints | None) -> None:
    folder.mkdir(parents=True)
    name, params = _camera(photographs)
    camera = f"1 {name} {photographs.width} {photographs.height} {_numbers(params)}\n"
    (folder / "cameras.txt").write_text(f"# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n{camera}", encoding="utf-8")
    lines = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of X Y POINT3D_ID of what was seen in it"]
    for k, (q, t) in enumerate(model.poses):
        lines.append(f"{k + 1} {_numbers(q)} {_numbers(t)} 1 {photographs.files[k].name}")
        seen = zip(model.pixels[k], model.points[k].tolist(), strict=True)
        lines.append(" ".join(f"{_numbers(pixel)} {i + 1}" for pixel, i in seen))
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = ["# POINT3D_ID X Y Z R G B ERROR TRACK (IMAGE_ID POINT2D_IDX)"]
    if cloud is not None:
        for i, point in enumerate(cloud.points_W_m):
            red, green, blue = cloud.colours[i].tolist()
            track = "".join(f" {k + 1} {j}" for k, j in model.tracks[i])
            rows.append(f"{i + 1} {_numbers(point)} {red} {green} {blue} {model.errors_px[i]:.17g}{track}")
    (folder / "points3D.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.17g}" for value in values)


_NAMES = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")


def write_nerfstudio(
    folder: Path, photographs: Photographs, cloud: SparsePoints | None = None, held_out: Sequence[str] = ()
) -> None:
    """Write transforms.json, images/ and, with a cloud, sparse_pc.ply into a folder that is there.

    Held-out photographs are nerfstudio's `test_filenames` and `val_filenames`, the others its `train_filenames`.
    """
    (folder / "images").mkdir(exist_ok=True)
    frames = []
    matrices = opengl_camera(photographs.track.p_W_m, photographs.track.q)
    for file, matrix in zip(photographs.files, matrices, strict=True):
        place_picture(file, folder / "images" / file.name)
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
    if held_out:
        paths = [frame["file_path"] for frame in frames]
        judged = [f"images/{name}" for name in held_out]
        head |= {
            "train_filenames": [path for path in paths if path not in judged],
            "val_filenames": judged,
            "test_filenames": judged,
        }
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


def write_tum(path: Path, track: Trajectory, note: str) -> None:
    """Write a trajectory; the format states no axes, so they stay ours (NED), and the first line says so.

    `note` says what moved, and its axes.
    """
    rows = np.column_stack([track.times_s, track.p_W_m, track.q[:, [1, 2, 3, 0]]])
    lines = [" ".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    head = f"# {note}, in a world north-east-down\n# timestamp tx ty tz qx qy qz qw\n"
    write_text(path, head + "\n".join(lines) + "\n")

"""COLMAP's cameras and images from its files, text or binary, without the points that its own reader asks for.

Formats: COLMAP documentation, Output format.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise.vision.reconstruction.lenses import COUNTS, LAYOUTS, Lens, lens_from

_MODELS = (
    *("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV"),
    *("SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"),
)
"""Names by number in binary files."""
Pose = tuple[Array, Array]
"""R_WC, shape (3, 3), and p_WC, shape (3,)."""


def read_colmap(folder: Path) -> tuple[dict[str, Pose], dict[str, Lens]]:
    """Poses and lenses by photo name from images and cameras (.bin before .txt).

    Raises
    ------
    InputError
        If a file is missing or damaged, or a camera is of a model that is not known here.
    """
    binary = (folder / "images.bin").is_file()
    suffix = ".bin" if binary else ".txt"
    cameras_file, images_file = folder / f"cameras{suffix}", folder / f"images{suffix}"
    for file in (cameras_file, images_file):
        if not file.is_file():
            raise InputError(f"{file}: does not exist; COLMAP's cameras{suffix} and images{suffix} are needed")
    try:
        cameras = _cameras_bin(cameras_file) if binary else _cameras_txt(cameras_file)
        lenses = {number: _lens(cameras_file, *camera) for number, camera in cameras.items()}
        images = list(_images_bin(images_file) if binary else _images_txt(images_file))
        poses = {name: _pose(numbers) for name, numbers, _ in images}
        return poses, {name: lenses[camera] for name, _, camera in images}
    except (OSError, UnicodeDecodeError, ValueError, IndexError, KeyError, struct.error):
        raise InputError(f"{folder}: cameras{suffix} and images{suffix} are not as COLMAP writes them") from None


def _lens(file: Path, model: str, width: int, height: int, params: Array) -> Lens:
    if model not in LAYOUTS:
        raise InputError(f"{file}: camera model {model} is not known here, allowed are {', '.join(LAYOUTS)}")
    if len(params) != COUNTS[model] or not np.isfinite(params).all():
        raise InputError(f"{file}: {len(params)} parameters, {model} has {COUNTS[model]}, all finite")
    return lens_from(model, width, height, params)


def _pose(numbers: Array) -> Pose:
    """From world-to-camera, quaternion and shift, to the camera in the world."""
    if not np.isfinite(numbers).all() or not np.linalg.norm(numbers[:4]) > 0.0:
        raise ValueError
    R_CW = matrix_from_quat(numbers[:4])
    return R_CW.T, -R_CW.T @ numbers[4:]


def _rows(file: Path) -> list[list[str]]:
    return [line.split() for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def _cameras_txt(file: Path) -> dict[int, tuple[str, int, int, Array]]:
    rows = [row for row in _rows(file) if row]
    return {int(r[0]): (r[1], int(r[2]), int(r[3]), np.array([float(word) for word in r[4:]])) for r in rows}


def _images_txt(file: Path) -> Iterator[tuple[str, Array, int]]:
    """Two lines an image; the second, of its points, may be empty."""
    rows = _rows(file)
    while rows and not rows[-1]:
        rows.pop()
    for row in rows[::2]:
        yield " ".join(row[9:]), np.array([float(word) for word in row[1:8]]), int(row[8])


def _cameras_bin(file: Path) -> dict[int, tuple[str, int, int, Array]]:
    data, at, out = file.read_bytes(), 8, {}
    for _ in range(struct.unpack_from("<Q", data)[0]):
        number, kind, width, height = struct.unpack_from("<iiQQ", data, at)
        model = _MODELS[kind] if 0 <= kind < len(_MODELS) else f"number {kind}"
        if model not in COUNTS:
            raise InputError(f"{file}: camera model {model} is not known here, allowed are {', '.join(LAYOUTS)}")
        out[number] = (model, width, height, np.frombuffer(data, "<f8", COUNTS[model], at + 24))
        at += 24 + 8 * COUNTS[model]
    if at != len(data):
        raise ValueError
    return out


def _images_bin(file: Path) -> Iterator[tuple[str, Array, int]]:
    data, at = file.read_bytes(), 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        numbers = np.frombuffer(data, "<f8", 7, at + 4)
        (camera,) = struct.unpack_from("<i", data, at + 60)
        end = data.index(b"\0", at + 64)
        yield data[at + 64 : end].decode(), numbers, camera
        (points,) = struct.unpack_from("<Q", data, end + 1)
        at = end + 9 + 24 * points
    if at != len(data):
        raise ValueError

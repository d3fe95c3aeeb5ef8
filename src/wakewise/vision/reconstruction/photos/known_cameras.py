"""Known poses and intrinsics of photographs from COLMAP, nerfstudio, a CSV table or Strecha's .camera files.

COLMAP's cameras and images are read without the points that its own reader needs (COLMAP documentation, Output format).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.csv_separators import csv_rows
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise.vision.reconstruction.photos.lenses import COUNTS, LAYOUTS, Lens, read_model
from wakewise.vision.reconstruction.photos.photo_folder import Photo

_MODELS = (
    *("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV"),
    *("SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"),
)
"""Names by number in binary files."""
Pose = tuple[Array, Array]
"""R_WC, shape (3, 3), and p_WC, shape (3,)."""


def _read_colmap(folder: Path) -> KnownCameras:
    """Poses and lenses from COLMAP's images and cameras (.bin before .txt).

    Raises InputError if a file is missing or damaged, or a camera is of a model that is not known here.
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
        return KnownCameras(
            rotations={name: pose[0] for name, pose in poses.items()},
            positions={name: pose[1] for name, pose in poses.items()},
            lenses={name: lenses[camera] for name, _, camera in images},
        )
    except (OSError, UnicodeDecodeError, ValueError, IndexError, KeyError, struct.error):
        raise InputError(f"{folder}: cameras{suffix} and images{suffix} are not as COLMAP writes them") from None


def _lens(file: Path, model: str, width: int, height: int, params: Array) -> Lens:
    if model not in LAYOUTS:
        raise InputError(f"{file}: camera model {model} is not known here, allowed are {', '.join(LAYOUTS)}")
    return read_model(file, model, width, height, params)


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


LEAST_CAMERAS = 2
MOST_SKEW = 1e-3
"""How far R'R may be from the unit matrix: more is no rotation, such as one with a scale in it."""
_KINDS = (
    "a folder of COLMAP's model (cameras and images, .txt or .bin), nerfstudio's transforms.json, a CSV file "
    "(name,x_m,y_m,z_m,qw,qx,qy,qz and perhaps width,height,fx,fy,cx,cy,k1,k2,p1,p2) or a folder of .camera files"
)
_POSE = ("name", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_LENS = ("width", "height", "fx", "fy", "cx", "cy")
_BEND, _FISHEYE_BEND = ("k1", "k2", "p1", "p2"), ("k1", "k2", "k3", "k4")


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownCameras:
    """By photo name: R_WC, shape (3, 3), camera axes right, down, ahead; p_WC_m, shape (3,); the lens where known."""

    rotations: dict[str, Array]
    positions: dict[str, Array]
    lenses: dict[str, Lens] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, given in self.rotations.items():
            R, place = np.asarray(given), np.asarray(self.positions[name])
            straight = R.shape == (3, 3) and bool(np.isfinite(R).all()) and bool(np.isfinite(place).all())
            if not straight or np.abs(R.T @ R - np.eye(3)).max() > MOST_SKEW or np.linalg.det(R) < 0.0:
                raise InputError(f"camera of {name}: its pose is no rotation with a place, all of it finite")


def read_known_cameras(path: Path) -> KnownCameras:
    """Poses and lenses of photographs.

    `path`: a folder with COLMAP's cameras and images (.txt or .bin; `sparse/0` below it is looked into, too),
    nerfstudio's transforms.json or a folder that holds it (OpenGL axes: right, up, back), a CSV file, or a folder of
    Strecha's .camera files. Raises InputError if nothing of these is there, or a file does not hold what it should.
    """
    if path.is_dir():
        for folder in (path, path / "sparse" / "0", path / "sparse"):
            if any((folder / f"images{suffix}").is_file() for suffix in (".bin", ".txt")):
                return _read_colmap(folder)
        if (path / "transforms.json").is_file():
            return _read_nerfstudio(path / "transforms.json")
        files = sorted(path.glob("*.camera"))
        if files:
            return _read_strecha(files)
        raise InputError(f"{path}: holds no cameras; needed is {_KINDS}")
    if not path.is_file():
        raise InputError(f"{path}: does not exist; needed is {_KINDS}")
    if path.suffix.lower() == ".json":
        return _read_nerfstudio(path)
    return _read_table(path)


def match_known(known: KnownCameras, photos: tuple[Photo, ...]) -> KnownCameras:
    """Cameras by the photos' own names: a name fits whole, without folders, or without its suffix.

    A lens of a photo of the same shape but another size, as of photographs that were made smaller, is scaled.

    Raises InputError if fewer than two photos have one, a name fits two cameras, or a lens has another shape than its
    photo.
    """
    by_file, by_stem = _by(known.positions, lambda p: p.name), _by(known.positions, lambda p: p.stem)
    rotations, positions, lenses = {}, {}, {}
    for photo in photos:
        path = PurePosixPath(photo.name)
        fits = [photo.name] if photo.name in known.positions else by_file.get(path.name) or by_stem.get(path.stem) or []
        # A CSV of names without suffix: 0001.camera's name is 0001.jpg, whose stem is 0001.
        if len(fits) > 1:
            raise InputError(f"cameras: {photo.name} fits {fits[0]} and {fits[1]}; give the names with their folders")
        if not fits:
            continue
        name = fits[0]
        rotations[photo.name], positions[photo.name] = known.rotations[name], known.positions[name]
        if name in known.lenses:
            lenses[photo.name] = _fitted(known.lenses[name], photo)
    if len(positions) < LEAST_CAMERAS:
        example = f"{next(iter(known.positions))} for {photos[0].name}" if known.positions else "none given"
        raise InputError(
            f"cameras: {len(positions)} of {len(photos)} photos have one, at least {LEAST_CAMERAS} must; names must be "
            f"the photos' names ({example})"
        )
    return KnownCameras(rotations=rotations, positions=positions, lenses=lenses)


def _by(names: Iterable[str], part: Any) -> dict[str, list[str]]:
    out: dict[str, list[str]] = {}
    for name in names:
        out.setdefault(part(PurePosixPath(name)), []).append(name)
    return out


def _fitted(lens: Lens, photo: Photo) -> Lens:
    """The lens at the photo's size."""
    if (lens.width, lens.height) == (photo.width, photo.height):
        return lens
    ratio = photo.width / lens.width
    if abs(ratio * lens.height - photo.height) > 1.0:
        raise InputError(
            f"cameras: the lens of {photo.name} is of {lens.width} x {lens.height} px, the photo has {photo.width} x "
            f"{photo.height}; it must have the same shape"
        )
    params = np.array(lens.params)
    params[:4] *= ratio  # lengths in pixels; distortion is in units of depth
    return replace(lens, width=photo.width, height=photo.height, params=params)


def _read_nerfstudio(path: Path) -> KnownCameras:
    try:
        whole = json.loads(path.read_text(encoding="utf-8"))
        frames = whole["frames"]
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: is no transforms.json of nerfstudio, which holds a list `frames`") from None
    rotations, positions, lenses = {}, {}, {}
    for k, frame in enumerate(frames if isinstance(frames, list) else []):
        try:
            name = PurePosixPath(str(frame["file_path"])).as_posix().removeprefix("./")
            matrix = np.array(frame["transform_matrix"], dtype=np.float64)[:3, :4]
            if matrix.shape != (3, 4):
                raise ValueError(matrix.shape)
            lens = _nerfstudio_lens({**whole, **frame})
        except (KeyError, TypeError, ValueError, IndexError) as fault:
            raise InputError(
                f"{path}: frame {k} must hold file_path, transform_matrix (4 x 4) and a lens (fl_x, cx, cy, w, h, here "
                f"or for all): {type(fault).__name__} {fault}"
            ) from None
        rotations[name] = matrix[:, :3] * [1.0, -1.0, -1.0]  # from OpenGL's axes
        positions[name] = matrix[:, 3]
        if lens is not None:
            lenses[name] = lens
    return KnownCameras(rotations=rotations, positions=positions, lenses=lenses)


def _nerfstudio_lens(values: Mapping[str, Any]) -> Lens | None:
    model = str(values.get("camera_model", "OPENCV"))
    if model not in ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV_FISHEYE"):
        raise ValueError(f"camera_model {model}, allowed is OPENCV, PINHOLE or OPENCV_FISHEYE")
    fisheye = model == "OPENCV_FISHEYE"
    if "w" not in values or "h" not in values:
        return None
    width, height = int(values["w"]), int(values["h"])
    if "fl_x" in values:
        fx = float(values["fl_x"])
    elif "camera_angle_x" in values:
        half = 0.5 * float(values["camera_angle_x"])
        fx = 0.5 * width / (half if fisheye else float(np.tan(half)))
    else:
        return None
    params = [fx, *(float(values.get(*entry)) for entry in (("fl_y", fx), ("cx", width / 2), ("cy", height / 2)))]
    bend, others = (_FISHEYE_BEND, ("p1", "p2")) if fisheye else (_BEND, ("k3", "k4"))
    params += [float(values.get(key, 0.0)) for key in bend]
    for key in others:
        if float(values.get(key, 0.0)) != 0.0:
            raise ValueError(f"{key}, which the four coefficients of {model} do not have")
    return Lens(width=width, height=height, params=np.array(params), fisheye=fisheye)


def _read_table(path: Path) -> KnownCameras:
    rotations, positions, lenses = {}, {}, {}
    for where, row in csv_rows(path, _POSE, f"{_KINDS}; places alone are for --reference-cameras"):
        some = [column for column in _LENS if column in row]
        if some and len(some) < len(_LENS):
            raise InputError(f"{path}: has {', '.join(some)}; a lens needs all of {', '.join(_LENS)}")
        name = row["name"]
        values = _numbers(where, row, _POSE[1:])
        if name in positions or not name or not np.linalg.norm(values[3:]) > 0.0:
            raise InputError(f"{where}: a name comes once, a quaternion is not 0")
        positions[name], rotations[name] = values[:3], matrix_from_quat(values[3:])
        if some:
            numbers = _numbers(where, row, _LENS)
            bend = _numbers(where, row, tuple(c for c in _BEND if c in row))
            params = np.concatenate([numbers[2:], bend, np.zeros(4 - len(bend))])
            lenses[name] = Lens(width=int(numbers[0]), height=int(numbers[1]), params=params)
    return KnownCameras(rotations=rotations, positions=positions, lenses=lenses)


def _numbers(where: str, row: Mapping[str, str | None], columns: tuple[str, ...]) -> Array:
    try:
        values = np.array([float(row[column] or "") for column in columns])
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all():
        raise InputError(f"{where}: {', '.join(columns)} must be numbers, all finite")
    return values


def _read_strecha(files: list[Path]) -> KnownCameras:
    """K in three rows, a row of zeros, three rows of R_WC, the centre, the size (C. Strecha et al., CVPR 2008)."""
    rotations, positions, lenses = {}, {}, {}
    for path in files:
        rows = _camera_rows(path)
        if [len(row) for row in (*rows[:3], *rows[4:9])] != [3, 3, 3, 3, 3, 3, 3, 2]:
            raise InputError(f"{path}: is no .camera file: K, a row of zeros, R (3 rows each), centre, size")
        K, R, centre, size = np.array(rows[:3]), np.array(rows[4:7]), np.array(rows[7]), rows[8]
        name = path.name.removesuffix(".camera")
        # Printed with six digits: the nearest rotation.
        u, _, vt = np.linalg.svd(R)
        rotations[name], positions[name] = u @ vt, centre
        params = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], 0.0, 0.0, 0.0, 0.0])
        lenses[name] = Lens(width=int(size[0]), height=int(size[1]), params=params)
    return KnownCameras(rotations=rotations, positions=positions, lenses=lenses)


def _camera_rows(path: Path) -> list[list[float]]:
    """Rows of numbers of a .camera file, empty lines left out."""
    try:
        rows = [[float(word) for word in line.split()] for line in path.read_text(encoding="utf-8").splitlines()]
    except (OSError, ValueError):
        raise InputError(f"{path}: is no .camera file, holds something that is no number") from None
    return [row for row in rows if row]


def read_reference_cameras(path: Path) -> dict[str, Array]:
    """Camera centres in m, shape (3,), by photo name.

    `path`: a folder of `<photo>.camera` files (C. Strecha et al., CVPR 2008, doi 10.1109/CVPR.2008.4587706: rows of K,
    a row of zeros, rows of the camera-to-world rotation, the camera centre, the image size), or a CSV file with columns
    name, x_m, y_m, z_m. Raises InputError if nothing is there, or a file does not hold what it should.
    """
    if path.is_dir():
        files = sorted(path.glob("*.camera"))
        if not files:
            raise InputError(f"{path}: holds no .camera files; a folder of them or a CSV file is needed")
        return {file.name.removesuffix(".camera"): _camera_centre(file) for file in files}
    if not path.is_file():
        raise InputError(
            f"{path}: does not exist; a folder of .camera files or a CSV file (name,x_m,y_m,z_m) is needed"
        )
    wanted = _POSE[:4]
    out: dict[str, Array] = {}
    for where, row in csv_rows(path, wanted, f"a table with columns {', '.join(wanted)}"):
        name = row["name"] or ""
        if name in out:
            raise InputError(f"{where}: {name} is there twice")
        out[name] = _numbers(where, row, wanted[1:])
    if not out:
        raise InputError(f"{path}: holds no cameras, needs at least 3 rows")
    return out


def _camera_centre(path: Path) -> Array:
    rows = _camera_rows(path)
    if len(rows) < 8 or len(rows[7]) != 3 or not np.all(np.isfinite(rows[7])):
        raise InputError(f"{path}: is no .camera file; row 8 must hold the camera centre, 3 numbers")
    return np.array(rows[7])


def match_references(references: dict[str, Array], names: Iterable[str]) -> dict[str, Array]:
    """References by the photos' own names; a name matches whole or without its suffix (0001.png for 0001.jpg).

    Raises InputError if fewer than three photos have a reference.
    """
    by_stem = {Path(name).stem: position for name, position in references.items()}
    photos = list(names)
    found = {n: references.get(n, by_stem.get(Path(n).stem)) for n in photos}
    matched = {name: np.asarray(p, dtype=np.float64) for name, p in found.items() if p is not None}
    if len(matched) < 3:
        example = f"{next(iter(references))} for {photos[0]}" if references and photos else "none given"
        raise InputError(
            f"reference cameras: {len(matched)} of {len(photos)} photos have one, at least 3 must; "
            f"the names must be the photos' names ({example})"
        )
    return matched

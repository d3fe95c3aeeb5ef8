"""Intrinsics and distortion of a camera in COLMAP's OPENCV or OPENCV_FISHEYE model.

A slope is (x / z, y / z) of a direction; its image is (pixel - centre) / focal length. Perspective: D. C. Brown,
Photogrammetric Engineering 37(8), 1971, with k1, k2, p1, p2. Fisheye: the image radius is a polynomial of the angle
from the axis, J. Kannala and S. S. Brandt, IEEE TPAMI 28(8), 2006, doi 10.1109/TPAMI.2006.153, with k1 to k4.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError, StageError

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.sfm.colmap import pycolmap


# Which parameters of COLMAP's models are fx, fy, cx, cy, k1, k2, p1, p2, or of a fisheye's fx, fy, cx, cy, k1, k2, k3,
# k4; -1 is a zero.
LAYOUTS = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2, -1, -1, -1, -1),
    "PINHOLE": (0, 1, 2, 3, -1, -1, -1, -1),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
    "SIMPLE_RADIAL_FISHEYE": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL_FISHEYE": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV_FISHEYE": (0, 1, 2, 3, 4, 5, 6, 7),
}
_NEEDED = "COLMAP's cameras.txt with one camera, or the JSON of `wakewise calibrate --out`,"
COUNTS = {name: max(layout) + 1 for name, layout in LAYOUTS.items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """Image size in pixels and `params`, shape (8,): fx, fy, cx, cy in pixels (centres at +0.5), k1, k2, p1, p2.

    Of a fisheye the last four are k1 to k4 (see `bending`).
    """

    width: int
    height: int
    params: Array
    fisheye: bool = False

    def __post_init__(self) -> None:
        freeze(self, params=(8,))
        if self.width < 1 or self.height < 1 or not (self.params[:2] > 0.0).all():
            raise InputError(
                f"camera: {self.width} x {self.height} px with focal lengths {self.params[0]:g} and "
                f"{self.params[1]:g} px, all must be above 0"
            )

    def for_colmap(self) -> tuple[str, str]:
        """COLMAP's model and its parameters: no more of them than it takes, as each will be fitted to the photos."""
        fx, fy, cx, cy, *bend = (float(value) for value in self.params)
        if self.fisheye:
            return "OPENCV_FISHEYE", ",".join(repr(value) for value in (fx, fy, cx, cy, *bend))
        if fx == fy and not any(bend):
            return "SIMPLE_RADIAL", f"{fx!r},{cx!r},{cy!r},0"
        return "OPENCV", ",".join(repr(value) for value in (fx, fy, cx, cy, *bend))

    def numbers(self) -> list[float]:
        """Size, parameters and kind as plain numbers."""
        return [float(value) for value in (self.width, self.height, *self.params, self.fisheye)]


def lens_of(camera: pycolmap.Camera) -> Lens:
    """Lens of a camera of a sparse model.

    Raises StageError if its distortion is of another kind than OpenCV's.
    """
    name = str(camera.model.name)
    if name not in LAYOUTS:
        raise StageError(f"cameras: model {name} is not known here, allowed are {', '.join(LAYOUTS)}")
    return lens_from(name, camera.width, camera.height, np.asarray(camera.params))


def read_lens(path: Path) -> Lens:
    """The camera of COLMAP's cameras.txt, given the file or a folder that holds it, or of what `calibrate` wrote.

    Raises InputError if nothing is there, it holds no camera or several, or the camera is not of a known model.
    """
    file = path / "cameras.txt" if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file}: does not exist; {_NEEDED} is needed")
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{file}: is no text file that can be read; {_NEEDED} is needed") from None
    if file.suffix.lower() == ".json" or text.lstrip()[:1] in ("{", "["):
        return _from_calibration(file, text)
    lines = [line.split() for line in text.splitlines()]
    rows = [words for words in lines if words and not words[0].startswith("#")]
    if len(rows) != 1:
        raise InputError(f"{file}: holds {len(rows)} cameras, must hold 1 (id, model, width, height, parameters)")
    row = rows[0]
    if len(row) < 4 or row[1] not in LAYOUTS:
        found = row[1] if len(row) > 1 else " ".join(row)
        raise InputError(f"{file}: camera model '{found[:40]}', allowed are {', '.join(LAYOUTS)}")
    try:
        width, height, params = int(row[2]), int(row[3]), np.array([float(word) for word in row[4:]])
    except ValueError:
        raise InputError(f"{file}: holds something that is no number where the camera's numbers must be") from None
    return read_model(file, row[1], width, height, params)


def _from_calibration(file: Path, text: str) -> Lens:
    """The camera in what `wakewise calibrate --out` wrote."""
    try:
        tree = json.loads(text)
    except ValueError:
        raise InputError(f"{file}: is no whole JSON; {_NEEDED} is needed") from None
    camera = tree.get("colmap") if isinstance(tree, dict) else None
    if not isinstance(camera, dict):
        if isinstance(tree, dict) and "focal_x_px" in tree:
            raise InputError(f"{file}: is a calibration of an earlier version, calibrate again")
        raise InputError(f"{file}: is no calibration; {_NEEDED} is needed")
    model, params = camera.get("model"), camera.get("params")
    size = [side for side in (camera.get("width"), camera.get("height")) if type(side) is int]
    numbers = isinstance(params, list) and all(type(value) in (int, float) for value in params)
    if model not in LAYOUTS or len(size) < 2 or not isinstance(params, list) or not numbers:
        raise InputError(
            f"{file}: colmap must hold model (one of {', '.join(LAYOUTS)}), width, height and params, a list of numbers"
        )
    return read_model(file, str(model), size[0], size[1], np.array(params, dtype=np.float64))


def read_model(file: Path, model: str, width: int, height: int, params: Array) -> Lens:
    """Lens of one of COLMAP's models in `LAYOUTS` as a file states it.

    Raises InputError if the number of parameters is not the model's, or one is not finite.
    """
    if len(params) != COUNTS[model] or not np.isfinite(params).all():
        raise InputError(f"{file}: {len(params)} parameters, {model} has {COUNTS[model]}, all finite")
    return lens_from(model, width, height, params)


def lens_from(model: str, width: int, height: int, params: Array) -> Lens:
    """Lens of one of COLMAP's models in `LAYOUTS`, with as many parameters as it has."""
    in_order = np.append(params, 0.0)[list(LAYOUTS[model])]
    return Lens(width=width, height=height, params=in_order, fisheye=model.endswith("FISHEYE"))


NEWTON_STEPS = 12
WIDEST = np.radians(89.0)
"""Angle from the axis of a fisheye's outermost rays: beyond, a direction has no slope."""


def distort(slopes: Array, params: Array, *, fisheye: bool) -> Array:
    """Images, shape (n, 2), of slopes, shape (n, 2), by a lens of four parameters."""
    return _fisheye(slopes, params) if fisheye else _brown(slopes, params)


def undistort(images: Array, params: Array, *, fisheye: bool) -> Array:
    """Slopes, shape (n, 2), that a lens of four parameters brings to these images, shape (n, 2).

    Where the lens folds the image over, or a fisheye sees sideways, there is none; what comes out is finite.
    """
    return _fisheye_back(images, params) if fisheye else _brown_back(images, params)


def _brown(slopes: Array, params: Array) -> Array:
    k1, k2, p1, p2 = params
    x, y = slopes.T
    r2 = x * x + y * y
    grown = 1.0 + r2 * (k1 + r2 * k2)
    return np.stack(
        [
            x * grown + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * grown + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=1,
    )


def _brown_back(images: Array, params: Array) -> Array:
    k1, k2, p1, p2 = params
    xy: Array = np.array(images)
    for _ in range(NEWTON_STEPS):
        x, y = xy.T
        r2 = x * x + y * y
        grown, slope = 1.0 + r2 * (k1 + r2 * k2), k1 + 2.0 * r2 * k2
        a = grown + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        b = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        d = grown + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        # Where the lens would fold the image over there is no ray: the step is kept small there, nothing is found.
        determinant = np.maximum(a * d - b * b, 0.05)
        ex, ey = (_brown(xy, params) - images).T
        xy = xy - np.stack([(d * ex - b * ey) / determinant, (a * ey - b * ex) / determinant], axis=1)
    return xy


def _fisheye(slopes: Array, params: Array) -> Array:
    r = np.linalg.norm(slopes, axis=1)
    reach = _reach(np.arctan(r), params)
    return np.asarray(slopes * np.where(r > 1e-12, reach / np.maximum(r, 1e-12), 1.0)[:, None])


def _fisheye_back(images: Array, params: Array) -> Array:
    wanted = np.linalg.norm(images, axis=1)
    k1, k2, k3, k4 = params
    angle = np.minimum(wanted, WIDEST)
    for _ in range(NEWTON_STEPS):
        a2 = angle * angle
        slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
        angle = np.clip(angle - (_reach(angle, params) - wanted) / np.maximum(slope, 0.05), 0.0, WIDEST)
    return np.asarray(images * np.where(wanted > 1e-12, np.tan(angle) / np.maximum(wanted, 1e-12), 1.0)[:, None])


def _reach(angle: Array, params: Array) -> Array:
    """Distance from the middle of the image, in focal lengths, of rays at an angle from the axis."""
    k1, k2, k3, k4 = params
    a2 = angle * angle
    return np.asarray(angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))))

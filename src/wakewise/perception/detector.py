"""Object detector: pictures to masks with scores, by a Protocol, with a checked call and a search by name.

Detectors come from an ONNX file, an entry point of the group `wakewise.detectors`, or ``package.module:make``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import BoolArray
from wakewise.core.checks import has_methods, instance_of, one_of, quoted
from wakewise.core.errors import InputError, StageError
from wakewise.core.optional_dependencies import need
from wakewise.core.plugins import make, offered, reason_of

Image = NDArray[np.uint8]
"""RGB picture, shape (h, w, 3)."""

KIND = "detector"
ONNX_SUFFIX = ".onnx"


@dataclass(frozen=True, kw_only=True, eq=False)
class Detection:
    """Detected object: its pixels in the picture, shape (h, w), a score of 0 to 1 and the name of its class or ""."""

    mask: BoolArray
    score: float
    name: str = ""

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        """Bounding box (left, top, right, bottom) in px; right and bottom are exclusive; zeros for an empty mask."""
        columns = np.flatnonzero(self.mask.any(axis=0))
        rows = np.flatnonzero(self.mask.any(axis=1))
        if not columns.size:
            return 0, 0, 0, 0
        return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


class Detector(Protocol):
    """Object detector of single pictures."""

    @property
    def name(self) -> str:
        """Name in messages and records."""

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Detections in an RGB picture, shape (h, w, 3), best first; masks have the shape (h, w)."""


def detect_checked(detector: Detector, image: Image) -> tuple[Detection, ...]:
    """Detections in an RGB picture, shape (h, w, 3), checked and sorted by score, best first.

    Raises InputError if the picture is no such array, or the answer breaks the Protocol: no tuple of `Detection`, a
    mask that is empty or of another size than the picture, a score that is not finite or outside 0 to 1. Raises
    StageError, with the detector's name, if the detector raises.
    """
    height, width = checked_image(image).shape[:2]
    try:
        found: object = detector.detect(image)
    except Exception as fault:
        raise StageError(f"detector {detector.name}: failed, {reason_of(fault)}") from fault
    if not isinstance(found, tuple):
        raise InputError(f"detector {detector.name}: gave a {type(found).__name__}, must be a tuple of Detection")
    for number, one in enumerate(found, start=1):
        _check_detection(one, (height, width), f"detector {detector.name}: detection {number} of {len(found)}")
    # Sorting is stable: a detector that keeps the order keeps its ties.
    return tuple(sorted(found, key=lambda one: -float(one.score)))


def find_detector(name: str) -> Detector:
    """Detector of a name.

    `name`: a path that ends in ``.onnx``, a name that an installed package offers (entry points `wakewise.detectors`),
    or ``package.module:make``. What the last two stand for is called without arguments. Raises InputError if there is
    nothing of that name, it cannot be made, or it is no `Detector`; MissingExtra if ONNX Runtime is not installed.
    """
    instance_of(name, str, KIND)
    if Path(name).suffix.lower() == ONNX_SUFFIX:
        need("an ONNX detector", "detector", "photos", only=("onnxruntime", "cv2"))
        from wakewise.perception.onnx_detector import load_onnx_detector

        return load_onnx_detector(Path(name).expanduser())
    if ":" not in name:
        one_of(name, (*offered(KIND), "package.module:make", f"a path that ends in {ONNX_SUFFIX}"), KIND)
    where = f"{KIND} '{name}'"
    made: Detector = has_methods(make(KIND, name, {}), ("detect",), where, KIND)
    instance_of(getattr(made, "name", None), str, f"{where}: name")
    return made


def checked_image(image: Image) -> Image:
    """The picture itself, if it is a uint8 array of shape (h, w, 3) with pixels; raises InputError if it is not."""
    given: object = image
    if not isinstance(given, np.ndarray):
        raise InputError(f"picture: a {type(given).__name__}, must be a uint8 array of shape (h, w, 3)")
    if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] != 3 or not given.size:
        raise InputError(f"picture: {given.dtype} of shape {given.shape}, must be uint8 of shape (h, w, 3)")
    return image


def _check_detection(one: object, shape: tuple[int, int], where: str) -> None:
    """Raise InputError that begins with `where` if this is no detection in a picture of this shape."""
    if not isinstance(one, Detection):
        raise InputError(f"{where}: a {type(one).__name__}, must be a Detection")
    mask: object = one.mask
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        what = mask.dtype if isinstance(mask, np.ndarray) else type(mask).__name__
        raise InputError(f"{where}: mask of {what}, must be an array of bool")
    if mask.shape != shape:
        raise InputError(f"{where}: mask of shape {mask.shape}, must be {shape}, as the picture")
    if not mask.any():
        raise InputError(f"{where}: mask is empty, must hold at least one pixel")
    score: object = one.score
    name: object = one.name
    if isinstance(score, (bool, np.bool_)) or not isinstance(score, Real) or not 0.0 <= float(score) <= 1.0:
        raise InputError(f"{where}: score {quoted(score)}, must be a number of 0 to 1")
    if not isinstance(name, str):
        raise InputError(f"{where}: name {quoted(name)}, must be text")

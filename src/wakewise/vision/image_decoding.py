"""Pictures by OpenCV: decoded, the size in the header checked first; grey and smaller copies."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.size_limits import check_picture

COLOUR = cv2.IMREAD_COLOR
AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
"""Colour, without EXIF's rotation."""


class _Quiet:
    """Context in which OpenCV's decoders print nothing, in all threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._level = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                cv2.utils.logging.setLogLevel(self._level)


_quiet_decoders = _Quiet()


def decode_picture(data: bytes, name: str, flags: int = COLOUR) -> NDArray[Any] | None:
    """A picture of bytes as OpenCV has it, blue first, rows down; None for what is none.

    Raises InputError if it has more pixels than are allowed; `name` says which it is.
    """
    if not check_picture(data, name):
        return None
    try:
        with _quiet_decoders:
            return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None


def read_picture(path: Path, flags: int = COLOUR) -> NDArray[Any] | None:
    """A picture of a file, as `decode_picture`; None where there is no file that can be read, too.

    Raises InputError if it has more pixels than are allowed.
    """
    try:
        data = path.read_bytes()
    except OSError:
        return None
    return decode_picture(data, str(path), flags)


def grey_of(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey values, shape (h, w), of a picture in blue, green, red."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def shrunk(image: NDArray[np.uint8], longest_px: int) -> NDArray[np.uint8]:
    """The picture, its longer side at most so long."""
    shrink = longest_px / max(image.shape[:2])
    if shrink >= 1.0:
        return image
    size = [max(1, round(shrink * side)) for side in image.shape[1::-1]]
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Context in which OpenCV's calls use one thread each, for callers that work on several pictures at once."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)

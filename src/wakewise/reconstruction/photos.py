"""A folder of photographs: which files are meant, whether they are whole, and a fingerprint of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.errors import InputError

Image = NDArray[np.uint8]
SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff")
MIN_PHOTOS = 3


@dataclass(frozen=True, kw_only=True)
class Photo:
    """One photograph: file name, size in pixels, and a digest of its bytes."""

    name: str
    width: int
    height: int
    digest: str


def read_photos(folder: Path) -> tuple[Photo, ...]:
    """Check every photograph of a folder by decoding it; sorted by name. Other files beside them are left alone.

    Raises
    ------
    InputError
        If the folder is missing, holds no photographs or fewer than three, or a file cannot be decoded.
    """
    allowed = ", ".join(SUFFIXES)
    if not folder.is_dir():
        found = "is a file" if folder.exists() else "does not exist"
        raise InputError(f"{folder}: {found}; a folder of photos ({allowed}) is needed")
    files = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    images = [p for p in files if p.suffix.lower() in SUFFIXES]
    if not images:
        found = f"holds no photos ({files[0].name} is none)" if files else "is empty"
        raise InputError(f"{folder}: {found}; at least {MIN_PHOTOS} photos ({allowed}) are needed")
    photos = tuple(_read_photo(path) for path in images)
    if len(photos) < MIN_PHOTOS:
        raise InputError(f"{folder}: holds {len(photos)} photos, at least {MIN_PHOTOS} are needed")
    return photos


def _read_photo(path: Path) -> Photo:
    data = path.read_bytes()
    image = decode(data)
    if image is None:
        raise InputError(f"{path}: is no image that can be read ({len(data)} bytes); allowed are {', '.join(SUFFIXES)}")
    height, width = image.shape[:2]
    return Photo(name=path.name, width=width, height=height, digest=hashlib.blake2b(data, digest_size=16).hexdigest())


def decode(data: bytes) -> Image | None:
    """Colours of an encoded image, shape (h, w, 3), blue first as OpenCV has them; None if it is no image.

    The camera's orientation tag is ignored, as COLMAP ignores it, so that pixels mean the same to both.
    """
    if not data:
        return None
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        image: Image | None = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)
    return image

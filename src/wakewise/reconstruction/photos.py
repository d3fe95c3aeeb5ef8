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
MIN_PHOTOS = 2
# How files begin, and the suffixes that say so: COLMAP goes by the suffix.
_BEGINNINGS = {
    b"\xff\xd8\xff": ("JPEG", (".jpg", ".jpeg")),
    b"\x89PNG\r\n\x1a\n": ("PNG", (".png",)),
    b"BM": ("BMP", (".bmp",)),
    b"II*\x00": ("TIFF", (".tif", ".tiff")),
    b"MM\x00*": ("TIFF", (".tif", ".tiff")),
}


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
        If the folder is missing, holds no photographs or fewer than two, or a file cannot be decoded.
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
    if data.startswith(b"\xff\xd8") and not jpeg_is_whole(data):
        raise InputError(
            f"{path}: is cut short ({len(data)} bytes), the JPEG image in it has no end; remove or replace it"
        )
    image = decode(data)
    if image is None:
        raise InputError(f"{path}: is no image that can be read ({len(data)} bytes); allowed are {', '.join(SUFFIXES)}")
    for beginning, (kind, suffixes) in _BEGINNINGS.items():
        if data.startswith(beginning) and path.suffix.lower() not in suffixes:
            raise InputError(f"{path}: holds a {kind} image, so its name must end in {suffixes[0]}, not {path.suffix}")
    height, width = image.shape[:2]
    return Photo(name=path.name, width=width, height=height, digest=hashlib.blake2b(data, digest_size=16).hexdigest())


def without_duplicates(photos: tuple[Photo, ...]) -> tuple[tuple[Photo, ...], int]:
    """Photos less those whose bytes another one has, which show nothing new; and how many those were.

    Raises
    ------
    InputError
        If fewer than two different ones are left.
    """
    first: dict[str, Photo] = {}
    for photo in photos:
        first.setdefault(photo.digest, photo)
    if len(first) < MIN_PHOTOS:
        raise InputError(f"photos: all {len(photos)} are copies of {photos[0].name}; {MIN_PHOTOS} different are needed")
    return tuple(first.values()), len(photos) - len(first)


def jpeg_is_whole(data: bytes) -> bool:
    """Whether a JPEG's coded image comes to its end marker; decoders paint what is missing grey and say nothing.

    ITU-T T.81, annex B: segments of a marker and a length; after a start of scan, coded bytes in which a marker is an
    0xFF that is followed neither by 0 nor by a restart marker.
    """
    at = 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            return False
        marker = data[at + 1]
        if marker == 0xD9:
            return True
        if marker == 0xFF:  # padding
            at += 1
            continue
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        if marker == 0xDA:
            at = _end_of_scan(data, at)
    return data[at : at + 2] == b"\xff\xd9"


def _end_of_scan(data: bytes, at: int) -> int:
    """Where the marker after coded bytes begins; the data's length if there is none."""
    while True:
        at = data.find(b"\xff", at)
        if at < 0 or at + 1 >= len(data):
            return len(data)
        if data[at + 1] not in (0x00, 0xFF) and not 0xD0 <= data[at + 1] <= 0xD7:
            return at
        at += 1 if data[at + 1] == 0xFF else 2


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

"""A folder of photographs: files, checks, digests, and what EXIF says of the camera."""

from __future__ import annotations

import hashlib
import io
import json
import struct
import threading
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import AS_STORED, decode_picture

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.photos.masks import Masks


# Tags of Exif 3.0 (CIPA DC-008-2023), tables 4 and 8, that distinguish lenses and states of a zoom.
_MAKE, _MODEL, _EXIF, _FOCAL, _BODY_SERIAL, _LENS_MODEL = 0x010F, 0x0110, 0x8769, 0x920A, 0xA431, 0xA434


PHOTOS_FILE = "stages/photos.json"
"""In a model's folder: digests of its photos."""
UNREADABLE = (OSError, SyntaxError, ValueError, LookupError, TypeError, ZeroDivisionError, struct.error)
"""What Pillow raises of pictures that only other decoders take, and of notes that are damaged."""


def exif_words(data: bytes) -> str:
    """Make, model, serial number, lens and focal length by an encoded image's EXIF; empty if there is none."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            tags = image.getexif()
            more = tags.get_ifd(_EXIF)
    except (*UNREADABLE, Image.DecompressionBombError):
        return ""
    words = [_clean(tags.get(tag)) for tag in (_MAKE, _MODEL)] + [_clean(more.get(_BODY_SERIAL))]
    words.append(_clean(more.get(_LENS_MODEL)))
    try:
        focal_mm = float(more.get(_FOCAL) or 0.0)
    except (TypeError, ValueError, ZeroDivisionError):
        focal_mm = 0.0
    words.append(f"{focal_mm:.4g} mm" if focal_mm > 0.0 else "")
    return " ".join(word for word in words if word)


def _clean(value: object) -> str:
    """A tag's text without the spaces and zeros that cameras fill it up with; at most 64 printable characters."""
    text = str(value) if isinstance(value, str) else ""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:64]


Image = NDArray[np.uint8]
SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff")
MIN_PHOTOS = 2
# Decoded photos that are kept for the stages after the first; more are decoded again.
KEPT_BYTES = 400_000_000
PNG = b"\x89PNG\r\n\x1a\n"
# What cameras leave beside photographs, and what it is; named when it is passed over.
_OTHERS = {
    "video": (".mp4", ".mov", ".avi", ".mkv", ".mts", ".m4v", ".webm", ".insv", ".360"),
    "HEIC": (".heic", ".heif", ".hif", ".avif"),
    "RAW": (".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".gpr", ".pef", ".srw", ".raw"),
    "other images": (".webp", ".gif", ".jp2", ".jxl", ".psd", ".exr", ".hdr"),
}
# First bytes of files and their suffixes: COLMAP decodes by the suffix.
_BEGINNINGS = {
    b"\xff\xd8\xff": ("JPEG", (".jpg", ".jpeg")),
    PNG: ("PNG", (".png",)),
    b"BM": ("BMP", (".bmp",)),
    b"II*\x00": ("TIFF", (".tif", ".tiff")),
    b"MM\x00*": ("TIFF", (".tif", ".tiff")),
}


@dataclass(frozen=True, kw_only=True)
class Photo:
    """One photograph: name below its folder, size in pixels, a digest of its bytes, EXIF's camera."""

    name: str
    width: int
    height: int
    digest: str
    camera: str = ""


def digests(photos: Sequence[Photo]) -> list[str]:
    """Digests of photos' bytes, sorted, as `refuse_other_photos` reads them."""
    return sorted(photo.digest for photo in photos)


def refuse_other_photos(out: Path, photos: Sequence[Photo]) -> None:
    """Raise InputError if a folder holds a finished model of photos none of which is among these."""
    try:
        before = set(json.loads((out / PHOTOS_FILE).read_bytes()))
    except (OSError, ValueError, TypeError):  # none is there, or it was damaged: as with the stamps of stages
        return
    if before and before.isdisjoint(digests(photos)):
        raise InputError(f"{out}: holds a model of other photos, these need a folder of their own (--out)")


class PhotoStore:
    """Photos of a folder, decoded once: kept as long as they are small enough together, else decoded at every call.

    `masks` hide parts of them.
    """

    def __init__(self, folder: Path, most_bytes: int = KEPT_BYTES) -> None:
        self.folder = folder
        self.masks: Masks | None = None
        self._left = most_bytes
        self._kept: dict[str, Image] = {}
        self._lock = threading.Lock()

    def image(self, name: str) -> Image:
        """Colours of a photo, shape (h, w, 3), blue first; not to be written to.

        Raises EnvironmentFailure if it could be read before and cannot be any more.
        """
        kept = self._kept.get(name)
        if kept is not None:
            return kept
        path = self.folder / name
        try:
            image = decode(path.read_bytes(), str(path))
        except OSError:
            image = None
        if image is None:
            raise EnvironmentFailure(f"{path}: can no longer be read")
        self.keep(name, image)
        return image

    def keep(self, name: str, image: Image) -> None:
        """Keep a decoded photo if there is room."""
        with self._lock:
            if name not in self._kept and image.nbytes <= self._left:
                image.setflags(write=False)
                self._kept[name] = image
                self._left -= image.nbytes


def read_photos(folder: Path, store: PhotoStore | None = None, threads: int = 2) -> tuple[Photo, ...]:
    """Check every photograph of a folder by decoding it; sorted by name. Other files beside them are left alone.

    Where the folder holds no photographs but folders of them, as of the cameras of a rig, theirs are read, and are
    named `folder/file`. What was decoded goes to `store`.

    Raises InputError if the folder is missing, holds no photographs or fewer than two, or a file cannot be decoded.
    """
    allowed = ", ".join(SUFFIXES)
    if not folder.is_dir():
        found = "is a file" if folder.exists() else "does not exist"
        raise InputError(f"{folder}: {found}; a folder of photos ({allowed}) is needed")
    images = photo_files(folder)
    if not images:
        files, inside = _files(folder), [path.name for path in _folders(folder)]
        found = "is empty"
        if files:
            found = f"holds no photos ({files[0].name} is none)"
        elif inside:
            found = f"holds only folders ({', '.join(inside[:3])}) without photos"
        raise InputError(f"{folder}: {found}; at least {MIN_PHOTOS} photos ({allowed}) are needed")
    photos = tuple(in_order(lambda path: _read_photo(folder, path, store), images, threads))
    if len(photos) < MIN_PHOTOS:
        raise InputError(f"{folder}: holds {len(photos)} photos, at least {MIN_PHOTOS} are needed")
    return photos


def photo_files(folder: Path) -> list[Path]:
    """Files of a folder that are taken for photographs by their names: its own, or else those of the folders in it.

    Folders that hold a model are passed over.
    """
    inside = (path for path in _folders(folder) if not (path / "reconstruction.json").is_file())
    below = (path for each in inside for path in _files(each))
    return [path for path in _files(folder) if path.suffix.lower() in SUFFIXES] or [
        path for path in below if path.suffix.lower() in SUFFIXES
    ]


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))


def _folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def unsupported_files(folder: Path) -> dict[str, int]:
    """How many files beside the photographs hold pictures that are not read, by kind: video, HEIC, RAW, others.

    In the folder itself, and in those in it where the photographs lie in them.
    """
    found = _beside(folder)
    counts = {kind: sum(path.suffix.lower() in wanted for path in found) for kind, wanted in _OTHERS.items()}
    return {kind: count for kind, count in counts.items() if count}


def unread_photos(folder: Path) -> list[Path]:
    """Files beside the photographs that hold pictures of a kind that is not read, but for videos."""
    wanted = {suffix for kind, suffixes in _OTHERS.items() if kind != "video" for suffix in suffixes}
    return [path for path in _beside(folder) if path.suffix.lower() in wanted]


def _beside(folder: Path) -> list[Path]:
    """Files of a folder, and of those in it where the photographs lie in them."""
    photographs = any(path.suffix.lower() in SUFFIXES for path in _files(folder))
    return [path for one in ([folder] if photographs else [folder, *_folders(folder)]) for path in _files(one)]


def _read_photo(folder: Path, path: Path, store: PhotoStore | None) -> Photo:
    data = path.read_bytes()
    if data.startswith(b"\xff\xd8") and not jpeg_is_whole(data):
        raise InputError(
            f"{path}: is cut short ({len(data)} bytes), the JPEG image in it has no end; remove or replace it"
        )
    if data.startswith(PNG) and not png_is_whole(data):
        raise InputError(f"{path}: is cut short or damaged ({len(data)} bytes of a PNG image); remove or replace it")
    image = decode(data, str(path))
    if image is None:
        raise InputError(f"{path}: is no image that can be read ({len(data)} bytes); allowed are {', '.join(SUFFIXES)}")
    kind, suffixes = next((found for start, found in _BEGINNINGS.items() if data.startswith(start)), ("", ()))
    if not kind:
        raise InputError(f"{path}: holds an image of another kind than JPEG, PNG, BMP or TIFF; save it as one of these")
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: holds a {kind} image, so its name must end in {suffixes[0]}, not {path.suffix}")
    name = path.relative_to(folder).as_posix()
    if store is not None:
        store.keep(name, image)
    height, width = image.shape[:2]
    digest = hashlib.blake2b(data, digest_size=16).hexdigest()
    return Photo(name=name, width=width, height=height, digest=digest, camera=exif_words(data))


def without_duplicates(photos: tuple[Photo, ...]) -> tuple[tuple[Photo, ...], int]:
    """Photos less those whose bytes another one has, which show nothing new; and how many those were.

    Raises InputError if fewer than two different ones are left.
    """
    first: dict[str, Photo] = {}
    for photo in photos:
        first.setdefault(photo.digest, photo)
    if len(first) < MIN_PHOTOS:
        raise InputError(f"photos: all {len(photos)} are copies of {photos[0].name}; {MIN_PHOTOS} different are needed")
    return tuple(first.values()), len(photos) - len(first)


def jpeg_is_whole(data: bytes) -> bool:
    """Whether a JPEG's coded image reaches its end marker; decoders fill what is missing with grey, without an error.

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


def png_is_whole(data: bytes) -> bool:
    """Whether a PNG's chunks reach its end with right checksums; its decoder's error cannot be handled.

    W3C, Portable Network Graphics, section 5: length, type, data, CRC-32 of type and data.
    """
    at = len(PNG)
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        stop = at + 8 + length
        if data[stop : stop + 4] != zlib.crc32(data[at + 4 : stop]).to_bytes(4, "big"):
            return False
        if data[at + 4 : at + 8] == b"IEND":
            return True
        at = stop + 4
    return False


def _end_of_scan(data: bytes, at: int) -> int:
    """Where the marker after coded bytes begins; the data's length if there is none."""
    while True:
        at = data.find(b"\xff", at)
        if at < 0 or at + 1 >= len(data):
            return len(data)
        if data[at + 1] not in (0x00, 0xFF) and not 0xD0 <= data[at + 1] <= 0xD7:
            return at
        at += 1 if data[at + 1] == 0xFF else 2


def decode(data: bytes, name: str) -> Image | None:
    """Colours of an encoded image, shape (h, w, 3), blue first as OpenCV has them; None if it is no image.

    The camera's orientation tag is ignored, as COLMAP ignores it, so that pixels mean the same to both.

    Raises InputError if the image `name` has more pixels than are allowed.
    """
    return decode_picture(data, name, AS_STORED)

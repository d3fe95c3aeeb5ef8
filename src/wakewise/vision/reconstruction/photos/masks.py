"""Masks: pixels of photographs that are not used, such as moving water, a diver or a turntable's surroundings.

They come from a folder of images with the photographs' names, black where nothing is used, or from transparency.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from wakewise.core.arrays import BoolArray
from wakewise.core.errors import InputError
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction.photos.photo_folder import PNG, Image, Photo

NAMES = ("{name}.png", "{stem}.png", "{stem}_mask.png", "{stem}.tif", "{stem}.jpg", "{stem}.jpeg", "{stem}.bmp")
"""Names of the mask of photo `stem.suffix`: as COLMAP, as most, and as Metashape has them."""
LEAST_SHARE = 0.01
"""Less than this left of a photograph is a mask the wrong way round, or an empty one."""
_ALPHA = (4, 6)
_MOST_GREY = 0.5


@dataclass(frozen=True, kw_only=True)
class Masks:
    """Files that hold masks, by photo's name, whether transparency or grey, and digests of their bytes."""

    files: Mapping[str, Path]
    digests: Mapping[str, str]

    def of(self, name: str) -> BoolArray | None:
        """Pixels of a photo that are used, shape (h, w); None for all."""
        path = self.files.get(name)
        return None if path is None else _read(path)


def read_masks(photos: Path, found: tuple[Photo, ...], folder: Path | None) -> Masks | None:
    """Masks of photographs, from a folder, else from their transparency; None if there are none.

    Raises InputError if the folder is none or holds masks of no photo, or a mask has another size than its photo or
    hides it all.
    """
    if folder is None:
        files = {photo.name: photos / photo.name for photo in found if _has_alpha(photos / photo.name)}
    else:
        if not folder.is_dir():
            raise InputError(f"{folder}: is no folder; masks are images in a folder, named like the photos")
        beside = {photo.name: [folder / _name(pattern, photo.name) for pattern in NAMES] for photo in found}
        there = {name: [path for path in paths if path.is_file()] for name, paths in beside.items()}
        files = {name: paths[0] for name, paths in there.items() if paths}
        if not files:
            raise InputError(
                f"{folder}: holds no mask of any of the {len(found)} photos; that of {found[0].name} would be "
                f"{', '.join(_name(pattern, found[0].name) for pattern in NAMES[:3])}"
            )
    digests = {}
    for photo in found:
        path = files.get(photo.name)
        if path is None:
            continue
        mask = _read(path)
        height, width = mask.shape
        if (width, height) != (photo.width, photo.height):
            raise InputError(
                f"{path}: is {width} x {height} px, its photo {photo.name} {photo.width} x {photo.height}; a mask must "
                "have its photo's size"
            )
        if mask.mean() < LEAST_SHARE:
            raise InputError(
                f"{path}: leaves {100.0 * mask.mean():.1f} % of {photo.name}; white is what is looked at, black what "
                "is not"
            )
        if folder is None and mask.all():
            del files[photo.name]
            continue
        digests[photo.name] = hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
    return Masks(files=files, digests=digests) if files else None


def write_for_colmap(masks: Masks, names: list[str], folder: Path) -> None:
    """Write masks as COLMAP reads them, `folder/<photo's name>.png`; white for photos without one."""
    for name in names:
        mask = masks.of(name)
        if mask is not None:
            path = folder / f"{name}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(cv2.imencode(".png", np.where(mask, 255, 0).astype(np.uint8))[1].tobytes())


def _name(pattern: str, name: str) -> str:
    return pattern.format(name=name, stem=str(PurePosixPath(name).with_suffix("")))


def _has_alpha(path: Path) -> bool:
    """Whether a file is a PNG image with transparency (its header's colour type, W3C PNG, 11.2.2)."""
    with path.open("rb") as file:
        head = file.read(26)
    return head.startswith(PNG) and len(head) == 26 and head[25] in _ALPHA


def _read(path: Path) -> BoolArray:
    """What is white, or opaque.

    Raises InputError if it is no image.
    """
    image: Image | None = read_picture(path, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise InputError(f"{path}: is no image that can be read; a mask is one, black where nothing is looked at")
    most = float(np.iinfo(image.dtype).max) if image.dtype.kind == "u" else 1.0
    if image.ndim == 3 and image.shape[2] == 4:
        return np.asarray(image[..., 3] > _MOST_GREY * most)
    grey = image if image.ndim == 2 else image[..., :3].max(axis=2)
    return np.asarray(grey > _MOST_GREY * most)

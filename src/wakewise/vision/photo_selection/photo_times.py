"""When photographs were taken: by EXIF, by their names, by the frame's number of a film, or by a stated interval."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import BinaryIO

import numpy as np

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.photos.photo_folder import UNREADABLE

# Tags of Exif 3.0 (CIPA DC-008-2023), table 8.
_EXIF, _TAKEN, _SUBSECONDS, _OFFSET = 0x8769, 0x9003, 0x9291, 0x9011
_IN_NAME = re.compile(
    r"(?<!\d)((?:19|20)\d\d)[-_.]?(\d\d)[-_.]?(\d\d)[-_.T ]{0,3}(\d\d)[-_.h:]?(\d\d)[-_.m:]?(\d\d)"
    r"(?:[-_.,](\d{1,6})|(\d{3}))?(?!\d)"
)
LEAST_SHARE = 0.9
"""Share of the photographs that must have a time from one source, for it to be the source."""

LEAST_EVEN = 20


@dataclass(frozen=True, kw_only=True)
class PhotoTime:
    """When one photograph was taken, in s: since 1970 by its own clock if `calendar`, else since the first one.

    `source`: EXIF, name, frame or interval. `step_s`: resolution of the time.
    """

    name: str
    time_s: float
    source: str
    calendar: bool
    step_s: float


def exif_time(file: Path | BinaryIO) -> tuple[float, float] | None:
    """Time of a picture's file by EXIF's DateTimeOriginal, in s since 1970, and its resolution in s; None without.

    Without OffsetTimeOriginal the clock is taken for UTC.
    """
    from PIL import Image

    try:
        with Image.open(file) as image:
            tags = image.getexif().get_ifd(_EXIF)
        taken = datetime.strptime(str(tags[_TAKEN]).strip("\0 "), "%Y:%m:%d %H:%M:%S")
    except (*UNREADABLE, Image.DecompressionBombError):
        return None
    digits = re.match(r"\d+", str(tags.get(_SUBSECONDS, "")).strip())
    zone = re.fullmatch(r"([+-])(\d\d):(\d\d)", str(tags.get(_OFFSET, "")).strip("\0 "))
    ahead = timedelta(hours=int(zone[2]), minutes=int(zone[3])) * (-1 if zone[1] == "-" else 1) if zone else timedelta()
    seconds = taken.replace(tzinfo=timezone(ahead)).timestamp()
    return seconds + (float(f"0.{digits[0]}") if digits else 0.0), 10.0 ** -len(digits[0]) if digits else 1.0


def name_time(name: str) -> tuple[float, float] | None:
    """Time in a file's name, such as dive_20220815_103005_250.jpg, as `exif_time`; None if there is none."""
    found = _IN_NAME.search(Path(name).stem)
    if found is None:
        return None
    digits = found[7] or found[8] or ""
    try:
        taken = datetime.strptime("".join(found.groups()[:6]) + "+0000", "%Y%m%d%H%M%S%z")
    except ValueError:
        return None
    return taken.timestamp() + (float(f"0.{digits}") if digits else 0.0), 10.0 ** -len(digits) if digits else 1.0


def photo_times(folder: Path, files: Sequence[Path], interval_s: float | None) -> tuple[list[PhotoTime], list[str]]:
    """Times of photographs in the order of time, and names of those without one.

    The source is EXIF if `LEAST_SHARE` of the files have it, else the names. A stated interval in s wins: photographs
    then follow one another in the order of their names.

    Raises InputError if nothing says when they were taken.
    """
    names = [path.relative_to(folder).as_posix() for path in files]
    if interval_s is not None:
        if not interval_s > 0.0:
            raise InputError(f"--interval {interval_s:g}: must be above 0 s")
        return [
            PhotoTime(name=name, time_s=k * interval_s, source="interval", calendar=False, step_s=0.0)
            for k, name in enumerate(names)
        ], []
    for source in ("EXIF", "name"):
        found = [exif_time(path) if source == "EXIF" else name_time(path.name) for path in files]
        if sum(one is not None for one in found) >= max(2, LEAST_SHARE * len(files)):
            told = [
                PhotoTime(name=name, time_s=one[0], source=source, calendar=True, step_s=one[1])
                for name, one in zip(names, found, strict=True)
                if one is not None
            ]
            missing = [name for name, one in zip(names, found, strict=True) if one is None]
            return evened(spread(sorted(told, key=lambda photo: (photo.time_s, photo.name)))), missing
    raise InputError(
        f"{folder}: neither EXIF (DateTimeOriginal) nor the names say when its {len(files)} photos were taken; "
        "--interval S states the time from one to the next"
    )


def spread(photos: list[PhotoTime]) -> list[PhotoTime]:
    """Photographs that share a time of a coarse clock at even parts of its step, in the order of their names."""
    many = Counter(photo.time_s for photo in photos)
    done: Counter[float] = Counter()
    out = []
    for photo in photos:
        part = done[photo.time_s] / many[photo.time_s] * photo.step_s
        done[photo.time_s] += 1
        out.append(replace(photo, time_s=photo.time_s + part))
    return out


def evened(photos: list[PhotoTime]) -> list[PhotoTime]:
    """Photographs of an even interval by a clock of whole seconds, on the straight line through their times.

    Others are returned as they are: those that are fewer than `LEAST_EVEN`, or stray from the line by a second.
    """
    if len(photos) < LEAST_EVEN or min(photo.step_s for photo in photos) < 1.0:
        return photos
    number, first_s = np.arange(len(photos)), photos[0].time_s
    time_s = np.array([photo.time_s - first_s for photo in photos])
    slope, begin = np.polyfit(number, time_s, 1)
    line = begin + slope * number
    if slope <= 0.0 or np.abs(time_s - line).max() >= 1.0:
        return photos
    # Whole seconds are cut off, half of one in the mean.
    step_s = float(np.std(time_s - line)) * math.sqrt(12.0 / len(photos))
    return [
        replace(photo, time_s=first_s + 0.5 + float(at), step_s=step_s) for photo, at in zip(photos, line, strict=True)
    ]

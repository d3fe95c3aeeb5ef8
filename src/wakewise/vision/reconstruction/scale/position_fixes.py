"""Where photographs were taken, as GPS receivers and depth gauges tell it: from a table, or from what EXIF holds.

A fix is weak knowledge: metres off, or of the depth alone. `by_fixes.py` asks how far a model's scale can rest on it.
"""

from __future__ import annotations

import csv
import io
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.exif import UNREADABLE
from wakewise.vision.reconstruction.photos import photo_files

GPS_SIGMA_M, GPS_HEIGHT_SIGMA_M = 8.0 / 2.448, 13.0 / 1.96
"""Of each of two horizontal axes, and of the height: 8 m and 13 m at 95 %, in the mean over the globe (GPS Standard
Positioning Service Performance Standard, 5th edition, 2020, table 3.8-3)."""
DEPTH_SIGMA_M = 0.1
"""Of a depth of which nobody says how sure it is: what divers' gauges show."""
MOST_APART_M = 20e3
"""Fixes farther apart are of two places, or have latitude and longitude mixed up."""
_A_M, _E2 = 6_378_137.0, 6.694_379_990_14e-3  # WGS 84 (NGA.STND.0036, 2014): semi-major axis, squared eccentricity
_GPS = 0x8825
_LAT_REF, _LAT, _LON_REF, _LON, _ALT_REF, _ALT, _ERROR = 1, 2, 3, 4, 5, 6, 31  # Exif 3.0 (CIPA DC-008-2023), 4.6.7
_FLAT, _ROUND = ("north_m", "east_m"), ("lat_deg", "lon_deg")
_NUMBERS = (*_FLAT, *_ROUND, "depth_m", "sigma_m", "depth_sigma_m")


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionFix:
    """A photo's place north, east and down in m, shape (3,), NaN where nothing is known, and standard deviations."""

    place_W_m: Array
    sigma_m: Array

    def __post_init__(self) -> None:
        freeze(self, sigma_m=(3,))
        place = np.array(self.place_W_m, dtype=np.float64)  # what is not known is no number, which `freeze` refuses
        place.setflags(write=False)
        object.__setattr__(self, "place_W_m", place)


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionFixes:
    """Fixes by photo name. origin: latitude and longitude in degrees of where north and east are 0, where known."""

    fixes: Mapping[str, PositionFix]
    origin: tuple[float, float] | None = None

    @cached_property
    def _by_stem(self) -> dict[str, PositionFix]:
        return {_stem(name): fix for name, fix in self.fixes.items()}

    def of(self, name: str) -> PositionFix | None:
        """The fix of a photo; a name matches whole or without its suffix."""
        return self.fixes.get(name) or self._by_stem.get(_stem(name))

    def key(self) -> list[Any]:
        """Plain values that tell these from others, None for what is not known."""
        return [
            [name, [None if math.isnan(x) else x for x in fix.place_W_m.tolist()], fix.sigma_m.tolist()]
            for name, fix in sorted(self.fixes.items())
        ]


def _stem(name: str) -> str:
    """A name without its suffix, with its folder: two cameras of a rig number their photos alike."""
    return Path(name).with_suffix("").as_posix()


@dataclass(frozen=True, kw_only=True)
class _Told:
    """What is told of one photo: degrees or metres, and metres down; None where nothing is."""

    flat: tuple[float, float] | None = None
    angles: tuple[float, float] | None = None
    depth_m: float | None = None
    sigma_m: float = GPS_SIGMA_M
    depth_sigma_m: float = DEPTH_SIGMA_M


def read_fixes(path: Path) -> PositionFixes:
    """Fixes of a CSV file.

    Parameters
    ----------
    path : Path
        Columns `name` and `depth_m` (down from the surface), or these and `lat_deg`, `lon_deg` (WGS 84) or `north_m`,
        `east_m`; with `sigma_m` (of each horizontal axis) and `depth_sigma_m` where they are known. Empty cells say
        nothing.

    Raises
    ------
    InputError
        If it cannot be read, or a row says what cannot be.
    """
    columns = "name, depth_m, lat_deg, lon_deg (or north_m, east_m), sigma_m, depth_sigma_m"
    told: dict[str, _Told] = {}
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            given = tuple(reader.fieldnames or ())
            unknown = [name for name in given if name not in ("name", *_NUMBERS)]
            if "name" not in given or "depth_m" not in given or unknown:
                wrong = f"has a column {unknown[0]}" if unknown else "needs at least the columns name and depth_m"
                raise InputError(f"{path}: {wrong}; allowed are {columns}{other_separator(given)}")
            for row in reader:
                name = (row["name"] or "").strip()
                if not name:
                    raise InputError(f"{path}: line {reader.line_num}: has no name, must be a photo's")
                if name in told:
                    raise InputError(f"{path}: line {reader.line_num}: {name} is there twice")
                told[name] = _row(f"{path}: line {reader.line_num}", row)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}; needed is a CSV file with {columns}") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path}: is no CSV text; needed is a table with {columns}") from None
    if not told:
        raise InputError(f"{path}: holds no fixes, needs a row for each photo")
    return _flattened(told, str(path))


def exif_fixes(folder: Path) -> PositionFixes:
    """Fixes that cameras wrote into the photos of a folder.

    Raises
    ------
    InputError
        If no photo holds one with a height.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of photos, only theirs hold fixes")
    told: dict[str, _Told] = {}
    files = photo_files(folder)
    for path in files:
        try:
            found = exif_place(path.read_bytes())
        except OSError:
            continue  # who decodes the photos says so
        if found is not None:
            told[path.relative_to(folder).as_posix()] = found
    if not told:
        raise InputError(
            f"{folder}: none of {len(files)} photos holds latitude, longitude and height in its EXIF; a CSV with name "
            "and depth_m says it, too"
        )
    return _flattened(told, str(folder))


def exif_place(data: bytes) -> _Told | None:
    """Latitude, longitude and height that an encoded image holds; None where one of them is missing or damaged."""
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(io.BytesIO(data)) as image:
            tags = image.getexif().get_ifd(_GPS)  # Pillow warns of damaged tags
        angles = _angle(tags[_LAT], tags[_LAT_REF], "S"), _angle(tags[_LON], tags[_LON_REF], "W")
        below = tags.get(_ALT_REF, b"\x00")
        below = below[0] if isinstance(below, bytes) and below else below
        # 1 and 3 are below sea level and below the ellipsoid.
        depth = float(tags[_ALT]) * (1.0 if below in (1, 3) else -1.0)
        sigma = float(tags.get(_ERROR, 0.0))
    except (*UNREADABLE, Image.DecompressionBombError):
        return None
    if not (all(map(math.isfinite, (*angles, depth, sigma))) and abs(angles[0]) <= 90.0 and abs(angles[1]) <= 180.0):
        return None
    return _Told(
        angles=angles,
        depth_m=depth,
        sigma_m=sigma if sigma > 0.0 else GPS_SIGMA_M,
        depth_sigma_m=GPS_HEIGHT_SIGMA_M,
    )


def _angle(parts: Any, ref: Any, negative: str) -> float:
    """Degrees of degrees, minutes and seconds."""
    degrees, minutes, seconds = (float(part) for part in parts)
    size = degrees + minutes / 60.0 + seconds / 3600.0
    return -size if str(ref).strip("\0 ").upper() == negative else size


def _row(where: str, row: Mapping[str, str | None]) -> _Told:
    numbers: dict[str, float] = {}
    for column in _NUMBERS:
        words = (row.get(column) or "").strip()
        if not words:
            continue
        try:
            numbers[column] = float(words)
        except ValueError:
            raise InputError(f"{where}: {column} is '{words}', must be a number") from None
        if not math.isfinite(numbers[column]):
            raise InputError(f"{where}: {column} is {words}, must be finite")
    for pair in (_FLAT, _ROUND):
        if sum(column in numbers for column in pair) == 1:
            raise InputError(f"{where}: {pair[0]} and {pair[1]} must both be said, or none")
    for column in ("sigma_m", "depth_sigma_m"):
        if numbers.get(column, 1.0) <= 0.0:
            raise InputError(f"{where}: {column} is {numbers[column]:g}, must be above 0")
    if abs(numbers.get("lat_deg", 0.0)) > 90.0 or abs(numbers.get("lon_deg", 0.0)) > 180.0:
        raise InputError(f"{where}: lat_deg must be within 90 and lon_deg within 180")
    return _Told(
        flat=(numbers["north_m"], numbers["east_m"]) if "north_m" in numbers else None,
        angles=(numbers["lat_deg"], numbers["lon_deg"]) if "lat_deg" in numbers else None,
        depth_m=numbers.get("depth_m"),
        sigma_m=numbers.get("sigma_m", GPS_SIGMA_M),
        depth_sigma_m=numbers.get("depth_sigma_m", DEPTH_SIGMA_M),
    )


def _flattened(told: Mapping[str, _Told], source: str) -> PositionFixes:
    """All in metres, about the first that has degrees.

    Raises
    ------
    InputError
        If some are in degrees and some in metres, or they lie too far apart.
    """
    origin = next((one.angles for one in told.values() if one.angles is not None), None)
    if origin is not None and any(one.flat is not None for one in told.values()):
        raise InputError(f"{source}: has places in degrees and in metres, must be one of them")
    fixes: dict[str, PositionFix] = {}
    for name, one in told.items():
        place = np.full(3, np.nan)
        if one.angles is not None and origin is not None:
            place[:2] = _on_map(one.angles, origin)
        elif one.flat is not None:
            place[:2] = one.flat
        if one.depth_m is not None:
            place[2] = one.depth_m
        fixes[name] = PositionFix(place_W_m=place, sigma_m=np.array([one.sigma_m, one.sigma_m, one.depth_sigma_m]))
    known = np.array([fix.place_W_m for fix in fixes.values()])
    for axis, words in enumerate(("north", "east", "down")):
        values = known[np.isfinite(known[:, axis]), axis]
        if values.size and np.ptp(values) > MOST_APART_M:
            raise InputError(
                f"{source}: fixes lie {np.ptp(values) / 1e3:.0f} km apart ({words}), {MOST_APART_M / 1e3:.0f} km are "
                "believed; are latitude and longitude mixed up?"
            )
    return PositionFixes(fixes=fixes, origin=origin)


def _on_map(angles: tuple[float, float], origin: tuple[float, float]) -> tuple[float, float]:
    """North and east in m of a place near an origin, by the ellipsoid's radii of curvature there.

    Source: W. Torge, J. Mueller, Geodesy, 4th edition, 2012, chapter 4.
    """
    latitude = math.radians(origin[0])
    w2 = 1.0 - _E2 * math.sin(latitude) ** 2
    meridian, normal = _A_M * (1.0 - _E2) / w2**1.5, _A_M / math.sqrt(w2)
    east = (angles[1] - origin[1] + 180.0) % 360.0 - 180.0
    return math.radians(angles[0] - origin[0]) * meridian, math.radians(east) * normal * math.cos(latitude)

"""Position fixes of cameras by GPS or depth gauge, from a table or EXIF; scale and orientation of a model from them.

Depths alone give both: depth is a linear function of camera position, with a slope in metres per unit of the model.
North and east also give the frame. Errors of fixes are taken as independent: a common error does no harm, a drift is
not seen.
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
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction.photos.photo_folder import UNREADABLE, photo_files

GPS_SIGMA_M, GPS_HEIGHT_SIGMA_M = 8.0 / 2.448, 13.0 / 1.96
"""Of each of two horizontal axes, and of the height: 8 m and 13 m at 95 %, in the mean over the globe (GPS Standard
Positioning Service Performance Standard, 5th edition, 2020, table 3.8-3)."""
DEPTH_SIGMA_M = 0.1
"""Default standard deviation of a depth: that of divers' gauges."""
MOST_APART_M = 20e3
"""Fixes farther apart are an error, such as mixed-up latitude and longitude."""
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
        """Plain values for a fingerprint, None for what is not known."""
        return [
            [name, [None if math.isnan(x) else x for x in fix.place_W_m.tolist()], fix.sigma_m.tolist()]
            for name, fix in sorted(self.fixes.items())
        ]


def _stem(name: str) -> str:
    """A name without its suffix, with its folder: two cameras of a rig may use the same numbers."""
    return Path(name).with_suffix("").as_posix()


@dataclass(frozen=True, kw_only=True)
class _RawFix:
    """Fix of one photo as read: degrees or metres, and metres down; None where nothing is given."""

    flat: tuple[float, float] | None = None
    angles: tuple[float, float] | None = None
    depth_m: float | None = None
    sigma_m: float = GPS_SIGMA_M
    depth_sigma_m: float = DEPTH_SIGMA_M


def read_fixes(path: Path) -> PositionFixes:
    """Fixes of a CSV file.

    `path`: columns `name` and `depth_m` (down from the surface), or these and `lat_deg`, `lon_deg` (WGS 84) or
    `north_m`, `east_m`; with `sigma_m` (of each horizontal axis) and `depth_sigma_m` where they are known. Empty cells
    are unknown. Raises InputError if it cannot be read, or a row is not possible.
    """
    columns = "name, depth_m, lat_deg, lon_deg (or north_m, east_m), sigma_m, depth_sigma_m"
    raw: dict[str, _RawFix] = {}
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
                if name in raw:
                    raise InputError(f"{path}: line {reader.line_num}: {name} is there twice")
                raw[name] = _row(f"{path}: line {reader.line_num}", row)
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror or fault}; needed is a CSV file with {columns}") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path}: is no CSV text; needed is a table with {columns}") from None
    if not raw:
        raise InputError(f"{path}: holds no fixes, needs a row for each photo")
    return _flattened(raw, str(path))


def exif_fixes(folder: Path) -> PositionFixes:
    """Fixes that cameras wrote into the photos of a folder.

    Raises InputError if no photo holds one with a height.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of photos, only theirs hold fixes")
    raw: dict[str, _RawFix] = {}
    files = photo_files(folder)
    for path in files:
        try:
            found = exif_place(path.read_bytes())
        except OSError:
            continue  # reported where the photos are decoded
        if found is not None:
            raw[path.relative_to(folder).as_posix()] = found
    if not raw:
        raise InputError(
            f"{folder}: none of {len(files)} photos holds latitude, longitude and height in its EXIF; a CSV with name "
            "and depth_m says it, too"
        )
    return _flattened(raw, str(folder))


def exif_place(data: bytes) -> _RawFix | None:
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
    return _RawFix(
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


def _row(where: str, row: Mapping[str, str | None]) -> _RawFix:
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
    return _RawFix(
        flat=(numbers["north_m"], numbers["east_m"]) if "north_m" in numbers else None,
        angles=(numbers["lat_deg"], numbers["lon_deg"]) if "lat_deg" in numbers else None,
        depth_m=numbers.get("depth_m"),
        sigma_m=numbers.get("sigma_m", GPS_SIGMA_M),
        depth_sigma_m=numbers.get("depth_sigma_m", DEPTH_SIGMA_M),
    )


def _flattened(raw: Mapping[str, _RawFix], source: str) -> PositionFixes:
    """All in metres, about the first that has degrees.

    Raises InputError if some are in degrees and some in metres, or they lie too far apart.
    """
    origin = next((one.angles for one in raw.values() if one.angles is not None), None)
    if origin is not None and any(one.flat is not None for one in raw.values()):
        raise InputError(f"{source}: has places in degrees and in metres, must be one of them")
    fixes: dict[str, PositionFix] = {}
    for name, one in raw.items():
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
                "accepted; are latitude and longitude mixed up?"
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


MOST_UNSURE_PCT = 20.0
"""A scale with a larger uncertainty is reported and not used."""
LEAST_FIXES = 4
FAR_SIGMAS = 4.0
_BEND = 2.0  # sigmas from which residuals count linearly


@dataclass(frozen=True, kw_only=True, eq=False)
class Georeference:
    """Similarity from the model to north, east, down in m: scale, R (3, 3), t (3,); and how well the fixes fit.

    uncertainty_pct: standard deviation of the scale, inf where it is open; off_m: of each photo with a fix, its fix
    less its place, shape (3,), NaN where unknown; far: photos whose fix is far off by its own uncertainty;
    turned: whether north is known.
    """

    scale: float
    R: Array
    t: Array
    uncertainty_pct: float
    off_m: Mapping[str, Array]
    far: tuple[str, ...]
    turned: bool

    def __post_init__(self) -> None:
        freeze(self, R=(3, 3), t=(3,))

    def rms_m(self, axes: slice) -> float | None:
        """Rms difference along some axes; None without fixes there."""
        off = np.array([one[axes] for one in self.off_m.values()])
        known = off[np.isfinite(off)]
        return float(np.sqrt((known**2).mean())) if known.size else None


def place_by_fixes(centres: Mapping[str, Array], fixes: PositionFixes) -> Georeference:
    """Fit cameras' places in a model, shape (3,) by photo, to fixes.

    Raises InputError if too few of the photos have a fix.
    """
    found = {name: fix for name in sorted(centres) if (fix := fixes.of(name)) is not None}
    names = [name for name, fix in found.items() if np.isfinite(fix.place_W_m[2])]
    if len(names) < LEAST_FIXES:
        raise InputError(
            f"fixes: {len(names)} of {len(centres)} registered photos have one with a depth or height, at least "
            f"{LEAST_FIXES} must; the names must be the photos' names"
        )
    points = np.array([centres[name] for name in names])
    places = np.array([found[name].place_W_m for name in names])
    sigmas = np.array([found[name].sigma_m for name in names])
    whole = np.isfinite(places).all(axis=1)
    turned = int(whole.sum()) >= LEAST_FIXES
    scale, R, t, share = _similar(points, places, sigmas) if turned else _sloping(points, places[:, 2], sigmas[:, 2])
    off = places - (scale * points @ R.T + t)
    if not turned:
        off[:, :2] = np.nan
    far = np.nanmax(np.abs(off) / sigmas, axis=1) > FAR_SIGMAS
    return Georeference(
        scale=scale,
        R=R,
        t=t,
        uncertainty_pct=100.0 * share,
        off_m=dict(zip(names, off, strict=True)),
        far=tuple(name for name, one in zip(names, far, strict=True) if one),
        turned=turned,
    )


def why_unused(placed: Georeference) -> str | None:
    """Why the scale is not used; None where it can be."""
    if placed.uncertainty_pct <= MOST_UNSURE_PCT:
        return None
    how = f"{placed.uncertainty_pct:.0f} %" if placed.uncertainty_pct < 1e3 else "more than tenfold"
    what = "photos must be farther apart" if placed.turned else "depths must differ more, and not along one line"
    return f"uncertain by {how}, above {MOST_UNSURE_PCT:g} %: {what}"


def figures(placed: Georeference, fixes: PositionFixes, used: bool, checks: bool) -> dict[str, Any]:
    """Plain values for JSON."""
    return {
        "used": used,
        "why": why_unused(placed),
        "photos": len(placed.off_m),
        "uncertainty_pct": placed.uncertainty_pct if np.isfinite(placed.uncertainty_pct) else None,
        "model_off_pct": 100.0 * (1.0 / placed.scale - 1.0) if checks else None,
        "horizontal_rms_m": placed.rms_m(slice(0, 2)),
        "depth_rms_m": placed.rms_m(slice(2, 3)),
        "far": list(placed.far),
        "north_known": placed.turned,
        "origin_deg": list(fixes.origin) if fixes.origin is not None and placed.turned else None,
    }


def _sloping(points: Array, depths: Array, sigmas: Array) -> tuple[float, Array, Array, float]:
    """Scale, rotation, shift and relative standard deviation of the scale from depths alone."""
    middle = points.mean(axis=0)
    spread = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    A = np.hstack([(points - middle) / spread, np.ones((len(points), 1))])

    def misfit(x: Array) -> Array:
        return np.asarray((A @ x - depths) / sigmas)

    start = np.linalg.lstsq(A / sigmas[:, None], depths / sigmas, rcond=None)[0]
    fit = least_squares(misfit, start, loss="soft_l1", f_scale=_BEND)
    slope = fit.x[:3]
    size = float(np.linalg.norm(slope))
    covariance = _covariance(fit, len(depths))
    if size == 0.0 or covariance is None:
        return 1.0, np.eye(3), np.zeros(3), float("inf")
    down = slope / size
    share = float(np.sqrt(down @ covariance[:3, :3] @ down)) / size
    R = Rotation.align_vectors([[0.0, 0.0, 1.0]], [down])[0].as_matrix()
    scale = size / spread
    t = -scale * R @ middle
    t[2] += fit.x[3]
    return scale, R, t, share


def _similar(points: Array, places: Array, sigmas: Array) -> tuple[float, Array, Array, float]:
    """Scale, rotation, shift and relative standard deviation of the scale from north, east and down."""
    known = np.isfinite(places)
    whole = known.all(axis=1)
    try:
        first = umeyama(points[whole], places[whole])
    except InputError:  # on one line: the rotation about it is open, and so is the scale
        return 1.0, np.eye(3), np.zeros(3), float("inf")
    middle = points.mean(axis=0)
    spread = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    flat = (points - middle) / spread
    turn = Rotation.from_matrix(first.R_AB)
    begun = first.scale * spread

    def placed(x: Array) -> Array:
        return np.asarray(begun * np.exp(x[0]) * (Rotation.from_rotvec(x[1:4]) * turn).apply(flat) + begun * x[4:])

    def misfit(x: Array) -> Array:
        return np.asarray(((placed(x) - places) / sigmas)[known])

    start = np.concatenate([np.zeros(4), first.apply(middle[None])[0] / begun])
    fit = least_squares(misfit, start, loss="soft_l1", f_scale=_BEND, x_scale="jac")
    covariance = _covariance(fit, int(known.sum()))
    R = (Rotation.from_rotvec(fit.x[1:4]) * turn).as_matrix()
    scale = float(begun * np.exp(fit.x[0]) / spread)
    t = begun * fit.x[4:] - scale * R @ middle
    return scale, R, t, float("inf") if covariance is None else float(np.sqrt(covariance[0, 0]))


def _covariance(fit: Any, count: int) -> Array | None:
    """Covariance of a fit's parameters, enlarged if fixes scatter more than stated; None if one is not determined.

    The scatter is that of the middle of the residuals, which a few wrong fixes do not move: the median of |r| is .6745
    sigma of a normal one.
    """
    J = fit.jac
    _, sizes, axes = np.linalg.svd(J, full_matrices=False)
    if sizes[-1] <= 1e-9 * sizes[0]:
        return None
    freedom = max(1.0 - len(fit.x) / count, 1.0 / count)
    scatter = float(np.median(np.abs(fit.fun)) / 0.6745) ** 2 / freedom
    return np.asarray((axes.T / sizes**2) @ axes * max(scatter, 1.0))

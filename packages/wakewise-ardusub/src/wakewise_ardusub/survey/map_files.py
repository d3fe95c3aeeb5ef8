"""Survey lines of a map file: GeoJSON LineString or KML coordinates, in WGS 84, to metres in the autopilot's frame.

Projection: the tangent plane at the file's first point, with the ellipsoid's radii of curvature there. A place at
distance d is off by about d^2 tan(latitude) / (2 R), with R = 6,371 km: at 40 degrees of latitude 1 cm at 400 m and
15 cm at 1.5 km from the first point. Places farther than `FARTHEST_M` are refused. Heights in the file have no effect.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

FARTHEST_M, APART_M = 2000.0, 0.1
"""Farthest place from the first; places nearer to the one before are that one, as a double click draws it twice."""
LARGEST_B = 4_000_000
_A_M, _E2 = 6_378_137.0, 6.694379990141e-3
"""Semi-major axis and squared eccentricity of WGS 84."""
_KML_OTHERS = ("Point", "Polygon", "LinearRing", "Track", "GroundOverlay", "Model")
_WGS_84 = ("CRS84", "EPSG::4326", "EPSG:4326")


@dataclass(frozen=True, kw_only=True)
class GeoAnchor:
    """Latitude and longitude (deg) of a place, shape (2,), of the autopilot's local frame."""

    latitude_deg: float
    longitude_deg: float
    north_m: float
    east_m: float


def read_map(path: Path) -> Array:
    """Corners of the one line of a `.geojson`, `.json` or `.kml` file, shape (n, 2): latitude and longitude, deg.

    Raises
    ------
    InputError
        If it cannot be read, holds no line or several, is in another projection, a coordinate is no place, or places
        lie too far apart.
    """
    try:
        size = path.stat().st_size
        text = path.read_text(encoding="utf-8-sig") if size <= LARGEST_B else ""
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, a GeoJSON or KML file with one LineString is needed") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, a GeoJSON or KML file with one LineString is needed") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text in UTF-8; save it as UTF-8") from None
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror}") from None
    if size > LARGEST_B:
        raise InputError(f"{path}: {size} bytes, at most {LARGEST_B}")
    ending = path.suffix.lower()
    if ending not in (".geojson", ".json", ".kml"):
        raise InputError(f"{path}: ending '{ending}', must be .geojson, .json or .kml")
    lines, others = _kml_lines(path, text) if ending == ".kml" else _geojson_lines(path, text)
    if len(lines) > 1:
        raise InputError(f"{path}: {len(lines)} lines, must hold one LineString: save each in a file of its own")
    if not lines:
        beside = f" but {', '.join(sorted(others))}" if others else ""
        raise InputError(f"{path}: no line{beside}, must hold one LineString")
    return _checked(path, lines[0])


def _geojson_lines(path: Path, text: str) -> tuple[list[Any], set[str]]:
    """Lines, and the kinds of what else there is."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{path}: is no JSON ({fault})") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: is no GeoJSON object")
    crs = found.get("crs")
    if crs is not None and not any(name in json.dumps(crs) for name in _WGS_84):
        raise InputError(f"{path}: crs {json.dumps(crs)[:80]}, must be WGS 84 (longitude, latitude; no crs member)")
    lines, others = [], set[str]()
    for kind, places in _geometries(path, found):
        if kind == "LineString":
            lines.append(places)
        elif kind == "MultiLineString":
            lines += _listed(path, "coordinates", places)
        else:
            others.add(kind)
    return lines, others


def _listed(path: Path, member: str, value: Any) -> list[Any]:
    if not isinstance(value, list | None):
        raise InputError(f"{path}: {member} is a {type(value).__name__}, must be an array")
    return value or []


def _geometries(path: Path, node: Any) -> Iterator[tuple[str, Any]]:
    """Kind and coordinates of each geometry."""
    if not isinstance(node, dict):
        return
    kind = node.get("type")
    if kind == "FeatureCollection":
        for feature in _listed(path, "features", node.get("features")):
            yield from _geometries(path, feature)
    elif kind == "Feature":
        yield from _geometries(path, node.get("geometry"))
    elif kind == "GeometryCollection":
        for geometry in _listed(path, "geometries", node.get("geometries")):
            yield from _geometries(path, geometry)
    elif isinstance(kind, str):
        yield kind, node.get("coordinates")


def _kml_lines(path: Path, text: str) -> tuple[list[Any], set[str]]:
    """Lines, and the kinds of what else there is."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{path}: declares entities, which KML does not need")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as fault:
        raise InputError(f"{path}: is no XML ({fault})") from None
    found, others = [], set[str]()
    for node in root.iter():
        kind = node.tag.rpartition("}")[2]
        others |= {kind} & set(_KML_OTHERS)
        if kind == "LineString":
            places = [child.text or "" for child in node.iter() if child.tag.rpartition("}")[2] == "coordinates"]
            found.append([place.split(",") for place in " ".join(places).split()])
    return found, others


def _checked(path: Path, line: Any) -> Array:
    try:
        lon_lat = np.array([[float(place[0]), float(place[1])] for place in line])
    except (TypeError, ValueError, IndexError, KeyError):
        raise InputError(f"{path}: a coordinate is not longitude, latitude") from None
    if len(lon_lat) < 2 or not np.isfinite(lon_lat).all():
        raise InputError(f"{path}: a line needs two places or more, all finite numbers")
    if (np.abs(lon_lat) > [180.0, 90.0]).any():
        far = lon_lat[(np.abs(lon_lat) > [180.0, 90.0]).any(axis=1)][0]
        raise InputError(f"{path}: {far[0]:g}, {far[1]:g} is no longitude, latitude in degrees: another projection")
    places = lon_lat[:, ::-1]
    try:
        metres = local_m(places, *places[0])
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
    kept = [0]
    for k in range(1, len(places)):
        if math.dist(metres[k], metres[kept[-1]]) >= APART_M:
            kept.append(k)
    if len(kept) < 2:
        raise InputError(f"{path}: all places lie within {APART_M:g} m, a line is needed")
    return places[kept]


def local_m(lat_lon_deg: Array, latitude_deg: float, longitude_deg: float) -> Array:
    """Places, shape (n, 2), deg, as metres north and east of a place by the tangent plane at the first of them.

    Raises
    ------
    InputError
        If one is farther than `FARTHEST_M` from the first, or the place is at a pole.
    """
    first = lat_lon_deg[0]
    sine = math.sin(math.radians(first[0]))
    if abs(sine) > math.sin(math.radians(85.0)):
        raise InputError(f"latitude {first[0]:.1f}, must be within 85 degrees of the equator")
    bend = 1.0 - _E2 * sine * sine
    north_m = _A_M * (1.0 - _E2) / bend**1.5
    east_m = _A_M / math.sqrt(bend) * math.cos(math.radians(first[0]))
    off_deg = lat_lon_deg - [latitude_deg, longitude_deg]
    off_deg[:, 1] = (off_deg[:, 1] + 180.0) % 360.0 - 180.0  # a line may cross the antimeridian
    metres = np.radians(off_deg) * [north_m, east_m]
    away = float(np.hypot(*(metres - metres[0]).T).max())
    if away > FARTHEST_M:
        raise InputError(
            f"a place {away:.0f} m from the first one, at most {FARTHEST_M:g}: metres in place of degrees?"
        )
    return metres

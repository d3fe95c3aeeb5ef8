"""Lines of GeoJSON and KML files, in metres, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise_ardusub.survey.map_files import local_m, read_map

LINE = [[-118.4, 33.8], [-118.4, 33.801], [-118.399, 33.801]]


def written(folder: Path, content: Any, name: str = "line.geojson") -> Path:
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("wrap", [
    lambda line: line,
    lambda line: {"type": "Feature", "geometry": line, "properties": {}},
    lambda line: {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": line}]},
])  # fmt: skip
def test_a_line_of_geojson_is_read_from_whatever_holds_it(tmp_path: Path, wrap: Any) -> None:
    """Corners as latitude and longitude."""
    path = written(tmp_path, wrap({"type": "LineString", "coordinates": LINE}))
    assert read_map(path) == pytest.approx(np.array(LINE)[:, ::-1])


def test_kml_and_geojson_of_the_same_line_agree(tmp_path: Path) -> None:
    """Heights have no effect."""
    places = " ".join(f"{lon},{lat},-5" for lon, lat in LINE)
    kml = (
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString>'
        f"<coordinates>\n{places}\n</coordinates></LineString></Placemark></Document></kml>"
    )
    assert read_map(written(tmp_path, kml, "line.kml")) == pytest.approx(np.array(LINE)[:, ::-1])


def test_places_drawn_twice_count_once_and_a_byte_order_mark_is_no_letter(tmp_path: Path) -> None:
    """As a double click and some editors leave them."""
    path = tmp_path / "line.geojson"
    line = {"type": "LineString", "coordinates": [LINE[0], *LINE, LINE[2]]}
    path.write_text(json.dumps(line), encoding="utf-8-sig")
    assert read_map(path) == pytest.approx(np.array(LINE)[:, ::-1])
    path.write_bytes(json.dumps({"name": "B\u00e4r", **line}, ensure_ascii=False).encode("latin-1"))
    with pytest.raises(InputError, match="save it as UTF-8"):
        read_map(path)
    with pytest.raises(InputError, match="is a folder"):
        read_map(tmp_path)


def test_a_line_across_the_antimeridian_is_as_short_as_it_is() -> None:
    """0.0002 degrees of longitude at 17 S are 21 m, whichever side they are said from."""
    places = np.array([[-17.0, 179.9999], [-17.0, -179.9999]])
    for k in (0, 1):
        metres = local_m(places, *places[k])
        assert np.hypot(*(metres[1] - metres[0])) == pytest.approx(21.3, abs=0.1)


def test_metres_are_those_of_the_ellipsoid() -> None:
    """A thousandth of a degree at 33.8 N: 110.92 m of latitude, 92.58 m of longitude (WGS 84), within 2 cm."""
    metres = local_m(np.array(LINE)[:, ::-1], 33.8, -118.4)
    assert metres[0] == pytest.approx([0.0, 0.0])
    assert metres[2] == pytest.approx([110.917, 92.585], abs=0.02)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.geojson", {"type": "LineString", "coordinates": [[500000, 3740000], [500010, 3740000]]}, "projection"),
        ("a.geojson", {"type": "LineString", "coordinates": LINE, "crs": {"name": "EPSG:32611"}}, "must be WGS 84"),
        ("a.geojson", {"type": "LineString", "coordinates": [LINE[0]]}, "two places or more"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[NaN, 1], [2, 3]]}', "finite numbers"),
        ("a.geojson", {"type": "LineString", "coordinates": [["x", 1], [2, 3]]}, "is not longitude, latitude"),
        ("a.geojson", {"type": "MultiLineString", "coordinates": [LINE, LINE]}, "2 lines, must hold one"),
        ("a.geojson", {"type": "Point", "coordinates": LINE[0]}, "no line but Point, must hold one"),
        ("a.kml", "<kml><Polygon><LinearRing/></Polygon></kml>", "no line but LinearRing, Polygon"),
        ("a.geojson", {"type": "LineString", "coordinates": [LINE[0], LINE[0]]}, "all places lie within 0.1 m"),
        ("a.geojson", {"type": "LineString", "coordinates": [[0, 0], [0, 20]]}, "metres in place of degrees"),
        ("a.geojson", {"type": "MultiLineString", "coordinates": 5}, "coordinates is a int, must be an array"),
        ("a.geojson", {"type": "FeatureCollection", "features": 5}, "features is a int, must be an array"),
        ("a.geojson", {"type": "FeatureCollection", "features": {"a": 1}}, "features is a dict, must be an array"),
        ("a.geojson", {"type": "GeometryCollection", "geometries": 7}, "geometries is a int, must be an array"),
        ("a.geojson", {"type": "FeatureCollection", "features": None}, "no line, must hold one"),
        ("a.geojson", "{", "is no JSON"),
        ("a.kml", "<kml>", "is no XML"),
        ("a.kml", '<!DOCTYPE kml [<!ENTITY a "b">]><kml/>', "entities"),
        ("a.shp", "", "must be .geojson"),
    ],
)
def test_a_map_that_cannot_be_flown_is_refused_in_one_line(tmp_path: Path, name: str, content: Any, words: str) -> None:
    """The line names the file and what would be right."""
    with pytest.raises(InputError, match=words) as refused:
        read_map(written(tmp_path, content, name))
    assert "\n" not in str(refused.value)
    assert name in str(refused.value)


def test_places_that_are_far_apart_or_missing_are_refused(tmp_path: Path) -> None:
    """More than 2 km from the first; a file that is not there."""
    with pytest.raises(InputError, match="from the first one, at most 2000"):
        local_m(np.array([[33.8, -118.4], [33.9, -118.4]]), 33.8, -118.4)
    with pytest.raises(InputError, match="no such file"):
        read_map(tmp_path / "none.kml")

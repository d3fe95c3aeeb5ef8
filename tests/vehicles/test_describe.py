"""The description for people and programs, and the drawing."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from wakewise.vehicles import Vehicle, describe, drawing_svg, load_vehicle, vehicle_names

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module", params=vehicle_names())
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(request.param)


def test_the_description_is_plain_json_that_says_what_matters(vehicle: Vehicle) -> None:
    said = json.loads(json.dumps(describe(vehicle), allow_nan=False))
    assert said["rank"] == 6
    assert [n["name"] for n in said["null_space"]] == ["horizontal squeeze", "vertical twist"]
    assert len(said["thrusters"]) == 8
    assert said["achievable_wrench"]["heave"]["highest"] > 200.0
    assert said["does_not_claim"]
    assert np.allclose(np.array(said["allocation_matrix"]), vehicle.allocation_matrix)


def test_the_heavy_sinks_by_its_published_tenth_of_a_kilogram() -> None:
    assert np.isclose(describe(load_vehicle("bluerov2-heavy"))["trim_N"], -0.980665)
    assert describe(load_vehicle("paper"))["trim_N"] == 0.0


def test_the_drawing_is_one_whole_svg_with_every_thruster_numbered_in_both_views(vehicle: Vehicle) -> None:
    text = drawing_svg(vehicle)
    root = ElementTree.fromstring(text)
    words = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert {str(n) for n in range(1, 9)} <= set(words)
    assert {"1·2", "3·4", "5·6", "7·8"} <= set(words)
    assert "href" not in text


def test_the_drawing_stays_on_the_page(vehicle: Vehicle) -> None:
    root = ElementTree.fromstring(drawing_svg(vehicle))
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    for element in root.iter(f"{SVG}circle"):
        x, y, r = (float(element.attrib[name]) for name in ("cx", "cy", "r"))
        assert r <= x <= width - r
        assert r <= y <= height - r


def test_words_from_the_file_cannot_break_the_drawing() -> None:
    odd = replace(load_vehicle("paper"), title='<script>&"')
    assert "<script>" not in drawing_svg(odd)
    assert ElementTree.fromstring(drawing_svg(odd)).find(f"{SVG}title") is not None

"""The drawing: whole, on its page, and true to the geometry."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import VehicleDraft, draft_names, load_draft, load_vehicle
from wakewise.ui.reports.vehicle import drawing_svg

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module", params=draft_names())
def draft(request: pytest.FixtureRequest) -> VehicleDraft:
    return load_draft(request.param)


def numbers_on(text: str) -> list[str]:
    root = ElementTree.fromstring(text)
    words = [element.text or "" for element in root.iter(f"{SVG}text") if element.attrib["fill"] == "#ffffff"]
    return [number for word in words for number in word.split("·")]


def test_every_thruster_is_numbered_once_in_each_of_three_views(draft: VehicleDraft) -> None:
    text = drawing_svg(draft)
    wanted = sorted(str(n) for n in range(1, len(draft.thrusters) + 1))
    assert sorted(numbers_on(text)) == sorted(3 * wanted)
    assert "href" not in text


def test_the_drawing_stays_on_the_page(draft: VehicleDraft) -> None:
    root = ElementTree.fromstring(drawing_svg(draft))
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    for element in root.iter(f"{SVG}circle"):
        x, y, r = (float(element.attrib[name]) for name in ("cx", "cy", "r"))
        assert r <= x <= width - r
        assert r <= y <= height - r
    for element in root.iter(f"{SVG}rect"):
        x, y, w, h = (float(element.attrib.get(name, 0)) for name in ("x", "y", "width", "height"))
        assert x >= 0 <= y
        assert x + w <= width
        assert y + h <= height


def test_an_eight_thruster_vehicle_shows_pairs_behind_each_other_from_the_side() -> None:
    words = [e.text for e in ElementTree.fromstring(drawing_svg(load_vehicle("paper"))).iter(f"{SVG}text")]
    assert {"1·2", "3·4", "5·6", "7·8"} <= set(words)


def test_a_jet_points_against_the_force_it_makes() -> None:
    """From above, the streams' gradients of the horizontals run along minus the force axis."""
    paper = load_draft("paper")
    root = ElementTree.fromstring(drawing_svg(paper))
    jets = {g.attrib["id"]: g.attrib for g in root.iter(f"{SVG}linearGradient")}
    for index in range(4):
        jet = jets[f"jet-0-{index}"]
        way = np.array([float(jet["x2"]) - float(jet["x1"]), float(jet["y2"]) - float(jet["y1"])])
        assert np.allclose(way / np.linalg.norm(way), -paper.thrusters[index].axis_B[:2], atol=1e-2)


def test_what_the_file_does_not_state_is_named_and_dashed() -> None:
    text = drawing_svg(load_draft("orca"))
    assert "Not stated by its file: size" in text
    assert "size and propellers not stated" in text
    assert "Not stated" not in drawing_svg(load_draft("paper"))


def test_words_from_the_file_cannot_break_the_drawing() -> None:
    odd = replace(load_vehicle("paper"), title='<script>&"')
    assert "<script>" not in drawing_svg(odd)
    assert ElementTree.fromstring(drawing_svg(odd)).find(f"{SVG}title") is not None


def test_a_matrix_alone_cannot_be_drawn() -> None:
    with pytest.raises(InputError, match="no places of thrusters"):
        drawing_svg(replace(load_draft("rexrov"), thrusters=()))

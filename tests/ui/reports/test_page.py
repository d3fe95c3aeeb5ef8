"""The page of a vehicle: self-contained, complete, and safe against words from files."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from wakewise.robot.vehicles import VehicleDraft, draft_names, load_draft, parameters
from wakewise.ui.reports.vehicle import vehicle_page

VOID = {"meta", "br", "link", "img"}


class Nesting(HTMLParser):
    """Collects faults of nesting and the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert not any(name in ("src", "href") for name, _ in attrs), "the page must need nothing from elsewhere"
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def read(draft: VehicleDraft) -> str:
    page = Nesting()
    page.feed(vehicle_page(draft))
    assert page.open == []
    return " ".join(page.words)


@pytest.mark.parametrize("name", draft_names())
def test_every_page_is_well_formed_and_holds_every_parameter_with_its_source(name: str) -> None:
    draft = load_draft(name)
    words = read(draft)
    for parameter in parameters(draft):
        assert parameter.quantity in words
        assert parameter.value is None or parameter.value in words
        assert parameter.source in words
    for thruster in draft.thrusters:
        assert thruster.name in words
    assert draft.does_not_claim in words
    assert ("Missing." in words) == bool(draft.missing)


def test_estimates_are_marked() -> None:
    assert read(load_draft("paper")).count("estimate") > read(load_draft("bluerov2-heavy")).count("estimate")


def test_couplings_are_shown_whole() -> None:
    assert "409.44" in read(load_draft("rexrov"))
    assert "Added mass, whole" not in read(load_draft("paper"))


def test_a_matrix_alone_has_a_page_without_a_drawing() -> None:
    assert "The file holds a matrix only." in read(replace(load_draft("rexrov"), thrusters=()))


def test_words_from_the_file_cannot_break_the_page() -> None:
    evil = "<script>alert(1)</script></table>"
    paper = load_draft("paper")
    odd = replace(paper, title=evil, source=evil, does_not_claim=evil, notes=(evil,))
    odd = replace(odd, thrusters=(replace(paper.thrusters[0], name="<td>evil"), *paper.thrusters[1:]))
    page = vehicle_page(odd)
    assert "<script" not in page
    assert "<td>evil" not in page
    assert evil in read(odd)


def test_coloured_cells_have_a_legend_and_the_page_a_dark_side() -> None:
    """Both ends of each colour scale are named, worse first; a lost axis has the full tint, a whole one none."""
    page = vehicle_page(load_draft("paper"))
    assert "0 %: the axis is lost" in page
    assert "100 %: nothing is lost" in page
    assert "prefers-color-scheme: dark" in page
    for share, left in re.findall(r'class="cell lost" style="--share:([\d.]+)">(\d+)<', page):
        assert float(share) == pytest.approx(1.0 - min(float(left), 100.0) / 100.0, abs=0.006)
    assert 'class="cell lost"' in page

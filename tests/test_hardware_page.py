"""docs/hardware.md and its drawings: fresh, true to the code and to a real vehicle's log, and legible."""

import os
import re
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from wakewise_ardusub.sensors import jy901

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tools"))
try:
    import draw_hardware
finally:
    sys.path.pop(0)

TABLE = draw_hardware.read_table()
LINKS = [(name, link) for name, told in TABLE.items() for link in told["links"]]
RATED = [link for _, link in LINKS if "rate" in link]


def test_page_and_drawings_are_what_the_table_says() -> None:
    """Written anew they are the same bytes; `python tools/draw_hardware.py` writes them."""
    for path, text in draw_hardware.pages().items():
        assert (ROOT / "docs" / path).read_text(encoding="utf-8") == text, f"docs/{path} is stale"


@pytest.mark.parametrize("link", [link for link in RATED if "constant" in link], ids=lambda link: link["constant"])
def test_a_rate_that_the_code_has_is_the_codes(link: dict[str, Any]) -> None:
    """Module and name are there, and hold what the drawing says."""
    assert draw_hardware.value_of(link["constant"]) == pytest.approx(link["rate"])


def test_every_link_of_data_has_a_rate_and_says_where_it_comes_from() -> None:
    """Power is told in volts; whatever carries data has a number, a unit and a source."""
    for name, link in LINKS:
        assert {link["from"], link["to"]} <= set(TABLE[name]["boxes"])
        if link.get("kind") != "power":
            assert link["rate"] > 0.0
            assert link["unit"] in {"Hz", "ms", "Mbit/s"}
            assert link["source"] or link["constant"]


def test_rates_of_telemetry_are_those_of_a_real_vehicle() -> None:
    """Messages of the log divided by its length are within 5 % of what the drawing says."""
    data = os.environ.get("WAKEWISE_DATA")
    log = Path(data or "none") / "ardusub" / "2023-04-18.tlog"
    if not log.is_file():
        pytest.skip("WAKEWISE_DATA does not name the folder of real logs")
    mavlink = pytest.importorskip("pymavlink.mavutil")
    counts: Counter[tuple[str, int, int]] = Counter()
    reader, first, last = mavlink.mavlink_connection(str(log)), None, 0.0
    while (message := reader.recv_match()) is not None:
        if message.get_type() != "BAD_DATA":
            counts[message.get_type(), message.get_srcSystem(), message.get_srcComponent()] += 1
            first, last = first or message._timestamp, message._timestamp
    for link in RATED:
        if "log" in link:
            measured = counts[tuple(link["log"])] / (last - (first or 0.0))
            assert measured == pytest.approx(link["rate"], rel=0.05), link["log"]


def test_the_units_line_carries_what_it_is_said_to() -> None:
    """A byte is ten bits on the wire: 9600 baud carry 29 samples of three frames, 50 need 16500, 115200 carry them."""
    sample_bits = 3 * jy901.LENGTH * 10
    assert jy901.BAUD // sample_bits == 29
    assert 50 * sample_bits == 16500
    text = (ROOT / "docs" / "hardware.md").read_text()
    assert "29 samples" in text
    assert "16500 baud" in text


@pytest.mark.parametrize("name", TABLE)
def test_words_fit_their_boxes_and_nothing_lies_outside(name: str) -> None:
    """By a width of 0.6 em a letter, a wide font's mean; boxes do not overlap; the SVG is well-formed."""
    told = TABLE[name]
    boxes = list(told["boxes"].values())
    for k, box in enumerate(boxes):
        for size, line in [(14, box["title"]), *((12.5, line) for line in box["lines"])]:
            assert 0.6 * size * len(line) < box["w"], f"{line} in {box['title']}"
        assert 17 * (1 + len(box["lines"])) <= box["h"]
        assert box["x"] >= 8
        assert box["x"] + box["w"] <= draw_hardware.WIDTH - 8
        assert box["y"] + box["h"] <= told["height"]
        for other in boxes[k + 1 :]:
            apart = (
                box["x"] + box["w"] <= other["x"]
                or other["x"] + other["w"] <= box["x"]
                or box["y"] + box["h"] <= other["y"]
                or other["y"] + other["h"] <= box["y"]
            )
            assert apart, (box["title"], other["title"])
    svg = draw_hardware.drawing(told)
    ET.fromstring(svg)
    assert not re.search(r"https?://(?!www\.w3\.org)", svg)
    assert "prefers-color-scheme: dark" in svg


def test_text_stands_out_in_light_and_dark() -> None:
    """Contrast of 4.5 to 1 and more between every kind of text and what it lies on (WCAG 2.2, 1.4.3)."""

    def luminance(colour: str) -> float:
        channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    light, dark = draw_hardware._STYLE.split("@media")
    for rules in (light, dark):
        fill = {}
        for names, body in re.findall(r"([^{}]+)\{([^{}]*)\}", rules):
            colour = re.search(r"fill: (#\w{6})", body)
            for one in names.split(","):
                if colour:
                    fill[one.strip().lstrip(".").split(" ")[-1].lstrip(".")] = colour[1]
        for text, ground in (("text", "box"), ("text", "ours"), ("small", "box"), ("small", "ours"), ("name", "area"),
                             ("rate", "area"), ("rate", "page"), ("label", "area")):  # fmt: skip
            a, b = sorted((luminance(fill[text]), luminance(fill[ground])), reverse=True)
            assert (a + 0.05) / (b + 0.05) >= 4.5, (text, ground)

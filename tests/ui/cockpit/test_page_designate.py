"""A box drawn on the picture in a real browser, and what the page shows of the target that it designates."""

from __future__ import annotations

import time
from typing import Any

import pytest
from browser import Page, until
from standin import StandIn

TRACKED = {
    "status": "tracked",
    "outline": {"u": 0.5, "v": 0.4, "radius": 0.1},
    "distance_m": 0.62,
    "std_m": 0.005,
    "age_ms": 80,
    "trouble": "",
}
SEEN = "document.getElementById('no-picture').hidden"
INKED = """(([u, v]) => {
  const marks = document.getElementById('marks'), camera = document.getElementById('camera');
  const wide = marks.width, high = marks.height, scale = Math.min(wide / camera.width, high / camera.height);
  const x = (wide - scale * camera.width) / 2 + u * scale * camera.width;
  const y = (high - scale * camera.height) / 2 + v * scale * camera.height;
  return [...marks.getContext('2d').getImageData(Math.round(x), Math.round(y), 1, 1).data]; })"""
"""Colour of the marks at shares of the picture."""


def spot(page: Page, u: float, v: float) -> tuple[float, float]:
    """Shares of the picture in pixels of the page; the picture is as wide as 4 : 3 allows within its canvas."""
    x, y, w, h = page.js(
        "(() => { const b = document.getElementById('camera').getBoundingClientRect();"
        " return [b.x, b.y, b.width, b.height]; })()"
    )
    wide = min(w, h * 4 / 3)
    return x + w / 2 + (u - 0.5) * wide, y + h / 2 + (v - 0.5) * wide * 3 / 4


def mouse(page: Page, kind: str, at: tuple[float, float]) -> None:
    held = {"button": "left", "clickCount": 1, "buttons": 1}
    page.call("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], **held)


def drag(page: Page, begin: tuple[float, float], end: tuple[float, float], *, let_go: bool = True) -> None:
    """Draw from one place of the picture to another, in shares of it."""
    mouse(page, "mousePressed", spot(page, *begin))
    mouse(page, "mouseMoved", spot(page, (begin[0] + end[0]) / 2, end[1]))
    mouse(page, "mouseMoved", spot(page, *end))
    if let_go:
        mouse(page, "mouseReleased", spot(page, *end))


def sent(standin: StandIn) -> dict[str, Any]:
    message: dict[str, Any] = until(lambda: standin.of("designate"), "a designation")[-1]
    return message


def test_a_box_goes_out_in_shares_of_its_picture(standin: StandIn, fly: Any) -> None:
    """From whichever corner it is drawn; a part outside the picture is cut off, and the picture is named."""
    page = fly()
    page.until(SEEN)
    drag(page, (0.6, 0.7), (0.3, 0.2))
    message = sent(standin)
    assert message["box"] == pytest.approx([0.3, 0.2, 0.6, 0.7], abs=0.005)
    assert message["lease"] == standin.lease
    assert 0 < message["frame"] <= max(m["frame"] for m in standin.of("seen"))
    drag(page, (0.9, 0.9), (1.01, 0.99))
    until(lambda: len(standin.of("designate")) == 2, "another box")
    assert sent(standin)["box"][2] == 1.0


def test_a_click_is_a_box_about_it(standin: StandIn, fly: Any) -> None:
    """Of 12 % of the picture's width; key T is a click on the middle."""
    page = fly()
    page.until(SEEN)
    drag(page, (0.4, 0.5), (0.4, 0.5))
    assert sent(standin)["box"] == pytest.approx([0.34, 0.42, 0.46, 0.58], abs=0.006)
    page.press("KeyT")
    until(lambda: len(standin.of("designate")) == 2, "the middle")
    assert sent(standin)["box"] == pytest.approx([0.44, 0.42, 0.56, 0.58], abs=0.001)


def test_who_watches_designates_nothing(standin: StandIn, spectate: Any) -> None:
    """The page says what is missing."""
    page = spectate()
    page.until(SEEN)
    drag(page, (0.3, 0.3), (0.6, 0.6))
    page.press("KeyT")
    page.until("document.getElementById('notes').innerText.includes('Take the helm first')")
    time.sleep(0.2)
    assert standin.of("designate") == []


def test_escape_gives_up_a_box_and_then_the_target(standin: StandIn, fly: Any) -> None:
    """One that is being drawn is not sent; Escape and the button ask for the scenario's own target."""
    page = fly()
    page.until(SEEN)
    page.press("Escape")
    drag(page, (0.3, 0.3), (0.6, 0.6), let_go=False)
    page.until(f"{INKED}([0.45, 0.3])[3] > 0")
    page.press("Escape")
    mouse(page, "mouseReleased", spot(page, 0.6, 0.6))
    page.until(f"{INKED}([0.45, 0.3])[3] === 0")
    time.sleep(0.2)
    assert standin.of("designate") == []
    assert page.js("document.getElementById('designated').hidden")
    standin.target = TRACKED
    page.until("!document.getElementById('designated').hidden")
    page.press("Escape")
    assert sent(standin)["box"] == "clear"
    page.click("#forget")
    until(lambda: len(standin.of("designate")) == 2, "the button")
    standin.target = None
    page.until("document.getElementById('designated').hidden")


def test_the_outline_and_its_line_say_how_it_stands(standin: StandIn, fly: Any) -> None:
    """A circle where the target is, in the colour of its status, and one line of text; nothing of a target behind."""
    page = fly()
    page.until(SEEN)
    standin.target = TRACKED
    page.until("document.getElementById('designated-line').innerText.startsWith('tracked')")
    assert page.text("#designated-line").replace("\u202f", " ") == "tracked, 0.62 m, ±5 mm, 80 ms old"
    page.until(f"{INKED}([0.6, 0.4])[1] > 190")
    assert page.js(f"{INKED}([0.5, 0.4])[3]") == 0
    standin.target = TRACKED | {"status": "lost", "trouble": "no pictures"}
    page.until("document.getElementById('designated-line').innerText.endsWith('no pictures')")
    assert page.js("document.getElementById('designated').dataset.status") == "lost"
    standin.target = TRACKED | {"outline": None, "distance_m": None, "std_m": None, "age_ms": None}
    page.until("document.getElementById('designated-line').innerText === 'tracked'")
    page.until(f"{INKED}([0.6, 0.4])[3] === 0")


def test_a_proposal_is_answered_by_buttons_and_keys(standin: StandIn, fly: Any) -> None:
    """The buttons are there only while a target is proposed; key B asks for a proposal, K accepts, N refuses."""
    page = fly()
    page.until(SEEN)
    page.press("KeyK")
    page.press("KeyB")
    until(lambda: len(standin.of("proposal")) == 1, "a request")
    standin.target = TRACKED | {"status": "proposed"}
    page.until("!document.getElementById('accept').hidden && !document.getElementById('refuse').hidden")
    page.press("KeyK")
    page.press("KeyN")
    page.click("#accept")
    page.click("#refuse")
    until(lambda: len(standin.of("proposal")) == 5, "the answers")
    assert [m["what"] for m in standin.of("proposal")] == ["ask", "accept", "refuse", "accept", "refuse"]
    assert all(m["lease"] == standin.lease for m in standin.of("proposal"))
    standin.target = TRACKED
    page.until("document.getElementById('accept').hidden && document.getElementById('refuse').hidden")


@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390)])
def test_a_thumb_asks_for_a_proposal_on_a_phone(standin: StandIn, fly: Any, width: int, height: int) -> None:
    """The button is as high as a thumb needs and nothing lies over it; it is there while there is no target."""
    page = fly("", width, height, phone=True)
    page.until(SEEN)
    page.until("!document.getElementById('propose').hidden")
    x, y, high, on_top = page.js(
        "(() => { const b = document.getElementById('propose').getBoundingClientRect();"
        " const x = b.x + b.width / 2, y = b.y + b.height / 2;"
        " return [x, y, b.height, document.elementFromPoint(x, y).id]; })()"
    )
    assert high >= 44
    assert on_top == "propose"
    page.touch("touchStart", [(x, y)])
    page.touch("touchEnd", [])
    until(lambda: len(standin.of("proposal")) == 1, "a request")
    assert standin.of("proposal")[0]["what"] == "ask"
    standin.target = TRACKED
    page.until("document.getElementById('propose').hidden")


def test_a_thumb_draws_a_box_on_a_phone(standin: StandIn, fly: Any) -> None:
    """The page does not scroll meanwhile, and the button is as high as a thumb needs."""
    page = fly("", 390, 844, phone=True)
    page.until(SEEN)
    page.touch("touchStart", [spot(page, 0.4, 0.4)])
    page.touch("touchMove", [spot(page, 0.5, 0.6)])
    page.touch("touchMove", [spot(page, 0.6, 0.7)])
    page.touch("touchEnd", [])
    assert sent(standin)["box"] == pytest.approx([0.4, 0.4, 0.6, 0.7], abs=0.02)
    standin.target = TRACKED
    page.until("!document.getElementById('designated').hidden")
    assert page.js("document.getElementById('forget').getBoundingClientRect().height") >= 44
    assert page.js("scrollY") == 0

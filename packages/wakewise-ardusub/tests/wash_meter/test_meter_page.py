"""The meter's page in a browser: legible on a laptop, a phone and as a widget; it says what the server says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browser import CHROMIUM, NO_BROWSER, Browser, Page, until

from wakewise_ardusub.wash_meter.server import MeterServer

NAMES = ["front right horizontal", "front left horizontal", "rear right horizontal", "rear left horizontal",
         "front right vertical", "front left vertical", "rear right vertical", "rear left vertical"]  # fmt: skip
FLOWN = [7.5, 9.1, -6.7, -2.4, 1.2, 1.2, 1.2, 1.2]
LIVE: dict[str, Any] = {
    "time_s": 100.0, "vehicle": "bluerov2-heavy", "wake_model": "jet", "points": "of a ball 0.4 m ahead of the bow",
    "marked": False, "can_mark": True, "system": 1, "armed": True, "mode": "MANUAL", "voltage_V": 15.4,
    "directions_known": True, "others": [], "why_not": None, "running": True, "saved_pct": 41.7,
    "saved_dive_pct": 38.2, "running_instants": 600, "second": 99, "second_mm_s": [12.0, 7.0], "thrusters": NAMES,
    "disturbance": {"flown": 4e-3, "least": 3e-3, "gentle": 1e-3}, "publishes": False,
    "rms_mm_s": {"flown": 16.3, "least": 14.1, "gentle": 8.2},
    "peak_mm_s": {"flown": 39.6, "least": 36.0, "gentle": 20.0},
    "thrusts_N": {"flown": FLOWN, "least": FLOWN, "gentle": [-1.0, 0.5, -9.0, -4.0, 1.2, 1.2, 1.2, 1.2]},
    "shares_pct": [44.0, 56.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
}  # fmt: skip
SIZES = {"desktop": (1280, 800, False, ""), "phone": (390, 844, True, ""), "widget": (300, 300, False, "?widget=1")}


class Stage:
    """A server whose state a test sets."""

    def __init__(self) -> None:
        self.state: dict[str, Any] = dict(LIVE)
        self.past: dict[str, Any] = {"until_s": 99, "flown_mm_s": [None, 10.0, 14.0], "gentle_mm_s": [None, 5.0, 6.0]}
        self.desired: list[str] = []
        self.server = MeterServer(lambda: self.state, lambda: self.past, self._command)

    def _command(self, what: str) -> str | None:
        self.desired.append(what)
        self.state = self.state | {"marked": what == "mark"}
        return None


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip(NO_BROWSER)
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def stage() -> Iterator[Stage]:
    stage = Stage()
    stage.server.start()
    yield stage
    stage.server.stop()


@pytest.fixture
def opened(browser: Browser, stage: Stage) -> Iterator[Any]:
    pages: list[Page] = []

    def open_page(size: str = "desktop", *, dark: bool = False) -> Page:
        width, height, phone, query = SIZES[size]
        page = browser.open(stage.server.address + query, width, height, phone=phone, dark=dark)
        pages.append(page)
        page.until("document.body.dataset.link !== 'connecting'")
        return page

    yield open_page
    for page in pages:
        assert page.complaints() == []
        page.close()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("dark", [False, True])
def test_the_number_is_in_sight_at_every_size(opened: Any, size: str, dark: bool) -> None:
    """Nothing runs out sideways or is cut, the number stands large and first, in a light and a dark page."""
    page = opened(size, dark=dark)
    page.until("document.querySelector('#saved').textContent === '42'")
    assert page.js("document.documentElement.scrollWidth <= innerWidth")
    bottom, large = page.js(
        "(() => { const e = document.querySelector('.big'), b = e.getBoundingClientRect();"
        " return [b.bottom <= innerHeight, parseFloat(getComputedStyle(e).fontSize)]; })()"
    )
    assert bottom
    assert large >= 40
    cut = page.js(
        "[...document.querySelectorAll('output, dd, dt, p, h2, button, .dive b')].filter(e => e.offsetParent &&"
        " e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline').map(e => e.id || e.className)"
    )
    assert set(cut) <= {"who"}  # the vehicle's name may end in dots
    small = page.js(
        "Math.min(...[...document.querySelectorAll('body *')].filter(e => e.offsetParent && e.children.length === 0"
        " && e.textContent.trim()).map(e => parseFloat(getComputedStyle(e).fontSize)))"
    )
    assert small >= 12
    assert page.text("#flown") == "16.3\u202fmm/s"
    assert page.text("#gentle") == "8.2\u202fmm/s"
    if size != "widget":
        assert page.js("document.querySelectorAll('#thrusters li').length") == 8
        assert page.js("document.querySelectorAll('#thrusters li.strong').length") == 2


def test_what_is_not_known_is_a_dash_and_a_reason(opened: Any, stage: Stage) -> None:
    """No old number stands while nothing is heard; unknown directions and a second vehicle are warned of."""
    for name in ("rms_mm_s", "peak_mm_s", "thrusts_N", "shares_pct", "disturbance"):
        stage.state.pop(name)
    silent = {"why_not": "no servo outputs are heard", "saved_pct": None, "running": False, "directions_known": False}
    stage.state |= silent | {"others": [7]}
    page = opened()
    page.until("document.body.dataset.link === 'waiting'")
    assert page.text("#saved") == "–"
    assert page.text("#flown") == "–"
    assert page.text("#meaning") == "No servo outputs are heard."
    assert "MOT_n_DIRECTION" in page.text("#note")
    assert "system 7" in page.text("#note")
    stage.state = dict(LIVE) | {"saved_pct": None, "running": False, "running_instants": 0}
    page.until("document.querySelector('#meaning').textContent === 'The thrusters rest.'")
    assert page.js("document.querySelector('#note').hidden")
    stage.state = dict(LIVE) | {"saved_pct": 0.01}
    page.until("document.querySelector('#meaning').textContent.includes('these thrusts are gentle')")


def test_the_page_marks_a_target_and_lets_it_go(opened: Any, stage: Stage) -> None:
    """One button for both, which says which; it is not there where the vehicle's place is not known."""
    page = opened()
    page.until("document.querySelector('#mark').textContent === 'Mark the target here'")
    page.click("#mark")
    until(lambda: stage.desired == ["mark"], "the mark")
    page.until("document.querySelector('#mark').getAttribute('aria-pressed') === 'true'")
    page.click("#mark")
    until(lambda: stage.desired == ["mark", "unmark"], "the mark to go")
    page.click("#begin")
    until(lambda: stage.desired[-1] == "begin", "the new beginning")
    stage.state |= {"can_mark": False, "marked": False}
    page.until("document.querySelector('#mark').hidden")


def test_a_server_that_is_gone_is_said(opened: Any, stage: Stage) -> None:
    """The lamp says so, and what was is pale; it comes back by itself."""
    page = opened()
    stage.server.stop()
    page.until("document.body.dataset.link === 'lost'")
    assert page.text("#link") == "No answer"
    stage.server = MeterServer(lambda: stage.state, lambda: stage.past, stage._command, port=stage.server.port)
    stage.server.start()
    page.until("document.body.dataset.link === 'live'")

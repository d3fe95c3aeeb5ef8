"""The page and the cockpit's own server together: what a flight's loop reads of hands in a real browser."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from browser import Browser, Page, until
from rehearsal import Rehearsal

from wakewise.ui.cockpit.server import CockpitServer, page_files


@pytest.fixture
def rehearsal() -> Iterator[Rehearsal]:
    show = Rehearsal()
    yield show
    show.close()


@pytest.fixture
def server(rehearsal: Rehearsal) -> Iterator[CockpitServer]:
    served = CockpitServer(rehearsal, files=page_files())
    served.start()
    yield served
    served.stop()


@pytest.fixture
def page(browser: Browser, server: CockpitServer) -> Iterator[Page]:
    opened = browser.open(server.address + "?name=Ada")
    opened.until("document.body.dataset.link === 'up' && document.querySelector('#time').textContent !== '–'")
    opened.press("KeyG")
    opened.until("document.body.dataset.helm === 'mine'")
    opened.press("KeyO")
    opened.until("document.body.dataset.mode === 'operator'")
    yield opened
    if opened.alive():
        assert opened.complaints() == []
        opened.close()


def flies(rehearsal: Rehearsal, axis: int, value: float) -> None:
    until(lambda: rehearsal.flown[-1][1][axis] == value, f"axis {axis} at {value}")


def test_a_key_moves_the_vehicle_and_a_window_left_stops_it(rehearsal: Rehearsal, page: Page, browser: Browser) -> None:
    """From key to loop and back to rest; once rested it stays at rest, and after a second the helm is free."""
    start = rehearsal.p.copy()
    page.down("KeyW")
    flies(rehearsal, 0, 1.0)
    until(lambda: np.linalg.norm(rehearsal.p - start) > 0.02, "to move")
    other = browser.open("about:blank")
    until(lambda: not rehearsal.flown[-1][1].any(), "to stop")
    stopped_s = time.monotonic()
    until(lambda: not rehearsal.mailbox.holding.flying, "the helm to lapse")
    assert not any(axes.any() for at_s, axes in rehearsal.flown if at_s > stopped_s)
    other.close()
    page.front()
    until(lambda: rehearsal.mailbox.holding.flying, "sticks again")
    page.up("KeyW")
    page.down("KeyA")
    flies(rehearsal, 1, -1.0)


def test_a_closed_tab_stops_and_frees_the_helm(rehearsal: Rehearsal, page: Page) -> None:
    """At once, without waiting for sticks to grow old."""
    page.down("KeyW")
    flies(rehearsal, 0, 1.0)
    page.close()
    until(lambda: rehearsal.mailbox.holding.holder is None, "the helm to be free")
    assert not rehearsal.mailbox.read(0.0)


def test_pictures_flow_and_captures_count(rehearsal: Rehearsal, page: Page) -> None:
    """The server's one picture in flight is acknowledged, so that the next comes; a capture is one photograph."""
    shown = rehearsal.frames
    until(lambda: rehearsal.frames > shown + 5, "pictures")
    assert page.js("[document.getElementById('camera').width, document.getElementById('camera').height]") == [480, 270]
    page.press("KeyC")
    page.until("document.querySelector('[data-field=photos]').innerText === '1'")
    page.press("Space")
    until(lambda: rehearsal.settings["mode"] == "hold", "hold")
    assert "capture" in page.text("#notes")


def test_a_second_helm_needs_consent_and_a_reload_gives_up(
    rehearsal: Rehearsal, page: Page, server: CockpitServer, browser: Browser
) -> None:
    """Handed over by who flies; who loads the page again only watches."""
    page.always_front()
    ben = browser.open(server.address + "?name=Ben")
    ben.always_front()
    ben.until("document.getElementById('banner-what').innerText === 'Ada has the helm'")
    ben.click("#helm-button")
    page.until("!document.getElementById('ask').hidden")
    page.click("#ask-yes")
    ben.until("document.body.dataset.helm === 'mine'")
    ben.down("KeyS")
    flies(rehearsal, 0, -1.0)
    page.until("document.getElementById('banner-what').innerText === 'Ben has the helm'")
    ben.call("Page.reload")
    until(lambda: not rehearsal.flown[-1][1].any(), "to stop")
    ben.until("document.body.dataset.link === 'up' && document.body.dataset.helm === 'free'")
    ben.close()


def test_a_server_that_restarts_is_found_again(rehearsal: Rehearsal, page: Page, server: CockpitServer) -> None:
    """On the same port, by the page's own tries; as a spectator."""
    server.stop()
    page.until("document.body.dataset.link === 'down'")
    assert "the vehicle holds" in page.text("#banner")
    again = CockpitServer(rehearsal, port=server.port)
    again.start()
    try:
        page.until("document.body.dataset.link === 'up' && document.body.dataset.helm === 'free'")
    finally:
        again.stop()


def test_a_pause_of_the_link_must_be_answered_by_letting_go(rehearsal: Rehearsal, page: Page) -> None:
    """Sticks that did not arrive for a while do not go on by themselves: the page says so, and what to do."""
    page.down("KeyW")
    flies(rehearsal, 0, 1.0)
    page.js(
        "(() => { const send = WebSocket.prototype.send; WebSocket.prototype.send = () => {};"
        " setTimeout(() => { WebSocket.prototype.send = send; }, 600); })()"
    )
    flies(rehearsal, 0, 0.0)
    page.until("document.getElementById('banner-more').innerText.includes('let go of them once')")
    time.sleep(0.3)
    assert not rehearsal.flown[-1][1].any()
    page.up("KeyW")
    page.until("document.getElementById('banner-what').innerText === 'You have the helm'")
    page.down("KeyW")
    flies(rehearsal, 0, 1.0)


@pytest.mark.parametrize(("fragment", "words"), [("", "a token is needed"), ("#token=guess", "the token is wrong")])
def test_who_has_no_token_is_told_in_words(rehearsal: Rehearsal, browser: Browser, fragment: str, words: str) -> None:
    """The socket is refused at its handshake, of which a browser tells nothing: the page asks why."""
    served = CockpitServer(rehearsal, files=page_files(), origins=("http://127.0.0.1:1",))
    served.start()
    try:
        opened = browser.open(f"http://127.0.0.1:{served.port}/{fragment}")
        opened.until("document.body.dataset.link === 'refused'")
        assert opened.text("#banner-what") == "Not let in"
        assert words in opened.text("#banner-more")
        opened.close()
        opened = browser.open(f"http://127.0.0.1:{served.port}/#token={served.token}")
        opened.until("document.body.dataset.link === 'up'")
        opened.close()
    finally:
        served.stop()

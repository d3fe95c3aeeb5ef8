"""One headless Chromium for all tests of the page, and a server to stand in for the cockpit's."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from browser import CHROMIUM, NO_BROWSER, Browser, Page
from standin import StandIn


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip(NO_BROWSER)
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def standin() -> Iterator[StandIn]:
    with StandIn(picture_hz=5.0, width=160) as server:
        yield server


Opener = Callable[..., Page]


@pytest.fixture
def spectate(browser: Browser, standin: StandIn) -> Iterator[Opener]:
    """Opens pages that are connected and only watch; closes them after the test, which no error may have outlived."""
    pages: list[Page] = []

    def open_page(query: str = "", width: int = 1280, height: int = 800, *, phone: bool = False) -> Page:
        page = browser.open(standin.url + query, width, height, phone=phone)
        pages.append(page)
        page.until("document.body.dataset.link === 'up' && document.querySelector('#time').textContent !== '–'")
        return page

    yield open_page
    for page in pages:
        if page.alive():
            assert page.complaints() == []
            page.close()


@pytest.fixture
def fly(spectate: Opener) -> Opener:
    """Opens pages that have the helm and may fly."""

    def open_page(query: str = "", width: int = 1280, height: int = 800, *, phone: bool = False) -> Page:
        page = spectate(query, width, height, phone=phone)
        page.press("KeyG")
        page.until("document.body.dataset.helm === 'mine'")
        page.press("KeyO")
        page.until("document.body.dataset.mode === 'operator'")
        return page

    return open_page

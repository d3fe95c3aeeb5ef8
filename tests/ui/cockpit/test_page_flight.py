"""One whole flight by hand from a real browser, in the paper's own water, which costs least."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from browser import Browser, Page, until

from wakewise.operation import Scenario
from wakewise.ui.cockpit.server import CockpitServer
from wakewise.ui.cockpit.session import CockpitSession

pytestmark = pytest.mark.slow


@pytest.fixture
def session(tmp_path: Path, browser: Browser) -> Iterator[CockpitSession]:
    scenario = Scenario.preset("quick", world="paper").replace(**{"target.points": 60})
    flown = CockpitSession(scenario, tmp_path / "flight")
    flown.start()
    yield flown
    flown.stop()


@pytest.fixture
def page(session: CockpitSession, browser: Browser) -> Iterator[Page]:
    server = CockpitServer(session)
    server.start()
    opened = browser.open(server.address)
    yield opened
    assert opened.complaints() == []
    opened.close()
    server.stop()


def test_a_flight_by_hand_from_the_browser(session: CockpitSession, page: Page, browser: Browser) -> None:
    """Fly, photograph, leave the window, come back, end: the vehicle went, held still, and its folder is whole."""
    page.until("document.body.dataset.link === 'up'")
    page.until("document.querySelector('#time').textContent !== '–'", 180.0)
    page.press("KeyG")
    page.until("document.body.dataset.helm === 'mine'")
    page.press("KeyO")
    page.until("document.body.dataset.mode === 'operator'")
    start = position(session)
    page.down("KeyD")
    until(lambda: np.linalg.norm(position(session) - start) > 0.05, "to move", 60.0)
    page.press("KeyC")
    until(lambda: (session.state() or {})["photos"] == 1, "a photograph", 60.0)
    other = browser.open("about:blank")
    until(lambda: not session.mailbox.holding.flying, "the helm to lapse")
    until(lambda: speed(session) < 0.01, "to hold", 60.0)
    rest = position(session)
    time.sleep(1.0)
    assert np.linalg.norm(position(session) - rest) < 0.03
    other.close()
    page.front()
    until(lambda: session.mailbox.holding.flying, "sticks again")
    page.until("document.getElementById('camera').width === 480", 60.0)
    page.click("#end")
    page.click("#end-box .danger")
    until(lambda: session.flown, "the folder", 60.0)
    folder = session.flown[0]
    rows = pl.read_parquet(folder / "steps.parquet")
    assert rows.height > 20
    assert session.live is not None
    assert len(session.live.exposures) == 1
    page.until("document.getElementById('banner-more').innerText.includes('the flight is over')")


def test_a_box_in_the_picture_of_a_flight_changes_what_is_protected(session: CockpitSession, page: Page) -> None:
    """The controllers' region is the designated one until it is forgotten; then it is the scenario's."""
    page.until("document.querySelector('#time').textContent !== '–'", 180.0)
    page.press("KeyG")
    page.until("document.body.dataset.helm === 'mine'")
    page.until("document.getElementById('no-picture').hidden", 60.0)
    assert session.live is not None
    methods = session.live.parts.controller.motion.methods
    own = methods["wake-aware"]
    assert (session.state() or {})["target"] is None
    page.press("KeyT")
    until(lambda: methods["wake-aware"] is not own, "another region", 60.0)
    page.until("document.getElementById('designated-line').innerText.startsWith('assumed')")
    page.until("document.getElementById('notes').innerText.includes('target designated')")
    page.press("Escape")
    until(lambda: methods["wake-aware"] is own, "the scenario's region")
    page.until("document.getElementById('designated').hidden")
    page.until("document.getElementById('notes').innerText.includes('target forgotten')")


def position(session: CockpitSession) -> np.ndarray:
    return np.array((session.state() or {})["position_W_m"])


def speed(session: CockpitSession) -> float:
    return float(np.linalg.norm((session.state() or {})["velocity_m_s"]))

"""Start of the web server."""

from __future__ import annotations

import threading
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.server import Site, WebServer

SITE = Site(files=StaticFiles(folder=Path("nowhere")))


class Failing(WebServer):
    """A server whose own tasks cannot be made."""

    def tasks(self) -> tuple[Coroutine[Any, Any, None], ...]:
        raise ValueError("no tasks")


def test_what_keeps_a_server_from_starting_is_raised_and_its_port_is_free_again() -> None:
    """Its start does not wait for ever."""
    server, faults = Failing(SITE), list[BaseException]()

    def start() -> None:
        try:
            server.start()
        except ValueError as fault:
            faults.append(fault)

    thread = threading.Thread(target=start, daemon=True)
    thread.start()
    thread.join(20.0)
    assert [str(fault) for fault in faults] == ["no tasks"]
    server.stop()
    other = WebServer(SITE, port=server.port)
    other.start()
    other.stop()


class EndsLater(WebServer):
    """A server whose loop fails while it runs."""

    async def _serve(self, started: Any) -> None:
        await super()._serve(started)
        raise ValueError("later")


def test_a_fault_after_the_start_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread raises it, as any other thread."""
    told = list[str]()
    monkeypatch.setattr(threading, "excepthook", lambda raised: told.append(str(raised.exc_value)))
    server = EndsLater(SITE)
    server.start()
    server.stop()
    assert told == ["later"]

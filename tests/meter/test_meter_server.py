"""Who may look at a meter's page, and who may wish something of it."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest
from test_cockpit_extras import EXTRAS, SERVICE, WIDGET, fits

from wakewise.errors import InputError
from wakewise.meter.server import OFFER, PAGE, TOKEN_HEADER, Server
from wakewise.serving.gate import Caller

WISHED: list[str] = []
ASK = urllib.request.build_opener(urllib.request.ProxyHandler({})).open


def wish(what: str) -> str | None:
    WISHED.append(what)
    return "no place" if what == "mark" else None


def make(host: str = "127.0.0.1", *, token: bool = True) -> Server:
    return Server(lambda: {"why_not": None}, lambda: {"flown_mm_s": []}, wish, host, token=token)


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = make()
    server.start()
    yield server
    server.stop()


def got(server: Server, path: str, method: str = "GET", **headers: str) -> tuple[int, Any, bytes]:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers=headers, method=method)
    try:
        with ASK(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code, refusal.headers, refusal.read()


def test_the_page_and_all_its_parts_are_served(server: Server) -> None:
    """Each file of the page's folder and those that every page has; nothing names another host."""
    for entry in PAGE.iterdir():
        path = "/" if entry.name == "index.html" else f"/page/{entry.name}"
        status, headers, body = got(server, path)
        assert (status, body) == (200, entry.read_bytes())
        assert "default-src 'self'" in headers["Content-Security-Policy"]
        assert b"http://" not in body
        assert b"https://" not in body
    for shared in ("colours.css", "theme.js", "draw.js", "numbers.js", "icon.svg"):
        assert got(server, f"/page/{shared}")[0] == 200
    assert got(server, "/page/../server.py")[0] == 404
    assert got(server, "/nothing")[0] == 404


def test_the_state_is_told_and_wishes_are_done(server: Server) -> None:
    """JSON both ways; a wish that cannot be done says why, one that is none is not there."""
    assert json.loads(got(server, "/state.json")[2]) == {"why_not": None}
    assert json.loads(got(server, "/history.json")[2]) == {"flown_mm_s": []}
    WISHED.clear()
    assert got(server, "/begin", "POST")[0] == 200
    status, _, body = got(server, "/mark", "POST")
    assert (status, json.loads(body)) == (409, {"why_not": "no place"})
    assert got(server, "/arm", "POST")[0] == 404
    assert got(server, "/mark")[0] == 404
    assert WISHED == ["begin", "mark"]


def test_another_sites_page_sees_and_wishes_nothing(server: Server) -> None:
    """Foreign host names and origins are refused; only what ground stations read is shared."""
    for path, method in (("/state.json", "GET"), ("/begin", "POST"), ("/", "GET")):
        assert got(server, path, method, Host="evil.example")[0] == 403
        assert got(server, path, method, Origin="http://evil.example")[0] == 403
    status, headers, body = got(server, "/cockpit_extras.json", Origin="http://blueos.local")
    assert status == 200
    assert headers["Access-Control-Allow-Origin"] == "*"
    assert json.loads(body) == OFFER.cockpit_extras()
    assert got(server, "/state.json")[1]["Access-Control-Allow-Origin"] is None


def test_from_elsewhere_the_token_opens_it_unless_everybody_may() -> None:
    """Files lie open, state and wishes do not; with --no-token they do, and other sites are refused all the same."""
    rov = Caller(address="10.0.0.7", host="rov.local:8765", origin=None)
    closed, everybody = make("0.0.0.0"), make("0.0.0.0", token=False)
    try:
        assert closed.token is not None
        assert closed.address.endswith(f"#token={closed.token}")
        assert closed.answer("GET", "/", rov, None)[0] == 200
        for method, path in (("GET", "/state.json"), ("POST", "/begin")):
            assert closed.answer(method, path, rov, None)[0] == 401
            assert closed.answer(method, path, rov, "guess")[0] == 401
            assert closed.answer(method, path, rov, closed.token)[0] == 200
            assert everybody.answer(method, path, rov, None)[0] == 200
            foreign = Caller(address="10.0.0.7", host="rov.local:8765", origin="http://evil.example")
            assert everybody.answer(method, path, foreign, None)[0] == 403
    finally:
        for one in (closed, everybody):
            one.start()
            one.stop()
    assert TOKEN_HEADER in (PAGE / "meter.js").read_text(encoding="utf-8")


def test_ground_stations_are_told_by_their_schema(server: Server) -> None:
    """Cockpit's extras and BlueOS' service; every address they name is served."""
    extras, service = OFFER.cockpit_extras(), OFFER.register_service()
    fits(extras, EXTRAS)
    fits(service, SERVICE)
    assert extras["actions"] == []
    for widget in extras["widgets"]:
        fits(widget, WIDGET)
        assert got(server, widget["iframeUrl"])[0] == 200
        assert got(server, widget["iframeIcon"])[0] == 200
    assert got(server, service["extras"]["cockpit"])[0] == 200
    assert json.loads(got(server, "/register_service")[2]) == service


def test_a_port_that_is_taken_is_said_in_one_line(server: Server) -> None:
    """With the way out."""
    with pytest.raises(InputError, match=r"--port \d+ at 127.0.0.1: .*give another --port"):
        Server(dict, dict, wish, port=server.port)

"""Who may look at a meter's page, and who may command something of it."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from typing import Any

import pytest
from test_cockpit_extras import EXTRAS, SERVICE_KEYS, WIDGET, fits

from wakewise.core.errors import InputError
from wakewise.ui.web.origin_check import PER_ADDRESS, TOKEN_HEADER, RequestOrigin
from wakewise.ui.web.server import MAX_KEPT
from wakewise_ardusub.wash_meter.server import OFFER, PAGE, MeterServer

WISHED: list[str] = []
ASK = urllib.request.build_opener(urllib.request.ProxyHandler({})).open


def command(what: str) -> str | None:
    WISHED.append(what)
    return "no place" if what == "mark" else None


def make(host: str = "127.0.0.1", *, token: bool = True) -> MeterServer:
    return MeterServer(lambda: {"why_not": None}, lambda: {"flown_mm_s": []}, command, host, token=token)


@pytest.fixture(scope="module")
def server() -> Iterator[MeterServer]:
    server = make()
    server.start()
    yield server
    server.stop()


def got(server: MeterServer, path: str, method: str = "GET", **headers: str) -> tuple[int, Any, bytes]:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers=headers, method=method)
    try:
        with ASK(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code, refusal.headers, refusal.read()


def test_the_page_and_all_its_parts_are_served(server: MeterServer) -> None:
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


def test_the_state_is_told_and_commands_are_done(server: MeterServer) -> None:
    """JSON both ways; a command that cannot be done says why, one that is none is not there."""
    assert json.loads(got(server, "/state.json")[2]) == {"why_not": None}
    assert json.loads(got(server, "/history.json")[2]) == {"flown_mm_s": []}
    WISHED.clear()
    assert got(server, "/begin", "POST")[0] == 200
    status, _, body = got(server, "/mark", "POST")
    assert (status, json.loads(body)) == (409, {"why_not": "no place"})
    assert got(server, "/arm", "POST")[0] == 404
    assert got(server, "/mark")[0] == 404
    assert WISHED == ["begin", "mark"]


def test_another_sites_page_sees_and_commands_nothing(server: MeterServer) -> None:
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
    """Files lie open, state and commands do not; with --no-token they do, and other sites are refused all the same."""
    rov = RequestOrigin(address="10.0.0.7", host="rov.local:8765", origin=None)
    closed, everybody = make("0.0.0.0"), make("0.0.0.0", token=False)
    try:
        assert closed.token is not None
        assert closed.address.endswith(f"#token={closed.token}")
        assert not any("0.0.0.0" in one for one in closed.addresses), "no phone can open that"
        assert closed.answer("GET", "/", rov, None)[0] == 200
        for method, path in (("GET", "/state.json"), ("POST", "/begin")):
            assert closed.answer(method, path, rov, None)[0] == 401
            assert closed.answer(method, path, rov, "guess")[0] == 401
            assert closed.answer(method, path, rov, closed.token)[0] == 200
            assert everybody.answer(method, path, rov, None)[0] == 200
            foreign = RequestOrigin(address="10.0.0.7", host="rov.local:8765", origin="http://evil.example")
            assert everybody.answer(method, path, foreign, None)[0] == 403
    finally:
        for one in (closed, everybody):
            one.start()
            one.stop()
    assert TOKEN_HEADER in (PAGE / "meter.js").read_text(encoding="utf-8")


def test_ground_stations_are_told_by_their_schema(server: MeterServer) -> None:
    """Cockpit's extras and BlueOS' service; every address they name is served."""
    extras, service = OFFER.cockpit_extras(), OFFER.register_service()
    fits(extras, EXTRAS)
    fits(service, SERVICE_KEYS)
    assert extras["actions"] == []
    for widget in extras["widgets"]:
        fits(widget, WIDGET)
        assert got(server, widget["iframeUrl"])[0] == 200
        assert got(server, widget["iframeIcon"])[0] == 200
    assert got(server, service["extras"]["cockpit"])[0] == 200
    assert json.loads(got(server, "/register_service")[2]) == service


def test_a_port_that_is_taken_is_said_in_one_line(server: MeterServer) -> None:
    """With the way out."""
    with pytest.raises(InputError, match=r"--port \d+ at 127.0.0.1: .*give another --port"):
        MeterServer(dict, dict, command, port=server.port)


def dialled(server: MeterServer, says: bytes) -> socket.socket:
    caller = socket.create_connection(("127.0.0.1", server.port), timeout=20.0)
    with suppress(ConnectionError):  # closed already, for one that came after it
        caller.sendall(says)
    return caller


@pytest.mark.parametrize("says", [b"", b"G", b"GET /state.json HTTP/1.1\r\nHost: x", b"POST /mark HTTP/1.1\r\n"])
def test_connections_that_say_nothing_keep_nobody_out(says: bytes) -> None:
    """However many there are: the page is answered, and threads stay bounded."""
    server, before = make(), threading.active_count()
    server.start()
    try:
        with ExitStack() as stack:
            for _ in range(PER_ADDRESS + 60):
                stack.enter_context(dialled(server, says))
            assert got(server, "/state.json")[0] == 200
            until_s = time.monotonic() + 5.0  # threads of connections that were closed need a moment to end
            while threading.active_count() - before > PER_ADDRESS + 3 and time.monotonic() < until_s:
                time.sleep(0.01)
            assert threading.active_count() - before <= PER_ADDRESS + 3
    finally:
        server.stop()


def test_a_connection_that_was_let_in_is_kept_whatever_others_do(server: MeterServer) -> None:
    """A page that asks again and again loses nothing to a crowd of silent connections; of kept ones there are few."""
    page = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    with ExitStack() as stack:
        stack.callback(page.close)

        def asks(asker: http.client.HTTPConnection) -> http.client.HTTPResponse:
            asker.request("GET", "/state.json")
            answer = asker.getresponse()
            answer.read()
            return answer

        assert not asks(page).will_close
        own = page.sock
        for _ in range(PER_ADDRESS + 60):
            stack.enter_context(dialled(server, b""))
        assert not asks(page).will_close
        assert page.sock is own
        kept = 0
        for _ in range(MAX_KEPT + 5):
            other = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
            stack.callback(other.close)
            kept += not asks(other).will_close
        assert kept < MAX_KEPT


def test_without_the_token_no_connection_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A caller from elsewhere who may see the files alone goes on counting as one who has said nothing."""
    server = make()
    monkeypatch.setattr(type(server._gate), "needs_token", lambda *_: True)
    server.start()
    try:
        for path, headers, closes in (
            ("/", {}, "close"),
            ("/state.json", {}, "close"),
            ("/state.json", {TOKEN_HEADER: "guess"}, "close"),
            ("/state.json", {TOKEN_HEADER: str(server.token)}, None),
        ):
            asks = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
            asks.request("GET", path, headers=headers)
            assert asks.getresponse().getheader("Connection") == closes
            asks.close()
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("request_line", "headers", "status"),
    [
        (b"POST / HTTP/1.1", b"Content-Length: 300000\r\n\r\n" + b"x" * 300_000, 404),
        (b"DELETE / HTTP/1.1", b"\r\n", 501),
        (b"GET / HTTP/1.1", b"X: " + b"y" * 70_000 + b"\r\n\r\n", 431),
        (b"GET / HTTP/1.1", b"X: y\r\n" * 300 + b"\r\n", 431),
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1", b"\r\n", 414),
        (b"GET / HTTP/9.9", b"\r\n", 505),
        (b"GET / nonsense", b"\r\n", 400),
        (b"GET / HTTP/1.1", b"Host: \xff\r\n\r\n", 403),
    ],
)
def test_whatever_is_asked_is_answered(server: MeterServer, request_line: bytes, headers: bytes, status: int) -> None:
    """No request ends without a status, nor with a page of HTML."""
    own = b"" if b"Host:" in headers else f"Host: 127.0.0.1:{server.port}\r\n".encode()
    with dialled(server, request_line + b"\r\n" + own + headers) as caller:
        answer = http.client.HTTPResponse(caller)
        answer.begin()
        assert answer.status == status
        assert (answer.getheader("Content-Type") or "").startswith("text/plain")
        assert answer.read().strip()


def test_head_is_get_without_the_body(server: MeterServer) -> None:
    """With the length that GET would have; refusals alike."""
    for path, host in (("/", ""), ("/page/meter.js", ""), ("/nothing", ""), ("/state.json", ""), ("/", "evil.example")):
        own = {"Host": host} if host else {}
        status, headers, body = got(server, path, **own)
        head, told, nothing = got(server, path, "HEAD", **own)
        assert (head, nothing) == (status, b"")
        assert told["Content-Length"] == headers["Content-Length"] == str(len(body))

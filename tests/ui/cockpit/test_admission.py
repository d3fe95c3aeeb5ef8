"""Who gets a place at the server: silent connections keep nobody out, nor do too many pages the pilot."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack, ExitStack, suppress
from typing import Any

import pytest
from rehearsal import Rehearsal
from test_server import Page, _opening, page
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from wakewise.ui.cockpit.server import MOST_CLIENTS, CockpitServer
from wakewise.ui.web.origin_check import PER_ADDRESS

ORIGIN = Origin("http://rov.example")


@pytest.fixture
def show() -> Iterator[Rehearsal]:
    rehearsal = Rehearsal()
    yield rehearsal
    rehearsal.close()


@pytest.fixture
def server(show: Rehearsal) -> Iterator[CockpitServer]:
    serving = CockpitServer(show)
    serving.start()
    yield serving
    serving.stop()


@pytest.fixture
def guarded(show: Rehearsal) -> Iterator[CockpitServer]:
    """A server that asks everybody for the token, as behind a proxy."""
    serving = CockpitServer(show, origins=(ORIGIN,))
    serving.start()
    yield serving
    serving.stop()


def dialled(server: CockpitServer, says: bytes) -> socket.socket:
    caller = socket.create_connection(("127.0.0.1", server.port), timeout=20.0)
    with suppress(ConnectionError):  # closed already, for one that came after it
        caller.sendall(says)
    return caller


@pytest.mark.parametrize("kind", ["silent", "half a request", "a drip", "no hello"])
def test_connections_that_say_nothing_keep_nobody_out(server: CockpitServer, show: Rehearsal, kind: str) -> None:
    """However many there are and wherever they stop: the pilot gets page and helm, and they stay bounded."""
    says = {"silent": b"", "half a request": b"GET / HTTP/1.1\r\nHost: x", "a drip": b"G", "no hello": _opening(server)}

    async def flies() -> None:
        async with page(server, "helm") as one:
            assert one.lease is not None
            await one.sticks(1.0)
            async with asyncio.timeout(2.0):
                while show.axes[0] != 1.0:
                    await asyncio.sleep(0.005)

    with ExitStack() as stack:
        for _ in range(PER_ADDRESS + 60):
            stack.enter_context(dialled(server, says[kind]))
        own = f"Host: 127.0.0.1:{server.port}\r\n\r\n".encode()
        assert said(server, b"GET / HTTP/1.1\r\n" + own)[0] == 200
        asyncio.run(flies())
        assert len(server._pending) <= PER_ADDRESS
        assert len(server.clients) <= PER_ADDRESS


def test_it_ends_at_once_though_many_wait(server: CockpitServer) -> None:
    """Nobody is waited for who has not said anything."""
    with ExitStack() as stack:
        for says in (b"", b"GET", _opening(server)):
            for _ in range(5):
                stack.enter_context(dialled(server, says))
        time.sleep(0.2)
        began_s = time.monotonic()
        server.stop()
        assert time.monotonic() - began_s < 4.0


def test_of_too_many_pages_the_last_pilot_still_gets_in(server: CockpitServer) -> None:
    """One place is kept for whoever had the helm last; a lease that was never given opens nothing."""

    async def refused(**hello: str) -> tuple[int | None, str | None]:
        async with connect(f"ws://127.0.0.1:{server.port}/ws") as one:
            await one.send(json.dumps({"type": "hello", "token": None, "name": "x", "wants": "watch"} | hello))
            with pytest.raises(ConnectionClosed):
                await one.recv()
            return one.close_code, one.close_reason

    async def tries() -> None:
        async with AsyncExitStack() as stack:
            async with page(server, "helm") as pilot:
                lease = pilot.lease or ""
                assert lease
                for _ in range(MOST_CLIENTS - 1):
                    await stack.enter_async_context(page(server))
                assert await refused() == (1013, "too many pages are open")
            await stack.enter_async_context(page(server))
            for known in ({}, {"lease": ""}, {"lease": "guess"}, {"lease": "\ud800"}):
                assert (await refused(**known))[0] == 1013
            async with page(server, "helm", lease=lease) as again:
                assert again.lease not in (None, lease)
                assert (await refused(lease=lease))[0] == 1013, "that lease is an older one by now"
                assert (await refused(lease=again.lease or ""))[0] == 1013, "one place is kept, not two"

    asyncio.run(tries())


def test_the_token_is_asked_at_the_handshake(guarded: CockpitServer) -> None:
    """Without it no socket opens, so that none can wait; the same request without a socket is answered in words."""
    home = f"127.0.0.1:{guarded.port}"
    right: list[dict[str, Any]] = [
        {"subprotocols": ["wakewise", f"token.{guarded.token}"]},
        {"additional_headers": {"X-Wakewise-Token": guarded.token}},
    ]
    wrong: list[dict[str, Any]] = [
        {},
        {"subprotocols": ["wakewise"]},
        {"subprotocols": ["wakewise", "token.guess"]},
        {"additional_headers": {"X-Wakewise-Token": "\xe9"}},
    ]

    async def tries() -> None:
        for more in wrong:
            with pytest.raises(InvalidStatus) as refusal:
                await connect(f"ws://{home}/ws", origin=ORIGIN, **more)
            assert refusal.value.response.status_code == 401
        assert guarded.clients == {}
        for more in right:
            async with connect(f"ws://{home}/ws", origin=ORIGIN, **more) as one:
                await one.send(json.dumps({"type": "hello", "token": None, "name": "x", "wants": "helm"}))
                assert (await Page(one).helm())["yours"]

    asyncio.run(tries())
    for token, status in ((None, 401), ("guess", 401), (guarded.token, 426)):
        asks = http.client.HTTPConnection("127.0.0.1", guarded.port, timeout=5)
        asks.request("GET", "/ws", headers={} if token is None else {"X-Wakewise-Token": token})
        answer = asks.getresponse()
        assert answer.status == status
        assert (b"token" in answer.read()) == (status == 401)
        asks.close()


@pytest.mark.parametrize("token", ["guess", "\ud800", "x" * 64, "\x00", "токен"])
def test_any_wrong_token_is_told_to_be_wrong(server: CockpitServer, token: str) -> None:
    """4401 in words, whatever characters it is made of."""

    async def tries() -> None:
        async with connect(f"ws://127.0.0.1:{server.port}/ws") as one:
            await one.send(json.dumps({"type": "hello", "token": token, "name": "x", "wants": "watch"}))
            with pytest.raises(ConnectionClosed):
                await one.recv()
            assert (one.close_code, one.close_reason) == (4401, "the token is wrong")

    asyncio.run(tries())


def test_pages_of_one_name_are_numbered(server: CockpitServer) -> None:
    """So that "A pilot has the helm" tells the other pilot which; a number that is free is given again."""

    async def tries() -> None:
        async with page(server, name="A pilot") as one, page(server, name="A pilot") as two:
            async with page(server, name="A pilot"):
                assert sorted(client.name for client in server.clients.values()) == [
                    "A pilot",
                    "A pilot 2",
                    "A pilot 3",
                ]
            await two.say(type="helm", want=True)
            assert (await one.helm(lambda told: told["holder"] is not None))["holder"] == "A pilot 2"

    asyncio.run(tries())


def said(server: CockpitServer, request: bytes, *, then: bytes = b"") -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of the answer to raw bytes."""
    with dialled(server, request) as caller:
        if then:
            caller.sendall(then)
        answer = http.client.HTTPResponse(caller, method=request[:4].decode("latin-1").strip())
        answer.begin()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()


def test_head_is_get_without_the_body(server: CockpitServer) -> None:
    """With the length that GET would have; refusals alike."""
    own = f"Host: 127.0.0.1:{server.port}\r\n\r\n".encode()
    for path in (b"/", b"/page/cockpit.js", b"/nothing", b"/register_service"):
        status, headers, body = said(server, b"GET " + path + b" HTTP/1.1\r\n" + own)
        assert int(headers["content-length"]) == len(body)
        assert said(server, b"HEAD " + path + b" HTTP/1.1\r\n" + own) == (status, headers, b"")
    assert said(server, b"HEAD / HTTP/1.1\r\nHost: evil.example\r\n\r\n")[0] == 403
    assert said(server, b"HEAD /ws HTTP/1.1\r\nUpgrade: websocket\r\n" + own)[0] == 426


@pytest.mark.parametrize(
    ("request_line", "headers", "status"),
    [
        (b"POST / HTTP/1.1", b"Content-Length: 4\r\n\r\nbody", 405),
        (b"POST /ws HTTP/1.1", b"Content-Length: 300000\r\n\r\n" + b"x" * 300_000, 405),
        (b"DELETE / HTTP/1.1", b"\r\n", 501),
        (b"OPTIONS * HTTP/1.1", b"\r\n", 501),
        (b"GET / HTTP/1.0", b"\r\n", 200),
        (b"GET / HTTP/2.0", b"\r\n", 505),
        (b"GET /", b"\r\n", 400),
        (b"GET / HTTP/1.1", b"X: " + b"y" * 20_000 + b"\r\n\r\n", 431),
        (b"GET / HTTP/1.1", b"X: y\r\n" * 300 + b"\r\n", 431),
        (b"GET /" + b"a" * 20_000 + b" HTTP/1.1", b"\r\n", 414),
        (b"GET / HTTP/1.1", b"no header\r\n\r\n", 400),
        (b"GET / HTTP/1.1", b"Content-Length: 3\r\n\r\nabc", 400),
        (b"GET / HTTP/1.1", b"Host: \xff\r\n\r\n", 403),
        (b"HEAD / HTTP/1.1", b"X: " + b"y" * 20_000 + b"\r\n\r\n", 431),
    ],
)
def test_whatever_is_asked_is_answered(server: CockpitServer, request_line: bytes, headers: bytes, status: int) -> None:
    """No request ends without a status; a method that is not allowed is told which are."""
    own = b"" if b"Host:" in headers else f"Host: 127.0.0.1:{server.port}\r\n".encode()
    got, told, body = said(server, request_line + b"\r\n" + own + headers)
    assert got == status
    assert body.strip() or request_line.startswith(b"HEAD")
    if status == 405:
        assert told["allow"] == "GET, HEAD"

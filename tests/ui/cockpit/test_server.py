"""The server on a real socket: who is let in, who flies, and that nobody can hold up anybody else."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest
from rehearsal import Rehearsal
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from wakewise.core.errors import InputError
from wakewise.ui.cockpit import server as server_module
from wakewise.ui.cockpit.control_mailbox import ControlMailbox
from wakewise.ui.cockpit.server import CockpitServer


class Clock:
    """The time, and a day more when asked."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def __call__(self) -> float:
        return time.monotonic() + self.ahead_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def show(clock: Clock) -> Iterator[Rehearsal]:
    rehearsal = Rehearsal(mailbox=ControlMailbox(clock))
    yield rehearsal
    rehearsal.close()


@pytest.fixture
def server(show: Rehearsal) -> Iterator[CockpitServer]:
    serving = CockpitServer(show)
    serving.start()
    yield serving
    serving.stop()


class Page:
    """A client that keeps what it is told."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket, self.lease, self.seq, self.id = socket, None, 0, ""
        self.told: deque[dict[str, Any]] = deque(maxlen=20)
        self.pictures: list[bytes] = []

    async def say(self, **told: Any) -> None:
        await self.socket.send(json.dumps(told))

    async def sticks(self, forward: float, seq: int | None = None, lease: str | None = None) -> None:
        self.seq = self.seq + 1 if seq is None else seq
        axes = [forward, 0, 0, 0, 0]
        lease = lease or self.lease or ""
        await self.say(type="sticks", seq=self.seq, t=1e3 * time.monotonic(), axes=axes, lease=lease)

    async def until(self, right: Callable[[dict[str, Any]], bool], within_s: float = 5.0) -> dict[str, Any]:
        """Read on to a message that is right."""
        async with asyncio.timeout(within_s):
            while True:
                message = await self.socket.recv()
                if isinstance(message, bytes):
                    self.pictures.append(message)
                    continue
                told = json.loads(message)
                self.told.append(told)
                if told["type"] == "helm":
                    self.lease = told["lease"]
                self.id = told.get("id", self.id)
                if right(told):
                    return told

    async def helm(self, right: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        return await self.until(lambda told: told["type"] == "helm" and right(told))


@asynccontextmanager
async def page(server: CockpitServer, wants: str = "watch", **hello: Any) -> AsyncIterator[Page]:
    home = f"127.0.0.1:{server.port}"
    async with connect(f"ws://{home}/ws", origin=Origin(f"http://{home}"), max_queue=None, close_timeout=1) as socket:
        one = Page(socket)
        await one.say(**({"type": "hello", "token": None, "name": wants, "wants": wants} | hello))
        await one.helm()
        yield one


async def flown(show: Rehearsal, forward: float, within_s: float = 2.0) -> None:
    """Wait until the sticks of the loop are at `forward`."""
    async with asyncio.timeout(within_s):
        while abs(show.axes[0] - forward) > 1e-9:
            await asyncio.sleep(0.005)


def get(server: CockpitServer, path: str, host: str | None = None) -> tuple[int, str]:
    caller = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    try:
        caller.request("GET", path, headers={} if host is None else {"Host": host})
        answer = caller.getresponse()
        return answer.status, answer.read().decode()
    finally:
        caller.close()


def test_the_page_is_served_under_this_computers_names_alone(server: CockpitServer) -> None:
    """Another Host gets nothing, nor does an address that leads out of the page's folder."""
    status, body = get(server, "/")
    assert (status, "<html" in body.lower()) == (200, True)
    assert get(server, "/", "evil.example")[0] == 403
    assert get(server, "/", f"localhost:{server.port}")[0] == 200
    for path in ("/page/../server.py", "/page/%2e%2e/server.py", "/etc/passwd", "/page/", "/page"):
        assert get(server, path)[0] == 404


def test_another_sites_page_may_not_open_the_socket(server: CockpitServer) -> None:
    """Neither a foreign Origin nor a foreign Host."""
    foreign: list[dict[str, Any]] = [
        {"origin": "http://evil.example"},
        {"additional_headers": {"Host": "evil.example"}},
    ]

    async def tries() -> None:
        for more in foreign:
            with pytest.raises((InvalidStatus, ConnectionClosed)):
                async with connect(f"ws://127.0.0.1:{server.port}/ws", **more):
                    pass

    asyncio.run(tries())


def test_a_wrong_token_and_no_hello_end_the_connection(server: CockpitServer) -> None:
    """With 4401 and a reason; the right token is welcome though none is needed from here."""

    async def tries() -> None:
        home = f"127.0.0.1:{server.port}"
        for first, words in (
            ({"type": "hello", "token": "guess", "name": "x", "wants": "helm"}, "token is wrong"),
            ({"type": "sticks", "seq": 1, "t": 0, "axes": [1, 0, 0, 0, 0], "lease": ""}, "say hello first"),
            ({"type": "nonsense"}, "say hello first"),
        ):
            async with connect(f"ws://{home}/ws") as socket:
                await socket.send(json.dumps(first))
                with pytest.raises(ConnectionClosed):
                    await socket.recv()
                assert socket.close_code == 4401
                assert words in (socket.close_reason or "")
        async with page(server, token=server.token) as one:
            assert one.id

    asyncio.run(tries())


def test_one_flies_and_another_asks(server: CockpitServer, show: Rehearsal) -> None:
    """The second waits for consent; sticks and dials of who has no lease, or another's, do nothing."""

    async def tries() -> None:
        async with page(server, "helm") as one, page(server, "helm") as two:
            assert one.lease is not None
            assert two.lease is None
            await one.sticks(0.5)
            await two.sticks(1.0, lease="guess")
            await two.say(type="settings", set={"w_track": 1.0}, lease="guess")
            await two.say(type="press", what="capture", lease="guess")
            await two.say(type="helm", want=True, force=True)
            assert "refused" in (await two.helm())["why"]
            await two.say(type="helm", want=True)
            asked = await one.helm(lambda told: told["asked_by"] is not None)
            await one.sticks(0.5)
            await one.say(type="consent", to=asked["asked_by"]["id"], yes=True)
            given = await two.helm(lambda told: told["yours"])
            assert given["lease"] != one.lease
            assert not (await one.helm(lambda told: told["asked_by"] is None))["yours"]
            await two.sticks(1.0)
            await flown(show, 1.0)
            await one.sticks(0.5)
            await asyncio.sleep(0.05)
            assert show.axes[0] == 1.0
            assert (show.photos, show.settings["w_track"]) == (0, 5.0)

    asyncio.run(tries())


def test_replays_are_dropped_and_quiet_hands_are_zero(server: CockpitServer, show: Rehearsal) -> None:
    """An old number changes nothing; 300 ms without sticks is zero, and a second without them frees the helm."""

    async def tries() -> None:
        async with page(server, "helm") as one, page(server) as two:
            await one.sticks(0.525, seq=9)
            await flown(show, 0.5)
            await one.sticks(1.0, seq=9)
            await one.sticks(1.0, seq=3)
            await flown(show, 0.0)
            assert max(axes[0] for _, axes in show.flown) == pytest.approx(0.5)
            free = await two.helm(lambda told: not told["flying"])
            assert "no sticks" in free["why"]
            await two.say(type="helm", want=True)
            assert (await two.helm())["yours"]

    asyncio.run(tries())


def test_a_page_left_open_for_a_day_flies_nothing(server: CockpitServer, show: Rehearsal, clock: Clock) -> None:
    """Its lease is void by then; it may ask anew."""

    async def tries() -> None:
        async with page(server, "helm") as one:
            await one.sticks(1.0)
            await flown(show, 1.0)
            clock.ahead_s = 86400.0
            await one.sticks(1.0)
            await one.helm(lambda told: not told["yours"])
            assert show.axes[0] == 0.0
            await one.say(type="helm", want=True)
            assert (await one.helm())["yours"]

    asyncio.run(tries())


def test_a_page_that_closes_stops_the_vehicle_at_once(server: CockpitServer, show: Rehearsal) -> None:
    """With the connection its hands are gone, and the next page has the helm by asking."""

    async def tries() -> None:
        async with page(server, "helm") as one:
            await one.sticks(1.0)
            await flown(show, 1.0)
        async with asyncio.timeout(2.0):
            while server.clients:
                await asyncio.sleep(0.002)
        assert show.mailbox.read(0.0) is None
        async with page(server, "helm") as again:
            assert again.lease is not None

    asyncio.run(tries())


def test_what_cannot_be_read_is_told_back_and_too_much_of_it_ends(server: CockpitServer) -> None:
    """A note for each, and after fifty the connection is closed."""

    async def tries() -> None:
        async with page(server) as one:
            await one.socket.send("{")
            note = await one.until(lambda told: told["type"] == "note")
            assert (note["level"], "not JSON" in note["text"]) == ("warn", True)
            with pytest.raises(ConnectionClosed):
                for _ in range(80):
                    await one.socket.send("nonsense")
                await one.until(lambda _: False)
            assert one.socket.close_code == 1008
        async with page(server) as one:
            await one.socket.send("x" * 70_000)
            with pytest.raises(ConnectionClosed):
                await one.until(lambda _: False)
            assert one.socket.close_code == 1009

    asyncio.run(tries())


def test_a_dial_out_of_range_is_told_to_who_set_it(server: CockpitServer, show: Rehearsal) -> None:
    """Nothing is changed then; what is in range is."""

    async def tries() -> None:
        async with page(server, "helm") as one:
            await one.say(type="settings", set={"w_track": 500}, lease=one.lease)
            note = await one.until(lambda told: told["type"] == "note")
            assert "w_track" in note["text"]
            await one.say(type="settings", set={"w_track": 2.0}, lease=one.lease)
            await one.until(lambda told: told["type"] == "state" and told["settings"]["w_track"] == 2.0)

    asyncio.run(tries())


def test_only_who_has_the_helm_designates(server: CockpitServer, show: Rehearsal) -> None:
    """A box of anybody else does nothing; one that is refused or cannot be read is told to who drew it."""

    async def tries() -> None:
        async with page(server, "helm") as one, page(server) as two:
            box = [0.1, 0.2, 0.5, 0.6]
            await two.say(type="designate", box=box, frame=3, lease="guess")
            await one.say(type="designate", box=box, frame=0, lease=one.lease)
            assert "no pictures" in (await one.until(lambda told: told["type"] == "note"))["text"]
            await one.say(type="designate", box=[0.5, 0.2, 0.5, 0.6], frame=3, lease=one.lease)
            note = await one.until(lambda told: told["type"] == "note")
            assert "not understood: designate: box must lie" in note["text"]
            await one.say(type="designate", box=box, frame=3, lease=one.lease)
            await one.say(type="designate", box="clear", lease=one.lease)
            async with asyncio.timeout(2.0):
                while len(show.designated) < 2:
                    await asyncio.sleep(0.005)
            assert show.designated == [(tuple(box), 3), (None, 0)]

    asyncio.run(tries())


def test_only_who_has_the_helm_answers_a_proposal(server: CockpitServer, show: Rehearsal) -> None:
    """An answer of anybody else does nothing; one that is refused or cannot be read is told to who gave it."""

    async def tries() -> None:
        async with page(server, "helm") as one, page(server) as two:
            await two.say(type="proposal", what="ask", lease="guess")
            await one.say(type="proposal", what="accept", lease=one.lease)
            assert "no target is proposed" in (await one.until(lambda told: told["type"] == "note"))["text"]
            await one.say(type="proposal", what="perhaps", lease=one.lease)
            note = await one.until(lambda told: told["type"] == "note")
            assert "not understood: proposal: what 'perhaps', allowed ask, accept, refuse" in note["text"]
            for what in ("ask", "refuse", "accept"):
                await one.say(type="proposal", what=what, lease=one.lease)
            async with asyncio.timeout(2.0):
                while len(show.proposals) < 3:
                    await asyncio.sleep(0.005)
            assert show.proposals == ["ask", "refuse", "accept"]

    asyncio.run(tries())


def test_one_picture_is_under_way_until_it_was_seen(server: CockpitServer) -> None:
    """A page that does not acknowledge gets no second one; each has its number and the flight's time."""

    async def tries() -> None:
        async with page(server) as one:
            await asyncio.sleep(0.4)
            await one.until(lambda told: told["type"] == "state")
            await one.until(lambda told: told["type"] == "state")
            assert len(one.pictures) == 1
            number = int.from_bytes(one.pictures[0][:4], "little")
            assert one.pictures[0][8:10] == b"\xff\xd8"
            await one.say(type="seen", frame=number)
            async with asyncio.timeout(2.0):
                while len(one.pictures) < 2:
                    await one.until(lambda told: told["type"] == "state")
            assert int.from_bytes(one.pictures[1][:4], "little") > number

    asyncio.run(tries())


def test_a_spectator_who_never_reads_costs_nobody_anything(
    server: CockpitServer, show: Rehearsal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """States go on to others at their pace, what waits for it stays small, and it is let go."""
    monkeypatch.setattr(server_module, "STUCK_S", 0.6)
    plain = show.state
    monkeypatch.setattr(show, "state", lambda: plain() | {"ballast": "x" * 300_000})

    async def tries() -> None:
        with socket.socket() as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.connect(("127.0.0.1", server.port))
            deaf.sendall(_opening(server) + _masked('{"type":"hello","token":null,"name":"deaf","wants":"watch"}'))
            await beside(server)

    async def beside(server: CockpitServer) -> None:
        async with page(server, "helm") as one:
            began_s, states = time.monotonic(), 0
            while time.monotonic() - began_s < 2.5:
                await one.until(lambda told: told["type"] == "state")
                states += 1
                await one.sticks(1.0)
            assert states >= 15
            assert {client.name for client in server.clients.values()} == {"helm"}

    asyncio.run(tries())
    late = np.diff([at_s for at_s, _ in show.flown])
    assert float(np.median(late)) < 0.03


def test_a_flood_is_slowed_and_then_ended(server: CockpitServer) -> None:
    """A client that sends thousands of messages a second is not read that fast, and not for long."""

    async def tries() -> None:
        async with page(server) as one:
            text = json.dumps({"type": "seen", "frame": 1})
            for _ in range(400):
                await one.socket.send(text)
            await asyncio.sleep(0.3)
            client = next(iter(server.clients.values()))
            assert 0 < client.throttled < 5

    asyncio.run(tries())


def test_a_port_that_is_taken_is_said(server: CockpitServer, show: Rehearsal) -> None:
    """In one line that names the port and what to do."""
    with pytest.raises(InputError, match=f"--port {server.port} at 127.0.0.1: .*; give another --port, or 0 for any"):
        CockpitServer(show, port=server.port).start()


def test_it_ends_quickly_with_pages_open(show: Rehearsal) -> None:
    """Connections are closed, the thread ends, the port is free again."""
    serving = CockpitServer(show)
    serving.start()

    async def tries() -> float:
        async with page(serving, "helm"), page(serving):
            began_s = time.monotonic()
            await asyncio.to_thread(serving.stop)
            return time.monotonic() - began_s

    assert asyncio.run(tries()) < 4.0
    again = CockpitServer(show, port=serving.port)
    again.start()
    again.stop()


def _opening(server: CockpitServer) -> bytes:
    lines = (
        "GET /ws HTTP/1.1",
        f"Host: 127.0.0.1:{server.port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Version: 13",
    )
    return ("\r\n".join(lines) + "\r\n\r\n").encode()


def _masked(text: str) -> bytes:
    """A text frame of a client, masked with zeros."""
    body = text.encode()
    assert len(body) < 126
    return bytes((0x81, 0x80 | len(body), 0, 0, 0, 0)) + body

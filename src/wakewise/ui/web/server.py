"""Web server of all pages: static files, JSON, POST requests and one WebSocket, on one port.

HTTP/1.1 over asyncio, in a thread with an event loop of its own. `WebServer` answers, `HttpConnection` reads requests
and writes answers. A WebSocket is handed to the websockets library (`websocket.py`), which is imported only for a
server that has one. By default a server listens at the loopback address.

Access (`origin_check.OriginCheck`): requests with a foreign Host or Origin are refused with 403. Static files need no
token. Private addresses, POST requests and the WebSocket need the token unless the caller is on this computer.

Connections are bounded (`PendingConnections`) until a caller that may see the private addresses has sent a request.
"""

from __future__ import annotations

import asyncio
import http
import logging
import re
import secrets
import socket
import threading
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from wakewise.core.errors import InputError
from wakewise.ui.web.files import StaticFile, StaticFiles
from wakewise.ui.web.origin_check import (
    TOKEN_HEADER,
    OriginCheck,
    PendingConnections,
    RequestOrigin,
    is_loopback,
    page_addresses,
    page_headers,
)

if TYPE_CHECKING:
    from wakewise.ui.web.websocket import PageSocket

MAX_KEPT = 32
"""Connections that are kept open between requests; of more, each is closed after its answer."""
MAX_LINE, MAX_HEADERS = 8192, 100
"""Longest line of a request in bytes, and largest number of headers."""
QUIET_S, LINGER_S = 10.0, 0.5
"""A connection without a request is closed after `QUIET_S`; a refused one is read for `LINGER_S`, until its answer has
arrived."""
TOKEN_PREFIX = "token."
"""A browser offers the token of a WebSocket as a subprotocol with this prefix; it cannot set headers there."""
_BACKLOG = 512
_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+\Z")
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class HttpRequest:
    """Head of a request: names of `headers` are lower case, and a repeated header has several entries."""

    method: str
    path: str
    version: str
    headers: tuple[tuple[str, str], ...] = ()

    def header(self, name: str) -> str | None:
        """Value of a header; repeated ones are joined, so that they match no allowed value."""
        values = [value for key, value in self.headers if key == name.lower()]
        return ", ".join(values) if values else None

    @property
    def token(self) -> str | None:
        """The token of the caller: a header, or an offered subprotocol."""
        shown = self.header(TOKEN_HEADER)
        if shown is not None:
            return shown
        offered = [one.strip() for one in (self.header("Sec-WebSocket-Protocol") or "").split(",")]
        return next((one.removeprefix(TOKEN_PREFIX) for one in offered if one.startswith(TOKEN_PREFIX)), None)


class HttpError(Exception):
    """A request that cannot be read: status and one line of text."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


def parse_request(head: bytes) -> HttpRequest:
    """Request of the bytes up to the empty line (RFC 9112).

    Raises HttpError with status 400, 414, 431 or 505.
    """
    first, *lines = head.decode("latin-1").splitlines()
    words = first.split(" ")
    if len(words) != 3 or not words[2].startswith("HTTP/"):
        raise HttpError(400, "not a request for a page")
    method, path, version = words
    if version not in ("HTTP/1.0", "HTTP/1.1"):
        raise HttpError(505, "this server uses HTTP/1.1")
    if len(lines) > MAX_HEADERS:
        raise HttpError(431, "the headers are too long")
    headers = []
    for line in lines:
        name, colon, value = line.partition(":")
        if not colon or _TOKEN.match(name) is None:
            raise HttpError(400, "not a request for a page")
        headers.append((name.lower(), value.strip()))
    request = HttpRequest(method=method, path=path, version=version, headers=tuple(headers))
    if method != "POST" and (request.header("Content-Length") or "0") != "0":
        raise HttpError(400, "a request for a page has no body")
    return request


def text_file(text: str) -> StaticFile:
    """One line of plain text."""
    return StaticFile(body=f"{text}\n".encode(), kind="text/plain; charset=utf-8")


@dataclass(frozen=True, kw_only=True)
class Site:
    """What a server offers.

    `private`: content by address, made when it is requested. `post`: action by address; it returns status and answer.
    `socket`: address of the WebSocket.
    """

    files: StaticFiles
    private: Mapping[str, Callable[[], StaticFile]] = field(default_factory=dict)
    post: Mapping[str, Callable[[], tuple[int, StaticFile]]] = field(default_factory=dict)
    socket: str | None = None


class WebServer:
    """Serves one site at `host` and `port` (0 takes any free port).

    `token` is drawn if not given; with `open_to_all` callers from other computers need none. `origins` are the
    addresses of a proxy in front of the server.
    """

    def __init__(
        self,
        site: Site,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        token: str | None = None,
        open_to_all: bool = False,
        origins: tuple[str, ...] = (),
    ) -> None:
        self.host, self.port = host, port
        self.token = None if open_to_all else token or secrets.token_urlsafe(16)
        self._site = site
        self._gate = OriginCheck(port=port, token=self.token or "", origins=origins)
        self._pending = PendingConnections()
        self._connections: set[HttpConnection] = set()
        self._kept: set[HttpConnection] = set()
        self._listener: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._over: asyncio.Event | None = None
        self._take_over: Callable[[asyncio.Transport, bytes, int], None] | None = None

    @property
    def addresses(self) -> tuple[str, ...]:
        """URLs of the page, best first; with the token where one is needed."""
        fragment = "" if self.token is None else f"#token={self.token}"
        if self._gate.origins:
            return tuple(f"{origin}/{fragment}" for origin in self._gate.origins)
        return page_addresses(self.host, self.port, "" if is_loopback(self.host) else fragment)

    @property
    def address(self) -> str:
        """The first of `addresses`."""
        return self.addresses[0]

    def bind(self) -> None:
        """Reserve the port; requests are answered after `start`.

        Raises InputError if the port is in use, or the address is not one of this computer.
        """
        if self._listener is not None:
            return
        try:
            family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
            self._listener = socket.create_server((self.host, self.port), family=family, backlog=_BACKLOG)
        except OSError as fault:
            why = (fault.strerror or str(fault)).lower()
            raise InputError(f"--port {self.port} at {self.host}: {why}; give another --port, or 0 for any") from None
        address, self.port = self._listener.getsockname()[:2]
        self._gate = replace(self._gate, port=self.port, open_to_net=not is_loopback(str(address)))

    def start(self) -> None:
        """Answer requests from now on; raises as `bind`, or what kept it from starting."""
        self.bind()
        started: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, args=(started,), name="web", daemon=True)
        self._thread.start()
        started.result()

    def stop(self) -> None:
        """Close all connections and end the thread."""
        if self._thread is not None and self._loop is not None and self._over is not None:
            with suppress(RuntimeError):  # the loop has ended by itself
                self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join(timeout=10.0)
        elif self._listener is not None:
            self._listener.close()

    async def meet(self, connection: PageSocket) -> None:
        """Serve one open WebSocket until it closes; here at once, since a server that uses them says how."""
        await connection.close()

    def tasks(self) -> tuple[Coroutine[Any, Any, None], ...]:
        """Coroutines that run while the server runs."""
        return ()

    def _run(self, started: Future[None]) -> None:
        try:
            asyncio.run(self._serve(started))
        except BaseException as fault:
            if started.done():
                raise
            if self._listener is not None:
                self._listener.close()
            started.set_exception(fault)

    async def _serve(self, started: Future[None]) -> None:
        assert self._listener is not None
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        sockets = None
        if self._site.socket is not None:
            from wakewise.ui.web.websocket import SocketServer

            sockets = SocketServer(self.meet, self._pending)
            self._take_over = sockets.take_over
        listening = await self._loop.create_server(lambda: HttpConnection(self), sock=self._listener, backlog=_BACKLOG)
        if sockets is not None:
            sockets.attach(listening)
        tasks = [asyncio.create_task(one) for one in self.tasks()]
        started.set_result(None)
        await self._over.wait()
        for task in tasks:
            task.cancel()
        for connection in list(self._connections):
            connection.abort()
        self._pending.close()
        if sockets is not None:
            await sockets.close()
        listening.close()
        await asyncio.gather(*tasks, return_exceptions=True)

    def answer(self, method: str, path: str, caller: RequestOrigin, token: str | None) -> tuple[int, StaticFile]:
        """Status and content for a request; HEAD is given as GET."""
        address = path.partition("?")[0]
        file = self._site.files.at(path) if method == "GET" else None
        if file is not None and file.shared:
            caller = replace(caller, origin=None)
        refused = self._gate.refusal(caller)
        if refused is not None:
            return 403, text_file(f"refused: {refused}")
        if method == "POST" and not self._site.post:
            return 405, text_file("only GET and HEAD here")
        if file is not None:
            return 200, file
        if not self.lets_in(caller, token):
            return 401, text_file(str(self.token_fault(token)))
        if method == "GET" and address in self._site.private:
            return 200, self._site.private[address]()
        if method == "POST" and address in self._site.post:
            return self._site.post[address]()
        return 404, text_file("there is nothing here")

    def lets_in(self, caller: RequestOrigin, token: str | None) -> bool:
        """Whether a caller may see private addresses."""
        return self.token is None or not self._gate.needs_token(caller) or self._gate.fits(token)

    def token_fault(self, token: str | None) -> str | None:
        """What is wrong with a token; None if it is right."""
        if self._gate.fits(token):
            return None
        return "the token is wrong" if token else "a token is needed: open the address that was printed"

    def headers(self, request: HttpRequest | None, file: StaticFile) -> dict[str, str]:
        """Headers of an answer."""
        host = "" if request is None else request.header("Host") or ""
        shared = {"Access-Control-Allow-Origin": "*"} if file.shared else {}
        return {"Content-Type": file.kind} | page_headers(host, self._gate.origins) | shared

    def respond(self, connection: HttpConnection, request: HttpRequest, head: bytes) -> None:
        """Answer one request, or open the WebSocket."""
        caller = RequestOrigin(address=connection.peer, host=request.header("Host"), origin=request.header("Origin"))
        if request.method not in ("GET", "HEAD", "POST"):
            connection.send(request, 501, text_file("this server knows GET, HEAD and POST"), keep=False)
            return
        method = "GET" if request.method == "HEAD" else request.method
        if method == "GET" and request.path.partition("?")[0] == self._site.socket:
            status, text = self._socket_refusal(request, caller)
            if status:
                connection.send(request, status, text_file(text), keep=False)
            elif self._take_over is not None:
                connection.hand_over(self._take_over, head)
            return
        try:
            status, file = self.answer(method, request.path, caller, request.token)
        except Exception:
            _LOG.exception("%s %s", request.method, request.path)
            status, file = 500, text_file("the server failed")
        keep = method == "GET" and status != 403 and request.version == "HTTP/1.1"
        keep = keep and (request.header("Connection") or "").lower() != "close"
        keep = keep and self.lets_in(caller, request.token) and self._keep(connection)
        connection.send(request, status, file, keep=keep)

    def _socket_refusal(self, request: HttpRequest, caller: RequestOrigin) -> tuple[int, str]:
        """Status and text with which a WebSocket is refused; status 0 if it may open."""
        refused = self._gate.refusal(caller)
        if refused is not None:
            return 403, f"refused: {refused}"
        if not self.lets_in(caller, request.token):
            return 401, str(self.token_fault(request.token))
        if request.method == "HEAD" or request.header("Upgrade") is None:
            return 426, "a WebSocket"
        return 0, ""

    def _keep(self, connection: HttpConnection) -> bool:
        """Keep a connection of an admitted caller open, if there is room."""
        if connection not in self._kept and len(self._kept) >= MAX_KEPT:
            return False
        self._kept.add(connection)
        self._pending.leave(connection.number)
        return True

    def opened(self, connection: HttpConnection) -> int:
        """Count a new connection; returns its number among the pending ones."""
        self._connections.add(connection)
        return self._pending.enter(connection.peer, connection.abort_soon)

    def handed_over(self, connection: HttpConnection) -> None:
        """A connection has become a WebSocket, which closes itself."""
        self._connections.discard(connection)
        self._kept.discard(connection)

    def closed(self, connection: HttpConnection) -> None:
        """A connection is closed."""
        self._connections.discard(connection)
        self._kept.discard(connection)
        self._pending.leave(connection.number)


_MORE_HEADERS = {405: {"Allow": "GET, HEAD"}, 426: {"Upgrade": "websocket"}}


class HttpConnection(asyncio.Protocol):
    """One connection of a `WebServer`."""

    def __init__(self, server: WebServer) -> None:
        self._server = server
        self._loop = asyncio.get_running_loop()
        self._buffer = b""
        self._ended = self._paused = False
        self._timer: asyncio.TimerHandle | None = None
        self.peer, self.number = "", 0
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count the connection as pending."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        peer = transport.get_extra_info("peername")
        self.peer = str(peer[0]) if peer else ""
        self.number = self._server.opened(self)
        self._wait(QUIET_S)

    def connection_lost(self, _: Exception | None) -> None:
        """Forget the connection."""
        self._stop_waiting()
        self._server.closed(self)

    def data_received(self, data: bytes) -> None:
        """Answer each complete request."""
        if self._ended:
            return
        self._buffer += data
        self._process()

    def pause_writing(self) -> None:
        """The caller does not read: read no more requests."""
        self._paused = True
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        """The caller has read."""
        self._paused = False
        self._transport.resume_reading()
        self._process()

    def abort(self) -> None:
        """Close at once."""
        self._transport.abort()

    def abort_soon(self) -> None:
        """Close; may be called from any thread."""
        self._loop.call_soon_threadsafe(self.abort)

    def hand_over(self, take_over: Callable[[asyncio.Transport, bytes, int], None], head: bytes) -> None:
        """Give the connection to a WebSocket, with the request that opens it and what follows."""
        self._ended = True
        self._stop_waiting()
        self._server.handed_over(self)
        take_over(self._transport, head + self._buffer, self.number)

    def send(self, request: HttpRequest | None, status: int, file: StaticFile, *, keep: bool) -> None:
        """Write an answer; close the connection unless `keep`."""
        headers = self._server.headers(request, file) | _MORE_HEADERS.get(status, {})
        headers |= {"Content-Length": str(len(file.body))} | ({} if keep else {"Connection": "close"})
        lines = [f"HTTP/1.1 {status} {http.HTTPStatus(status).phrase}", *(f"{k}: {v}" for k, v in headers.items())]
        body = b"" if request is not None and request.method == "HEAD" else file.body
        self._transport.write("\r\n".join([*lines, "", ""]).encode("latin-1", "replace") + body)
        if keep:
            self._wait(QUIET_S)
            return
        self._ended, self._buffer = True, b""
        with suppress(OSError, RuntimeError):
            self._transport.write_eof()
        self._wait(LINGER_S)

    def _process(self) -> None:
        while not (self._ended or self._paused):
            end = re.search(rb"\r?\n\r?\n", self._buffer)
            try:
                self._check_length(self._buffer if end is None else self._buffer[: end.start()])
                if end is None:
                    return
                head, self._buffer = self._buffer[: end.end()], self._buffer[end.end() :]
                request = parse_request(head[: end.start()])
            except HttpError as fault:
                method = "HEAD" if self._buffer.startswith(b"HEAD ") else "GET"
                refused = HttpRequest(method=method, path="", version="HTTP/1.1")
                self.send(refused, fault.status, text_file(fault.text), keep=False)
                return
            self._server.respond(self, request, head)

    def _check_length(self, head: bytes) -> None:
        first, _, rest = head.partition(b"\n")
        if len(first) > MAX_LINE:
            raise HttpError(414, "the address is too long")
        if len(rest) > MAX_LINE * 4 or any(len(line) > MAX_LINE for line in rest.split(b"\n")):
            raise HttpError(431, "the headers are too long")

    def _wait(self, limit_s: float) -> None:
        """Close the connection after this time."""
        self._stop_waiting()
        self._timer = self._loop.call_later(limit_s, self._transport.abort)

    def _stop_waiting(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

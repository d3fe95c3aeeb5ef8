"""What the page's server answers to a request: a file, a socket, or why neither.

A connection of the page's server that answers what is no request for a page or a socket, too, and counts as pending.

The websockets library closes such a connection without a word: HEAD, POST, headers that are too long, an older HTTP.

What other ground stations are told of the cockpit: a widget, and no action, since nothing moves without the helm.
"""

from __future__ import annotations

import asyncio
import http
from dataclasses import replace
from pathlib import Path
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import SecurityError
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from wakewise.ui.web.blueos import ServiceDescription
from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.origin_check import TOKEN_HEADER, OriginCheck, PendingConnections, RequestOrigin, page_headers

_LONGEST_LINE = 8192
_LINGER_S = 1.0
"""How long a connection stays open after such an answer: closed while words still come, it could lose the answer."""


class PageConnection(ServerConnection):
    """One connection; it waits in `pending` from the first byte until `named`."""

    def __init__(self, *args: Any, pending: PendingConnections, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.head_only = False
        self._pending, self._number = pending, 0
        self._line: bytes | None = b""
        self._method = self._version = b""
        self._answered = False

    def named(self) -> None:
        """Whoever is at the other end has said who it is."""
        self._pending.leave(self._number)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count it among those that wait."""
        super().connection_made(transport)
        peer = self.remote_address
        self._number = self._pending.enter(str(peer[0]) if peer else "", self.transport.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count it no more."""
        self._pending.leave(self._number)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take in what comes; HEAD is read as GET, and answered without the body."""
        if self._line is not None:
            line = self._line + data
            if b"\n" not in line and len(line) < _LONGEST_LINE:
                self._line = line
                return
            self._method = line.partition(b" ")[0]
            self._version = line.partition(b"\n")[0].rstrip().rpartition(b" ")[2]
            self._line, self.head_only = None, self._method == b"HEAD"
            data = b"GET" + line[4:] if self.head_only else line
        super().data_received(data)

    def send_data(self) -> None:
        """Send what the protocol has to say, after an answer where it would say nothing."""
        cause = None if self.protocol.handshake_exc is None else self.protocol.handshake_exc.__cause__
        if cause is not None and self.request is None and not (self._answered or isinstance(cause, EOFError)):
            self._answered = True
            self.transport.write(self.without_body(self._refusal(cause)).serialize())
        super().send_data()

    def without_body(self, response: Response) -> Response:
        """A response as it is sent: to HEAD without its body."""
        return replace(response, body=b"") if self.head_only else response

    async def handshake(self, *args: Any, **kwargs: Any) -> None:
        """Perform the opening handshake; after a refusal, wait until the other end has read it."""
        try:
            await super().handshake(*args, **kwargs)
        except Exception:
            if self._answered:
                await asyncio.wait([self.connection_lost_waiter], timeout=_LINGER_S)
            raise

    def _refusal(self, cause: BaseException) -> Response:
        if self._method not in (b"GET", b"HEAD"):
            return answer(http.HTTPStatus.METHOD_NOT_ALLOWED, b"only GET and HEAD here\n", more={"Allow": "GET, HEAD"})
        if isinstance(cause, SecurityError):
            return answer(http.HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, b"the headers are too long\n")
        if self._version.startswith(b"HTTP/") and self._version != b"HTTP/1.1":
            return answer(http.HTTPStatus.HTTP_VERSION_NOT_SUPPORTED, b"HTTP/1.1 is spoken here\n")
        return answer(http.HTTPStatus.BAD_REQUEST, b"not a request for a page\n")


def answer(
    status: http.HTTPStatus, body: bytes, kind: str = "text/plain; charset=utf-8", more: dict[str, str] | None = None
) -> Response:
    """An answer after which the connection is closed."""
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close", **(more or {})})
    return Response(status.value, status.phrase, headers, body)


SUBPROTOCOL, TOKEN_PREFIX = Subprotocol("wakewise"), "token."
"""What a page offers with its handshake: a browser can say its token there, and nowhere else in that request."""


def respond(connection: PageConnection, request: Request, files: StaticFiles, gate: OriginCheck) -> Response | None:
    """The response to a request; None where a socket may open."""
    caller = _caller(connection, request)
    file = files.at(request.path)
    shared = file is not None and file.shared
    if shared:
        caller = replace(caller, origin=None)
    refused = gate.refusal(caller)
    if refused is not None:
        return answer(http.HTTPStatus.FORBIDDEN, f"refused: {refused}\n".encode())
    if request.path.partition("?")[0] == "/ws":
        if gate.needs_token(caller) and (why := wrong(_token(request.headers), gate)):
            return answer(http.HTTPStatus.UNAUTHORIZED, f"{why}\n".encode())
        if connection.head_only or _only(request.headers, "Upgrade") is None:
            return answer(http.HTTPStatus.UPGRADE_REQUIRED, b"a WebSocket\n", more={"Upgrade": "websocket"})
        return None
    if file is None:
        return answer(http.HTTPStatus.NOT_FOUND, b"there is nothing here\n")
    more = page_headers(caller.host or "", gate.origins) | ({"Access-Control-Allow-Origin": "*"} if shared else {})
    return answer(http.HTTPStatus.OK, file.body, file.kind, more)


def wrong(token: str | None, gate: OriginCheck) -> str | None:
    """What is wrong with a token, in words; None if nothing."""
    if gate.fits(token):
        return None
    return "the token is wrong" if token else "a token is needed: open the address that was printed"


def _caller(connection: ServerConnection, request: Request) -> RequestOrigin:
    peer = connection.remote_address
    return RequestOrigin(
        address=str(peer[0]) if peer else "",
        host=_only(request.headers, "Host"),
        origin=_only(request.headers, "Origin"),
    )


def _token(headers: Headers) -> str | None:
    """The token that a request for the socket shows, as a header or among the protocols it offers."""
    shown = _only(headers, TOKEN_HEADER)
    if shown is not None:
        return shown
    offered = [one.strip() for value in headers.get_all("Sec-WebSocket-Protocol") for one in value.split(",")]
    return next((one.removeprefix(TOKEN_PREFIX) for one in offered if one.startswith(TOKEN_PREFIX)), None)


def _only(headers: Headers, name: str) -> str | None:
    """The one value of a header; of several none counts but one that nobody may have."""
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else ", ".join(values) if values else None


PAGE = Path(__file__).with_name("page")
SERVICE = ServiceDescription(
    name="Wakewise",
    description="Fly an underwater vehicle by hand while its wash leaves the target still.",
    widget="Wakewise: gentle flight",
)


def page_files() -> StaticFiles:
    """The page, and what ground stations ask for."""
    return StaticFiles(folder=PAGE, more=SERVICE.files())

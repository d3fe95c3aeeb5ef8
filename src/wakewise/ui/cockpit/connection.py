"""A connection of the page's server that answers what is no request for a page or a socket, too, and counts as pending.

The websockets library closes such a connection without a word: HEAD, POST, headers that are too long, an older HTTP.
"""

from __future__ import annotations

import asyncio
import http
from dataclasses import replace
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import SecurityError
from websockets.http11 import Response

from wakewise.ui.web.pending import PendingConnections

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

"""What the page's server answers to a request: a file, a socket, or why neither."""

from __future__ import annotations

import http
from dataclasses import replace

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from wakewise.ui.cockpit.connection import PageConnection, answer
from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.origin_check import TOKEN_HEADER, OriginCheck, RequestOrigin, page_headers

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

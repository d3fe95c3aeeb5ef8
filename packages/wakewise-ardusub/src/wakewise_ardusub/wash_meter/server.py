"""The page's server: its files, the state as JSON, and three things that a page may wish of the meter.

Only the standard library, one thread a request. A page asks again and again (five times a second), which passes through
any proxy, BlueOS' too. Who may ask is `wakewise.ui.web.origin_check`'s: this computer by its own names, others with the
token unless the pilot has said that everybody on the network may.
"""

from __future__ import annotations

import http
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.ui.web.blueos import ServiceDescription, as_json
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

PAGE = Path(__file__).with_name("page")
OFFER = ServiceDescription(
    name="Wakewise gentle meter",
    description="What the thrusters do to the target's water, and what gentler thrusts would spare. Listens only.",
    widget="Wakewise: gentle meter",
)
PAGE_REQUESTS = ("mark", "unmark", "begin")
_STATE, _HISTORY = "/state.json", "/history.json"
MOST_KEPT = 32
"""Connections that are kept open for callers who were let in; of more, each ends with its answer."""
_QUIET_S, _LINGER_S = 10.0, 0.5

Told = Callable[[], dict[str, Any]]
Wish = Callable[[str], str | None]


class MeterServer:
    """Serves one meter.

    Parameters
    ----------
    state, history : callable
        What is told at the two addresses.
    wish : callable
        Does one of `PAGE_REQUESTS`; says why not, or None.
    host, port : str, int
        Where to listen; port 0 takes any that is free.
    token : bool
        Whether callers from other computers must show the token.

    Raises
    ------
    InputError
        If the port is taken, or the address is not this computer's.
    """

    def __init__(
        self, state: Told, history: Told, wish: Wish, host: str = "127.0.0.1", port: int = 0, *, token: bool = True
    ) -> None:
        self.host, self.token = host, secrets.token_urlsafe(16) if token else None
        self.over = False
        self._wish = wish
        more = {_STATE: lambda: as_json(state()), _HISTORY: lambda: as_json(history())}
        self._files = StaticFiles(folder=PAGE, more=OFFER.files() | more)
        try:
            self._http = _Listening((host, port), _handler(self))
        except OSError as fault:
            why = (fault.strerror or str(fault)).lower()
            raise InputError(f"--port {port} at {host}: {why}; give another --port, or 0 for any") from None
        self.port = int(self._http.server_address[1])
        self._gate = OriginCheck(port=self.port, token=self.token or "", open_to_net=not is_loopback(host))
        self._thread = threading.Thread(target=self._http.serve_forever, name="meter page", daemon=True)

    @property
    def addresses(self) -> tuple[str, ...]:
        """Where the page is, best first."""
        secret = "" if is_loopback(self.host) or self.token is None else f"#token={self.token}"
        return page_addresses(self.host, self.port, secret)

    @property
    def address(self) -> str:
        """The first of `addresses`."""
        return self.addresses[0]

    def start(self) -> None:
        """Answer from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Answer no more, on connections that are open neither."""
        self.over = True
        self._http.shutdown()
        self._http.server_close()
        self._http.pending.close()
        self._thread.join(timeout=10.0)

    def answer(self, method: str, path: str, caller: RequestOrigin, token: str | None) -> tuple[int, StaticFile]:
        """What a request gets, and its status."""
        address = path.partition("?")[0]
        file = self._files.at(path) if method == "GET" and address not in (_STATE, _HISTORY) else None
        if file is not None and file.shared:
            caller = RequestOrigin(address=caller.address, host=caller.host, origin=None)
        refused = self._gate.refusal(caller)
        if refused is not None:
            return 403, _line(f"refused: {refused}")
        if file is not None:
            return 200, file
        if not self.lets_in(caller, token):
            return 401, _line("a token is needed: open the address that was printed")
        if method == "GET" and (file := self._files.at(path)) is not None:
            return 200, file
        if method == "POST" and address.removeprefix("/") in PAGE_REQUESTS:
            why_not = self._wish(address.removeprefix("/"))
            return (200, as_json({"done": True})) if why_not is None else (409, as_json({"why_not": why_not}))
        return 404, _line("there is nothing here")

    def lets_in(self, caller: RequestOrigin, token: str | None) -> bool:
        """Whether a caller may see the state: by the token, where one is needed."""
        return self.token is None or not self._gate.needs_token(caller) or self._gate.fits(token)


def _line(text: str) -> StaticFile:
    return StaticFile(body=f"{text}\n".encode(), kind="text/plain; charset=utf-8")


class _Listening(ThreadingHTTPServer):
    """Takes connections; each waits in `pending` until a caller who may see the state has asked for something."""

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = 128

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.pending = PendingConnections()
        self._numbers: dict[Any, int] = {}
        self._named: set[Any] = set()
        super().__init__(*args, **kwargs)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Count a connection among those that wait, and hear it in a thread of its own."""
        self._numbers[request] = self.pending.enter(str(client_address[0]), partial(_shut, request))
        super().process_request(request, client_address)

    def named(self, request: Any) -> bool:
        """Whoever is at the other end was let in; whether its connection may be kept open."""
        if request not in self._named and len(self._named) >= MOST_KEPT:
            return False
        self._named.add(request)
        self.pending.leave(self._numbers.get(request, 0))
        return True

    def shutdown_request(self, request: Any) -> None:
        """Close a connection once the other end has read its answer, which it may lose while words still come."""
        end_s = time.monotonic() + _LINGER_S
        with suppress(OSError):
            request.shutdown(socket.SHUT_WR)
            request.settimeout(_LINGER_S)
            while request.recv(1 << 16) and time.monotonic() < end_s:
                pass
        self.pending.leave(self._numbers.pop(request, 0))
        self._named.discard(request)
        self.close_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that was closed while it was answered is nothing to tell of; anything else is."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


def _shut(request: Any) -> None:
    with suppress(OSError):
        request.shutdown(socket.SHUT_RDWR)


def _handler(server: MeterServer) -> type[BaseHTTPRequestHandler]:
    """The class of requests to one server."""

    class Request(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        default_request_version = "HTTP/1.0"  # of a request without one; older ones get no status
        timeout = _QUIET_S
        error_content_type = "text/plain; charset=utf-8"
        error_message_format = "%(code)d %(message)s\n"

        def do_GET(self) -> None:
            self._do("GET")

        def do_HEAD(self) -> None:
            self._do("GET", body=False)

        def do_POST(self) -> None:
            # What a wish carries says nothing; it is not read, so the connection ends with the answer.
            self.close_connection = True
            self._do("POST")

        def _do(self, method: str, *, body: bool = True) -> None:
            if server.over:
                self.close_connection = True
                return
            caller = RequestOrigin(address=self.client_address[0], host=self._only("Host"), origin=self._only("Origin"))
            token = self._only(TOKEN_HEADER)
            status, file = server.answer(method, self.path, caller, token)
            if status == http.HTTPStatus.FORBIDDEN or not server.lets_in(caller, token) or not self._kept():
                self.close_connection = True
            self.send_response(status, http.HTTPStatus(status).phrase)
            self.send_header("Content-Type", file.kind)
            self.send_header("Content-Length", str(len(file.body)))
            for name, value in page_headers(caller.host or "").items():
                self.send_header(name, value)
            if file.shared:
                self.send_header("Access-Control-Allow-Origin", "*")
            if self.close_connection:
                self.send_header("Connection", "close")
            self.end_headers()
            if body:
                self.wfile.write(file.body)

        def _kept(self) -> bool:
            assert isinstance(self.server, _Listening)
            return self.server.named(self.request)

        def _only(self, name: str) -> str | None:
            """The one value of a header; of several none counts but one that nobody may have."""
            values = self.headers.get_all(name) or []
            return values[0] if len(values) == 1 else ", ".join(values) if values else None

        def version_string(self) -> str:
            return "wakewise"

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing: the page asks five times a second."""

    return Request

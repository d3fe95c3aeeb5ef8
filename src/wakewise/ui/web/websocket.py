"""WebSockets of a `WebServer`: the websockets library, given a connection whose request has been checked."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import cast

from websockets.asyncio.server import Server, ServerConnection
from websockets.server import ServerProtocol
from websockets.typing import Subprotocol

from wakewise.ui.web.origin_check import PendingConnections

SUBPROTOCOL = Subprotocol("wakewise")
MAX_BYTES = 65536
"""A longer message ends the connection."""
_SEND_BUFFER = 1 << 17  # bytes: what waits in the system is old when it arrives
_QUIET = logging.getLogger("wakewise.ui.web.websocket")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False


class PageSocket(ServerConnection):
    """One WebSocket; it counts as pending until `admit`."""

    pending: PendingConnections
    number: int

    def admit(self) -> None:
        """The caller has identified itself."""
        self.pending.leave(self.number)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count it no more."""
        self.pending.leave(self.number)
        super().connection_lost(exc)


class SocketServer:
    """All WebSockets of one server; `meet` is called with each that has opened."""

    def __init__(self, meet: Callable[[PageSocket], Awaitable[None]], pending: PendingConnections) -> None:
        self._pending = pending
        handler = cast("Callable[[ServerConnection], Awaitable[None]]", meet)
        self._server = Server(handler, server_header=None, logger=_QUIET)

    def take_over(self, transport: asyncio.Transport, received: bytes, number: int) -> None:
        """Open a WebSocket on a connection; `received` begins with its request."""
        protocol = ServerProtocol(
            select_subprotocol=lambda _, offered: SUBPROTOCOL if SUBPROTOCOL in offered else None,
            max_size=MAX_BYTES,
            logger=_QUIET,
        )
        connection = PageSocket(protocol, self._server, ping_interval=5.0, ping_timeout=20.0, close_timeout=1.0)
        connection.pending, connection.number = self._pending, number
        with suppress(OSError):
            transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        transport.set_protocol(connection)
        connection.connection_made(transport)
        connection.data_received(received)

    def attach(self, listening: asyncio.Server) -> None:
        """Join the server that accepts the connections."""
        self._server.wrap(listening)

    async def close(self) -> None:
        """Accept no more connections and close all WebSockets."""
        self._server.close()
        await self._server.wait_closed()

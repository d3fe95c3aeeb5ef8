"""The page's server: files and a socket on one port, in a thread and an event loop of its own.

It shows what a `ViewModel` knows ten times a second and takes sticks for its seat. The flight never waits for a client,
nor does one client for another: each has an outbox in which only the newest state and one picture wait, and one that
does not read is let go. What clients say is in `messages`, who may come in `gate`, who may fly `helm`.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import socket
import threading
from dataclasses import replace
from functools import partial
from typing import Any, cast

from websockets.asyncio.server import Server as Listening
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from wakewise.core.errors import InputError
from wakewise.ui.cockpit.client import Client, show_pictures
from wakewise.ui.cockpit.control_mailbox import DEVICE, ControlOwnership
from wakewise.ui.cockpit.messages import (
    MOST_BYTES,
    ButtonPress,
    ControlConsent,
    ControlRequest,
    Hello,
    InvalidMessage,
    Message,
    PictureAck,
    SettingsChange,
    StickMessage,
    read_message,
)
from wakewise.ui.cockpit.requests import SUBPROTOCOL, PageConnection, page_files, respond, wrong
from wakewise.ui.cockpit.view_model import StatusMessage, ViewModel, as_json
from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.origin_check import OriginCheck, PendingConnections, equal_secrets, is_loopback, page_addresses

PROTOCOL = 1
STATE_EVERY_S = 0.1
MOST_CLIENTS = 16
"""Pages at a time. One more place is kept for whoever had the helm last."""
STUCK_S = 10.0
"""A client that takes nothing for so long is let go."""
_HELLO_WITHIN_S, _MOST_AMISS, _MOST_THROTTLED = 5.0, 50, 40
_REFUSED, _TOO_MUCH, _FULL = 4401, 1008, 1013
_SYSTEM_KEEPS = 1 << 17  # bytes
_BACKLOG = 512  # connections that the system keeps until they are taken
_QUIET = logging.getLogger("wakewise.ui.cockpit")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False


class CockpitServer:
    """Serves one show.

    Parameters
    ----------
    show : ViewModel
    host : str
        Address to listen at; this computer's own unless asked otherwise.
    port : int
        0 takes any that is free.
    token : str, optional
        What callers from elsewhere must show; drawn if not given.
    files : Files, optional
        The page.
    origins : tuple of str
        Where browsers ask for the page if a proxy stands before it.
    """

    def __init__(
        self,
        show: ViewModel,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        files: StaticFiles | None = None,
        origins: tuple[str, ...] = (),
    ) -> None:
        self.show, self.host, self.port = show, host, port
        self.token = token or secrets.token_urlsafe(16)
        self.clients: dict[str, Client] = {}
        self._files = files or page_files()
        self._gate = OriginCheck(port=port, token=self.token, origins=origins)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._listening: Listening | None = None
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._seen = asyncio.Event()
        self._fault: OSError | None = None
        self._over: asyncio.Event | None = None
        self._told: ControlOwnership | None = None
        self._last_lease: str | None = None
        self._pending = PendingConnections()
        self._edition = -1
        self._count = 0

    @property
    def addresses(self) -> tuple[str, ...]:
        """Where the page is, best first: for this computer's browser, or with the token where it is asked for."""
        token = f"#token={self.token}"
        if self._gate.origins:
            return tuple(f"{origin}/{token}" for origin in self._gate.origins)
        return page_addresses(self.host, self.port, "" if is_loopback(self.host) else token)

    @property
    def address(self) -> str:
        """The first of `addresses`."""
        return self.addresses[0]

    @property
    def spectators(self) -> int:
        """Clients that only look."""
        holder = self.show.seat.holding.holder
        return sum(client.greeted and client.id != holder for client in list(self.clients.values()))

    def start(self) -> None:
        """Listen.

        Raises
        ------
        InputError
            If the port is taken, or the address is not this computer's.
        """
        self._thread = threading.Thread(target=self._run, name="cockpit", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._fault is not None:
            self._thread.join()
            why = self._fault.strerror or str(self._fault)
            raise InputError(f"--port {self.port} at {self.host}: {why.lower()}; give another --port, or 0 for any")

    def stop(self) -> None:
        """Close all connections and end the thread."""
        if self._loop is None or self._thread is None or self._over is None:
            return
        with contextlib.suppress(RuntimeError):  # the loop has ended by itself
            self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(timeout=10.0)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        try:
            self._listening = await serve(
                self._meet,
                self.host,
                self.port,
                process_request=self._answer,
                select_subprotocol=lambda _, offered: SUBPROTOCOL if SUBPROTOCOL in offered else None,
                create_connection=cast("type[ServerConnection]", partial(PageConnection, pending=self._pending)),
                compression=None,
                max_size=MOST_BYTES,
                ping_interval=5.0,
                ping_timeout=20.0,
                close_timeout=1.0,
                server_header=None,
                backlog=_BACKLOG,
                logger=_QUIET,
            )
        except OSError as fault:
            self._fault = fault
            self._ready.set()
            return
        self.port = self._listening.sockets[0].getsockname()[1]
        near = is_loopback(self._listening.sockets[0].getsockname()[0])
        self._gate = replace(self._gate, port=self.port, open_to_net=not near)
        self._ready.set()
        tasks = [
            asyncio.create_task(self._beat()),
            asyncio.create_task(show_pictures(self.show, self._greeted, self._seen)),
        ]
        await self._over.wait()
        for task in tasks:
            task.cancel()
        self._listening.close()
        self._pending.close()
        await self._listening.wait_closed()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file, let a socket open, or refuse either."""
        assert isinstance(connection, PageConnection)
        response = respond(connection, request, self._files, self._gate)
        return None if response is None else connection.without_body(response)

    async def _meet(self, connection: ServerConnection) -> None:
        """One client, from its first word to its last."""
        assert self._loop is not None
        assert isinstance(connection, PageConnection)
        self._count += 1
        client = Client(connection=connection, id=f"c{self._count}-{secrets.token_hex(3)}")
        self.clients[client.id] = client
        _keep_little(connection)
        sending = asyncio.create_task(client.send_all(self._loop))
        try:
            async with asyncio.timeout(_HELLO_WITHIN_S):
                first = read_message(await connection.recv())
            refused = self._refused(first)
            if refused is not None:
                await connection.close(*refused)
                return
            connection.named()
            self._greet(client, first)
            async for raw in connection:
                if not client.may_speak(self._loop.time()):
                    if client.throttled > _MOST_THROTTLED:
                        await connection.close(_TOO_MUCH, "too many messages")
                        return
                    await asyncio.sleep(0.25)  # what it says meanwhile waits on its own side
                self._heed(client, read_message(raw))
                if client.amiss > _MOST_AMISS:
                    await connection.close(_TOO_MUCH, "too many messages that cannot be read")
                    return
        except (ConnectionClosed, TimeoutError):
            pass
        finally:
            sending.cancel()
            self.clients.pop(client.id, None)
            self.show.seat.left(client.id)
            self._tell_helm("the page was closed")

    def _refused(self, first: Message | InvalidMessage) -> tuple[int, str] | None:
        """Code and words with which a client is let go for its first message; None where it may stay."""
        if not isinstance(first, Hello):
            return _REFUSED, f"say hello first: {first.why}"[:120] if isinstance(
                first, InvalidMessage
            ) else "say hello first"
        if first.token is not None and (why := wrong(first.token, self._gate)):
            return _REFUSED, why
        comes_back = (
            first.lease is not None and self._last_lease is not None and equal_secrets(first.lease, self._last_lease)
        )
        if len(self._greeted()) >= MOST_CLIENTS + comes_back:
            return _FULL, "too many pages are open"
        return None

    def _greet(self, client: Client, hello: Message | InvalidMessage) -> None:
        assert isinstance(hello, Hello)
        client.name, client.greeted = self._free_name(hello.name), True
        client.tell(self._welcome(client))
        holding = self.show.seat.holding
        if hello.wants == "helm" and not holding.flying:
            self.show.seat.ask(client.id)
        self._tell_helm("", always=client)

    def _free_name(self, name: str) -> str:
        """A name that no other page has: its own, else with the first number that is free."""
        taken, count, free = {client.name for client in self._greeted()}, 1, name
        while free in taken:
            count += 1
            free = f"{name} {count}"
        return free

    def _welcome(self, client: Client) -> str:
        return as_json(
            {"type": "welcome", "id": client.id, "name": client.name, "protocol": PROTOCOL, **self.show.welcome()}
        )

    def _heed(self, client: Client, message: Message | InvalidMessage) -> None:
        """Do what a client asks for, as far as it may."""
        seat = self.show.seat
        match message:
            case InvalidMessage():
                client.amiss += 1
                client.tell(StatusMessage(text=f"a message was not understood: {message.why}", level="warn").message())
            case StickMessage():
                seat.moved(client.id, message.lease, message.seq, message.t_ms, message.axes)
            case PictureAck():
                client.seen(message.frame)
                self._seen.set()
            case ButtonPress():
                seat.press(client.id, message.lease, message.what)
            case SettingsChange():
                if seat.may(client.id, message.lease):
                    self._set_desk(client, message.changes)
            case ControlRequest(want=True):
                words = seat.ask(client.id, message.force)
                self._tell_helm(words, always=client)
            case ControlRequest():
                seat.left(client.id)
                self._tell_helm("the helm was given back")
            case ControlConsent():
                self._tell_helm(seat.consent(client.id, message.to, message.yes), always=client)
            case Hello():
                client.tell(self._welcome(client))

    def _set_desk(self, client: Client, changes: dict[str, Any]) -> None:
        try:
            self.show.set_desk(changes)
        except InputError as fault:
            client.tell(StatusMessage(text=str(fault), level="warn").message())

    def _tell_helm(self, why: str, always: Client | None = None) -> None:
        """Tell everybody of a change at the helm, and `always` this one how it stands."""
        holding = self.show.seat.holding
        changed, before = holding != self._told, self._told
        self._told = holding
        if holding.holder in self.clients:
            self._last_lease = holding.lease
        if before is not None and holding.holder != before.holder:
            name = self._named(holding.holder)
            self._to_all(
                StatusMessage(text="nobody has the helm" if name is None else f"{name} has the helm").message()
            )
        asking = self.clients.get(holding.asked_by or "")
        told = {
            "type": "helm",
            "holder": self._named(holding.holder),
            "asked_by": None if asking is None else {"id": asking.id, "name": asking.name},
            "flying": holding.flying,
            "armed": holding.armed,
            "why": why,
        }
        for client in list(self.clients.values()):
            if client.greeted and (changed or client is always):
                yours = client.id == holding.holder
                client.tell(as_json(told | {"yours": yours, "lease": holding.lease if yours else None}))

    def _named(self, holder: str | None) -> str | None:
        client = self.clients.get(holder or "")
        return client.name if client is not None else holder if holder == DEVICE else None

    async def _beat(self) -> None:
        """Ten times a second: who has the helm, what happened, what is so."""
        assert self._loop is not None
        due_s, amiss = self._loop.time(), ""
        while True:
            try:
                self._tell_all()
            except Exception as fault:  # what is shown may be at fault, the helm must be looked after all the same
                if (said := f"{type(fault).__name__}: {fault}") != amiss:
                    self._to_all(
                        StatusMessage(text=f"the page cannot be told how it stands ({said})", level="error").message()
                    )
                amiss = said
            due_s = max(due_s + STATE_EVERY_S, self._loop.time())
            await asyncio.sleep(due_s - self._loop.time())

    def _tell_all(self) -> None:
        self._look_after_helm()
        self._let_go_of_stuck()
        for note in self.show.notes():
            self._to_all(note.message())
        if self.show.edition != self._edition:
            self._edition = self.show.edition
            for client in self._greeted():
                client.tell(self._welcome(client))
        state = self.show.state() if self._greeted() else None
        if state is not None:
            holder = self._named(self.show.seat.holding.holder)
            text = as_json(state | {"type": "state", "helm": holder, "spectators": self.spectators})
            for client in self._greeted():
                client.state(text)

    def _to_all(self, message: str) -> None:
        for client in self._greeted():
            client.tell(message)

    def _look_after_helm(self) -> None:
        holding = self.show.seat.holding
        if self._told is not None and holding != self._told:
            quiet = self._told.flying and not holding.flying
            self._tell_helm("no sticks for a second: the vehicle holds, the helm is free" if quiet else "")

    def _let_go_of_stuck(self) -> None:
        """End connections whose other end takes nothing."""
        assert self._loop is not None
        for client in list(self.clients.values()):
            since_s = client.sending_since_s
            if since_s is not None and self._loop.time() - since_s > STUCK_S:
                client.connection.transport.abort()

    def _greeted(self) -> list[Client]:
        return [client for client in self.clients.values() if client.greeted]


def _keep_little(connection: ServerConnection) -> None:
    """Have the system keep little for a client: what waits there is old when it arrives."""
    with contextlib.suppress(OSError):
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SYSTEM_KEEPS)

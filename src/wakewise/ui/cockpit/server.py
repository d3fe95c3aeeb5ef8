"""Server of the cockpit page: state ten times per second, camera pictures, and the pilot's controls.

The flight never waits for a client, and no client waits for another: each has an outbox (`client.py`) that holds the
newest state and one picture. A client that does not read is disconnected. Messages are read by `messages.py`; who has
the controls is decided by `control_mailbox.py`; HTTP and WebSocket are `wakewise.ui.web.server`.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed

from wakewise.core.errors import InputError
from wakewise.ui.cockpit.client import Client, show_pictures
from wakewise.ui.cockpit.control_mailbox import DEVICE, ControlOwnership
from wakewise.ui.cockpit.messages import (
    ButtonPress,
    ControlConsent,
    ControlRequest,
    Hello,
    InvalidMessage,
    Message,
    PictureAck,
    SettingsChange,
    StickMessage,
    TargetDesignation,
    TargetProposal,
    read_message,
)
from wakewise.ui.cockpit.view_model import StatusMessage, ViewModel, as_json
from wakewise.ui.web.blueos import ServiceDescription
from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.origin_check import equal_secrets
from wakewise.ui.web.server import Site, WebServer
from wakewise.ui.web.websocket import PageSocket

PAGE = Path(__file__).with_name("page")
SERVICE = ServiceDescription(
    name="Wakewise",
    description="Fly an underwater vehicle by hand while its wash leaves the target still.",
    widget="Wakewise: gentle flight",
)
"""Listed by other ground stations: a widget and no action, since nothing moves without the controls."""
PROTOCOL = 1
STATE_EVERY_S = 0.1
MOST_CLIENTS = 16
"""Pages at a time. One more place is kept for the last pilot."""
STUCK_S = 10.0
"""A client that reads nothing for this time is disconnected."""
_HELLO_WITHIN_S, _MOST_INVALID, _MOST_THROTTLED = 5.0, 50, 40
_REFUSED, _TOO_MUCH, _FULL = 4401, 1008, 1013


def page_files() -> StaticFiles:
    """The page, and the descriptions for ground stations."""
    return StaticFiles(folder=PAGE, more=SERVICE.files())


class CockpitServer(WebServer):
    """Serves one view model; arguments are those of `WebServer`."""

    def __init__(
        self,
        model: ViewModel,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        files: StaticFiles | None = None,
        origins: tuple[str, ...] = (),
    ) -> None:
        super().__init__(Site(files=files or page_files(), socket="/ws"), host, port, token=token, origins=origins)
        self.model = model
        self.clients: dict[str, Client] = {}
        self._seen = asyncio.Event()
        self._sent_ownership: ControlOwnership | None = None
        self._last_lease: str | None = None
        self._edition = -1
        self._count = 0

    @property
    def spectators(self) -> int:
        """Number of clients without the controls."""
        holder = self.model.mailbox.holding.holder
        return sum(client.greeted and client.id != holder for client in list(self.clients.values()))

    def tasks(self) -> tuple[Coroutine[Any, Any, None], ...]:
        """State and pictures."""
        return self._send_states(), show_pictures(self.model, self._greeted, self._seen)

    async def meet(self, connection: PageSocket) -> None:
        """One client, from its first message to its last."""
        clock = asyncio.get_running_loop()
        self._count += 1
        client = Client(connection=connection, id=f"c{self._count}-{secrets.token_hex(3)}")
        self.clients[client.id] = client
        sending = asyncio.create_task(client.send_all(clock))
        try:
            async with asyncio.timeout(_HELLO_WITHIN_S):
                first = read_message(await connection.recv())
            refused = self._refused(first)
            if refused is not None:
                await connection.close(*refused)
                return
            connection.admit()
            self._greet(client, first)
            async for raw in connection:
                if not client.may_speak(clock.time()):
                    if client.throttled > _MOST_THROTTLED:
                        await connection.close(_TOO_MUCH, "too many messages")
                        return
                    await asyncio.sleep(0.25)  # its next messages wait on its own side
                self._handle(client, read_message(raw))
                if client.invalid > _MOST_INVALID:
                    await connection.close(_TOO_MUCH, "too many messages that cannot be read")
                    return
        except (ConnectionClosed, TimeoutError):
            pass
        finally:
            sending.cancel()
            self.clients.pop(client.id, None)
            self.model.mailbox.left(client.id)
            self._send_ownership("the page was closed")

    def _refused(self, first: Message | InvalidMessage) -> tuple[int, str] | None:
        """Code and words with which a client is let go for its first message; None where it may stay."""
        if not isinstance(first, Hello):
            why = f": {first.why}" if isinstance(first, InvalidMessage) else ""
            return _REFUSED, f"say hello first{why}"[:120]
        if first.token is not None and (fault := self.token_fault(first.token)):
            return _REFUSED, fault
        comes_back = (
            first.lease is not None and self._last_lease is not None and equal_secrets(first.lease, self._last_lease)
        )
        if len(self._greeted()) >= MOST_CLIENTS + comes_back:
            return _FULL, "too many pages are open"
        return None

    def _greet(self, client: Client, hello: Message | InvalidMessage) -> None:
        assert isinstance(hello, Hello)
        client.name, client.greeted = self._free_name(hello.name), True
        client.send(self._welcome(client))
        holding = self.model.mailbox.holding
        if hello.wants == "helm" and not holding.flying:
            self.model.mailbox.ask(client.id)
        self._send_ownership("", always=client)

    def _free_name(self, name: str) -> str:
        """A name that no other page has: its own, else with the first number that is free."""
        taken, count, free = {client.name for client in self._greeted()}, 1, name
        while free in taken:
            count += 1
            free = f"{name} {count}"
        return free

    def _welcome(self, client: Client) -> str:
        return as_json(
            {"type": "welcome", "id": client.id, "name": client.name, "protocol": PROTOCOL, **self.model.welcome()}
        )

    def _handle(self, client: Client, message: Message | InvalidMessage) -> None:
        """Do what a client asks for, as far as it may."""
        mailbox = self.model.mailbox
        match message:
            case InvalidMessage():
                client.invalid += 1
                client.send(StatusMessage(text=f"a message was not understood: {message.why}", level="warn").message())
            case StickMessage():
                mailbox.moved(client.id, message.lease, message.seq, message.t_ms, message.axes)
            case PictureAck():
                client.seen(message.frame)
                self._seen.set()
            case ButtonPress():
                mailbox.press(client.id, message.lease, message.what)
            case SettingsChange():
                if mailbox.may(client.id, message.lease):
                    self._ask(client, lambda: self.model.change_settings(message.changes))
            case TargetDesignation():
                if mailbox.may(client.id, message.lease):
                    self._ask(client, lambda: self.model.designate(message.box, message.frame))
            case TargetProposal():
                if mailbox.may(client.id, message.lease):
                    self._ask(client, lambda: self.model.propose(message.what))
            case ControlRequest(want=True):
                words = mailbox.ask(client.id, message.force)
                self._send_ownership(words, always=client)
            case ControlRequest():
                mailbox.left(client.id)
                self._send_ownership("the helm was given back")
            case ControlConsent():
                self._send_ownership(mailbox.consent(client.id, message.to, message.yes), always=client)
            case Hello():
                client.send(self._welcome(client))

    def _ask(self, client: Client, change: Callable[[], None]) -> None:
        """Make a change of the flight; a client whose values are refused is told."""
        try:
            change()
        except InputError as fault:
            client.send(StatusMessage(text=str(fault), level="warn").message())

    def _send_ownership(self, why: str, always: Client | None = None) -> None:
        """Tell everybody of a change at the helm, and `always` this one how it stands."""
        holding = self.model.mailbox.holding
        changed, before = holding != self._sent_ownership, self._sent_ownership
        self._sent_ownership = holding
        if holding.holder in self.clients:
            self._last_lease = holding.lease
        if before is not None and holding.holder != before.holder:
            name = self._named(holding.holder)
            self._to_all(
                StatusMessage(text="nobody has the helm" if name is None else f"{name} has the helm").message()
            )
        asking = self.clients.get(holding.asked_by or "")
        message = {
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
                client.send(as_json(message | {"yours": yours, "lease": holding.lease if yours else None}))

    def _named(self, holder: str | None) -> str | None:
        client = self.clients.get(holder or "")
        return client.name if client is not None else holder if holder == DEVICE else None

    async def _send_states(self) -> None:
        """Ten times a second: who has the helm, what happened, what is so."""
        clock, last_fault = asyncio.get_running_loop(), ""
        due_s = clock.time()
        while True:
            try:
                self._send_all()
            except Exception as fault:  # what is shown may be at fault, the helm must be looked after all the same
                if (said := f"{type(fault).__name__}: {fault}") != last_fault:
                    self._to_all(
                        StatusMessage(text=f"the page cannot be told how it stands ({said})", level="error").message()
                    )
                last_fault = said
            due_s = max(due_s + STATE_EVERY_S, clock.time())
            await asyncio.sleep(due_s - clock.time())

    def _send_all(self) -> None:
        self._update_ownership()
        self._disconnect_stuck()
        for note in self.model.notes():
            self._to_all(note.message())
        if self.model.edition != self._edition:
            self._edition = self.model.edition
            for client in self._greeted():
                client.send(self._welcome(client))
        state = self.model.state() if self._greeted() else None
        if state is not None:
            holder = self._named(self.model.mailbox.holding.holder)
            text = as_json(state | {"type": "state", "helm": holder, "spectators": self.spectators})
            for client in self._greeted():
                client.state(text)

    def _to_all(self, message: str) -> None:
        for client in self._greeted():
            client.send(message)

    def _update_ownership(self) -> None:
        holding = self.model.mailbox.holding
        if self._sent_ownership is not None and holding != self._sent_ownership:
            quiet = self._sent_ownership.flying and not holding.flying
            self._send_ownership("no sticks for a second: the vehicle holds, the helm is free" if quiet else "")

    def _disconnect_stuck(self) -> None:
        """End connections whose other end takes nothing."""
        now_s = asyncio.get_running_loop().time()
        for client in list(self.clients.values()):
            since_s = client.sending_since_s
            if since_s is not None and now_s - since_s > STUCK_S:
                client.connection.transport.abort()

    def _greeted(self) -> list[Client]:
        return [client for client in self.clients.values() if client.greeted]

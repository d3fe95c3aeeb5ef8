"""One connected page: its outbox and its message rate, and the pictures of all pages.

One picture is in transit per client; the next one is rendered meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from websockets.asyncio.server import ServerConnection

from wakewise.ui.cockpit.view_model import CameraPicture, ViewModel

_MOST_WAITING = 64
"""Largest number of notes in an outbox; of more the oldest are dropped."""
SEEN_WITHIN_S = 0.3
"""A visible page acknowledges a picture within this time."""
RATE_HZ, BURST = 120.0, 240.0
"""Messages that a client may send: sticks come at 25 Hz, pictures are acknowledged at some 15 Hz."""


@dataclass(kw_only=True, eq=False)
class Client:
    """A connection and its outbox. It holds the newest state and picture only; nothing waits for the client."""

    connection: ServerConnection
    id: str
    name: str = "somebody"
    greeted: bool = False
    invalid: int = 0
    throttled: int = 0
    unseen: int | None = None
    pictured_s: float = 0.0
    """When the last picture was put into the outbox."""
    sending_since_s: float | None = None
    """When the message that is on its way was given to the socket; None between messages."""
    _words: deque[str] = field(default_factory=lambda: deque(maxlen=_MOST_WAITING))
    _state: str | None = None
    _picture: CameraPicture | None = None
    _something: asyncio.Event = field(default_factory=asyncio.Event)
    _allowance: float = BURST
    _allowed_at_s: float = 0.0

    @property
    def looks(self) -> bool:
        """Whether a picture would be sent at once."""
        return self.greeted and self.unseen is None and self._picture is None

    def will_look(self, now_s: float) -> bool:
        """Whether it can take a picture, or its acknowledgement of the last one may be in transit."""
        return self.looks or (self.greeted and now_s - self.pictured_s < SEEN_WITHIN_S)

    def send(self, text: str) -> None:
        """Put a message that is to arrive into the outbox."""
        self._words.append(text)
        self._something.set()

    def state(self, text: str) -> None:
        """Put the newest state into the outbox, in place of one that still waits."""
        self._state = text
        self._something.set()

    def picture(self, picture: CameraPicture, now_s: float) -> None:
        """Put a picture into the outbox; the next one waits until this one was seen."""
        self._picture, self.unseen, self.pictured_s = picture, picture.number, now_s
        self._something.set()

    def seen(self, number: int) -> None:
        """The client has shown a picture."""
        if number == self.unseen:
            self.unseen = None

    def may_speak(self, now_s: float) -> bool:
        """Whether a message comes within the rate that is allowed."""
        self._allowance = min(BURST, self._allowance + RATE_HZ * (now_s - self._allowed_at_s)) - 1.0
        self._allowed_at_s = now_s
        if self._allowance >= 0.0:
            return True
        self._allowance = 0.0
        self.throttled += 1
        return False

    async def send_all(self, clock: asyncio.AbstractEventLoop) -> None:
        """Send what is in the outbox, for as long as the connection lasts: words first, then state, then picture."""
        while True:
            await self._something.wait()
            self._something.clear()
            while (message := self._next()) is not None:
                self.sending_since_s = clock.time()
                await self.connection.send(message)
                self.sending_since_s = None

    def _next(self) -> str | bytes | None:
        if self._words:
            return self._words.popleft()
        if self._state is not None:
            state, self._state = self._state, None
            return state
        if self._picture is not None:
            picture, self._picture = self._picture, None
            return picture.message()
        return None


PICTURE_EVERY_S = 1.0 / 15.0
OLD_S = 0.3
"""A picture that no client could take for this time is rendered again."""


async def show_pictures(show: ViewModel, clients: Callable[[], Iterable[Client]], seen: asyncio.Event) -> None:
    """Render pictures while a page can show them, until cancelled.

    `show`: its `picture` is called in a thread. `clients`: who may look now. `seen`: set when a client has shown a
    picture.
    """
    clock = asyncio.get_running_loop()
    while True:
        due_s = clock.time() + PICTURE_EVERY_S
        if any(client.will_look(clock.time()) for client in clients()):
            with contextlib.suppress(Exception):  # a picture that fails is one less
                picture = await asyncio.to_thread(show.picture)
                drawn_s = clock.time()
                while picture is not None and clock.time() < drawn_s + OLD_S:
                    seen.clear()
                    ready = [client for client in clients() if client.looks]
                    for client in ready:
                        client.picture(picture, clock.time())
                    if ready:
                        break
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(seen.wait(), drawn_s + OLD_S - clock.time())
        await asyncio.sleep(max(due_s - clock.time(), 0.005))

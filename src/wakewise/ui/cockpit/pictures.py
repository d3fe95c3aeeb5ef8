"""When pictures are drawn and to whom they go: one is under way per client, and the next one is drawn meanwhile."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable

from wakewise.ui.cockpit.client import Client
from wakewise.ui.cockpit.view_model import ViewModel

PICTURE_EVERY_S = 1.0 / 15.0
OLD_S = 0.3
"""A picture that nobody could take for so long is drawn anew."""


async def show_pictures(show: ViewModel, clients: Callable[[], Iterable[Client]], seen: asyncio.Event) -> None:
    """Draw pictures for as long as somebody looks, until cancelled.

    Parameters
    ----------
    show : ViewModel
        Its `picture` is called in a thread.
    clients : callable
        Who may look now.
    seen : asyncio.Event
        Set when a client has shown a picture.
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

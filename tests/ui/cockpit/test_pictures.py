"""The next picture is drawn while the last one is on its way, and none for those who do not look."""

from __future__ import annotations

import asyncio
import time
from typing import Any, cast

from wakewise.ui.cockpit.client import OLD_S, SEEN_WITHIN_S, Client, show_pictures
from wakewise.ui.cockpit.view_model import CameraPicture, ViewModel


class Drawn:
    """A show that numbers its pictures."""

    def __init__(self) -> None:
        self.number = 0

    def picture(self) -> CameraPicture:
        self.number += 1
        return CameraPicture(number=self.number, time_s=0.0, jpeg=b"\xff\xd8")


def looked_at(frames_seen: int, then_s: float) -> tuple[int, int | None, int]:
    """Number drawn for a client that has seen so many pictures, what it has not seen, and drawn `then_s` later."""

    async def fly() -> tuple[int, int | None, int]:
        show, seen = Drawn(), asyncio.Event()
        client = Client(connection=cast("Any", None), id="c", greeted=True)
        task = asyncio.create_task(show_pictures(cast("ViewModel", show), lambda: [client], seen))
        for _ in range(frames_seen):
            while client.unseen is None:
                await asyncio.sleep(0.001)
            client._picture = None  # it was sent
            client.seen(client.unseen)
            seen.set()
        ends_s = time.monotonic() + SEEN_WITHIN_S
        while show.number < frames_seen + 2 and time.monotonic() < ends_s:
            await asyncio.sleep(0.005)
        await asyncio.sleep(0.1)
        first = show.number
        await asyncio.sleep(then_s)
        task.cancel()
        return first, client.unseen, show.number

    return asyncio.run(fly())


def test_a_picture_is_drawn_ahead_but_not_sent() -> None:
    """After three were seen the fourth is under way and the fifth is ready: it waits for a word of the fourth."""
    drawn, unseen, _ = looked_at(3, 0.0)
    assert unseen == 4
    assert drawn == 5


def test_a_page_that_shows_nothing_costs_no_pictures() -> None:
    """A hidden page leaves its picture unseen: after a moment nothing is drawn for it any more."""
    _, unseen, drawn = looked_at(0, 2.0 * (SEEN_WITHIN_S + OLD_S))
    assert unseen == 1
    assert drawn <= 3

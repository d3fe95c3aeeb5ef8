"""What of a session is worth a line in its journal: changes of the vehicle and of who speaks to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from wakewise_ardusub.link.message_state import LinkState
from wakewise_ardusub.link.session_log import SessionLog

TOLD_EVERY_S = 0.5
"""News of one kind are written down no more often, but for changes of state."""


class EventLogger:
    """Writes into a journal, if there is one."""

    def __init__(self, journal: SessionLog | None, clock: Callable[[], float]) -> None:
        self._journal, self._clock = journal, clock
        self._due: dict[str, tuple[float, int]] = {}
        self._jump = ""

    def tell(self, event: str, **told: Any) -> None:
        """A line; what is told over and over only now and then, with how often it was left out."""
        if self._journal is None:
            return
        now_s = self._clock()
        due_s, left_out = self._due.get(event, (-math.inf, 0))
        if event != "state" and now_s < due_s:
            self._due[event] = (due_s, left_out + 1)
            return
        self._due[event] = (now_s + TOLD_EVERY_S, 0)
        self._journal.write(event, **told, **({"left_out": left_out} if left_out else {}))

    def changed(self, before: LinkState, after: LinkState, jump: str) -> None:
        """What a message changed; `jump` is what was last said of a clock."""
        if (before.armed, before.mode) != (after.armed, after.mode):
            self.tell("vehicle", armed=after.armed, mode=after.mode_name)
        if after.duplicate_s != before.duplicate_s and before.duplicate != after.duplicate:
            self.tell("rival", words=after.duplicate)
        if after.takeover_s != before.takeover_s:
            self.tell("takeover", words=after.takeover)
        if after.camera_s != before.camera_s:
            self.tell("camera", words=after.camera)
        if after.status != before.status:
            self.tell("status", words=after.status)
        if jump != self._jump:
            self._jump = jump
            self.tell("clock", words=jump)
        if set(before.ground) != set(after.ground):
            self.tell("ground stations", systems=sorted(after.ground))
        if before.odd != after.odd:
            self.tell("nonsense", message=after.odd[-1])

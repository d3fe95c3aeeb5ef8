"""When photographs are taken in a flight by hand: when somebody asks."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts

BETWEEN_S = 0.2
"""Time between two photographs at least; who asks more often is served then."""
BY_HAND = "by hand"
"""What a stretch of flight is called where the pilot has no name for it."""


class PhotoTrigger:
    """A `Timetable` that opens when asked, from any thread or by the pilot's own hands.

    A pilot may have a method `taken()`, which gives and clears what hands asked for since: "capture" is a photograph in
    the same step, "stop" the end of the flight. So both belong to the flight's time, and a flight that is flown again
    from its record has them where they were. It may also say in `leg` what it does now.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._asked = threading.Event()
        self._last_s = -math.inf
        self.time_s = 0.0
        self.over = False

    def ask(self) -> None:
        """Have a photograph taken at the next step."""
        self._asked.set()

    def leg_name(self, time_s: float) -> str:  # noqa: ARG002  (of the moment that the pilot knows)
        """What the pilot says that it does."""
        return str(getattr(self._parts.pilot, "leg", BY_HAND))

    def heed(self) -> None:
        """Take in what hands asked for since."""
        for what in getattr(self._parts.pilot, "taken", tuple)():
            if what == "capture":
                self._asked.set()
            self.over |= what == "stop"

    def shutter_s(self, number: int, time_s: float, dt_s: float) -> float | None:  # noqa: ARG002
        """Now, if a photograph was asked for and the last one is long enough ago."""
        self.time_s = time_s
        self.heed()
        if not self._asked.is_set() or time_s < self._last_s + BETWEEN_S - 1e-9:
            return None
        self._asked.clear()
        self._last_s = time_s
        return time_s

"""One clock for a log whose own may jump: computers without a battery set theirs when the network tells them."""

from __future__ import annotations

import math
from dataclasses import dataclass

BACK_S, AHEAD_S = 0.5, 3.0
"""Steps from one record to the next beyond these are questioned."""
LONGEST_PAUSE_S = 3600.0
"""Longest pause that is believed where no second clock tells of it."""
_AGREE_S = 1.0


@dataclass(frozen=True)
class ClockJump:
    """A step of the log's clock that was taken out: when, on the mended clock, and by how much."""

    time_s: float
    step_s: float


class LogClock:
    """Turns the stamps of records, in the order of the file, into seconds from the first one that never run back.

    A step back, or ahead by more than `AHEAD_S`, is a jump or a pause. The vehicle's time since boot tells which: after
    the step the mended clock goes on as that does. Where nothing tells, a step back counts as none and one ahead as a
    pause of at most `LONGEST_PAUSE_S`. A single stamp far from those about it is damage and does not count.
    """

    def __init__(self) -> None:
        self.jumps: list[ClockJump] = []
        self.first_stamp_s: float | None = None
        self._stamp_s = math.nan
        self._now_s = 0.0
        self._boot: tuple[float, float] | None = None
        self._open: tuple[float, float] | None = None
        self._ahead_s = 0.0
        self._stray: tuple[float, int] | None = None

    @property
    def now_s(self) -> float:
        """Mended time of the last record that had a stamp; 0 before the first."""
        return self._now_s

    def at(self, stamp_s: float, boot_s: float | None = None) -> float:
        """Mended time of a record by its stamp, and by the vehicle's own time since boot where it has one."""
        if self.first_stamp_s is None:
            self.first_stamp_s = self._stamp_s = stamp_s
        step = stamp_s - self._stamp_s
        if self._stray is not None:
            before_s, told = self._stray
            self._stray = None
            if -BACK_S <= stamp_s - before_s <= AHEAD_S:
                # The one record between had a damaged stamp.
                step, self._open = stamp_s - before_s, None
                del self.jumps[told:]
        last_s, self._stamp_s = self._stamp_s, stamp_s
        if self._open is not None and not -BACK_S <= step <= AHEAD_S:
            # Several steps with nothing to judge them by between count as one.
            at_s, before = self._open
            step, self._open = before + step, None
            if not -BACK_S <= step <= AHEAD_S:
                self._open = (at_s, step)
        elif not -BACK_S <= step <= AHEAD_S:
            self._open = (self._now_s, step)
            self._stray = (last_s, len(self.jumps))
        if -BACK_S <= step <= AHEAD_S:
            held = min(max(step, 0.0), self._ahead_s)
            self._ahead_s -= held
            self._now_s += max(step, 0.0) - held
        if boot_s is not None:
            if self._open is not None:
                self._settle(boot_s)
            self._boot = (boot_s, self._now_s)
        return self._now_s

    def close(self) -> None:
        """Judge a step that no time since boot came after."""
        self._settle(None)

    def _settle(self, boot_s: float | None) -> None:
        """Say what the open step was, and go on after it."""
        if self._open is None:
            return
        (at_s, step), self._open = self._open, None
        gap = None
        if boot_s is not None and self._boot is not None and boot_s >= self._boot[0]:
            late = (boot_s - self._boot[0]) - (self._now_s - self._boot[1])
            gap = max(late, 0.0)
            # A clock that never runs back stands still where it went too far.
            self._ahead_s = max(-late, 0.0)
        if gap is None or gap > LONGEST_PAUSE_S:
            gap = step if 0.0 < step <= LONGEST_PAUSE_S else 0.0
        self._now_s += gap
        if abs(step - gap) > _AGREE_S:
            self.jumps.append(ClockJump(time_s=at_s, step_s=step - gap))

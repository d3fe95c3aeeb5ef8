"""Which frames of the firmware are new: a repeat is answered again and moves nothing, a gap is counted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

LATE = 8
"""A count that is lower by no more than this came late; lower by more, the firmware was started anew."""
QUIET_S = 1.0
"""How long the firmware must have been silent before another one may take its place."""

Verdict = Literal["begin", "step", "repeat", "late", "other"]


@dataclass(frozen=True, kw_only=True)
class FrameCounter:
    """What has come so far.

    Parameters
    ----------
    last : int or None
        Count of the last new frame.
    sender : tuple of str and int, or None
        Who sent it.
    heard_s : float
        When that one was last heard.
    stepped, repeats, lost, late, starts, strangers : int
        Frames that moved the vehicle, that were resent, that never came, that came late; how often the firmware
        started; frames of others meanwhile.
    """

    last: int | None = None
    sender: tuple[str, int] | None = None
    heard_s: float = 0.0
    stepped: int = 0
    repeats: int = 0
    lost: int = 0
    late: int = 0
    starts: int = 0
    strangers: int = 0

    def take(self, frame: int, sender: tuple[str, int], now_s: float) -> tuple[FrameCounter, Verdict]:
        """What a frame is, and the count after it.

        "begin" asks for the vehicle at its start and one step, "step" for a step, "repeat" for the last answer again;
        "late" and "other" (a second firmware beside the first) ask for nothing.
        """
        if self.last is None or sender != self.sender:
            if self.last is not None and now_s - self.heard_s < QUIET_S:
                return replace(self, strangers=self.strangers + 1), "other"
            return self._begun(frame, sender, now_s), "begin"
        ahead = frame - self.last
        if ahead == 0:
            return replace(self, repeats=self.repeats + 1, heard_s=now_s), "repeat"
        if ahead > 0:
            return (
                replace(self, last=frame, stepped=self.stepped + 1, lost=self.lost + ahead - 1, heard_s=now_s),
                "step",
            )
        if -ahead <= LATE and frame > 1:
            return replace(self, late=self.late + 1, heard_s=now_s), "late"
        return self._begun(frame, sender, now_s), "begin"

    def _begun(self, frame: int, sender: tuple[str, int], now_s: float) -> FrameCounter:
        return replace(self, last=frame, sender=sender, heard_s=now_s, stepped=self.stepped + 1, starts=self.starts + 1)

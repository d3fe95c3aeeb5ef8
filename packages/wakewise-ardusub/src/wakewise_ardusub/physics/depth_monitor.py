"""Whether the autopilot's depth is the truth: its VFR_HUD, overheard, against the physics that moves it."""

from __future__ import annotations

import math
import time
from typing import Protocol

from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage, update_link_state
from wakewise_ardusub.link.protocol import DEFAULT_SYSTEM

APART_M = 0.3
"""A difference that is told: more than the simulated sensor's noise and than a fast dive between two messages."""
FRESH_S = 1.0
_MOST = 1000


class MessageSource(Protocol):
    """Where messages come from."""

    def receive(self, timeout_s: float) -> tuple[list[MavlinkMessage], int]:
        """Messages that came, and how many stretches of bytes were none."""
        ...


class DepthMonitor:
    """Compares now and then what the autopilot last said with the truth.

    Attributes
    ----------
    looks, apart : int
        How often both were known, and how often they were more than `APART_M` apart.
    off_m, most_m : float
        What the autopilot says less the truth, as last seen, and the largest without its sign; NaN before.
    """

    def __init__(self, receiving: MessageSource, system: int = DEFAULT_SYSTEM) -> None:
        self._receiving, self._known = receiving, LinkState(system=system)
        self.looks = self.apart = 0
        self.off_m = self.most_m = math.nan

    def look(self, depth_m: float | None) -> None:
        """Take what came, and compare the last of it with the depth that is true now."""
        for _ in range(_MOST):
            said, bad = self._receiving.receive(0.0)
            if not said and not bad:
                break
            for message in said:
                self._known = update_link_state(self._known, message, time.monotonic())
        fresh = time.monotonic() - self._known.depth_s < FRESH_S
        if depth_m is None or not fresh:
            self.off_m = math.nan
            return
        self.off_m = self._known.depth_m - depth_m
        self.looks += 1
        self.apart += abs(self.off_m) > APART_M
        self.most_m = max(abs(self.off_m), self.most_m) if self.looks > 1 else abs(self.off_m)

    @property
    def words(self) -> str:
        """For the status line: how far it is off, or that nothing is heard."""
        if not math.isfinite(self.off_m):
            return "autopilot's depth not heard"
        told = f"autopilot's depth {self.off_m:+.2f} m from the truth"
        told += " WRONG" if abs(self.off_m) > APART_M else ""
        return told + (f" ({self.apart} of {self.looks} looks over {APART_M:g} m)" if self.apart else "")

    def facts(self) -> dict[str, float | int | None]:
        """Figures as JSON has them."""
        most = self.most_m if math.isfinite(self.most_m) else None
        return {"depth_looks": self.looks, "depth_apart": self.apart, "depth_apart_most_m": most}

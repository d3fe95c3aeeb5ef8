"""The last minutes as the page draws them: one mean a second, so that a page opened late sees them, too."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from wakewise_ardusub.wash_meter.meter import MeterReading

KEPT_S = 600


@dataclass
class WashHistory:
    """Mean D of each second, as flown and with gentle thrusts; a second without readings is a gap."""

    weight: float
    _seconds: deque[tuple[int, float | None, float | None]] = field(default_factory=lambda: deque(maxlen=KEPT_S))
    _now: int | None = None
    _flown: list[float] = field(default_factory=list)
    _gentle: list[float] = field(default_factory=list)

    def add(self, reading: MeterReading) -> None:
        """Take in a reading."""
        second = math.floor(reading.time_s)
        if self._now is None:
            self._now = second
        while self._now < second:
            self._seconds.append((self._now, self._mean(self._flown), self._mean(self._gentle)))
            self._flown, self._gentle = [], []
            # After a pause of any length only what is kept is gone through.
            self._now = max(self._now + 1, second - KEPT_S)
        if reading.spared is not None:
            self._flown.append(reading.spared.disturbance["flown"])
            self._gentle.append(reading.spared.disturbance["gentle"])

    def told(self) -> dict[str, Any]:
        """Root mean square speeds in mm/s, oldest first; the last ended `until_s`."""
        return {
            "until_s": self._now,
            "flown_mm_s": [self._speed(d) for _, d, _ in self._seconds],
            "gentle_mm_s": [self._speed(d) for _, _, d in self._seconds],
        }

    @property
    def last(self) -> tuple[int | None, float | None, float | None]:
        """The last whole second, and its speeds in mm/s."""
        if not self._seconds:
            return None, None, None
        second, flown, gentle = self._seconds[-1]
        return second, self._speed(flown), self._speed(gentle)

    def _speed(self, disturbance: float | None) -> float | None:
        return None if disturbance is None else round(1e3 * math.sqrt(disturbance / self.weight), 3)

    @staticmethod
    def _mean(values: list[float]) -> float | None:
        return sum(values) / len(values) if values else None

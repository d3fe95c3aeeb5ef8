"""How near what must be fresh comes to its limit, and how often it was over it: what a pilot looks at who loses it."""

from __future__ import annotations

import math
from collections import Counter, deque

import numpy as np

from wakewise_ardusub.link.engagement_fsm import EngagementInputs, EngagementLimits, Transition

SPAN_S = 60.0
SHARE = 0.99
_MOST = round(SPAN_S / 0.02)
WHAT = ("pose", "sticks", "attitude")


class FreshnessMargins:
    """Ages of the last minute, looked at as often as the watch ticks, and trips.

    A trip is a fault that ended an engagement, or took back that all was well.

    Attributes
    ----------
    trips : Counter
        By the kind of fault.
    """

    def __init__(self) -> None:
        self.trips: Counter[str] = Counter()
        self._ages: deque[tuple[float, float, float]] = deque(maxlen=_MOST)

    def looked(self, facts: EngagementInputs) -> None:
        """What is known at a tick."""
        ages = (facts.pose_s, facts.operator_s, facts.telemetry_s)
        if all(map(math.isfinite, ages)):
            self._ages.append(ages)

    def told(self, change: Transition) -> None:
        """A change of state."""
        if change.kind and change.before in ("ready", "engaged"):
            self.trips[change.kind] += 1

    def p99_s(self) -> dict[str, float]:
        """The age that 99 of 100 looks of the last minute did not exceed, of each of `WHAT`; NaN before any."""
        if not self._ages:
            return dict.fromkeys(WHAT, math.nan)
        return dict(zip(WHAT, np.quantile(np.array(self._ages), SHARE, axis=0).tolist(), strict=True))

    def words(self, limits: EngagementLimits) -> str:
        """For the status line: ages in ms against their limits, and trips."""
        most = dict(zip(WHAT, (limits.pose_s, limits.operator_s, limits.telemetry_s), strict=True))
        ages = [
            f"{what} {1e3 * age_s:.0f}{'!' if age_s > most[what] else ''}"
            for what, age_s in self.p99_s().items()
            if math.isfinite(age_s)
        ]
        told = f"p99 ms {', '.join(ages)} of {1e3 * limits.pose_s:.0f}" if ages else ""
        if self.trips:
            which = ", ".join(f"{kind} {count}" for kind, count in self.trips.most_common())
            told += f"{'  ' if told else ''}trips {self.trips.total()} ({which})"
        return told

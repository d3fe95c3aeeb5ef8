"""The clock of a flight that a person is in: steps wait for their time, and how late they come is known."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from wakewise.core.arrays import Array

MOST_CATCHING_UP_S = 0.25
"""How much lost time is flown again in a hurry. A world that runs fast under a person's hands is worse than one that
lost a moment, so what is more than this is let go."""
KEPT = 3000
"""Steps that percentiles are taken over: the last minute at 50 Hz."""


class RealTimePacer:
    """Holds each step of `run_loop` back until its time has come; one thread steps, any may read.

    Parameters
    ----------
    wait : callable
        Waits so many seconds, or less where there is nothing to wait for any more.
    paced : bool
        Without it no step waits; the reaction is measured all the same.
    clock : callable
        The time in s, never set back.

    Attributes
    ----------
    behind_s : float
        How late the last step came.
    lost_s : float
        Time let go in all.
    """

    def __init__(
        self, wait: Callable[[float], object], paced: bool = True, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._wait, self._paced, self._clock = wait, paced, clock
        self._origin_s: float | None = None
        self._read_at_s = 0.0
        self._behind, self._reaction = np.zeros(KEPT), np.zeros(KEPT)
        self._steps = 0
        self.behind_s = self.lost_s = 0.0

    def pace(self, time_s: float) -> None:
        """Wait until this time of the flight; the first call says when the flight began."""
        now_s = self._clock()
        if self._origin_s is None:
            self._origin_s = now_s - time_s
        if self._paced:
            if (early_s := self._origin_s + time_s - now_s) > 0.0:
                self._wait(early_s)
                now_s = self._clock()
            late_s = max(now_s - self._origin_s - time_s, 0.0)
            if late_s > MOST_CATCHING_UP_S:
                self._origin_s += late_s
                self.lost_s += late_s
            self.behind_s = late_s
        self._read_at_s = now_s

    def due_s(self, time_s: float) -> float:
        """When this time of the flight has come, by the clock; before the first step the flight begins now."""
        return (self._clock() if self._origin_s is None else self._origin_s) + time_s

    def sent(self, time_s: float) -> None:  # noqa: ARG002  (run_loop hands it over)
        """Take note that the thrusts which answer what was read at `pace` go to the plant."""
        k = self._steps % KEPT
        self._reaction[k] = self._clock() - self._read_at_s
        self._behind[k] = self.behind_s
        self._steps += 1

    @property
    def reaction_s(self) -> float:
        """From reading the controls to the plant's thrusts, at the last step."""
        return float(self._reaction[(self._steps - 1) % KEPT]) if self._steps else 0.0

    def late_s(self, share: float = 0.99) -> float:
        """How late this share of the last steps came at most; 0 before the first."""
        return _quantile(self._behind, self._steps, share)

    def answered_s(self, share: float = 0.99) -> float:
        """Within what time this share of the last steps turned controls into thrusts, lateness included."""
        return _quantile(self._behind + self._reaction, self._steps, share)


def _quantile(ring: Array, steps: int, share: float) -> float:
    return float(np.quantile(ring[: min(steps, KEPT)], share)) if steps else 0.0

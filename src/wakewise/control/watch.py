"""The water that a method watches now: the region, and what the current, as the estimator finds it, brings to it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wakewise.arrays import Array, freeze
from wakewise.control.levers import LeverSettings, with_drift
from wakewise.interfaces import BodyState
from wakewise.targets import Region
from wakewise.wake.silt import SiltView
from wakewise.wake.view import WakeView

MOVED_M_S = 0.004
"""Change of the current at which its points are placed anew: over `DRIFT_S` it is a decimetre, a jet's width there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """What is watched for a current, shape (3,)."""

    current_W_m_s: Array
    view: WakeView

    def __post_init__(self) -> None:
        freeze(self, current_W_m_s=(3,))


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """A region with what the levers add to it but for drift, the view of it, the levers, and the bed if it counts."""

    region: Region
    view: WakeView
    levers: LeverSettings
    silt: SiltView | None = None

    def at(self, seen: Seen | None, estimate: BodyState) -> Seen:
        """What to watch now: the same as before while the current is about the same.

        The current is the one stated in the levers, else the estimate's; before that is known there is none.
        """
        current = self.current_W_m_s(estimate)
        if seen is not None and float(np.abs(current - seen.current_W_m_s).max()) <= MOVED_M_S:
            return seen
        region = with_drift(self.region, current)
        if region is self.region:
            return Seen(current_W_m_s=current, view=self.view)
        view = replace(self.view, points_W_m=region.points_W_m, weights=region.weights)
        return Seen(current_W_m_s=current, view=view)

    def current_W_m_s(self, estimate: BodyState) -> Array:
        """Current that is reckoned with, shape (3,); zero where drift does not count or nothing is known."""
        return self._believed_m_s(estimate) if self.levers.drift else np.zeros(3)

    def silt_gram(self, estimate: BodyState, thrusts_N: Array) -> Array | None:
        """What silt adds to the matrix of a mean D, shape (2 n, 2 n), after such thrusts; None where it counts not."""
        if self.silt is None:
            return None
        return self.silt.gram(estimate.X_WB, thrusts_N, self._believed_m_s(estimate))

    def _believed_m_s(self, estimate: BodyState) -> Array:
        stated, found = self.levers.drift_m_s, estimate.current_W_m_s
        if stated is not None:
            return np.array(stated, dtype=np.float64)
        return np.zeros(3) if found is None else found

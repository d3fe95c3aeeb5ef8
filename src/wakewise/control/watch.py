"""What a method watches: the region as the jets reach it, carried by the current that the estimator finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.arrays import Array
from wakewise.control.levers import LeverSettings
from wakewise.interfaces import BodyState
from wakewise.wake.carried import Flow
from wakewise.wake.view import WakeView

UNSURE = 0.2
"""Standard deviation of each component of the current along a jet's way over its speed at the vehicle, beside what the
estimator is unsure of: from the bed's own layer, where a current falls to a half, and eddies of a tenth to a fifth
(I. Nezu and H. Nakagawa, Turbulence in Open-Channel Flows, 1993)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """The view of a region with what the levers add to it, and the levers."""

    view: WakeView
    levers: LeverSettings

    def gram(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Matrix G of D = s' G s at an estimate, shape (2 n, 2 n), in the flow that it tells of."""
        return self.view.gram(estimate.X_WB, self.flow(estimate, thrusts_N))

    def flow(self, estimate: BodyState, thrusts_N: Array) -> Flow | None:
        """The current to reckon with and the thrusts, shape (n,), to reckon from; None where it does not count.

        The current is the one stated in the levers, else the estimate's; before that is known there is none.
        """
        current, found = self._believed(estimate)
        if current is None or not self.levers.drift:
            return None
        variance = 0.0 if found is None else float(np.trace(found)) / 3.0
        unsure_m_s = float(np.sqrt(variance + UNSURE**2 * float(current @ current)))
        return Flow(current_W_m_s=current, unsure_m_s=unsure_m_s, thrusts_N=thrusts_N)

    def _believed(self, estimate: BodyState) -> tuple[Array | None, Array | None]:
        """The current, shape (3,), and its covariance, shape (3, 3), None each where nothing is known or sure."""
        if self.levers.drift_m_s is not None:
            return np.array(self.levers.drift_m_s, dtype=np.float64), None
        return estimate.current_W_m_s, estimate.current_covariance

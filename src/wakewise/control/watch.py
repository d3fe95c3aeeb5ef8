"""What a method watches: the region as the jets reach it, carried by the current that the estimator finds.

Where a jet's water goes depends on how hard it is sent, so in a current the Gram matrix holds near the thrusts that it
was made with. Shares are therefore judged by the matrix of their own thrusts: those of before, the least, and what the
exact allocator makes of the matrix of either; the best of the four is flown, and the next search begins there. So
no share is flown that its own matrix calls worse than the least thrusts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation import Allocation, Layout, Weights, disturbance_of, least_thrusts
from wakewise.arrays import Array
from wakewise.control.levers import LeverSettings
from wakewise.control.thrift import Sharer
from wakewise.interfaces import BodyState
from wakewise.wake.carried import Flow
from wakewise.wake.view import WakeView

UNSURE = 0.2
"""Standard deviation of each component of the current along a jet's way over its speed at the vehicle, beside what the
estimator is unsure of: from the bed's own layer, where a current falls to a half, and eddies of a tenth to a fifth
(I. Nezu and H. Nakagawa, Turbulence in Open-Channel Flows, 1993)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """The view of a region with what the levers add to it, the levers, and what shares are weighed by."""

    view: WakeView
    levers: LeverSettings
    sharer: Sharer
    weights: Weights

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.sharer.layout

    def gram(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Matrix G of D = s' G s at an estimate, shape (2 n, 2 n), in the flow that it tells of."""
        return self.view.gram(estimate.X_WB, self.flow(estimate, thrusts_N))

    def flow(self, estimate: BodyState, thrusts_N: Array) -> Flow | None:
        """The current to reckon with and the thrusts, shape (n,), to reckon from; None where it does not count.

        The current is the one stated in the levers, else the estimate's; before that is known there is none.
        """
        current, found = self._believed(estimate)
        if current is None or not self.levers.drift or not current.any():
            return None
        variance = 0.0 if found is None else float(np.trace(found)) / 3.0
        unsure_m_s = float(np.sqrt(variance + UNSURE**2 * float(current @ current)))
        return Flow(current_W_m_s=current, unsure_m_s=unsure_m_s, thrusts_N=thrusts_N)

    def cost(self, thrusts_N: Array, gram: Array, previous_N: Array | None = None) -> float:
        """Cost of thrusts, shape (n,), by a Gram matrix; with thrusts of before, the price on change is in it."""
        weights = self.weights
        value = weights.disturbance * disturbance_of(gram, thrusts_N) + weights.effort * float(thrusts_N @ thrusts_N)
        change = None if previous_N is None else thrusts_N - previous_N
        return value if change is None else value + weights.previous * float(change @ change)

    def moved(self, wrench_B: Array, previous_N: Array) -> Array:
        """Thrusts of before with the least change that makes another wrench, shape (n,), whatever the limits."""
        return np.asarray(previous_N + self.layout.inverse @ (wrench_B - self.layout.B @ previous_N))

    def allowed(self, thrusts_N: Array) -> bool:
        """Whether thrusts, shape (n,), are within the limits."""
        return bool(np.all((thrusts_N >= self.layout.lower_N) & (thrusts_N <= self.layout.upper_N)))

    def share_out(
        self, wrench_B: Array, estimate: BodyState, previous_N: Array, *, free: bool = False
    ) -> tuple[Allocation, Array] | None:
        """The gentlest thrusts found for a wrench, and the Gram matrix that says so, shape (2 n, 2 n).

        `previous_N`, shape (n,), are the thrusts of before; `free` leaves out the price on change. None if the wake
        model gives what is not finite.
        """
        layout, weights = self.layout, replace(self.weights, previous=0.0) if free else self.weights
        before = None if free else previous_N
        moved = self.moved(wrench_B, previous_N)
        least = least_thrusts(layout, wrench_B)
        still = self.flow(estimate, previous_N) is None
        best: tuple[float, Allocation, Array] | None = None
        for guess in (moved,) if still or least.scale < 1.0 - 1e-9 else (moved, least.thrusts_N):
            G = self.gram(estimate, guess)
            if not np.isfinite(G).all():
                return None
            found = self.sharer.shares(wrench_B, G, weights, self.view.total_weight, previous_N)
            if still:
                return found, G
            choices = [(found, self.gram(estimate, found.thrusts_N))]
            if self.allowed(guess):
                choices.append((replace(found, thrusts_N=guess, wrench_B=layout.B @ guess), G))
            for choice, own in choices:
                value = self.cost(choice.thrusts_N, own, before)
                if best is None or value < best[0]:
                    best = value, choice, own
        if best is None or not np.isfinite(best[0]):
            return None
        _, chosen, own = best
        return replace(chosen, disturbance=disturbance_of(own, chosen.thrusts_N)), own

    def _believed(self, estimate: BodyState) -> tuple[Array | None, Array | None]:
        """The current, shape (3,), and its covariance, shape (3, 3), None each where nothing is known or sure."""
        if self.levers.drift_m_s is not None:
            return np.array(self.levers.drift_m_s, dtype=np.float64), None
        return estimate.current_W_m_s, estimate.current_covariance

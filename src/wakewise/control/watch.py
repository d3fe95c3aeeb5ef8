"""What a method watches: the region as the jets reach it, carried by the current that the estimator finds.

Where a jet's water goes depends on how hard it is sent, so in a current the Gram matrix holds near the thrusts that
it was made with. Shares are therefore judged by the matrix of their own thrusts. Ten times a second those of before
are held against what the exact allocator makes of their matrix, and the next search begins at the better; every two
seconds, on a step of its own, the least thrusts and what the allocator makes of theirs are looked at. So no share is
flown for longer that its own matrix calls worse than the least thrusts.

A belief is not the water. With a share of `DOUBT` a jet is held to have gone astray, and D is the mean of both beliefs:
thrusts that are harmless only if all goes as reckoned are no longer free. What shares may cost is asked of the first
belief alone (`thrift`): the second is about the same wherever a vehicle hovers near a target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation import Allocation, Layout, Weights, disturbance_of, min_norm_allocation
from wakewise.control.levers import LeverSettings
from wakewise.control.thrift import Sharer
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.influence import InfluenceMatrices, InfluenceModel

UNSURE = 0.55
"""Standard deviation of how far the current takes a jet's water over what is reckoned, beside what the estimator is
unsure of. Of this 0.2 is the current's own, along the way: from the bed's layer, where it falls to a half, and eddies
of a tenth to a fifth (I. Nezu and H. Nakagawa, Turbulence in Open-Channel Flows, 1993). The rest is time: what a
controller sends is pushes of a second as often as jets, and a push needs longer. Its front goes as t^(1/4) once it is
cut off (J. M. Richards, Int. J. Mech. Sci. 7 (1965) 61), a jet's as t^(1/2), so it is on its way once to twice as long,
half as long again in the mean, give or take half."""

DOUBT = 0.3
"""Share of belief that a jet has gone astray (see `wakewise.wake.disturbance`) rather than where it is reckoned to go.
Of 64 single pushes the belief has the order right to .73 (docs/research-log/0048). Set before any flight of it; .6 and
.9
flew as gently for more power (docs/research-log/0070)."""

WORTH = 0.05
"""Share of the cost that a jump must save: less is within what a wake model may claim to know."""
EVERY_S = 0.1
"""Time between two searches for the best shares: the planner's own, and a thruster's lag."""
JUMP_EVERY_S = 2.0
"""Time between two looks for better shares elsewhere: the planner's horizon."""
APART_S = 0.04
"""Plan, shares and jumps are made so long after one another, so that no step has two of them."""
FULL = 1.0 - 1e-9
"""Shares of a wrench above this are all of it, but for rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """The view of a region with what the levers add to it, the levers, and what shares are weighed by."""

    view: InfluenceModel
    levers: LeverSettings
    sharer: Sharer
    weights: Weights

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.sharer.layout

    def gram(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Matrix G of D = s' G s at an estimate, shape (2 n, 2 n), in the flow that it tells of: what is reckoned."""
        return self.view.seen(estimate.X_WB, self.flow(estimate, thrusts_N)).gram

    def seen(self, estimate: BodyState, thrusts_N: Array) -> InfluenceMatrices:
        """Matrices of D at an estimate, in the flow that it tells of: to choose shares by, and of thrusts as sent.

        To choose by, their mean over both beliefs: jets that go where they are reckoned to, and jets that have gone
        astray. As sent, the first alone: a doubt is a reason to choose, but no wash that would be worth power.
        """
        seen = self.view.seen(estimate.X_WB, self.flow(estimate, thrusts_N))
        astray = self.view.astray(estimate.X_WB) if self.levers.doubt else None
        if astray is None:
            return seen
        return InfluenceMatrices(gram=(1.0 - DOUBT) * seen.gram + np.diag(DOUBT * astray), sent=seen.sent)

    def flow(self, estimate: BodyState, thrusts_N: Array) -> CrossFlow | None:
        """The current to reckon with and the thrusts, shape (n,), to reckon from; None where it does not count.

        The current is the one stated in the levers, else the estimate's; before that is known there is none.
        """
        current, found = self._believed(estimate)
        if current is None:
            return None
        variance = 0.0 if found is None else float(found.trace()) / 3.0
        unsure_m_s = math.sqrt(variance + UNSURE**2 * float(current @ current))
        return CrossFlow(current_W_m_s=current, unsure_m_s=unsure_m_s, thrusts_N=thrusts_N)

    def cost(self, thrusts_N: Array, gram: Array, previous_N: Array | None = None) -> float:
        """What shares of a wrench, shape (n,), are compared by under a Gram matrix: their cost and their power.

        With thrusts of before, the price on change is in it.
        """
        weights = self.weights
        value = weights.disturbance * disturbance_of(gram, thrusts_N) + weights.effort * float(thrusts_N @ thrusts_N)
        if previous_N is not None:
            change = thrusts_N - previous_N
            value += weights.previous * float(change @ change)
        return self.sharer.worth(value, thrusts_N, weights, self.view.total_weight)

    def moved(self, wrench_B: Array, previous_N: Array) -> Array:
        """Thrusts of before with the least change that makes another wrench, shape (n,), whatever the limits."""
        return np.asarray(previous_N + self.layout.inverse @ (wrench_B - self.layout.B @ previous_N))

    def allowed(self, thrusts_N: Array) -> bool:
        """Whether thrusts, shape (n,), are within the limits."""
        return bool(np.all((thrusts_N >= self.layout.lower_N) & (thrusts_N <= self.layout.upper_N)))

    def share_out(
        self, wrench_B: Array, estimate: BodyState, previous_N: Array
    ) -> tuple[Allocation, InfluenceMatrices] | None:
        """Gentle thrusts for a wrench, near those of before, and the matrices that say so.

        The gentler of two: those of before, `previous_N`, shape (n,), with the least change, and what the exact
        allocator makes of their matrix. None if the wake model gives what is not finite.
        """
        moved = self.moved(wrench_B, previous_N)
        before = self.seen(estimate, moved)
        if not np.isfinite(before.gram).all():
            return None
        found = self.follow(wrench_B, before, previous_N)
        if self._believed(estimate)[0] is None:
            return found, before
        after = self.seen(estimate, found.thrusts_N)
        if self.allowed(moved):
            stays = self.cost(moved, before.gram, previous_N)
            if not self.cost(found.thrusts_N, after.gram, previous_N) < stays:
                return self.as_found(wrench_B, before, moved), before
        if not np.isfinite(after.gram).all():
            return None
        return replace(found, disturbance=disturbance_of(after.gram, found.thrusts_N)), after

    def follow(self, wrench_B: Array, seen: InfluenceMatrices, previous_N: Array) -> Allocation:
        """Gentle thrusts for a wrench that may have changed since the matrices were made.

        Least changes would send the noise of the wrench through thrusters that rest because they blow at the target.
        """
        return self.sharer.shares(wrench_B, seen, self.weights, self.view.total_weight, previous_N)

    def as_found(self, wrench_B: Array, seen: InfluenceMatrices, thrusts_N: Array) -> Allocation:
        """Thrusts within limits that make the wrench, shape (n,), as if they had been looked for."""
        return Allocation(
            thrusts_N=thrusts_N,
            wrench_B=self.layout.B @ thrusts_N,
            requested_B=wrench_B,
            disturbance=disturbance_of(seen.gram, thrusts_N),
            method="moved",
            gap=0.0,
            scale=1.0,
        )

    def jump(
        self, wrench_B: Array, estimate: BodyState, present_N: Array, present: InfluenceMatrices | None = None
    ) -> tuple[Allocation, InfluenceMatrices] | None:
        """Other thrusts for a wrench, better by more than `WORTH` than those that make it now; None if there are none.

        Without a price on change, from the least thrusts on: the price keeps shares near to the last ones, and for good
        where another minimum lies apart. `present_N`, shape (n,), must make the wrench; `present` are their matrices,
        where known from the last search.
        """
        least = min_norm_allocation(self.layout, wrench_B)
        first = self.seen(estimate, present_N) if present is None else present
        there = self.seen(estimate, least.thrusts_N)
        if not (np.isfinite(first.gram).all() and np.isfinite(there.gram).all()):
            return None
        free = replace(self.weights, previous=0.0)
        found = self.sharer.shares(wrench_B, there, free, self.view.total_weight)
        own = there if self._believed(estimate)[0] is None else self.seen(estimate, found.thrusts_N)
        best, seen = min(((least, there), (found, own)), key=lambda pair: self.cost(pair[0].thrusts_N, pair[1].gram))
        if best.scale < FULL or not self.cost(best.thrusts_N, seen.gram) < (1.0 - WORTH) * self.cost(
            present_N, first.gram
        ):
            return None
        return replace(best, disturbance=disturbance_of(seen.gram, best.thrusts_N)), seen

    def _believed(self, estimate: BodyState) -> tuple[Array | None, Array | None]:
        """The current, shape (3,), and its covariance, shape (3, 3); None each where it does not count or is sure."""
        stated, found = self.levers.drift_m_s, estimate.current_covariance
        current = estimate.current_W_m_s if stated is None else np.array(stated, dtype=np.float64)
        if current is None or not self.levers.drift or not current.any():
            return None, None
        return current, found if stated is None else None

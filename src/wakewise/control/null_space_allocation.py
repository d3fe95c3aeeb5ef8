"""Null-space allocation: of all thrusts that make a wrench, those whose jets disturb the target least.

An `AllocationContext` is the region as the jets reach it: carried by the current that the estimator finds, with
merging jets where the settings say so. An `Allocator` searches with it at the rate of the plans and follows the wrench
in between; without a context it takes the least thrusts (pseudo-inverse).

In a current the Gram matrix depends on the thrusts: how far a jet is carried depends on how hard it is sent. So thrusts
are judged by the matrix of their own. Each search (10 Hz) compares the thrusts of before with what the exact allocator
makes of their matrix, and the next begins at the better. Every 2 s, on a step of its own, a restart compares the least
thrusts and what the allocator makes of theirs. The price on change keeps thrusts near the last ones; the restart leaves
a minimum that is poor. So no thrusts are flown longer than that which their own matrix rates worse than the least ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wakewise.allocation import (
    Allocation,
    Layout,
    PowerBoundedAllocator,
    PowerLaw,
    Weights,
    compile_layout,
    disturbance_of,
    min_norm_allocation,
)
from wakewise.control.settings import PREVIOUS_SHARE, AllocationSettings, ControlSettings
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, WakeModel
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.influence import InfluenceMatrices, InfluenceModel, with_merging_jets

if TYPE_CHECKING:
    from wakewise.control.pipeline import PipelineState

CURRENT_SPREAD = 0.55
"""Standard deviation of how far the current takes a jet's water over what is expected, beside what the estimator is
unsure of. Of this 0.2 is the current's own, along the way: from the bed's layer, where it falls to a half, and eddies
of a tenth to a fifth (I. Nezu and H. Nakagawa, Turbulence in Open-Channel Flows, 1993). The rest is time: what a
controller sends is pushes of a second as often as jets, and a push needs longer. Its front goes as t^(1/4) once it is
cut off (J. M. Richards, Int. J. Mech. Sci. 7 (1965) 61), a jet's as t^(1/2), so it is on its way once to twice as long,
half as long again in the mean, give or take half."""
RESTART_GAIN = 0.05
"""Share of the cost that a restart must save: less is within what a wake model may claim to know."""
SEARCH_S = 0.1
"""Time between two searches: the planner's own, and a thruster's lag."""
RESTART_S = 2.0
"""Time between two restarts: the planner's horizon."""
STAGGER_S = 0.04
"""Plan, search and restart are made so long after one another, so that no step has two of them."""
FULL = 1.0 - 1e-9
"""Shares of a wrench above this are all of it, but for rounding."""
STANDING_W = 2.0
"""Power beside that of the thrusters against which shares of power are measured: 1 to 2 W are not worth saving. Well
below what computer, camera and lights draw, since a flight's bound on energy counts thrusters alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AllocationContext:
    """The region as the jets reach it, the settings that add to it, and what thrusts are compared by."""

    view: InfluenceModel
    settings: AllocationSettings
    allocator: PowerBoundedAllocator
    weights: Weights

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.allocator.layout

    def gram(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Matrix G of D = s' G s, shape (2 n, 2 n), at an estimate and in its current, by the wake model alone."""
        return self.view.matrices(estimate.X_WB, self.flow(estimate, thrusts_N)).gram

    def influence(self, estimate: BodyState, thrusts_N: Array) -> InfluenceMatrices:
        """Matrices of D at an estimate and in its current: to choose thrusts by, and of thrusts as sent."""
        return self.view.matrices(estimate.X_WB, self.flow(estimate, thrusts_N))

    def flow(self, estimate: BodyState, thrusts_N: Array) -> CrossFlow | None:
        """The current, and the thrusts, shape (n,), whose jets it carries; None where it does not count.

        The current is the one stated in the settings, else the estimate's; before that is known there is none.
        """
        current, found = self._current(estimate)
        if current is None:
            return None
        variance = 0.0 if found is None else float(found.trace()) / 3.0
        current_std_m_s = math.sqrt(variance + CURRENT_SPREAD**2 * float(current @ current))
        return CrossFlow(current_W_m_s=current, current_std_m_s=current_std_m_s, thrusts_N=thrusts_N)

    def cost(self, thrusts_N: Array, gram: Array, previous_N: Array | None = None) -> float:
        """What thrusts of one wrench, shape (n,), are compared by under a Gram matrix: their cost and their power.

        With thrusts of before, the price on change is in it.
        """
        weights = self.weights
        value = weights.disturbance * disturbance_of(gram, thrusts_N) + weights.effort * float(thrusts_N @ thrusts_N)
        if previous_N is not None:
            change = thrusts_N - previous_N
            value += weights.previous * float(change @ change)
        return self.allocator.adjusted_cost(value, thrusts_N, weights, self.view.total_weight)

    def least_change(self, wrench_B: Array, previous_N: Array) -> Array:
        """Thrusts of before with the least change that makes another wrench, shape (n,), whatever the limits."""
        return np.asarray(previous_N + self.layout.inverse @ (wrench_B - self.layout.B @ previous_N))

    def within_limits(self, thrusts_N: Array) -> bool:
        """Whether thrusts, shape (n,), are within the limits."""
        return bool(np.all((thrusts_N >= self.layout.lower_N) & (thrusts_N <= self.layout.upper_N)))

    def search(
        self, wrench_B: Array, estimate: BodyState, previous_N: Array
    ) -> tuple[Allocation, InfluenceMatrices] | None:
        """Gentle thrusts for a wrench, near those of before, and the matrices that say so.

        The gentler of two: those of before, `previous_N`, shape (n,), with the least change, and what the exact
        allocator makes of their matrix. None if the wake model gives what is not finite.
        """
        moved = self.least_change(wrench_B, previous_N)
        before = self.influence(estimate, moved)
        if not np.isfinite(before.gram).all():
            return None
        found = self.follow(wrench_B, before, previous_N)
        if self._current(estimate)[0] is None:
            return found, before
        after = self.influence(estimate, found.thrusts_N)
        if self.within_limits(moved):
            stays = self.cost(moved, before.gram, previous_N)
            if not self.cost(found.thrusts_N, after.gram, previous_N) < stays:
                return self.as_found(wrench_B, before, moved), before
        if not np.isfinite(after.gram).all():
            return None
        return replace(found, disturbance=disturbance_of(after.gram, found.thrusts_N)), after

    def follow(self, wrench_B: Array, influence: InfluenceMatrices, previous_N: Array) -> Allocation:
        """Gentle thrusts for a wrench that may have changed since the matrices were made.

        Least changes would send the noise of the wrench through thrusters that rest because they blow at the target.
        """
        return self.allocator.allocate(
            wrench_B, influence.gram, influence.actual, self.weights, self.view.total_weight, previous_N
        )

    def as_found(self, wrench_B: Array, influence: InfluenceMatrices, thrusts_N: Array) -> Allocation:
        """Thrusts within limits that make the wrench, shape (n,), as the result of a search."""
        return Allocation(
            thrusts_N=thrusts_N,
            wrench_B=self.layout.B @ thrusts_N,
            requested_B=wrench_B,
            disturbance=disturbance_of(influence.gram, thrusts_N),
            method="moved",
            gap=0.0,
            scale=1.0,
        )

    def restart(
        self, wrench_B: Array, estimate: BodyState, present_N: Array, present: InfluenceMatrices | None = None
    ) -> tuple[Allocation, InfluenceMatrices] | None:
        """Other thrusts for a wrench, better by more than `RESTART_GAIN` than those that make it now; else None.

        From the least thrusts on and without a price on change. `present_N`, shape (n,), must make the wrench;
        `present` are their matrices, where known from the last search.
        """
        least = min_norm_allocation(self.layout, wrench_B)
        first = self.influence(estimate, present_N) if present is None else present
        there = self.influence(estimate, least.thrusts_N)
        if not (np.isfinite(first.gram).all() and np.isfinite(there.gram).all()):
            return None
        free = replace(self.weights, previous=0.0)
        found = self.allocator.allocate(wrench_B, there.gram, there.actual, free, self.view.total_weight)
        own = there if self._current(estimate)[0] is None else self.influence(estimate, found.thrusts_N)
        best, seen = min(((least, there), (found, own)), key=lambda pair: self.cost(pair[0].thrusts_N, pair[1].gram))
        if best.scale < FULL or not self.cost(best.thrusts_N, seen.gram) < (1.0 - RESTART_GAIN) * self.cost(
            present_N, first.gram
        ):
            return None
        return replace(best, disturbance=disturbance_of(seen.gram, best.thrusts_N)), seen

    def _current(self, estimate: BodyState) -> tuple[Array | None, Array | None]:
        """The current, shape (3,), and its covariance, shape (3, 3); None each where it does not count or is sure."""
        stated, found = self.settings.current_m_s, estimate.current_covariance
        current = estimate.current_W_m_s if stated is None else np.array(stated, dtype=np.float64)
        if current is None or not self.settings.advection or not current.any():
            return None, None
        return current, found if stated is None else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Allocator:
    """Stage 4 of the pipeline: thrusts for a wrench, step by step.

    With a `context`, thrusts of least cost; without, the least thrusts, whose D is that of `view` (None: nobody asks).
    `first_age_s` is the age that the first search is given, so that later ones fall between two plans.
    """

    layout: Layout
    context: AllocationContext | None = None
    view: InfluenceModel | None = None
    search_s: float = SEARCH_S
    first_age_s: float = 0.0

    def allocate(
        self, state: PipelineState, wrench_B: Array, estimate: BodyState, dt_s: float
    ) -> tuple[PipelineState, Allocation | None]:
        """Thrusts that make a wrench, shape (6,), within limits; None if the wake model gives what is not finite."""
        if self.context is None:
            return state, self._least(wrench_B, estimate)
        age_s, restart_age_s = state.search_age_s + dt_s, state.restart_age_s + dt_s
        held = state.influence
        if held is None or age_s + 1e-6 >= self.search_s:
            shared = self.context.search(wrench_B, estimate, state.thrusts_N)
            if shared is None:
                return state, None
            found, influence = shared
            return replace(
                state,
                influence=influence,
                disturbance=found.disturbance,
                search_age_s=0.0 if math.isfinite(age_s) else self.first_age_s,
                restart_age_s=restart_age_s,
            ), found
        moved = self.context.least_change(wrench_B, state.thrusts_N)
        due = restart_age_s + 1e-6 >= RESTART_S and age_s + 1e-6 >= STAGGER_S
        if not (due and self.context.within_limits(moved)):
            found = self.context.follow(wrench_B, held, state.thrusts_N)
            return replace(state, search_age_s=age_s, restart_age_s=restart_age_s), found
        # Such a step has no time to share the change out, too.
        state = replace(state, search_age_s=age_s, restart_age_s=0.0)
        better = self.context.restart(wrench_B, estimate, moved, held)
        if better is None:
            return state, self.context.as_found(wrench_B, held, moved)
        found, influence = better
        return replace(state, influence=influence, disturbance=found.disturbance), found

    def _least(self, wrench_B: Array, estimate: BodyState) -> Allocation | None:
        if self.view is None:
            return min_norm_allocation(self.layout, wrench_B)
        gram = self.view.gram(estimate.X_WB)
        return min_norm_allocation(self.layout, wrench_B, gram) if np.isfinite(gram).all() else None


def vehicle_layout(vehicle: Vehicle) -> Layout:
    """Allocation matrix and limits of a vehicle, ready for use."""
    return compile_layout(vehicle.allocation_matrix, vehicle.thrust_lower_N, vehicle.thrust_upper_N)


def power_law(vehicle: Vehicle) -> PowerLaw:
    """Electrical power of a vehicle's thrusters as it is believed; below their least thrusts they run in pulses."""
    one = np.ones(len(vehicle.thrusters))
    forward_N, reverse_N = vehicle.least_thrusts_N
    return PowerLaw(
        forward=electrical_power_W(one, vehicle.disk_areas_m2),
        reverse=electrical_power_W(-one, vehicle.disk_areas_m2),
        least_forward_N=forward_N,
        least_reverse_N=reverse_N,
        standing_W=STANDING_W,
    )


def weights_of(settings: ControlSettings, total_weight: float) -> Weights:
    """Weights of an allocation; D over the points' total weight, so that their number does not matter."""
    return Weights(
        disturbance=settings.w_disturbance / total_weight,
        effort=settings.w_effort,
        previous=PREVIOUS_SHARE * settings.w_effort,
    )


def allocation_context(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> AllocationContext:
    """The context of a vehicle near a region, with the weights and the wake terms of its settings.

    Arguments as for `make_controller`; `region` with the points of the bed, `wake` with the bed if they are to count.
    """
    layout = vehicle_layout(vehicle)
    view = InfluenceModel.of(vehicle, region, wake, settings.superposition)
    return AllocationContext(
        view=with_merging_jets(view, layout) if settings.allocation.merging_jets else view,
        settings=settings.allocation,
        allocator=PowerBoundedAllocator(
            layout=layout,
            law=power_law(vehicle) if settings.allocation.power_limit else None,
            excess=settings.allocation.power_excess,
        ),
        weights=weights_of(settings, view.total_weight),
    )


def least_thrust_allocator(
    layout: Layout, vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> Allocator:
    """Least thrusts of a layout; the wake model is only asked what D they cause."""
    return Allocator(layout=layout, view=InfluenceModel.of(vehicle, region, wake, settings.superposition))


def single_jet_allocator(vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings) -> Allocator:
    """Gentle thrusts of each step by itself, by single jets in still water: what flies where there is no plan.

    Least thrusts where D has no weight: what a planner without a disturbance term falls back on is `dp`.
    """
    if settings.w_disturbance == 0.0:
        return least_thrust_allocator(vehicle_layout(vehicle), vehicle, region, wake, settings)
    still = settings.model_copy(
        update={"allocation": settings.allocation.model_copy(update={"merging_jets": False, "advection": False})}
    )
    context = allocation_context(vehicle, region, wake, still)
    return Allocator(layout=context.layout, context=context, search_s=0.0)

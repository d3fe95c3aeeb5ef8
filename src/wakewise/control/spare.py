"""Spare thrusts shared out anew at every step, with what single jets do not show: jets that meet, and the bed.

Two jets that cross at less than 120 deg join and run on along the sum of their momenta (conservation of momentum; the
angle is that above which they rather turn aside, as jets that blow at each other do). The two forward jets of a
vectored layout cross a decimetre ahead of the bow, and what they become goes where the camera looks, although neither
jet alone comes near the target. In the tank this was most of the water's motion at a target downstream of a hover.

As a term of D. Of jets a and b with T_a = T_b = 1 N the joined jet carries |e_a + e_b| N of momentum along
e_a + e_b. With unequal thrusts it turns towards the stronger, and without one of them there is none; the geometric mean
sqrt(T_a T_b) = s_a s_b vanishes in the same way and keeps D a quadratic form of s, so the exact allocators of this room
take it as it is: it is an entry of G off the diagonal. It errs on the safe side where thrusts are unequal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wakewise.allocation import Allocation, Layout, Weights
from wakewise.arrays import Array, IntArray
from wakewise.control.loop import vehicle_layout
from wakewise.control.settings import PREVIOUS_SHARE, ControlSettings
from wakewise.control.thrift import Sharer, power_law
from wakewise.control.watch import Watch
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Command, Controller, Goal, WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import AxialJet, free_jet
from wakewise.wake.carried import Flow
from wakewise.wake.disturbance import carried_velocity
from wakewise.wake.view import WakeView

LEAST_COSINE = -0.5
"""Cosine of 120 deg: jets that cross at more turn aside rather than join."""
HALF_WIDTH_SLOPE = 0.096
"""Half-speed radius of a round jet over the distance along it (see `wakewise.wake.RoundJet`)."""
EVERY_S = 0.1
"""Time between two searches for the best shares: the planner's own, and a thruster's lag."""
FREE_EVERY_S = 2.0
"""Time between two searches without a price on change: the planner's horizon."""
WORTH = 0.05
"""Share of the cost that a jump must save: less is within what a wake model may claim to know."""
_PARALLEL = 0.999
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class MeetingView(WakeView):
    """A `WakeView` whose Gram matrix also holds what pairs of jets become where they meet.

    Parameters
    ----------
    pairs : tuple of (int, int)
        Thrusters whose jets are looked at.
    """

    pairs: tuple[tuple[int, int], ...] = field(default=())

    def gram(self, X_WB: Pose, flow: Flow | None = None) -> Array:
        """Matrix G of D = s' G s, shape (2 n, 2 n); what two jets become is carried as they are."""
        G = np.array(super().gram(X_WB, flow))
        origins, axes = X_WB.apply(self.positions_B_m), self.axes_B @ X_WB.R.T
        met = joined_jets(origins, axes, self.pairs)
        if len(met.share):
            areas = self.areas_m2[met.first % len(self.areas_m2)]
            jets = (self.points_W_m, met.origins_m, met.directions, areas)
            if flow is None or not isinstance(free_jet(self.wake), AxialJet):
                speed = self.wake.unit_velocity(*jets)
            else:
                pushed = met.momentum * np.sqrt(flow.guessed[met.first] * flow.guessed[met.second])
                speed = carried_velocity(self.wake, *jets, pushed, flow)
            D = met.momentum * met.share * np.einsum("n,inx,inx->i", self.weights, speed, speed)
            np.add.at(G, (met.first, met.second), 0.5 * D)
            np.add.at(G, (met.second, met.first), 0.5 * D)
        return G


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedJets:
    """Jets made of two, of m pairs of slots (slot i is thruster i with T > 0, slot n + i the same with T < 0).

    `origins_m`, shape (m, 3), lie as far behind the place of meeting as the two jets came on average, so that the
    joined jet is as wide there as they are; `directions`, shape (m, 3); `momentum`, shape (m,), over that of one of
    two equal jets; `share`, shape (m,), tells how squarely they meet: 1/2 where their axes pass one half-width apart.
    """

    first: IntArray
    second: IntArray
    origins_m: Array
    directions: Array
    momentum: Array
    share: Array


def joined_jets(origins_m: Array, axes: Array, pairs: tuple[tuple[int, int], ...]) -> JoinedJets:
    """Which jets meet and what they become, from disks, shape (n, 3), and force axes, shape (n, 3), in any frame."""
    n = len(origins_m)
    wanted = [(a, b) for i, j in pairs for a in (i, i + n) for b in (j, j + n)]
    first, second = np.array(wanted, dtype=np.int64).reshape(-1, 2).T
    directions, places = np.concatenate([-axes, axes]), np.concatenate([origins_m, origins_m])
    d, e, r = directions[first], directions[second], places[second] - places[first]
    cosine = np.einsum("ix,ix->i", d, e)
    usable = (cosine > LEAST_COSINE) & (cosine < _PARALLEL)
    sine2 = np.where(usable, 1.0 - cosine**2, 1.0)
    along, across = np.einsum("ix,ix->i", r, d), np.einsum("ix,ix->i", r, e)
    # Distances along both jets to where their axes come closest.
    x, y = (along - cosine * across) / sine2, (cosine * along - across) / sine2
    usable &= (x > 0.0) & (y > 0.0)
    here, there = places[first] + x[:, None] * d, places[second] + y[:, None] * e
    width = np.maximum(HALF_WIDTH_SLOPE * (x + y), 1e-9)
    share = np.exp(-np.log(2.0) * np.einsum("ix,ix->i", there - here, there - here) / width**2)
    usable &= share > _LEAST_SHARE
    total = d + e
    momentum = np.maximum(np.linalg.norm(total, axis=1), 1e-9)
    onward = total / momentum[:, None]
    start = 0.5 * (here + there) - 0.5 * (x + y)[:, None] * onward
    return JoinedJets(
        first=first[usable],
        second=second[usable],
        origins_m=np.ascontiguousarray(start[usable]),
        directions=np.ascontiguousarray(onward[usable]),
        momentum=momentum[usable],
        share=share[usable],
    )


def meeting_pairs(layout: Layout) -> tuple[tuple[int, int], ...]:
    """Pairs of thrusters that share a part of the null space.

    Only there can the allocation choose between them; other pairs would tie together parts that are searched exactly.
    """
    moves = [np.flatnonzero(np.any(np.abs(block) > 1e-12, axis=1)) for block in layout.blocks]
    return tuple(sorted({(int(i), int(j)) for own in moves for i in own for j in own if i < j}))


def meeting_view(view: WakeView, layout: Layout) -> MeetingView:
    """The same view with jets that meet."""
    return MeetingView(
        wake=view.wake,
        points_W_m=view.points_W_m,
        weights=view.weights,
        positions_B_m=view.positions_B_m,
        axes_B=view.axes_B,
        areas_m2=view.areas_m2,
        superposition=view.superposition,
        pairs=meeting_pairs(layout),
    )


@dataclass(frozen=True, eq=False)
class SpareState:
    """The other controller's state, the thrusts last told, shape (n,), and when they were last shared out (freely)."""

    inner: Any
    thrusts_N: Array
    age_s: float = np.inf
    disturbance: float | None = None
    free_age_s: float = np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class Respared:
    """The wrench of another controller, made with the gentlest thrusts; implements `wakewise.interfaces.Controller`.

    The motion is the other's; what its plan does not know (jets that meet, the bed) only moves spare thrusts, by the
    exact allocator, so it can neither slow the plan nor make it swing. Shares are found `EVERY_S`, as often as plans
    are made; in between the wrench's change is made with the least thrusts, which leaves the spare ones as they are.
    The price on change keeps shares near to the last ones, and for good where another minimum lies apart (the load on
    one diagonal pair of verticals or the other). So every `FREE_EVERY_S` they are sought without it, and taken where
    that is better by more than `WORTH`. A step on which the other fell back is flown as it is.
    """

    name: str
    inner: Controller[Any]
    sharer: Sharer
    watch: Watch
    weights: Weights

    @property
    def layout(self) -> Layout:
        """Allocation matrix and limits."""
        return self.sharer.layout

    def init(self) -> SpareState:
        """State before the first step."""
        return SpareState(inner=self.inner.init(), thrusts_N=np.zeros(self.layout.B.shape[1]))

    def step(self, state: SpareState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[SpareState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
        if command.fallback is not None:
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), command
        if state.age_s + 1e-6 < EVERY_S:
            missing = command.wrench_B - self.layout.B @ state.thrusts_N
            thrusts = state.thrusts_N + self.layout.inverse @ missing
            if np.all((thrusts >= self.layout.lower_N) & (thrusts <= self.layout.upper_N)):
                told = self._told(inner, thrusts, dt_s)
                held = replace(state, inner=told, thrusts_N=thrusts, age_s=state.age_s + dt_s)
                return held, replace(command, thrusts_N=thrusts, disturbance=state.disturbance)
        G, weights = self.watch.gram(estimate, state.thrusts_N), self.weights
        if not np.isfinite(G).all():
            words = "wake model not finite: thrusts of the plan"
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), replace(command, fallback=words)
        total = self.watch.view.total_weight
        found = self.sharer.shares(command.wrench_B, G, weights, total, state.thrusts_N)
        free_age_s = state.free_age_s + EVERY_S
        if free_age_s + 1e-6 >= FREE_EVERY_S:
            anew = self.sharer.shares(command.wrench_B, G, replace(weights, previous=0.0), total)
            free_age_s = 0.0
            if _cost(anew, weights) < (1.0 - WORTH) * _cost(found, weights):
                found = anew
        told = self._told(inner, found.thrusts_N, dt_s)
        new = SpareState(told, found.thrusts_N, dt_s, found.disturbance, free_age_s)
        return new, replace(command, thrusts_N=found.thrusts_N, disturbance=found.disturbance)

    def _told(self, inner: Any, thrusts_N: Array, dt_s: float) -> Any:
        """The other controller's state, told what was flown in place of its thrusts, if it can be told."""
        tell = getattr(self.inner, "told", None)
        return inner if tell is None else tell(inner, thrusts_N, dt_s)


def _cost(found: Allocation, weights: Weights) -> float:
    """Cost of shares without the price on change."""
    D = 0.0 if found.disturbance is None else found.disturbance
    return weights.disturbance * D + weights.effort * float(found.thrusts_N @ found.thrusts_N)


def respared(
    controller: Controller[Any], vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> Respared:
    """A planning controller whose wrenches are shared out anew, with the same weights.

    Arguments as for `make_controller`; `region` with what the levers add but for drift, `wake` with the floor if it is
    to count.
    """
    sharer = sharer_of(vehicle, settings)
    layout = sharer.layout
    view = WakeView.of(vehicle, region, wake, settings.superposition)
    return Respared(
        name=controller.name,
        inner=controller,
        sharer=sharer,
        watch=Watch(
            view=meeting_view(view, layout) if settings.levers.meet else view,
            levers=settings.levers,
        ),
        weights=Weights(
            disturbance=settings.w_disturbance / view.total_weight,
            effort=settings.w_effort,
            previous=PREVIOUS_SHARE * settings.w_effort,
        ),
    )


def sharer_of(vehicle: Vehicle, settings: ControlSettings) -> Sharer:
    """What shares a vehicle's wrenches out, within the bound on power if that lever is on."""
    return Sharer(layout=vehicle_layout(vehicle), law=power_law(vehicle) if settings.levers.thrift else None)

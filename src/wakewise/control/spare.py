"""Spare thrusts shared out anew at every step, with what single jets do not show: jets that meet, and the bed.

Two jets that cross at less than 120 deg join and run on along the sum of their momenta (conservation of momentum; the
angle is that above which they rather turn aside, as jets that blow at each other do). The two forward jets of a
vectored layout cross a decimetre ahead of the bow, and what they become goes where the camera looks, although neither
jet alone comes near the target. In the tank this was most of the water's motion at a target downstream of a hover.

In a flow, a pair of which one does no more than correct is charged as if the other pushed as a thruster at rest is
guessed to: half of what they would become each. D is of an instant, and shares that alternate between two jets that
miss are the least that it can find; the water has both of them. That is a charge, not what is in the water: thrusts
that leave one of the two at rest leave nothing of it, so the bound on power (`thrift`) asks what they do as sent.

As a term of D. Of jets a and b with T_a = T_b = 1 N the joined jet carries |e_a + e_b| N of momentum along
e_a + e_b. With unequal thrusts it turns towards the stronger, and without one of them there is none; the geometric mean
sqrt(T_a T_b) = s_a s_b vanishes in the same way and keeps D a quadratic form of s, so the exact allocators of this room
take it as it is: it is an entry of G off the diagonal. It errs on the safe side where thrusts are unequal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, cast

import numpy as np

from wakewise.allocation import Layout
from wakewise.arrays import Array, IntArray
from wakewise.control.carried import Carried, HandsOver
from wakewise.control.settings import ControlSettings
from wakewise.control.thrift import sharer_of, weights_of
from wakewise.control.watch import APART_S, EVERY_S, JUMP_EVERY_S, Watch
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Command, Controller, Goal, WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import AxialJet, free_jet
from wakewise.wake.carried import Flow
from wakewise.wake.disturbance import carried_velocity, incoherent, velocity_gram
from wakewise.wake.view import Seen, WakeView

LEAST_COSINE = -0.5
"""Cosine of 120 deg: jets that cross at more turn aside rather than join."""
HALF_WIDTH_SLOPE = 0.096
"""Half-speed radius of a round jet over the distance along it (see `wakewise.wake.RoundJet`)."""
WEAK_SHARE = 0.25
"""Thrusts below this share of the mean are corrections rather than jets."""
_PARALLEL = 0.999
_LEAST_SHARE, _WORTH_SHARE = 1e-3, 0.1


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
        """Matrix G of D = s' G s, shape (2 n, 2 n); in a flow what two jets become takes their own place."""
        return self.seen(X_WB, flow).gram

    def seen(self, X_WB: Pose, flow: Flow | None = None) -> Seen:
        """Matrices of D: with the charge for a pair of which one rests, and with what it becomes where both push."""
        origins, axes = X_WB.apply(self.positions_B_m), self.axes_B @ X_WB.R.T
        if flow is not None and isinstance(free_jet(self.wake), AxialJet):
            velocity, apart = self._carried(origins, axes, flow)
            G = velocity_gram(velocity, self.weights)
            if self.superposition == "incoherent":
                G = incoherent(G)
                return Seen(gram=G, sent=G)
            momentum = apart.momentum * apart.strength_N
            speed = carried_velocity(self.wake, self.points_W_m, *self._jets(apart), momentum, flow)
            # Either may push soon, and jets live for seconds: what one sends now meets what the other sends then.
            D = self._joined(apart, speed)
            charged = G.copy()
            np.add.at(charged, (apart.first, apart.first), 0.5 * D)
            np.add.at(charged, (apart.second, apart.second), 0.5 * D)
            return Seen(gram=charged, sent=_with_pairs(G, apart, D))
        G = np.array(super().gram(X_WB))
        met = joined_jets(origins, axes, self.pairs)
        D = self._joined(met, self.wake.unit_velocity(self.points_W_m, *self._jets(met)))
        G = _with_pairs(G, met, D)
        return Seen(gram=G, sent=G)

    def _jets(self, met: JoinedJets) -> tuple[Array, Array, Array]:
        """Origins, directions and areas of jets made of two."""
        return met.origins_m, met.directions, self.areas_m2[met.first % len(self.areas_m2)]

    def _joined(self, met: JoinedJets, speed: Array) -> Array:
        """D of what pairs become, per newton of their geometric mean, of their speed per square root of newton."""
        return np.asarray(met.momentum * met.share * np.einsum("n,inx,inx->i", self.weights, speed, speed))

    def _carried(self, origins: Array, axes: Array, flow: Flow) -> tuple[Array, JoinedJets]:
        """Velocity per square root of newton of all slots, shape (2 m, n, 3), with jets that join at these thrusts.

        Of a pair a share goes on as one, the rest as if alone. The velocity of the one is counted to its two by their
        thrusts, so that it is right where the thrusts are those reckoned from, and D stays a sum of squares. Pairs of
        which one pushes no more than corrections do are told apart.
        """
        m = len(origins)
        weak_N = WEAK_SHARE * float(np.mean(np.abs(flow.thrusts_N)))
        pushing = np.concatenate([flow.thrusts_N, -flow.thrusts_N])
        met = joined_jets(origins, axes, self.pairs, np.where(pushing > weak_N, pushing, flow.guessed))
        ends = np.tile([np.inf, 1.0], (2 * m, 1))
        real = (pushing[met.first] > weak_N) & (pushing[met.second] > weak_N)
        chosen = []
        for k in np.argsort(-met.share, kind="stable"):
            a, b = met.first[k], met.second[k]
            # Each jet joins one other, the one it meets most squarely.
            if real[k] and ends[a, 1] == 1.0 and ends[b, 1] == 1.0:
                ends[a] = met.ways_m[k, 0], 1.0 - met.share[k]
                ends[b] = met.ways_m[k, 1], 1.0 - met.share[k]
                chosen.append(k)
        slots = (np.concatenate([origins, origins]), np.concatenate([-axes, axes]), np.tile(self.areas_m2, 2))
        velocity = carried_velocity(self.wake, self.points_W_m, *slots, flow.guessed, flow, ends)
        if chosen:
            a, b, share = met.first[chosen], met.second[chosen], met.share[chosen]
            momentum = met.momentum[chosen] * met.strength_N[chosen]
            joined = carried_velocity(self.wake, self.points_W_m, *self._jets(met.take(chosen)), momentum, flow)
            joined *= (share * np.sqrt(momentum) / (pushing[a] + pushing[b]))[:, None, None]
            velocity[a] += np.sqrt(pushing[a])[:, None, None] * joined
            velocity[b] += np.sqrt(pushing[b])[:, None, None] * joined
        return velocity, met.take(~real & (met.share > _WORTH_SHARE))


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedJets:
    """Jets made of two, of m pairs of slots (slot i is thruster i with T > 0, slot n + i the same with T < 0).

    `origins_m`, shape (m, 3), lie as far behind the place of meeting as the two jets came on average, so that the
    joined jet is as wide there as they are; `directions`, shape (m, 3); `momentum`, shape (m,), over `strength_N`, the
    geometric mean of the two; `share`, shape (m,), tells how squarely they meet: 1/2 where their axes pass one
    half-width apart; `ways_m`, shape (m, 2), how far each comes until then.
    """

    first: IntArray
    second: IntArray
    origins_m: Array
    directions: Array
    momentum: Array
    share: Array
    strength_N: Array
    ways_m: Array

    def take(self, which: Any) -> JoinedJets:
        """Those that a mask or a list of numbers picks."""
        return JoinedJets(**{field.name: getattr(self, field.name)[which] for field in fields(self)})


def _with_pairs(G: Array, met: JoinedJets, D: Array) -> Array:
    """The matrix, in place, with D of what pairs become, per newton of their geometric mean."""
    np.add.at(G, (met.first, met.second), 0.5 * D)
    np.add.at(G, (met.second, met.first), 0.5 * D)
    return G


def joined_jets(
    origins_m: Array, axes: Array, pairs: tuple[tuple[int, int], ...], thrusts_N: Array | None = None
) -> JoinedJets:
    """Which jets meet and what they become, from disks, shape (n, 3), and force axes, shape (n, 3), in any frame.

    `thrusts_N`, shape (2 n,), are sizes to reckon with, more than 0; without them all jets are alike.
    """
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
    size = np.ones(2 * n) if thrusts_N is None else thrusts_N
    strength = np.sqrt(size[first] * size[second])
    total = (size[first] / strength)[:, None] * d + (size[second] / strength)[:, None] * e
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
        strength_N=strength[usable],
        ways_m=np.stack([x, y], axis=1)[usable],
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
    """The other controller's state, the thrusts last told, shape (n,), and when they were last shared out (freely).

    `seen` are the matrices of the last search.
    """

    inner: Any
    thrusts_N: Array
    age_s: float = np.inf
    disturbance: float | None = None
    free_age_s: float = np.inf
    seen: Seen | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Respared:
    """The wrench of another controller, made with the gentlest thrusts; implements `wakewise.interfaces.Controller`.

    The motion is the other's; what its plan does not know (jets that meet, the bed) only moves spare thrusts, by the
    exact allocator, so it can neither slow the plan nor make it swing. Where jets go is looked up `EVERY_S`, as often
    as plans are made; in between shares follow the wrench by the matrix of then.
    The price on change keeps shares near to the last ones, and for good where another minimum lies apart (the load on
    one diagonal pair of verticals or the other). So every `JUMP_EVERY_S` they are sought without it, on a step of its
    own, and taken where that is better by more than `WORTH` (see `watch`). A step on which the other fell back is flown
    as it is.
    """

    name: str
    inner: Controller[Any]
    watch: Watch

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.watch.layout

    def init(self) -> SpareState:
        """State before the first step."""
        return SpareState(inner=self.inner.init(), thrusts_N=np.zeros(self.layout.B.shape[1]))

    def carried(self, state: SpareState) -> Carried:
        """What another method can go on with; asked only where the other controller hands over, too."""
        return replace(cast(HandsOver, self.inner).carried(state.inner), thrusts_N=state.thrusts_N)

    def resumed(self, carried: Carried) -> SpareState:
        """State before the first step after another method's: shares are sought near its thrusts."""
        return SpareState(inner=cast(HandsOver, self.inner).resumed(carried), thrusts_N=carried.thrusts_N)

    def step(self, state: SpareState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[SpareState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
        if command.fallback is not None:
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), command
        watch, wrench = self.watch, command.wrench_B
        if state.seen is not None and state.age_s + 1e-6 < EVERY_S:
            moved = watch.moved(wrench, state.thrusts_N)
            due = state.free_age_s + 1e-6 >= JUMP_EVERY_S and state.age_s + 1e-6 >= APART_S
            if due and watch.allowed(moved):
                # Such a step has no time to share the change out, too.
                held = self._jumped(replace(state, thrusts_N=moved, free_age_s=0.0), wrench, estimate)
            else:
                held = replace(state, thrusts_N=watch.follow(wrench, state.seen, state.thrusts_N).thrusts_N)
            held = replace(held, age_s=held.age_s + dt_s, free_age_s=held.free_age_s + dt_s)
            held = replace(held, inner=self._told(inner, held.thrusts_N, dt_s))
            return held, replace(command, thrusts_N=held.thrusts_N, disturbance=held.disturbance)
        shared = watch.share_out(wrench, estimate, state.thrusts_N)
        if shared is None:
            words = "wake model not finite: thrusts of the plan"
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), replace(command, fallback=words)
        found, seen = shared
        # The first search is made with the first plan, the next ones between two plans.
        age_s = dt_s if np.isfinite(state.age_s) else EVERY_S - APART_S + dt_s
        told = self._told(inner, found.thrusts_N, dt_s)
        new = SpareState(told, found.thrusts_N, age_s, found.disturbance, state.free_age_s + dt_s, seen)
        return new, replace(command, thrusts_N=found.thrusts_N, disturbance=found.disturbance)

    def _jumped(self, state: SpareState, wrench_B: Array, estimate: BodyState) -> SpareState:
        """The state with better shares from elsewhere, if there are any."""
        anew = self.watch.jump(wrench_B, estimate, state.thrusts_N, state.seen)
        if anew is None:
            return state
        found, seen = anew
        return replace(state, thrusts_N=found.thrusts_N, disturbance=found.disturbance, seen=seen)

    def _told(self, inner: Any, thrusts_N: Array, dt_s: float) -> Any:
        """The other controller's state, told what was flown in place of its thrusts, if it can be told."""
        tell = getattr(self.inner, "told", None)
        return inner if tell is None else tell(inner, thrusts_N, dt_s)


def respared(
    controller: Controller[Any], vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> Respared:
    """A planning controller whose wrenches are shared out anew, with the same weights.

    Arguments as for `make_controller`; `region` with what the levers add but for drift, `wake` with the floor if it is
    to count.
    """
    return Respared(name=controller.name, inner=controller, watch=watching(vehicle, region, wake, settings))


def watching(vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings) -> Watch:
    """What a method watches with the levers of its settings. Arguments as for `respared`."""
    sharer = sharer_of(vehicle, settings)
    view = WakeView.of(vehicle, region, wake, settings.superposition)
    return Watch(
        view=meeting_view(view, sharer.layout) if settings.levers.meet else view,
        levers=settings.levers,
        sharer=sharer,
        weights=weights_of(settings, view.total_weight),
    )

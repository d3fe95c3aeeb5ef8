"""Influence matrix of a vehicle: the Gram matrix G of D = s' G s at a pose, from thruster geometry and wake model.

Merging jets. Two jets that cross at less than 120 deg merge and continue along the sum of their momenta (conservation
of momentum; beyond 120 deg they turn aside, like opposed jets). The two forward jets of a vectored layout cross a
decimetre ahead of the bow.

Term of D. Jets a and b with T_a = T_b = 1 N merge into one of |e_a + e_b| N of momentum along e_a + e_b. The geometric
mean sqrt(T_a T_b) = s_a s_b vanishes when either thrust does, so the merged jet is an entry of G off the diagonal and D
stays a quadratic form of s. With unequal thrusts this overestimates.

In a current (`flow`), a pair of which one thrust is only a correction is charged as if both were in use: half of the
merged jet's D on each diagonal entry. Otherwise thrusts that alternate between two such jets would look harmless,
while both jets are in the water. This charge is in `InfluenceMatrices.gram` only; `actual` has the D of the thrusts
themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from wakewise.allocation import Layout
from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.checks import one_of
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.core.jit.njit import assign, njit
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import (
    SUPERPOSITIONS,
    Superposition,
    advected_velocity,
    gram,
    incoherent,
    velocity_gram,
)
from wakewise.wake.gram import place
from wakewise.wake.jets import AxialJet
from wakewise.wake.learned import free_jet

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle
    from wakewise.scene.targets import Region


class InfluenceMatrices(NamedTuple):
    """Matrices of D, shape (2 n, 2 n) each: `gram` for the choice of thrusts, `actual` for D of the thrusts themselves.

    They differ only if `gram` has the extra cost of jets that may merge (`with_merging_jets`).
    """

    gram: Array
    actual: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class InfluenceModel:
    """Thruster positions and axes on the body, weighted points of the region in the world, and a wake model."""

    wake: WakeModel
    points_W_m: Array
    weights: Array
    positions_B_m: Array
    axes_B: Array
    areas_m2: Array
    superposition: Superposition = "coherent"

    def __post_init__(self) -> None:
        one_of(self.superposition, SUPERPOSITIONS, "superposition")
        n, m = len(self.points_W_m), len(self.positions_B_m)
        freeze(self, points_W_m=(n, 3), weights=(n,), positions_B_m=(m, 3), axes_B=(m, 3), areas_m2=(m,))
        if not np.sum(self.weights) > 0.0 or np.any(self.weights < 0.0):
            raise InputError("region: weights must not be negative, and at least one must be more than 0")

    @classmethod
    def of(
        cls, vehicle: Vehicle, region: Region, wake: WakeModel, superposition: Superposition = "coherent"
    ) -> InfluenceModel:
        """Influence of a vehicle on a region."""
        return cls(
            wake=wake,
            points_W_m=region.points_W_m,
            weights=region.weights,
            positions_B_m=vehicle.thruster_positions_B_m,
            axes_B=vehicle.thruster_axes_B,
            areas_m2=vehicle.disk_areas_m2,
            superposition=superposition,
        )

    @cached_property
    def total_weight(self) -> float:
        """Sum of the region's weights: D divided by it is a mean square speed."""
        return float(np.sum(self.weights))

    def gram(self, X_WB: Pose, flow: CrossFlow | None = None) -> Array:
        """Matrix G of D = s' G s, shape (2 n, 2 n), at a pose; `flow` advects the jets."""
        origins_W, axes_W = self.places(X_WB)
        place = (self.points_W_m, self.weights, origins_W, axes_W, self.areas_m2)
        return gram(self.wake, *place, superposition=self.superposition, flow=flow)

    def places(self, X_WB: Pose) -> tuple[Array, Array]:
        """Thruster origins and force axes in the world, shape (m, 3) each, of the body at a pose."""
        _, origins_W, axes_W = place(X_WB.p_m, X_WB.q, self.positions_B_m, self.axes_B)
        return origins_W, axes_W

    def matrices(self, X_WB: Pose, flow: CrossFlow | None = None) -> InfluenceMatrices:
        """Matrices of D for the choice of thrusts and for its value."""
        G = self.gram(X_WB, flow)
        return InfluenceMatrices(gram=G, actual=G)


LEAST_COSINE = -0.5
"""Cosine of 120 deg: jets that cross at more turn aside rather than join."""
HALF_WIDTH_SLOPE = 0.096
"""Half-speed radius of a round jet over the distance along it (see `wakewise.wake.RoundJet`)."""
WEAK_SHARE = 0.25
"""Thrusts below this share of the mean are corrections rather than jets."""
_PARALLEL = 0.999
_LEAST_SHARE, _WORTH_SHARE = 1e-3, 0.1


class JoinedJets(NamedTuple):
    """Merged jets of m pairs of slots (slot i is thruster i with T > 0, slot n + i the same with T < 0).

    `origins_m`, shape (m, 3), lie as far behind the crossing as the two jets came on average, so that the merged jet
    is as wide there as they are; `directions`, shape (m, 3); `momentum`, shape (m,), over `strength_N`, the
    geometric mean of the two; `share`, shape (m,), is the overlap: 1/2 where their axes pass one half-width
    apart; `ways_m`, shape (m, 2), how far each comes until then.
    """

    first: IntArray
    second: IntArray
    origins_m: Array
    directions: Array
    momentum: Array
    share: Array
    strength_N: Array
    ways_m: Array


class _TracedJets(NamedTuple):
    """Jets of a flow: those of all slots, then those that pairs become, then those that resting pairs would become.

    `origins_m` and `directions`, shape (m, 3), `areas_m2` and `thrusts_N`, shape (m,), `ends`, shape (m, 2), as for
    `advected_velocity`; `joined` and `apart`, the numbers in `JoinedJets` of the pairs that do and that would.
    """

    origins_m: Array
    directions: Array
    areas_m2: Array
    thrusts_N: Array
    ends: Array
    joined: IntArray
    apart: IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class MergingJetsModel(InfluenceModel):
    """`InfluenceModel` whose Gram matrix includes the merged jets of pairs that cross."""

    pairs: tuple[tuple[int, int], ...] = field(default=())  # thrusters whose jets are looked at

    def gram(self, X_WB: Pose, flow: CrossFlow | None = None) -> Array:
        """Matrix G of D = s' G s, shape (2 n, 2 n); in a flow the merged jet replaces its two."""
        return self.matrices(X_WB, flow).gram

    def matrices(self, X_WB: Pose, flow: CrossFlow | None = None) -> InfluenceMatrices:
        """Matrices of D: with the cost of a pair of which one is idle, and without it."""
        origins, axes = self.places(X_WB)
        if flow is not None and isinstance(free_jet(self.wake), AxialJet):
            return self._matrices_in_current(flow, origins, axes)
        G = np.array(super().gram(X_WB))
        merged = _merge_geometry(origins, axes, *self._slots, np.ones(2 * len(origins)))
        areas = self.areas_m2[merged.first % len(origins)]
        speed = self.wake.unit_velocity(self.points_W_m, merged.origins_m, merged.directions, areas)
        D = merged.momentum * merged.share * np.einsum("n,inx,inx->i", self.weights, speed, speed)
        np.add.at(G, (merged.first, merged.second), 0.5 * D)
        np.add.at(G, (merged.second, merged.first), 0.5 * D)
        return InfluenceMatrices(gram=G, actual=G)

    def _matrices_in_current(self, flow: CrossFlow, origins: Array, axes: Array) -> InfluenceMatrices:
        """The same in a flow, of disks and force axes in the world, shape (n, 3) each.

        Of an active pair a share continues as one jet and the rest as two. The merged velocity is divided between the
        two by their thrusts, so that it is exact at the nominal thrusts and D stays a sum of squares. A pair of which
        one thrust is only a correction has the cost of its merged jet, because jets live for seconds.
        """
        pushing = np.concatenate([flow.thrusts_N, -flow.thrusts_N])
        guessed, weak_N = flow.nominal_thrusts_N, WEAK_SHARE * float(np.abs(flow.thrusts_N).mean())
        merged = _merge_geometry(origins, axes, *self._slots, np.where(pushing > weak_N, pushing, guessed))
        traced = _jets_to_trace(origins, axes, self.areas_m2, guessed, pushing, weak_N, merged)
        place = (traced.origins_m, traced.directions, traced.areas_m2, traced.thrusts_N)
        velocity = advected_velocity(self.wake, self.points_W_m, *place, flow, traced.ends)
        _add_merged(velocity, merged, traced.joined, pushing)
        G = velocity_gram(velocity[: len(pushing)], self.weights)
        if self.superposition == "incoherent":
            G = incoherent(G)
            return InfluenceMatrices(gram=G, actual=G)
        return InfluenceMatrices(
            *_with_merging_costs(G, velocity[len(pushing) + len(traced.joined) :], self.weights, merged, traced.apart)
        )

    @cached_property
    def _slots(self) -> tuple[IntArray, IntArray]:
        return _slots_of(self.pairs, len(self.areas_m2))


def joined_jets(
    origins_m: Array, axes: Array, pairs: tuple[tuple[int, int], ...], thrusts_N: Array | None = None
) -> JoinedJets:
    """Pairs of jets that merge, from disks and force axes, shape (n, 3) each, in any frame.

    `thrusts_N`, shape (2 n,): magnitudes, more than 0; 1 if not given.
    """
    n = len(origins_m)
    sizes = np.ones(2 * n) if thrusts_N is None else np.array(thrusts_N, dtype=np.float64)
    return cast(JoinedJets, _merge_geometry(np.array(origins_m), np.array(axes), *_slots_of(pairs, n), sizes))


def _slots_of(pairs: tuple[tuple[int, int], ...], n: int) -> tuple[IntArray, IntArray]:
    """Slots, two arrays of shape (4 m,), whose jets m pairs of n thrusters may send."""
    wanted = [(a, b) for i, j in pairs for a in (i, i + n) for b in (j, j + n)]
    first, second = np.array(wanted, dtype=np.int64).reshape(-1, 2).T.copy()
    return first, second


@njit
def _merge_geometry(origins: Array, axes: Array, first: IntArray, second: IntArray, sizes: Array) -> JoinedJets:
    """`JoinedJets` of those of the pairs of slots, `first` with `second`, that meet; `sizes` as for `joined_jets`."""
    n, many, count = origins.shape[0], first.size, 0
    a, b = np.empty(many, np.int64), np.empty(many, np.int64)
    starts, onward, ways = np.empty((many, 3)), np.empty((many, 3)), np.empty((many, 2))
    momentum, share, strength = np.empty(many), np.empty(many), np.empty(many)
    d, e = np.empty(3), np.empty(3)
    for k in range(many):
        i, j = first[k] % n, second[k] % n
        cosine, along, across = 0.0, 0.0, 0.0
        for x in range(3):
            d[x] = axes[i, x] if first[k] >= n else -axes[i, x]
            e[x] = axes[j, x] if second[k] >= n else -axes[j, x]
            r = origins[j, x] - origins[i, x]
            cosine, along, across = cosine + d[x] * e[x], along + r * d[x], across + r * e[x]
        if not LEAST_COSINE < cosine < _PARALLEL:
            continue
        # Distances along both jets to where their axes come closest.
        sine2 = 1.0 - cosine * cosine
        ways[count, 0], ways[count, 1] = (along - cosine * across) / sine2, (cosine * along - across) / sine2
        way = ways[count, 0] + ways[count, 1]
        if not (ways[count, 0] > 0.0 and ways[count, 1] > 0.0):
            continue
        strength[count] = np.sqrt(sizes[first[k]] * sizes[second[k]])
        by_first, by_second = sizes[first[k]] / strength[count], sizes[second[k]] / strength[count]
        apart2, total2 = 0.0, 0.0
        for x in range(3):
            here, there = origins[i, x] + ways[count, 0] * d[x], origins[j, x] + ways[count, 1] * e[x]
            starts[count, x] = 0.5 * (here + there)
            onward[count, x] = by_first * d[x] + by_second * e[x]
            apart2, total2 = apart2 + (there - here) ** 2, total2 + onward[count, x] ** 2
        share[count] = np.exp(-np.log(2.0) * apart2 / max(HALF_WIDTH_SLOPE * way, 1e-9) ** 2)
        if not share[count] > _LEAST_SHARE:
            continue
        momentum[count] = max(np.sqrt(total2), 1e-9)
        for x in range(3):
            onward[count, x] /= momentum[count]
            starts[count, x] -= 0.5 * way * onward[count, x]
        a[count], b[count] = first[k], second[k]
        count += 1
    return JoinedJets(
        a[:count],
        b[:count],
        starts[:count],
        onward[:count],
        momentum[:count],
        share[:count],
        strength[:count],
        ways[:count],
    )


@njit
def _jets_to_trace(
    origins: Array, axes: Array, areas: Array, guessed: Array, pushing: Array, weak_N: float, merged: JoinedJets
) -> _TracedJets:
    """Jets to trace: of all slots, of merging pairs, of pairs that would merge.

    Thrusts `pushing` and nominal thrusts `guessed`, shape (2 n,).
    """
    n, pairs = origins.shape[0], merged.first.size
    joined, apart, joins, rests = np.empty(pairs, np.int64), np.empty(pairs, np.int64), 0, 0
    taken, ends = np.zeros(2 * n, np.bool_), np.ones((2 * n + pairs, 2))
    ends[:, 0] = np.inf
    for _ in range(pairs):
        # Each jet joins one other, the one it meets most squarely.
        best, square = -1, 0.0
        for k in range(pairs):
            a, b = merged.first[k], merged.second[k]
            free = not taken[a] and not taken[b] and min(pushing[a], pushing[b]) > weak_N
            if free and merged.share[k] > square:
                best, square = k, merged.share[k]
        if best < 0:
            break
        for side in range(2):
            slot = merged.first[best] if side == 0 else merged.second[best]
            taken[slot] = True
            ends[slot, 0], ends[slot, 1] = merged.ways_m[best, side], 1.0 - square
        joined[joins] = best
        joins += 1
    for k in range(pairs):
        if min(pushing[merged.first[k]], pushing[merged.second[k]]) <= weak_N and merged.share[k] > _WORTH_SHARE:
            apart[rests] = k
            rests += 1
    many = 2 * n + joins + rests
    places, directions, disks, thrusts = np.empty((many, 3)), np.empty((many, 3)), np.empty(many), np.empty(many)
    for i in range(2 * n):
        assign(places[i], origins[i % n])
        for x in range(3):
            directions[i, x] = -axes[i, x] if i < n else axes[i - n, x]
        disks[i], thrusts[i] = areas[i % n], guessed[i]
    for c in range(joins + rests):
        k, i = joined[c] if c < joins else apart[c - joins], 2 * n + c
        assign(places[i], merged.origins_m[k])
        assign(directions[i], merged.directions[k])
        disks[i], thrusts[i] = areas[merged.first[k] % n], merged.momentum[k] * merged.strength_N[k]
    return _TracedJets(places, directions, disks, thrusts, ends[:many], joined[:joins], apart[:rests])


@njit
def _add_merged(velocity: Array, merged: JoinedJets, joined: IntArray, pushing: Array) -> None:
    """Add the merged jets, rows of `velocity`, (m, n, 3), after all slots, to the rows of their two, by thrust."""
    for c in range(joined.size):
        k, one = joined[c], velocity[pushing.size + c]
        a, b = merged.first[k], merged.second[k]
        whole = merged.share[k] * np.sqrt(merged.momentum[k] * merged.strength_N[k]) / (pushing[a] + pushing[b])
        for slot in (a, b):
            part = whole * np.sqrt(pushing[slot])
            for j in range(one.shape[0]):
                for x in range(3):
                    velocity[slot, j, x] += part * one[j, x]


@njit
def _with_merging_costs(
    G: Array, velocity: Array, weights: Array, merged: JoinedJets, apart: IntArray
) -> tuple[Array, Array]:
    """G with the cost of idle pairs on its diagonal, and G with their merged jets off it, of velocities (m, n, 3)."""
    charged, actual = G.copy(), G.copy()
    for c in range(apart.size):
        k, total = apart[c], 0.0
        a, b = merged.first[k], merged.second[k]
        for j in range(weights.size):
            u, v, w = velocity[c, j, 0], velocity[c, j, 1], velocity[c, j, 2]
            total += weights[j] * (u * u + v * v + w * w)
        half = 0.5 * merged.momentum[k] * merged.share[k] * total
        charged[a, a] += half
        charged[b, b] += half
        actual[a, b] += half
        actual[b, a] += half
    return charged, actual


def merging_pairs(layout: Layout) -> tuple[tuple[int, int], ...]:
    """Pairs of thrusters that share a part of the null space.

    Only there can the allocation choose between them; other pairs would tie together parts that are searched exactly.
    """
    moves = [np.flatnonzero(own) for own in layout.owners]
    return tuple(sorted({(int(i), int(j)) for own in moves for i in own for j in own if i < j}))


def with_merging_jets(view: InfluenceModel, layout: Layout) -> MergingJetsModel:
    """The same influence model with merging jets."""
    return MergingJetsModel(
        wake=view.wake,
        points_W_m=view.points_W_m,
        weights=view.weights,
        positions_B_m=view.positions_B_m,
        axes_B=view.axes_B,
        areas_m2=view.areas_m2,
        superposition=view.superposition,
        pairs=merging_pairs(layout),
    )

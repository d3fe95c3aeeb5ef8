"""Impulse parcels: arrays of the free jets and the velocity that they induce (`induction`, `round_jet_closure`)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.induction import impulse_velocity
from wakewise.simulation.water.round_jet_closure import FIRST_D, disk_share

MERGE_SPACING = 0.7  # of sigma: a closer pair becomes one, so rows are no coarser than 1.4 sigma (ripple 1e-4),
_OLD_D, _OLD_SPACING = 2.0, 1.4  # and from sigma over D of 2 to 2.8 on they are 1.4 times as coarse (ripple 1 %)
_PARALLEL = 0.9  # cosine: opposite parcels would cancel instead of stirring each other, so they never merge
CENTRE_SPEED = 2 / (3 * (2 * math.pi) ** 1.5)
"""Speed at the centre of a parcel of unit impulse and size: two thirds of its impulse's density there."""


class ParcelBuffers(NamedTuple):
    """Room for parcels, oldest first, of which the first so many are in use; the step writes into it.

    Fields as of `Parcels`, each as long as there is room.
    """

    position: Array
    impulse: Array
    sigma: Array
    diameter: Array
    stream: IntArray
    gust: Array
    disk: Array
    share: Array
    flow: Array
    held: Array
    start: Array


@dataclass(frozen=True, eq=False)
class Parcels:
    """Impulse parcels at one instant, oldest first."""

    position_m: Array  # shape (n, 3), in the world
    impulse_m4_s: Array  # shape (n, 3): thrust times time over density, along the jet
    sigma_m: Array  # shape (n,)
    diameter_m: Array  # shape (n,): disk diameter of the thruster that sent it
    # Shape (n,): which jet it belongs to: twice the thruster's index, plus one for reverse thrust; then the hull's
    # wake, and then the fans of jets that have met.
    stream: IntArray
    gust: Array  # shape (n, 3): turbulent share of the impulse, a standard normal variable before scaling
    # Shape (n, 3): velocity of the disk when it was sent: its water starts with it and loses it to what is entrained.
    disk_m_s: Array
    share: Array  # shape (n,): of the parcel's water, what came through the disk
    flow_m_s: Array  # shape (n, 3): velocity of the jets' water there when it was last looked at
    held_s: Array  # shape (n,): how long ago that was; infinite if never
    # Shape (n,): speed on the axis of its row where that begins: a jet's exit speed, a wake's first deficit.
    start_m_s: Array

    @classmethod
    def none(cls) -> Parcels:
        """No parcels at all: still water."""
        v = np.zeros((0, 3))
        s = np.zeros(0)
        return cls(v, v, s, s, np.zeros(0, dtype=np.int64), v, v, s, v, s, s)

    @classmethod
    def sent(
        cls,
        position_m: Array,
        impulse_m4_s: Array,
        sigma_m: Array,
        diameter_m: Array,
        stream: IntArray,
        gust: Array,
        disk_m_s: Array,
        start_m_s: Array | None = None,
    ) -> Parcels:
        """New ones, at which the water has not been looked at yet; without `start_m_s` they count as ever fed."""
        never, flow = np.full(len(sigma_m), np.inf), np.zeros((len(sigma_m), 3))
        share, start = disk_share(sigma_m, diameter_m), np.zeros(len(sigma_m)) if start_m_s is None else start_m_s
        return cls(position_m, impulse_m4_s, sigma_m, diameter_m, stream, gust, disk_m_s, share, flow, never, start)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.sigma_m)

    @property
    def size_m4_s(self) -> Array:
        """Length of each impulse, shape (n,)."""
        size: Array = np.sqrt(np.einsum("ni,ni->n", self.impulse_m4_s, self.impulse_m4_s))
        return size

    def take(self, keep: np.ndarray) -> Parcels:
        """Those that a mask or an index array picks."""
        return Parcels(*(getattr(self, field.name)[keep] for field in fields(self)))

    def with_room(self, room: int) -> ParcelBuffers:
        """A copy with room for so many."""
        columns = [
            np.zeros((room, *np.shape(getattr(self, f.name))[1:]), getattr(self, f.name).dtype) for f in fields(self)
        ]
        for column, field in zip(columns, fields(self), strict=True):
            column[: self.count] = getattr(self, field.name)
        return ParcelBuffers(*columns)

    @classmethod
    def of(cls, jets: ParcelBuffers, count: int) -> Parcels:
        """A copy of the first so many."""
        copies: tuple[Any, ...] = tuple(column[:count].copy() for column in jets)
        return cls(*copies)


def parcel_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, bed_z_m: float
) -> Array:
    """Velocity of parcels and of their mirror images in the bed, shape (n, 3), at points, shape (n, 3).

    `bed_z_m`: the plane z = bed_z_m, through which nothing flows; infinite for water without a bed. Shapes:
    `points_W_m` (n, 3); `positions_m`, `impulses_m4_s` (k, 3); `sigmas_m` (k,).
    """
    room = TankFaces.of(bed_z_m, (math.inf, math.inf), surface=False)
    return confined_velocity(points_W_m, positions_m, impulses_m4_s, sigmas_m, room)


def confined_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, room: TankFaces
) -> Array:
    """Velocity of parcels and of their images in a room's faces; arguments as `parcel_velocity`."""
    sources = room.with_images(positions_m, impulses_m4_s, sigmas_m)
    u = impulse_velocity(points_W_m, *sources)
    for face in room.faces:
        if face.name == "bed":
            # On the bed itself parcel and image cancel across it; the sum only has their rounding.
            u[points_W_m[:, 2] == face.at_m, 2] = 0.0
    return u


@njit(inline="always")
def row_widening(sigma_m: float, diameter_m: float) -> float:
    """How much coarser than a young jet's an old one's row may be: from 1 to 1.4."""
    return min(max(sigma_m / (_OLD_D * diameter_m), 1.0), _OLD_SPACING)


def gusty_impulse_m4_s(parcels: Parcels, scale: float) -> Array:
    """Impulse with its turbulent part, which grows along the core and is full beyond it, shape (n, 3)."""
    if scale == 0.0 or parcels.count == 0:
        return parcels.impulse_m4_s
    gusty: Array = gusty_impulses(parcels.impulse_m4_s, parcels.gust, parcels.sigma_m, parcels.diameter_m, scale)
    return gusty


@njit(nogil=True)
def gusty_impulses(impulse: Array, gust: Array, sigma: Array, diameter: Array, scale: float) -> Array:
    """`gusty_impulse_m4_s` of the columns of parcels."""
    out = np.empty(impulse.shape)
    for j in range(sigma.shape[0]):
        first = FIRST_D * diameter[j]
        share = min(max((sigma[j] - first) / (0.5 * diameter[j] - first), 0.0), 1.0)
        # Of fewer parcels each may fluctuate less for their sum to fluctuate as much.
        share /= math.sqrt(row_widening(sigma[j], diameter[j]))
        size = math.sqrt(impulse[j, 0] ** 2 + impulse[j, 1] ** 2 + impulse[j, 2] ** 2)
        part = share * scale * size
        for k in range(3):
            out[j, k] = impulse[j, k] + part * gust[j, k]
    return out


def merged(parcels: Parcels, spacing: float) -> Parcels:
    """`merge_rows` of a copy."""
    jets = parcels.with_room(parcels.count)
    return Parcels.of(jets, merge_rows(jets, parcels.count, spacing))


def merged_across(parcels: Parcels, spacing: float) -> Parcels:
    """`merge_across` of a copy."""
    jets = parcels.with_room(parcels.count)
    return Parcels.of(jets, merge_across(jets, parcels.count, spacing))


@njit(apart=True, nogil=True)
def kept_only(jets: ParcelBuffers, count: int, keep: np.ndarray) -> int:
    """Close the ranks: of the first `count`, only those that a mask picks stay; how many they are."""
    left = 0
    for i in range(count):
        if not keep[i]:
            continue
        if left < i:
            jets.sigma[left], jets.diameter[left], jets.stream[left] = jets.sigma[i], jets.diameter[i], jets.stream[i]
            jets.share[left], jets.held[left], jets.start[left] = jets.share[i], jets.held[i], jets.start[i]
            for k in range(3):
                jets.position[left, k], jets.impulse[left, k] = jets.position[i, k], jets.impulse[i, k]
                jets.gust[left, k], jets.disk[left, k] = jets.gust[i, k], jets.disk[i, k]
                jets.flow[left, k] = jets.flow[i, k]
        left += 1
    return left


@njit(apart=True, nogil=True)
def merge_rows(jets: ParcelBuffers, count: int, spacing: float) -> int:
    """Pairs of successive parcels of one jet closer than `spacing` sigma made one; their impulse is conserved.

    For old parcels `row_widening` makes the distance longer. How many are left.

    Sizes are averaged, not widened by the distance: in a row the distance lies along the jet, and widening would
    spread the jet sideways as well.
    """
    if count < 2:
        return count
    return _merge(jets, count, np.arange(count), jets.stream, spacing)


@njit(apart=True, nogil=True)
def merge_across(jets: ParcelBuffers, count: int, spacing: float) -> int:
    """Pairs of far-travelled parcels of different jets, alike in size and direction and very close, made one.

    Parcels are sorted into cells of half the spacing at most, level by level of size; neighbours in a cell may merge.
    """
    old = np.flatnonzero(jets.sigma[:count] > jets.diameter[:count])  # 12 diameters of path
    if old.shape[0] < 2:
        return count
    key = np.empty(old.shape[0], np.int64)
    for q in range(old.shape[0]):
        level = math.floor(2 * math.log2(jets.sigma[old[q]]))
        side = _OLD_SPACING * spacing * 2.0 ** (level / 2)
        # Eight bits for the level, eighteen for each of the others: cells of their parcels' size never number more.
        key[q] = level + 128
        for k in range(3):
            key[q] = key[q] * 2**18 + math.floor(jets.position[old[q], k] / side) + 2**17
    order = np.argsort(key, kind="mergesort")
    labels = np.zeros(count, np.int64)
    label = 0
    for q in range(1, order.shape[0]):
        label += 1 if key[order[q]] != key[order[q - 1]] else 0
        labels[old[order[q]]] = label
    return _merge(jets, count, old[order], labels, spacing)


@njit(apart=True, nogil=True)
def _merge(jets: ParcelBuffers, count: int, order: IntArray, label: IntArray, spacing: float) -> int:
    """Walk through parcels in an order; each may take up the one before it with the same label."""
    labels = 0
    for j in order:
        labels = max(labels, label[j] + 1)
    last, keep, found = np.full(labels, -1), np.ones(count, np.bool_), False
    X, m, sigma, share, held = jets.position, jets.impulse, jets.sigma, jets.share, jets.held
    for j in order:
        i = last[label[j]]
        last[label[j]] = j
        if i < 0:
            continue
        wide_i = min(max(sigma[i] / (_OLD_D * jets.diameter[i]), 1.0), _OLD_SPACING)
        wide_j = min(max(sigma[j] / (_OLD_D * jets.diameter[j]), 1.0), _OLD_SPACING)
        reach = spacing * min(wide_i, wide_j) * min(sigma[i], sigma[j])
        gap2 = aa = bb = ab = 0.0
        for k in range(3):
            gap2 += (X[i, k] - X[j, k]) ** 2
            aa, bb, ab = aa + m[i, k] ** 2, bb + m[j, k] ** 2, ab + m[i, k] * m[j, k]
        a, b = math.sqrt(aa), math.sqrt(bb)
        if gap2 > reach * reach or ab < _PARALLEL * a * b:
            continue
        p = a / (a + b)
        q = 1 - p
        sigma[j], share[j] = p * sigma[i] + q * sigma[j], p * share[i] + q * share[j]
        held[j], jets.start[j] = max(held[i], held[j]), p * jets.start[i] + q * jets.start[j]
        for k in range(3):
            X[j, k] = p * X[i, k] + q * X[j, k]
            jets.disk[j, k] = p * jets.disk[i, k] + q * jets.disk[j, k]
            jets.flow[j, k] = p * jets.flow[i, k] + q * jets.flow[j, k]
            jets.gust[j, k] = (p * jets.gust[i, k] + q * jets.gust[j, k]) / math.sqrt(p * p + q * q)
            m[j, k] += m[i, k]
        keep[i], found = False, True
        # A merged parcel waits for the next step, so that rows thin evenly.
        last[label[j]] = -1
    return kept_only(jets, count, keep) if found else count


def _gust_per_turbulence() -> float:
    """Impulse fluctuation per parcel for a given relative fluctuation on the axis of a row of parcels.

    Parcels d = 1.05 sigma apart (young rows lie between 0.7 and 1.4) fluctuate independently; on the axis one adds
    2 A, so u'/u = a sqrt(sum (2A)^2) / sum 2A.
    """
    x = 1.05 * np.arange(-200, 201)[:, None] * np.array([0.0, 0.0, 1.0]) + np.array([0.0, 0.0, 0.2])
    one = np.array([[0.0, 0.0, 1.0]])
    along = parcel_velocity(x, np.zeros((1, 3)), one, np.ones(1), math.inf)[:, 2]
    return float(along.sum() / np.sqrt((along**2).sum()))


GUST_PER_TURBULENCE = _gust_per_turbulence()

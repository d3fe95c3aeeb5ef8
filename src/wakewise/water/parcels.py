"""Impulse parcels: what the free jets of the simulated water are made of, and the velocity that they induce.

The sum itself, and what a parcel is, are in `wakewise.water.induction`; how parcels move and grow in
`wakewise.water.closure`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit
from wakewise.water.closure import disk_share, first_sigma_m
from wakewise.water.faces import Room
from wakewise.water.induction import impulse_velocity

MERGE_SPACING = 0.7  # of sigma: a closer pair becomes one, so rows are no coarser than 1.4 sigma (ripple 1e-4),
_OLD_D, _OLD_SPACING = 2.0, 1.4  # and from sigma over D of 2 to 2.8 on they are 1.4 times as coarse (ripple 1 %)
_PARALLEL = 0.9  # cosine: opposite parcels would cancel instead of stirring each other, so they never merge
CENTRE_SPEED = 2 / (3 * (2 * math.pi) ** 1.5)
"""Speed at the centre of a parcel of unit impulse and size: two thirds of its impulse's density there."""


@dataclass(frozen=True, eq=False)
class Parcels:
    """Impulse parcels, oldest first; a plain container whose arrays the water replaces at every step.

    Parameters
    ----------
    position_m : ndarray, shape (n, 3), in the world
    impulse_m4_s : ndarray, shape (n, 3)
        Thrust times time over density, along the jet.
    sigma_m : ndarray, shape (n,)
    diameter_m : ndarray, shape (n,)
        Disk diameter of the thruster that sent it.
    stream : ndarray of int, shape (n,)
        Which jet it belongs to: twice the thruster's index, plus one for reverse thrust.
    gust : ndarray, shape (n, 3)
        Turbulent share of the impulse, a standard normal variable before scaling.
    disk_m_s : ndarray, shape (n, 3)
        Velocity of the disk when it was sent: its water starts with it and loses it to what is entrained.
    share : ndarray, shape (n,)
        Of the parcel's water, what came through the disk.
    flow_m_s : ndarray, shape (n, 3)
        Velocity of the jets' water there when it was last looked at.
    held_s : ndarray, shape (n,)
        How long ago that was; infinite if never.
    """

    position_m: Array
    impulse_m4_s: Array
    sigma_m: Array
    diameter_m: Array
    stream: IntArray
    gust: Array
    disk_m_s: Array
    share: Array
    flow_m_s: Array
    held_s: Array

    @classmethod
    def none(cls) -> Parcels:
        """No parcels at all: still water."""
        v = np.zeros((0, 3))
        s = np.zeros(0)
        return cls(v, v, s, s, np.zeros(0, dtype=np.int64), v, v, s, v, s)

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
    ) -> Parcels:
        """New ones, at which the water has not been looked at yet."""
        never, flow = np.full(len(sigma_m), np.inf), np.zeros((len(sigma_m), 3))
        share = disk_share(sigma_m, diameter_m)
        return cls(position_m, impulse_m4_s, sigma_m, diameter_m, stream, gust, disk_m_s, share, flow, never)

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

    def joined(self, *later: Parcels) -> Parcels:
        """These followed by the later ones."""
        groups = (self, *later)
        return Parcels(*(np.concatenate([getattr(group, f.name) for group in groups]) for f in fields(self)))


def parcel_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, bed_z_m: float
) -> Array:
    """Velocity of parcels and of their mirror images in the bed, shape (n, 3), at points, shape (n, 3).

    Parameters
    ----------
    points_W_m : ndarray, shape (n, 3)
    positions_m, impulses_m4_s : ndarray, shape (k, 3)
    sigmas_m : ndarray, shape (k,)
    bed_z_m : float
        The plane z = bed_z_m, through which nothing flows; infinite for water without a bed.
    """
    room = Room.of(bed_z_m, (math.inf, math.inf), surface=False)
    return confined_velocity(points_W_m, positions_m, impulses_m4_s, sigmas_m, room)


def confined_velocity(
    points_W_m: Array, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array, room: Room
) -> Array:
    """Velocity of parcels and of their images in a room's faces; arguments as `parcel_velocity`."""
    sources = room.with_images(positions_m, impulses_m4_s, sigmas_m)
    u = impulse_velocity(points_W_m, *sources)
    for face in room.faces:
        if face.name == "bed":
            # On the bed itself parcel and image cancel across it; the sum only has their rounding.
            u[points_W_m[:, 2] == face.at_m, 2] = 0.0
    return u


def row_widening(sigma_m: Array, diameter_m: Array) -> Array:
    """How much coarser than a young jet's an old one's row may be, shape (n,): from 1 to 1.4."""
    wide: Array = np.clip(sigma_m / (_OLD_D * diameter_m), 1.0, _OLD_SPACING)
    return wide


def gusty_impulse_m4_s(parcels: Parcels, scale: float) -> Array:
    """Impulse with its turbulent part, which grows along the core and is full beyond it, shape (n, 3)."""
    if scale == 0.0 or parcels.count == 0:
        return parcels.impulse_m4_s
    first = first_sigma_m(parcels.diameter_m)
    share = np.clip((parcels.sigma_m - first) / (parcels.diameter_m / 2 - first), 0.0, 1.0)
    # Of fewer parcels each may fluctuate less for their sum to fluctuate as much.
    share *= scale / np.sqrt(row_widening(parcels.sigma_m, parcels.diameter_m))
    gusty: Array = parcels.impulse_m4_s + (share * parcels.size_m4_s)[:, None] * parcels.gust
    return gusty


def merged(parcels: Parcels, spacing: float) -> Parcels:
    """Pairs of successive parcels of one jet closer than `spacing` sigma made one; their impulse is conserved.

    For old parcels `row_widening` makes the distance longer.

    Sizes are averaged, not widened by the distance: in a row the distance lies along the jet, and widening would
    spread the jet sideways as well.
    """
    if parcels.count < 2:
        return parcels
    return _merged(parcels, np.arange(parcels.count), parcels.stream, spacing)


def merged_across(parcels: Parcels, spacing: float) -> Parcels:
    """Pairs of far-travelled parcels of different jets, alike in size and direction and very close, made one.

    Parcels are sorted into cells of half the spacing at most, level by level of size; neighbours in a cell may merge.
    """
    old = np.flatnonzero(parcels.sigma_m > parcels.diameter_m)  # 12 diameters of path
    if len(old) < 2:
        return parcels
    level = np.floor(2 * np.log2(parcels.sigma_m[old])).astype(np.int64)
    cell = np.floor(parcels.position_m[old] / (_OLD_SPACING * spacing * 2.0 ** (level / 2))[:, None]).astype(np.int64)
    # Eight bits for the level, eighteen for each of the others: cells of the size of their parcels never number more.
    key = (((level + 128) * 2**18 + cell[:, 0] + 2**17) * 2**18 + cell[:, 1] + 2**17) * 2**18 + cell[:, 2] + 2**17
    order = np.argsort(key, kind="stable")
    labels = np.empty(parcels.count, dtype=np.int64)
    labels[old[order]] = np.cumsum(np.diff(key[order], prepend=key[order[0]]) != 0)
    return _merged(parcels, old[order], labels, spacing)


def _merged(parcels: Parcels, order: IntArray, label: IntArray, spacing: float) -> Parcels:
    """Walk through parcels in an order; each may take up the one before it with the same label."""
    position, impulse = parcels.position_m.copy(), parcels.impulse_m4_s.copy()
    sigma, gust, disk = parcels.sigma_m.copy(), parcels.gust.copy(), parcels.disk_m_s.copy()
    share, flow, held = parcels.share.copy(), parcels.flow_m_s.copy(), parcels.held_s.copy()
    keep = np.ones(parcels.count, dtype=np.bool_)
    labels = int(label[order].max()) + 1
    reach = spacing * row_widening(sigma, parcels.diameter_m)
    if not _merge_pairs(order, position, impulse, sigma, gust, disk, share, flow, held, label, labels, reach, keep):
        return parcels
    out = Parcels(position, impulse, sigma, parcels.diameter_m, parcels.stream, gust, disk, share, flow, held)
    return out.take(keep)


@njit
def _merge_pairs(
    order: IntArray,
    X: Array,
    m: Array,
    sigma: Array,
    gust: Array,
    disk: Array,
    share: Array,
    flow: Array,
    held: Array,
    label: IntArray,
    labels: int,
    spacing: Array,
    keep: np.ndarray,
) -> bool:
    last, found = np.full(labels, -1), False
    for j in order:
        i = last[label[j]]
        last[label[j]] = j
        if i < 0:
            continue
        reach = min(spacing[i], spacing[j]) * min(sigma[i], sigma[j])
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
        held[j] = max(held[i], held[j])
        for k in range(3):
            X[j, k] = p * X[i, k] + q * X[j, k]
            disk[j, k] = p * disk[i, k] + q * disk[j, k]
            flow[j, k] = p * flow[i, k] + q * flow[j, k]
            gust[j, k] = (p * gust[i, k] + q * gust[j, k]) / math.sqrt(p * p + q * q)
            m[j, k] += m[i, k]
        keep[i], found = False, True
        # A merged parcel waits for the next step, so that rows thin evenly.
        last[label[j]] = -1
    return found


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

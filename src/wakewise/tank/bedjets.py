"""Radial wall jets on the bed and the other faces: where a free jet goes after it has struck one.

A free jet that strikes a floor turns within about 0.14 of its height and runs out along the floor in a thin layer with
u_max = 1.16 sqrt(M) / r and a half thickness of 0.09 r, r from the strike point, M = thrust / density (Beltaos and
Rajaratnam 1974, J. Hydraul. Div. ASCE 100 HY10; Rajaratnam 1976, Turbulent Jets). Impulse parcels cannot
form that layer, so each one that strikes becomes a *ring*: a stretch of the layer that carries the parcel's impulse
outward at the layer's mean speed. Rings of one jet add up to the law when thrust is steady, and start, swell and fade
with it otherwise.

One ring's velocity in the sector at azimuth phi (height h above the bed, distance r from its centre) is
    u_r = (A/r) g dF/dh,   u_up = -(A/r) dg/dr F,   g = exp(-ln(r/R)^2 / (2 L^2)),
    F = delta sqrt(pi/2) erf(h / (sqrt 2 delta)) exp(-h/R),   delta = 0.093 R,
which is free of divergence, runs along the bed at h = 0 and takes its water from above. A jet that comes in at a slant
sends the share w(phi) = exp(kappa cos(phi - phi0)) / I0(kappa) of its momentum towards phi, with kappa such that the
horizontal momentum is the jet's own; in that sector R becomes R w^(1/4) and A becomes A sqrt(w), as the law asks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import i0

from wakewise.arrays import Array, IntArray
from wakewise.tank.bedjets_sums import (
    HIGHEST,
    LOG_WIDTH,
    REACH,
    WALL_JET_SPREAD,
    sum_planes,
    with_images,
)
from wakewise.tank.chunks import over_points
from wakewise.tank.faces import LEAST_IMAGE_M_S, Face, Room

WALL_JET_SPEED = 1.16  # u_max r / sqrt(M), Rajaratnam 1976
STRIKE_HEIGHT = 1.75  # of the parcel's sigma: 0.14 H, where the bed's pressure begins to turn the jet (Beltaos 1974)
_LAYER_CONVECTION = 1 / math.sqrt(2)  # mean of u weighted with u over a Gaussian layer, as a share of u_max
# Rings of one jet closer than this share of L become one: then none are more than 2 L apart, where a row of Gaussians
# still sums to a constant within 1.4 % (Poisson summation, 2 exp(-2 pi^2 / 4)).
_RING_MERGE = 1.0


@dataclass(frozen=True, eq=False)
class Rings:
    """Rings of the wall jets, oldest first.

    Parameters
    ----------
    centre_m : ndarray, shape (n, 2)
        Where the jet struck, carried by the current since.
    radius_m : ndarray, shape (n,)
    impulse_m4_s : ndarray, shape (n,)
    heading : ndarray, shape (n, 2)
        Horizontal unit vector towards which a slanting jet leans.
    kappa : ndarray, shape (n,)
        How much it leans, 0 for an upright jet.
    stream : ndarray of int, shape (n,)
        The jet it came from.
    """

    centre_m: Array
    radius_m: Array
    impulse_m4_s: Array
    heading: Array
    kappa: Array
    stream: IntArray

    @classmethod
    def none(cls) -> Rings:
        """No rings at all."""
        return cls(
            np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=np.int64)
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.radius_m)

    def take(self, keep: np.ndarray) -> Rings:
        """Those that a mask or an index array picks."""
        return Rings(
            self.centre_m[keep],
            self.radius_m[keep],
            self.impulse_m4_s[keep],
            self.heading[keep],
            self.kappa[keep],
            self.stream[keep],
        )

    def joined(self, later: Rings) -> Rings:
        """These followed by the later ones."""
        return Rings(
            np.concatenate([self.centre_m, later.centre_m]),
            np.concatenate([self.radius_m, later.radius_m]),
            np.concatenate([self.impulse_m4_s, later.impulse_m4_s]),
            np.concatenate([self.heading, later.heading]),
            np.concatenate([self.kappa, later.kappa]),
            np.concatenate([self.stream, later.stream]),
        )


def lean(horizontal_share: Array) -> Array:
    """Concentration kappa of a von Mises distribution whose mean direction vector has the given length, shape (n,).

    Best and Fisher 1981 (doi 10.1080/03610918108812225), good to about 1 %; cut at a length of 0.98.
    """
    h = np.clip(np.asarray(horizontal_share, dtype=np.float64), 0.0, 0.98)
    low = 2 * h + h**3 + 5 * h**5 / 6
    middle = -0.4 + 1.39 * h + 0.43 / (1 - h)
    high = 1 / np.maximum(h**3 - 4 * h**2 + 3 * h, 1e-9)
    kappa: Array = np.where(h < 0.53, low, np.where(h < 0.85, middle, high))
    return kappa


def rings_from_strikes(position_m: Array, impulse_m4_s: Array, sigma_m: Array, stream: IntArray) -> Rings:
    """Rings that take over from parcels (arrays as in `Parcels`) which have come down to the bed."""
    size = np.linalg.norm(impulse_m4_s, axis=1)
    flat = np.hypot(impulse_m4_s[:, 0], impulse_m4_s[:, 1])
    heading = np.where(flat[:, None] > 0, impulse_m4_s[:, :2], [1.0, 0.0]) / np.where(flat > 0, flat, 1.0)[:, None]
    share = flat / np.where(size > 0, size, 1.0)
    return Rings(position_m[:, :2].copy(), STRIKE_HEIGHT * sigma_m, size, heading, lean(share), stream.copy())


def ring_velocity(
    points_W_m: Array, rings: Rings, bed_z_m: float, least_m: float = 0.0, *, exact: bool = False
) -> Array:
    """Velocity of the rings, shape (n, 3), at points, shape (n, 3); zero if there are none.

    `least_m` is the least thickness delta of a layer, whose momentum stays; see `packed_rings`. `exact` sums in double
    precision.
    """
    return packed_velocity(points_W_m, packed_rings(rings, least_m), bed_z_m, exact=exact)


def packed_rings(rings: Rings, least_m: float = 0.0, per_height: float = 0.0) -> Array:
    """One row per ring, as the kernel reads it, for several calls of `packed_velocity`, shape (n, 14).

    A layer has the thickness hypot(0.093 R, least_m). Where that is more than the law's, it is slower by the square
    root of the ratio, so that it carries the same momentum. `per_height` is one over
    the distance to the opposite face, where F ends with a factor 1 - h per_height; 0 for none.
    """
    strength = ring_strength(rings)
    weight = 1 / i0(rings.kappa)
    # Where a ring can be felt at all, whatever the azimuth: w lies between exp(-kappa)/I0 and exp(kappa)/I0.
    inner = rings.radius_m * (weight * np.exp(-rings.kappa)) ** 0.25 * math.exp(-REACH)
    outer = rings.radius_m * (weight * np.exp(rings.kappa)) ** 0.25 * math.exp(REACH)
    highest = HIGHEST * outer * math.exp(-REACH)
    least, ends = np.full(rings.count, least_m), np.full(rings.count, per_height)
    return np.column_stack(
        [
            rings.centre_m,
            rings.radius_m,
            strength,
            rings.heading,
            rings.kappa,
            weight,
            inner**2,
            outer**2,
            highest,
            least,
            ends,
            np.log(weight),
        ]
    )


def packed_velocity(points_W_m: Array, packed: Array, bed_z_m: float, *, exact: bool = False) -> Array:
    """Velocity of packed rings, shape (n, 3), at points, shape (n, 3)."""
    flat = np.concatenate([np.zeros(3), np.eye(3).ravel(), [bed_z_m, 0.0]])
    return planes_velocity(points_W_m, flat[None], np.array([0, len(packed)]), packed, exact=exact)


def planes_velocity(points_W_m: Array, planes: Array, starts: IntArray, packed: Array, *, exact: bool = False) -> Array:
    """Velocity of packed rings on several planes, shape (n, 3), at points, shape (n, 3).

    Parameters
    ----------
    points_W_m : ndarray, shape (n, 3)
    planes : ndarray, shape (k, 14)
        Of each: origin, the three rows of the turn from the world into its frame, depth there, and 1 if it has the
        same rings on both sides, else 0.
    starts : ndarray of int, shape (k + 1,)
        Plane i has the rings from starts[i] to starts[i + 1].
    packed : ndarray, shape (m, 14)
        See `packed_rings`; each in its plane's frame.
    exact : bool
        Sum in double precision.
    """
    out = np.zeros((len(points_W_m), 3))
    if len(packed) and len(points_W_m):
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        cost = 4 * len(points) * len(packed)  # a ring takes as long as four parcels
        kind = np.zeros(0, np.float64 if exact else np.float32)
        over_points(lambda some, result: sum_planes(some, planes, starts, packed, kind, result), points, out, cost)
    return out


def with_ring_images(packed: Array, face: Face, room: Room) -> Array:
    """Packed rings on a face, and their images in the faces across it that they can reach at a speed that matters."""
    first, second = (face.axis + 1) % 3, (face.axis + 2) % 3
    walls = [((first, second).index(o.axis), o.at_m, o.side) for o in room.faces if o.axis != face.axis]
    if not walls or not len(packed):
        return packed
    return with_images(packed, np.array(walls, dtype=np.float64), LEAST_IMAGE_M_S)


def ring_strength(rings: Rings) -> Array:
    """A of each ring in m2/s, shape (n,): such that rings sent at a steady rate add up to u_max = 1.16 sqrt(M) / r."""
    scale = _LAYER_CONVECTION * WALL_JET_SPEED**2 / (math.sqrt(2 * math.pi) * LOG_WIDTH)
    return scale * rings.impulse_m4_s / rings.radius_m**2


def layer_speed(rings: Rings) -> Array:
    """Speed at the bed under each ring's crest, shape (n,), from all rings of its own jet.

    Rings about one centre add up in full. A jet that wanders leaves rings about many: the crests of two of them meet
    along less and less of their length as the centres part, and hardly at all a radius apart.
    """
    speed = np.zeros(rings.count)
    _sum_layers(rings.centre_m, rings.radius_m, ring_strength(rings), rings.stream, speed)
    return speed


def grown(rings: Rings, current_m_s: Array, dt_s: float, least_m: float = 0.0) -> tuple[Rings, Array]:
    """Rings after dt_s, and the layer speed they had, shape (n,). Exact in dt for a speed that falls as 1/R.

    The current carries the centres: velocity in the face's frame, shape (3,) or (n, 3). `least_m` as in
    `ring_velocity`.
    """
    thin = WALL_JET_SPREAD * rings.radius_m
    speed = layer_speed(rings) * np.sqrt(thin / np.hypot(thin, least_m))
    radius = np.sqrt(rings.radius_m**2 + 2 * rings.radius_m * _LAYER_CONVECTION * speed * dt_s)
    centre = rings.centre_m + current_m_s[..., :2] * dt_s
    return Rings(centre, radius, rings.impulse_m4_s, rings.heading, rings.kappa, rings.stream), speed


def coarsened(rings: Rings) -> Rings:
    """Neighbouring rings of one jet, close in radius and centre, made one; impulse is conserved."""
    if rings.count < 2:
        return rings
    order = np.lexsort((np.arange(rings.count), rings.stream))
    keep = np.ones(rings.count, dtype=np.bool_)
    centre, radius, impulse = rings.centre_m.copy(), rings.radius_m.copy(), rings.impulse_m4_s.copy()
    heading, kappa = rings.heading.copy(), rings.kappa.copy()
    _merge_rings(order, centre, radius, impulse, heading, kappa, rings.stream, keep)
    if keep.all():
        return rings
    return Rings(centre, radius, impulse, heading, kappa, rings.stream).take(keep)


@njit(cache=True)
def _merge_rings(
    order: IntArray,
    centre: Array,
    radius: Array,
    impulse: Array,
    heading: Array,
    kappa: Array,
    stream: IntArray,
    keep: np.ndarray,
) -> None:
    joined_last = False
    for n in range(1, order.shape[0]):
        a, b = order[n - 1], order[n]
        close = (
            not joined_last
            and stream[a] == stream[b]
            and abs(math.log(radius[a] / radius[b])) < _RING_MERGE * LOG_WIDTH
            and math.hypot(centre[a, 0] - centre[b, 0], centre[a, 1] - centre[b, 1])
            < _RING_MERGE * LOG_WIDTH * radius[a]
        )
        joined_last = close
        if not close:
            continue
        share = impulse[a] / (impulse[a] + impulse[b])
        # The newer ring b takes a's part, so that the order within a jet stays.
        centre[b] = share * centre[a] + (1 - share) * centre[b]
        radius[b] = share * radius[a] + (1 - share) * radius[b]
        turned = share * heading[a] + (1 - share) * heading[b]
        heading[b] = turned / max(math.hypot(turned[0], turned[1]), 1e-12)
        kappa[b] = share * kappa[a] + (1 - share) * kappa[b]
        impulse[b] += impulse[a]
        keep[a] = False


@njit(cache=True)
def _sum_layers(centre: Array, radius: Array, strength: Array, stream: IntArray, out: Array) -> None:
    """For each ring, strengths of its jet's rings weighted with nearness in log radius and in centre, over radius."""
    for i in range(radius.shape[0]):
        total = 0.0
        for j in range(radius.shape[0]):
            if stream[i] != stream[j]:
                continue
            apart = math.log(radius[i] / radius[j]) / LOG_WIDTH
            dx, dy = centre[i, 0] - centre[j, 0], centre[i, 1] - centre[j, 1]
            wide = 2.0 * (dx * dx + dy * dy) / (radius[i] * radius[i])
            exponent = 0.5 * apart * apart + wide
            if exponent < 12.0:
                total += strength[j] * math.exp(-exponent)
        out[i] = total / radius[i]

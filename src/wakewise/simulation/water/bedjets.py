"""Radial wall jets on bed, walls and surface, after a free jet strikes one of them.

A jet that strikes a floor turns within 0.14 of its height and spreads in a thin layer with u_max = 1.16 sqrt(M) / r and
half thickness 0.09 r, r from the strike point, M = thrust / density (Beltaos and Rajaratnam 1974, J. Hydraul. Div. ASCE
100 HY10; Rajaratnam 1976, Turbulent Jets). Impulse parcels cannot form that layer, so each parcel that strikes becomes
a *ring*: a part of the layer that carries the parcel's impulse outward at the layer's mean speed.

Velocity of a ring in the sector at azimuth phi (height h above the bed, distance r from its centre):

    u_r = (A/r) g dF/dh,   u_up = -(A/r) dg/dr F,   g = exp(-ln(r/R)^2 / (2 L^2)),
    F = delta sqrt(pi/2) erf(h / (sqrt 2 delta)) exp(-h/R),   delta = 0.093 R

It is free of divergence, parallel to the bed at h = 0, and entrains from above. At oblique incidence the share
w(phi) = exp(kappa cos(phi - phi0)) / I0(kappa) of the momentum goes towards phi, kappa such that the horizontal
momentum is the jet's; in that sector R becomes R w^(1/4) and A becomes A sqrt(w).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, assign_rows, njit
from wakewise.simulation.water.bedjets_sums import (
    COLUMNS,
    LOG_WIDTH,
    WALL_JET_SPREAD,
    finish_rows,
    leaning,
    log_i0s,
    log_overlap,
    with_images,
)
from wakewise.simulation.water.faces import TankFace, TankFaces, with_capacity

WALL_JET_SPEED = 1.16  # u_max r / sqrt(M), Rajaratnam 1976
STRIKE_HEIGHT = 1.75  # of the parcel's sigma: 0.14 H, where the bed's pressure begins to turn the jet (Beltaos 1974)
_LAYER_CONVECTION = 1 / math.sqrt(2)  # mean of u weighted with u over a Gaussian layer, as a share of u_max
STRENGTH = _LAYER_CONVECTION * WALL_JET_SPEED**2 / (math.sqrt(2 * math.pi) * LOG_WIDTH)
"""A of a ring in m2/s over its impulse, times its radius squared."""
# Rings become one that are less than this apart, counted in widths L of their crests: then rows are no coarser than
# 2 sqrt(2) L, where Gaussians still sum to a constant within 17 % (Poisson summation, 2 exp(-2 pi^2 / 8)), and mostly
# no coarser than 2 L, where they do within 1.4 %.
_MERGE_L2 = 2.0
# Weak rings may come from farther, as long as no water is moved wrongly by more than about this.
_MERGE_ERROR_M_S, _FARTHEST_L2 = 1.5e-3, 6.0


class RingBuffers(NamedTuple):
    """Room for the rings of all planes, of which the first so many are in use; the step writes into it.

    `plane`, shape (n,), is the number of each ring's plane; the others are as in `WallJetRings`.
    """

    plane: IntArray
    centre: Array
    radius: Array
    impulse: Array
    lean: Array


@dataclass(frozen=True, eq=False)
class WallJetRings:
    """Rings of the wall jets on one plane, in its own frame."""

    centre_m: Array  # shape (n, 2): where the jet struck, carried by the current since
    radius_m: Array  # shape (n,)
    impulse_m4_s: Array  # shape (n,)
    # Shape (n, 2): share of the impulse that goes along the plane, as a vector: its length is below 1, and 0 for an
    # upright jet.
    lean: Array

    @classmethod
    def none(cls) -> WallJetRings:
        """No rings at all."""
        return cls(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, 2)))

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.radius_m)

    @cached_property
    def heading_kappa(self) -> tuple[Array, Array]:
        """Unit vectors towards which slanting jets lean, shape (n, 2), and how much, shape (n,): 0 for upright ones."""
        heading, kappa = leaning(self.lean)
        return heading, kappa

    def take(self, keep: np.ndarray) -> WallJetRings:
        """Those that a mask or an index array picks."""
        return WallJetRings(self.centre_m[keep], self.radius_m[keep], self.impulse_m4_s[keep], self.lean[keep])

    @classmethod
    def of(cls, layers: RingBuffers, count: int, plane: int) -> WallJetRings:
        """A copy of those of the first `count` that lie on a plane."""
        on = np.flatnonzero(layers.plane[:count] == plane)
        return cls(layers.centre[on], layers.radius[on], layers.impulse[on], layers.lean[on])

    def layers(self) -> RingBuffers:
        """A copy as the only plane's."""
        copies = (a.copy() for a in (self.centre_m, self.radius_m, self.impulse_m4_s, self.lean))
        return RingBuffers(np.zeros(self.count, np.int64), *copies)

    def joined(self, later: WallJetRings) -> WallJetRings:
        """These followed by the later ones."""
        return WallJetRings(
            np.concatenate([self.centre_m, later.centre_m]),
            np.concatenate([self.radius_m, later.radius_m]),
            np.concatenate([self.impulse_m4_s, later.impulse_m4_s]),
            np.concatenate([self.lean, later.lean]),
        )


@njit(nogil=True)
def fill_row(
    row: Array,
    centre: Array,
    radius: float,
    impulse: float,
    heading: Array,
    kappa: float,
    least: float,
    per_height: float,
    stretch: float,
) -> None:
    """Write one row of `packed_rings`, but for what `finish_rows` fills in."""
    row[0], row[1], row[2] = centre[0], centre[1], radius
    row[3] = STRENGTH * impulse / radius**2 / stretch
    row[4], row[5], row[6] = heading[0], heading[1], kappa
    row[11], row[12] = least / stretch, per_height


def layer_speed(rings: WallJetRings) -> Array:
    """Speed at the bed under each ring's crest, shape (n,), from all rings that lie on the same ground.

    Rings about one centre that lean the same way add up in full, from whichever jets they came. Rings about different
    centres meet along less and less of their crests as the centres part, and hardly at all a radius apart; those that
    lean different ways lend each other speed as far as their directions overlap.
    """
    speed: Array = layer_speeds(rings.layers(), rings.count)
    return speed


@njit(apart=True, nogil=True)
def kept_rings(layers: RingBuffers, count: int, keep: np.ndarray) -> int:
    """Close the ranks: of the first `count`, only those that a mask picks stay; how many they are."""
    left = 0
    for j in range(count):
        if keep[j]:
            layers.plane[left], layers.radius[left] = layers.plane[j], layers.radius[j]
            layers.impulse[left] = layers.impulse[j]
            layers.centre[left], layers.lean[left] = layers.centre[j], layers.lean[j]
            left += 1
    return left


@njit(apart=True, nogil=True)
def layer_speeds(layers: RingBuffers, count: int) -> Array:
    """As `layer_speed`, each among those of its own plane."""
    out, per_L = np.empty(count), 1.0 / LOG_WIDTH
    heading, kappa = leaning(layers.lean[:count])
    centre, radius, plane = layers.centre, layers.radius, layers.plane
    logs, bessel = np.log(radius[:count]), log_i0s(kappa)
    strength = STRENGTH * layers.impulse[:count] / radius[:count] ** 2
    assign(out, strength)
    for i in range(count):
        for j in range(i + 1, count):
            apart = (logs[i] - logs[j]) * per_L
            alike = 0.5 * apart * apart
            if alike >= 12.0 or plane[i] != plane[j]:
                continue
            dx, dy = centre[i, 0] - centre[j, 0], centre[i, 1] - centre[j, 1]
            off = 2.0 * (dx * dx + dy * dy)
            for_i, for_j = alike + off / (radius[i] * radius[i]), alike + off / (radius[j] * radius[j])
            if min(for_i, for_j) >= 12.0:
                continue
            shared = log_overlap(heading[i], kappa[i], bessel[i], heading[j], kappa[j], bessel[j])
            if for_i < 12.0:
                out[i] += strength[j] * math.exp(shared - for_i)
            if for_j < 12.0:
                out[j] += strength[i] * math.exp(shared - for_j)
    for i in range(count):
        out[i] /= radius[i]
    return out


@njit(apart=True, nogil=True)
def grow_layers(
    layers: RingBuffers, count: int, current_m_s: Array, least_m: Array, stretch: Array, dt_s: float, speed_m_s: Array
) -> None:
    """Let rings run out for dt_s, in place. Exact in dt for a speed that falls as 1/R.

    - `current_m_s`, shape (count, 3): velocity of the current in each ring's plane's frame, which carries the centres.
    - `least_m`, `stretch`: as in `packed_rings`.
    - `speed_m_s`, shape (count,): layer speed that they had; written.
    """
    speeds = layer_speeds(layers, count)
    for j in range(count):
        R, plane = layers.radius[j], layers.plane[j]
        thin = WALL_JET_SPREAD * R
        speed_m_s[j] = speeds[j] * thin / math.sqrt((stretch[plane] * thin) ** 2 + least_m[plane] ** 2)
        layers.radius[j] = math.sqrt(R * R + 2 * R * _LAYER_CONVECTION * speed_m_s[j] * dt_s)
        for k in range(2):
            layers.centre[j, k] += current_m_s[j, k] * dt_s


@njit(apart=True, nogil=True)
def merge_layers(layers: RingBuffers, count: int) -> int:
    """Rings of a plane that are near each other in centre, radius and direction made one; how many are left.

    Kept are their impulse, the part of it along the plane, the centre of impulse, and the flow that they carry, which
    goes with impulse over radius. Each ring may take up an older one close to it, and one that took part waits for the
    next time.
    """
    if count < 2:
        return count
    centre, radius, impulse, lean = layers.centre, layers.radius, layers.impulse, layers.lean
    free, keep, found = np.ones(count, np.bool_), np.ones(count, np.bool_), False
    heading, kappa = leaning(lean[:count])
    logs, bessel, per_L2 = np.log(radius[:count]), log_i0s(kappa), LOG_WIDTH**-2
    speed = STRENGTH * impulse[:count] / radius[:count] ** 3
    for b in range(count - 1, 0, -1):
        if not free[b]:
            continue
        for a in range(b - 1, -1, -1):
            if not free[a] or layers.plane[a] != layers.plane[b]:
                continue
            dx, dy = centre[a, 0] - centre[b, 0], centre[a, 1] - centre[b, 1]
            apart2 = per_L2 * ((logs[a] - logs[b]) ** 2 + (dx * dx + dy * dy) / min(radius[a], radius[b]) ** 2)
            weaker = min(speed[a], speed[b])
            most = min(max(_MERGE_L2, (_MERGE_ERROR_M_S / weaker) ** 2), _FARTHEST_L2)
            if apart2 > most:
                continue
            # Gaussians x widths apart overlap by exp(-x^2 / 8).
            apart2 -= 8.0 * log_overlap(heading[a], kappa[a], bessel[a], heading[b], kappa[b], bessel[b])
            if apart2 > most:
                continue
            total = impulse[a] + impulse[b]
            share = impulse[a] / total
            for k in range(2):
                centre[b, k] = share * centre[a, k] + (1 - share) * centre[b, k]
                lean[b, k] = share * lean[a, k] + (1 - share) * lean[b, k]
            radius[b] = 1.0 / (share / radius[a] + (1 - share) / radius[b])
            impulse[b] = total
            keep[a] = free[a] = free[b] = False
            found = True
            break
    return kept_rings(layers, count, keep) if found else count


LEAST_RING_IMAGE_M_S = 2e-4  # images whose crest would not reach this speed at the wall are left out
_MOST = 400  # rings
_REST = 3.0  # wall jets rest at this many times the parcels' rest speed: on the bed 3 mm/s,
_SHEET_REST = 10.0  # and the jets of a meeting, of which there may be many, at this many
SPREADS_FASTER = 3.0
"""How many times as fast as a wall jet the radial jet of a meeting spreads: see
`wakewise.simulation.water.colliding_jets`.
"""
_SHEETS = 128  # capacity for planes of opposed jets: those stored, and those whose rings still move


class JetPlanes(NamedTuple):
    """Planes of the rings: the faces first, then spare rows for the planes of opposed jets.

    `frames`, shape (p, 14), are as in `bedjets.planes_velocity`; `thickness` and `stretch` the `least_m` and `stretch`
    of `bedjets.packed_rings`, and `per_height` its own; `key`, shape (p, 2), are the two jets that meet there, and
    `used` when that was last looked up, 0 if it is forgotten. `walls`, shape (f, 4), are the faces as
    `TankFaces.walls`.
    """

    frames: Array
    thickness: Array
    stretch: Array
    per_height: Array
    key: IntArray
    used: IntArray
    walls: Array

    @classmethod
    def of(cls, room: TankFaces) -> JetPlanes:
        """The faces of a room, and no meeting yet."""
        many, faces = len(room.faces) + _SHEETS, len(room.faces)
        planes = cls(
            np.zeros((many, 14)),
            np.zeros(many),
            np.full(many, SPREADS_FASTER),
            np.zeros(many),
            np.zeros((many, 2), np.int64),
            np.zeros(many, np.int64),
            np.array(room.walls),
        )
        for k, face in enumerate(room.faces):
            planes.frames[k], planes.per_height[k] = face.frame, _per_height(face, room)
        planes.stretch[:faces] = 1.0
        return planes


@dataclass(frozen=True, eq=False)
class PackedRings:
    """Rings and their images at one instant, packed for the kernel; arguments of `bedjets.planes_velocity`."""

    planes: Array
    starts: IntArray
    packed: Array

    def pairs(self, points: int) -> int:
        """How many pairs of a point and an impulse take as long as the sum at so many points."""
        return 2 * points * len(self.packed)


def _per_height(face: TankFace, room: TankFaces) -> float:
    """One over the distance from a face to the opposite one; 0 without one."""
    opposite = [other for other in room.faces if other.axis == face.axis and other.side != face.side]
    return 1.0 / abs(opposite[0].at_m - face.at_m) if opposite else 0.0


@njit(apart=True, nogil=True)
def start_ring(
    layers: RingBuffers, count: int, planes: JetPlanes, plane: int, position: Array, impulse: Array, sigma: float
) -> int:
    """Let a parcel that has come down to a plane go on as a ring behind the first `count`; how many there are then."""
    f = planes.frames[plane]
    size = np.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)
    layers.plane[count], layers.radius[count], layers.impulse[count] = plane, STRIKE_HEIGHT * sigma, size
    for i in range(2):
        place = along = 0.0
        for k in range(3):
            place += f[3 + 3 * i + k] * (position[k] - f[k])
            along += f[3 + 3 * i + k] * impulse[k]
        layers.centre[count, i], layers.lean[count, i] = place, along / size if size > 0.0 else 0.0
    return count + 1


@njit(apart=True, nogil=True)
def ring_places(layers: RingBuffers, count: int, planes: JetPlanes) -> Array:
    """Centres of the first `count` rings in the world, shape (count, 3)."""
    out = np.empty((count, 3))
    for j in range(count):
        f = planes.frames[layers.plane[j]]
        for k in range(3):
            along = f[3 + k] * layers.centre[j, 0] + f[6 + k] * layers.centre[j, 1]
            out[j, k] = f[k] + along + f[9 + k] * f[12]
    return out


@njit(apart=True, nogil=True)
def grow_rings(
    layers: RingBuffers,
    count: int,
    planes: JetPlanes,
    places: Array,
    ambient: Array,
    dt_s: float,
    rest_speed_m_s: float,
) -> int:
    """Let rings run out for dt_s, carried along their planes by the ambient water at their centres; how many are left.

    Those that have come to rest, have left the tank with the current by half their radius, or reach beyond twice the
    tank are gone. `places` and `ambient`, shape (count, 3), are their centres and the water there, in the world.
    """
    walls, reach = planes.walls, np.inf
    for f in range(walls.shape[0]):
        reach = (
            2 * abs(walls[f, 1]) if walls[f, 0] != 2 and (reach == np.inf or 2 * abs(walls[f, 1]) > reach) else reach
        )
    before, current, speed = layers.radius[:count].copy(), np.zeros((count, 3)), np.empty(count)
    for j in range(count):
        f = planes.frames[layers.plane[j]]
        for i in range(2):
            for k in range(3):
                current[j, i] += f[3 + 3 * i + k] * ambient[j, k]
    grow_layers(layers, count, current, planes.thickness, planes.stretch, dt_s, speed)
    keep = np.ones(count, np.bool_)
    for j in range(count):
        rest = rest_speed_m_s * (_REST if layers.plane[j] < walls.shape[0] else _SHEET_REST)
        keep[j] = speed[j] >= rest and layers.radius[j] < reach
        for f in range(walls.shape[0]):
            behind = walls[f, 2] * (places[j, int(walls[f, 0])] - walls[f, 1])
            keep[j] &= behind < 0.5 * before[j]
    return kept_rings(layers, count, keep)


@njit(apart=True, nogil=True)
def thin_rings(layers: RingBuffers, count: int) -> int:
    """Merge neighbouring rings of a plane; of too many, drop the slowest. Returns the count."""
    count = merge_layers(layers, count)
    if count > _MOST:
        speeds = layer_speeds(layers, count)
        least = np.sort(speeds)[count - _MOST]
        count = kept_rings(layers, count, speeds >= least)
    return count


@njit(apart=True, nogil=True)
def wall_rows(layers: RingBuffers, count: int, planes: JetPlanes) -> tuple[Array, IntArray, Array]:
    """Planes with rings, where each one's rings start, and the rings with their images, as `PackedRings` has them."""
    heading, kappa = leaning(layers.lean[:count])
    faces, many = planes.walls.shape[0], planes.frames.shape[0]
    on = np.zeros(many, np.int64)
    for j in range(count):
        on[layers.plane[j]] += 1
    frames, starts = np.empty((many, 14)), np.zeros(many + 1, np.int64)
    packed, used = np.empty((4 * count, COLUMNS)), 0
    for p in range(many):
        if on[p] == 0:
            continue
        rows, n = np.empty((on[p], COLUMNS)), 0
        for j in range(count):
            if layers.plane[j] == p:
                _fill_row(rows[n], layers, j, planes, heading[j], kappa[j])
                n += 1
        finish_rows(rows)
        if p < faces:
            rows = with_images(rows, _walls_across(planes.walls, p), LEAST_RING_IMAGE_M_S)
        end = starts[used] + rows.shape[0]
        if end > packed.shape[0]:
            packed = with_capacity(packed, 2 * end)
        assign_rows(packed[starts[used] : end], rows)
        assign(frames[used], planes.frames[p])
        used += 1
        starts[used] = end
    return frames[:used].copy(), starts[: used + 1].copy(), packed[: starts[used]].copy()


@njit(nogil=True)
def _fill_row(row: Array, layers: RingBuffers, j: int, planes: JetPlanes, heading: Array, kappa: float) -> None:
    p = layers.plane[j]
    fill_row(
        row,
        layers.centre[j],
        layers.radius[j],
        layers.impulse[j],
        heading,
        kappa,
        planes.thickness[p],
        planes.per_height[p],
        planes.stretch[p],
    )


@njit(nogil=True)
def _walls_across(walls: Array, face: int) -> Array:
    """Of the faces that stand across one: which of its two axes they stand on, where, and on which side."""
    out, count = np.empty((walls.shape[0], 3)), 0
    for f in range(walls.shape[0]):
        turn = (int(walls[f, 0]) - int(walls[face, 0])) % 3
        if turn:
            out[count, 0], out[count, 1], out[count, 2] = turn - 1, walls[f, 1], walls[f, 2]
            count += 1
    return out[:count]

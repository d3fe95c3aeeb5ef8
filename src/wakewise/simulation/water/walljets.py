"""All wall jets of the tank: rings on every face, and on the planes in which jets meet head-on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, assign_rows, njit
from wakewise.simulation.water.bedjets import (
    STRIKE_HEIGHT,
    RingBuffers,
    fill_row,
    grow_layers,
    kept_rings,
    layer_speeds,
    merge_layers,
)
from wakewise.simulation.water.bedjets_sums import COLUMNS, finish_rows, leaning, with_images
from wakewise.simulation.water.faces import TankFace, TankFaces, with_capacity

LEAST_RING_IMAGE_M_S = 2e-4  # images whose crest would not reach this speed at the wall are left out
_MOST = 400  # rings
_REST = 3.0  # wall jets rest at this many times the parcels' rest speed: on the bed 3 mm/s,
_SHEET_REST = 10.0  # and the jets of a meeting, of which there may be many, at this many
SPREADS_FASTER = 3.0
"""How many times as fast as a wall jet the radial jet of a meeting spreads: see
`wakewise.simulation.water.colliding_jets`.
"""
_SHEETS = 128  # room for planes in which jets meet: those remembered, and those whose rings still run


class JetPlanes(NamedTuple):
    """What rings run along: the faces first, then room for the planes in which jets meet.

    `frames`, shape (p, 14), are as in `bedjets.planes_velocity`; `thickness` and `stretch` the `least_m` and `stretch`
    of `bedjets.packed_rings`, and `per_height` its own; `key`, shape (p, 2), tells which two jets meet there, and
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
    """Make neighbouring rings of a plane one; of too many, let the slowest go. How many are left."""
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

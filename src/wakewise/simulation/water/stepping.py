"""Compiled step of the whole water: advection, emission, collisions, strikes, merging of parcels.

The state is in arrays with spare rows, of which the first `count` are in use, written in place. Ambient velocities are
evaluated before the step, since a current may be any Python object.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, assign_rows, njit
from wakewise.simulation.water.bedjets import (
    STRIKE_HEIGHT,
    JetPlanes,
    RingBuffers,
    grow_rings,
    ring_places,
    start_ring,
    thin_rings,
    wall_rows,
)
from wakewise.simulation.water.bedjets_sums import sum_planes
from wakewise.simulation.water.blockage import PackedBlockage, add_body, answer, deflect_velocity, strike_body
from wakewise.simulation.water.clusters import clustered, sum_field
from wakewise.simulation.water.colliding_jets import deflect_colliding, spread_crossing_jets
from wakewise.simulation.water.faces import mirrored
from wakewise.simulation.water.induction import ordered
from wakewise.simulation.water.parcel_advection import (
    advect_parcels,
    emit_parcels,
    fade_gusts,
    parcels_to_sample,
    slugs,
)
from wakewise.simulation.water.parcels import MERGE_SPACING, ParcelBuffers, kept_only, merge_across, merge_rows

_MANY = 800  # parcels; with more, old ones of different jets merge over distances that grow in proportion
# Steps after which different jets and rings are looked through for what may become one, and after which the body's
# answer to what carries parcels is found anew.
_EVERY = 2
_STEEPEST_GRAZE = math.sin(math.radians(10))  # parcels that come in flatter than this slide along the face


class WaterConstants(NamedTuple):
    """What stays the same from step to step."""

    drift: Array  # shape (5,): as in `parcel_advection.advect_parcels`; the fourth is the time step in s
    wake_stream: int  # of the hull's wake: one more than the jets' own
    rest_speed: float  # in m/s
    gusty: bool
    bed_z: float
    curve: np.ndarray  # `induction.curve()`
    constants: np.ndarray  # `induction.SINGLE`


class JetSources(NamedTuple):
    """What the thrusters are, and what of theirs waits to be sent.

    `areas` and `spacing` (of parcels at the disk, in m), shape (t,); `waiting_impulse` (m4/s) and `waiting_slug` (the
    length of the jet's core that it stands for), shape (t, 2), forward and reverse.
    """

    areas: Array
    spacing: Array
    waiting_impulse: Array
    waiting_slug: Array


class StepCounters(NamedTuple):
    """Counts, changed in place.

    `rows`, shape (2,), is how many parcels and rings there are, `steps`, shape (3,), how many steps there were, at
    which of them the body's answer, `held`, shape (s,), was found, and how many crossings; `gone`, shape (3,), the
    impulse retired, struck and met, in m4/s.
    """

    rows: IntArray
    steps: IntArray
    held: Array
    gone: Array


@njit(apart=True, nogil=True)
def flow_at(
    points: Array,
    order: IntArray,
    rows: np.ndarray,
    starts: IntArray,
    planes: Array,
    ring_starts: IntArray,
    rings: Array,
    bed_z: float,
    constants: np.ndarray,
    out: Array,
) -> None:
    """Write the velocity of free and wall jets at some of the points, shape (n, 3), into those rows of `out`.

    `order` says at which, best as `ordered` has them; `rows` and `starts` are those of an `ImpulseField`; `planes`,
    `ring_starts` and `rings` those of `bedjets.wall_rows`.
    """
    some, sums = points[order], np.zeros((order.shape[0], 3))
    sum_field(some, rows, starts, constants, sums)
    for p in range(order.shape[0]):
        if some[p, 2] == bed_z:
            sums[p, 2] = 0.0  # there is only rounding
    if rings.shape[0]:
        sum_planes(some, planes, ring_starts, rings, np.zeros(0, np.float32), sums)
    for p in range(order.shape[0]):
        for k in range(3):
            out[order[p], k] = sums[p, k]


@njit(nogil=True)
def places_of(jets: ParcelBuffers, layers: RingBuffers, planes: JetPlanes, rows: IntArray, disks: Array) -> Array:
    """Places where a step needs the ambient flow: the parcels, the rings, the disks."""
    n, r = rows[0], rows[1]
    out = np.empty((n + r + disks.shape[0], 3))
    assign_rows(out[:n], jets.position[:n])
    assign_rows(out[n : n + r], ring_places(layers, r, planes))
    assign_rows(out[n + r :], disks)
    return out


@njit(nogil=True)
def advance(
    jets: ParcelBuffers,
    layers: RingBuffers,
    planes: JetPlanes,
    body: PackedBlockage,
    laws: WaterConstants,
    thrusters: JetSources,
    tally: StepCounters,
    places: Array,
    ambient: Array,
    body_to_ambient: Array,
    disks: Array,
    impulses_m4_s: Array,
    noise: Array,
) -> None:
    """Move the water on by a step, in place.

    - `jets`, `layers`: with room for what is sent, for three of each that cross, and for a ring of each of those.
    - `places`, `ambient`, shape (n + r + t, 3): what `places_of` said, and the ambient water's velocity there, to which
      the body's answer is added.
    - `body_to_ambient`, shape (s,): the body's answer to the ambient water.
    - `disks`, shape (3, t, 3): as in `parcel_advection.emit_parcels`.
    - `impulses_m4_s`, shape (t, 2): forward and reverse, over the water's density.
    - `noise`, shape (n + k, 3): standard normal: of the parcels that there are and then of those sent.
    """
    n, r = tally.rows[0], tally.rows[1]
    dt_s, walls = laws.drift[3], planes.walls
    if body.points.shape[0]:
        add_body(body, places[: n + r], body_to_ambient, ambient[: n + r])
    count = _drift(jets, n, layers, r, planes, body, laws, tally, ambient, noise) if n else 0
    rings = 0
    if r:
        rings = grow_rings(layers, r, planes, places[n : n + r], ambient[n : n + r], dt_s, laws.rest_speed)
    sent = slugs(
        impulses_m4_s, dt_s, thrusters.areas, thrusters.spacing, thrusters.waiting_impulse, thrusters.waiting_slug
    )
    if sent[2].shape[0]:
        count = emit_parcels(jets, count, sent, thrusters.areas, disks, ambient[n + r :], laws.drift, walls, noise[n:])
    count, tally.steps[2] = spread_crossing_jets(jets, count, laws.wake_stream, tally.steps[2])
    count, rings, met = deflect_colliding(jets, count, laws.wake_stream, planes, walls.shape[0], layers, rings)
    tally.gone[2] += met
    for face in range(walls.shape[0]):
        count, rings, struck = _strike(jets, count, planes, face, layers, rings)
        tally.gone[1] += struck
    count = merge_rows(jets, count, MERGE_SPACING)
    if tally.steps[0] % _EVERY == 0:
        count = merge_across(jets, count, MERGE_SPACING * max(1.0, count / _MANY))
        rings = thin_rings(layers, rings)
    tally.rows[0], tally.rows[1] = count, rings
    tally.steps[0] += 1


@njit(apart=True, nogil=True)
def _drift(
    jets: ParcelBuffers,
    n: int,
    layers: RingBuffers,
    r: int,
    planes: JetPlanes,
    body: PackedBlockage,
    laws: WaterConstants,
    tally: StepCounters,
    ambient: Array,
    noise: Array,
) -> int:
    """Advect and grow parcels and remove those at rest; returns the count."""
    sigma, impulse, dt_s = jets.sigma[:n], jets.impulse[:n], laws.drift[3]
    look = parcels_to_sample(jets.flow[:n], jets.held[:n], sigma, dt_s)
    if look.shape[0]:
        # Gusts are heard everywhere but do not carry parcels: the growth of sigma stands for that mixing already.
        u = _carrying(jets.position[:n], impulse, sigma, look, layers, r, planes, body, laws, tally)
        for q in range(look.shape[0]):
            for k in range(3):
                jets.flow[look[q], k] = u[q, k]
    speed, before, place = np.empty(n), sigma.copy(), jets.position[:n].copy()
    advect_parcels(
        jets.position[:n],
        sigma,
        jets.share[:n],
        speed,
        jets.diameter[:n],
        jets.disk[:n],
        jets.flow[:n],
        ambient[:n],
        jets.start[:n],
        jets.stream[:n] == laws.wake_stream,
        laws.drift,
        planes.walls,
    )
    if body.points.shape[0]:
        for i in range(n):
            tally.gone[1] += strike_body(body, place[i], jets.position[i], jets.flow[i], sigma[i], impulse[i])
    if laws.gusty:
        fade_gusts(jets.gust[:n], before, speed, noise, dt_s)
    keep, resting = np.ones(n, np.bool_), False
    for i in range(n):
        if speed[i] < laws.rest_speed:
            keep[i], resting = False, True
            tally.gone[0] += math.sqrt(impulse[i, 0] ** 2 + impulse[i, 1] ** 2 + impulse[i, 2] ** 2)
    return kept_only(jets, n, keep) if resting else n


@njit(apart=True, nogil=True)
def _carrying(
    X: Array,
    impulse: Array,
    sigma: Array,
    look: IntArray,
    layers: RingBuffers,
    r: int,
    planes: JetPlanes,
    body: PackedBlockage,
    laws: WaterConstants,
    tally: StepCounters,
) -> Array:
    """Velocity of the jets' water at some of the parcels, led round the body, shape (k, 3)."""
    rows, starts = clustered(*mirrored(X, impulse, sigma, planes.walls))
    frames, ring_starts, rings = wall_rows(layers, r, planes)
    points = X[look]
    u, look_order = np.empty((look.shape[0], 3)), ordered(points, laws.curve)
    flow_at(points, look_order, rows, starts, frames, ring_starts, rings, laws.bed_z, laws.constants, u)
    if body.points.shape[0]:
        if tally.steps[1] < 0 or tally.steps[0] % _EVERY == 0:
            at_body, every = np.empty((body.points.shape[0], 3)), np.arange(body.points.shape[0])
            flow_at(body.points, every, rows, starts, frames, ring_starts, rings, laws.bed_z, laws.constants, at_body)
            assign(tally.held, answer(body, at_body))
            tally.steps[1] = tally.steps[0]
        answered = np.zeros(u.shape)
        add_body(body, points, tally.held, answered)
        for q in range(look.shape[0]):
            # Beyond the body's reach there is none.
            if answered[q, 0] != 0.0 or answered[q, 1] != 0.0 or answered[q, 2] != 0.0:
                deflect_velocity(body, points[q], u[q], answered[q])
    return u


@njit(apart=True, nogil=True)
def _strike(
    jets: ParcelBuffers, count: int, planes: JetPlanes, face: int, layers: RingBuffers, rings: int
) -> tuple[int, int, float]:
    """Hand parcels that come up to a face over to wall jets; parcels and rings left, and the impulse handed over."""
    axis, at, side = int(planes.walls[face, 0]), planes.walls[face, 1], planes.walls[face, 2]
    X, m, sigma = jets.position, jets.impulse, jets.sigma
    keep, struck = np.ones(count, np.bool_), 0.0
    for i in range(count):
        size = math.sqrt(m[i, 0] ** 2 + m[i, 1] ** 2 + m[i, 2] ** 2)
        if side * m[i, axis] > _STEEPEST_GRAZE * size and side * (at - X[i, axis]) < STRIKE_HEIGHT * sigma[i]:
            rings = start_ring(layers, rings, planes, face, X[i], m[i], sigma[i])
            keep[i] = False
            struck += size
    return kept_only(jets, count, keep) if struck > 0.0 else count, rings, struck

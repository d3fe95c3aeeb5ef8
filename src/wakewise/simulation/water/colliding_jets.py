"""Jets that meet head-on: they turn aside and run out in the plane where they met.

By symmetry two equal jets that blow at each other are each a jet that strikes a wall without friction, so what they
lose on meeting becomes rings of a radial jet (`wakewise.simulation.water.bedjets`) on both sides of that plane (those
that cross at 20 to 120 degrees: `wakewise.simulation.water.crossing_jets`). Of unequal jets the weaker one's share
turns aside and the rest goes on. The radial jet of two that strike each other spreads about three times as fast as one
that is led out between walls: P. O. Witze and H. A. Dwyer 1976, J. Fluid Mech. 75, 401, doi 10.1017/S0022112076000293
(from memory, not looked up again).

The plane, a sheet, is as thick as the jets' sigma where they met: the plane of two turbulent jets swings to and fro by
about as much, so their radial jet is no thinner on average. In the lattice (`head-on` case) it is 5 to 6 cm thick 7 cm
from the axis of jets with sigma 2.7 cm.
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, njit
from wakewise.simulation.water.bedjets import STRIKE_HEIGHT, RingBuffers
from wakewise.simulation.water.crossing_jets import LEAST_SPEED_M_S, WIDEST
from wakewise.simulation.water.parcels import CENTRE_SPEED, ParcelBuffers, kept_only
from wakewise.simulation.water.walljets import SPREADS_FASTER, JetPlanes, start_ring

_SAME_PLACE = 1.0  # sheets of the same two jets closer than this many sigma are one
_SAME_NORMAL = math.cos(math.radians(15))
_MOST_SHEETS = 8  # that are remembered, so that the rings of one meeting add up


@njit(apart=True, nogil=True)
def deflect_colliding(
    jets: ParcelBuffers, count: int, streams: int, planes: JetPlanes, faces: int, layers: RingBuffers, rings: int
) -> tuple[int, int, float]:
    """Take from the first `count` parcels what meets head-on, and start its rings behind the first `rings`.

    How many parcels and rings there are then, and the impulse taken in m4/s. Streams below `streams` are the thrusters'
    own; only those meet. The first `faces` planes are those of the room; a meeting for which there is no plane left
    waits.
    """
    X, m, sigma = jets.position, jets.impulse, jets.sigma
    strong = np.empty(count, np.int64)
    many = 0
    for i in range(count):
        size = math.sqrt(m[i, 0] ** 2 + m[i, 1] ** 2 + m[i, 2] ** 2)
        if jets.stream[i] < streams and CENTRE_SPEED * size > LEAST_SPEED_M_S * sigma[i] ** 3:
            strong[many] = i
            many += 1
    pairs = _meeting_pairs(X, m, sigma, jets.stream, strong[:many])
    if pairs.shape[0] == 0:
        return count, rings, 0.0
    keep, taken = np.ones(count, np.bool_), 0.0
    normal, middle = np.empty(3), np.empty(3)
    for pair in range(pairs.shape[0]):
        a, b = pairs[pair, 0], pairs[pair, 1]
        one = math.sqrt(m[a, 0] ** 2 + m[a, 1] ** 2 + m[a, 2] ** 2)
        two = math.sqrt(m[b, 0] ** 2 + m[b, 1] ** 2 + m[b, 2] ** 2)
        share = min(one, two)
        if share <= 1e-3 * max(one, two):
            continue
        length = 0.0
        for k in range(3):
            normal[k], middle[k] = m[a, k] / one - m[b, k] / two, 0.5 * (X[a, k] + X[b, k])
            length += normal[k] ** 2
        normal /= math.sqrt(length)
        size = 0.5 * (sigma[a] + sigma[b])
        sheet = _sheet(planes, faces, layers, rings, jets.stream[a], jets.stream[b], middle, normal, size)
        if sheet < 0:
            continue
        rings = start_ring(layers, rings, planes, sheet, middle, m[a] * (share / one), size)
        for k in range(3):
            m[a, k] *= 1 - share / one
            m[b, k] *= 1 - share / two
        # What is left of one that turned aside wholly is rounding.
        keep[a], keep[b] = one - share > 1e-6 * one, two - share > 1e-6 * two
        taken += 2 * share
    return kept_only(jets, count, keep), rings, taken


@njit(apart=True, nogil=True)
def _sheet(
    planes: JetPlanes,
    faces: int,
    layers: RingBuffers,
    rings: int,
    stream_a: int,
    stream_b: int,
    middle: Array,
    normal: Array,
    sigma: float,
) -> int:
    """The plane in which two jets meet: the remembered one if they still meet there, or a new one; -1 if none is left.

    Of those remembered the one that was used longest ago is forgotten first; its rings run on.
    """
    frames, used = planes.frames, planes.used
    newest = 0
    for s in range(faces, used.shape[0]):
        newest = max(newest, used[s])
    for s in range(faces, used.shape[0]):
        if used[s] == 0 or planes.key[s, 0] != stream_a or planes.key[s, 1] != stream_b:
            continue
        off = straight = 0.0
        for k in range(3):
            off += frames[s, 9 + k] * (middle[k] - frames[s, k])
            straight += frames[s, 9 + k] * normal[k]
        if abs(off) <= _SAME_PLACE * sigma and straight >= _SAME_NORMAL:
            used[s] = newest + 1
            return s
        used[s] = 0
    taken = np.zeros(used.shape[0], np.bool_)
    for j in range(rings):
        taken[layers.plane[j]] = True
    for s in range(faces, used.shape[0]):
        if used[s] or taken[s]:
            continue
        along = np.zeros(3)
        along[np.argmin(np.abs(normal))] = 1.0
        first = _cross(normal, along)
        first /= math.sqrt(first[0] ** 2 + first[1] ** 2 + first[2] ** 2)
        assign(frames[s, 0:3], middle)
        assign(frames[s, 3:6], first)
        assign(frames[s, 6:9], _cross(normal, first))
        assign(frames[s, 9:12], normal)
        frames[s, 12], frames[s, 13] = 0.0, SPREADS_FASTER
        planes.thickness[s], planes.per_height[s], used[s] = sigma, 0.0, newest + 1
        planes.key[s, 0], planes.key[s, 1] = stream_a, stream_b
        _forget_the_oldest(used, faces)
        return s
    return -1


@njit(nogil=True)
def _cross(a: Array, b: Array) -> Array:
    out = np.empty(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[k] = a[i] * b[j] - a[j] * b[i]
    return out


@njit(nogil=True)
def _forget_the_oldest(used: IntArray, faces: int) -> None:
    many, oldest = 0, -1
    for s in range(faces, used.shape[0]):
        if used[s]:
            many += 1
            oldest = s if oldest < 0 or used[s] < used[oldest] else oldest
    if many > _MOST_SHEETS:
        used[oldest] = 0


@njit(apart=True, nogil=True)
def _meeting_pairs(X: Array, m: Array, sigma: Array, stream: IntArray, strong: IntArray) -> IntArray:
    """Pairs that blow at each other nearly on one line and are as near as a jet is to the wall that it strikes."""
    n = strong.shape[0]
    found = np.empty((n, 2), np.int64)
    used = np.zeros(n, np.bool_)
    count = 0
    unit = np.empty((n, 3))
    for p in range(n):
        i = strong[p]
        length = math.sqrt(m[i, 0] ** 2 + m[i, 1] ** 2 + m[i, 2] ** 2)
        for k in range(3):
            unit[p, k] = m[i, k] / length
    for p in range(n):
        if used[p]:
            continue
        i = strong[p]
        for q in range(p + 1, n):
            # First what most pairs fail by.
            if unit[p, 0] * unit[q, 0] + unit[p, 1] * unit[q, 1] + unit[p, 2] * unit[q, 2] > WIDEST:
                continue
            j = strong[q]
            dx, dy, dz = X[j, 0] - X[i, 0], X[j, 1] - X[i, 1], X[j, 2] - X[i, 2]
            gap2 = dx * dx + dy * dy + dz * dz
            reach = STRIKE_HEIGHT * (sigma[i] + sigma[j])
            if gap2 > reach * reach or used[q] or stream[i] == stream[j]:
                continue
            ahead = dx * unit[p, 0] + dy * unit[p, 1] + dz * unit[p, 2]
            back = -(dx * unit[q, 0] + dy * unit[q, 1] + dz * unit[q, 2])
            aside2 = gap2 - ahead * ahead
            if ahead <= 0.0 or back <= 0.0 or aside2 > (0.5 * (sigma[i] + sigma[j])) ** 2:
                continue
            used[p] = used[q] = True
            found[count, 0], found[count, 1] = i, j
            count += 1
            break
    return found[:count]

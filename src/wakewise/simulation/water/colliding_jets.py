"""Opposed and crossing jets: turned aside in their plane of symmetry, or spread as a fan across their common plane.

*Opposed jets.* By symmetry each of two equal jets strikes a frictionless wall, so their lost impulse becomes rings of a
radial jet (`bedjets`) on both sides of that plane. Of unequal jets the weaker one's share turns aside. The radial jet
spreads about three times as fast as one led out between walls (P. O. Witze and H. A. Dwyer 1976, J. Fluid Mech. 75,
401, doi 10.1017/S0022112076000293, from memory). The sheet is as thick as the jets' sigma, because the plane of two
turbulent jets oscillates by about that; in the lattice case `head-on` it is 5 to 6 cm thick 7 cm from the axis of jets
of sigma 2.7 cm.

*Crossing jets* (20 to 120 deg). Momentum along the bisector adds up. The opposed components are stopped by a pressure
that drives water out of the common plane. For equal round jets at the angle 2 alpha without friction the azimuth phi
from the bisector gets the share

    w(phi) = sin^3 alpha / (1 - cos alpha cos phi)^2        (mean 1, mean cosine cos alpha)

(D. Hasson and R. E. Peck 1964, AIChE J. 10, 752, doi 10.1002/aic.690100533; G. I. Taylor 1960, Proc. R. Soc. A 259, 1;
both from memory). Two parcels of different thrusters become `RAYS` parcels of equal impulse, each in a direction within
an equal share of w (golden-section steps from meeting to meeting); a common correction keeps momentum exact. Equal
shares of w are equal areas about the focus of an ellipse of eccentricity cos alpha: Kepler's equation gives the
directions. Of unequal jets the excess of the stronger goes straight on. A parcel collides once. The plane is steady.
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import assign, njit
from wakewise.simulation.water.bedjets import SPREADS_FASTER, STRIKE_HEIGHT, JetPlanes, RingBuffers, start_ring
from wakewise.simulation.water.parcels import CENTRE_SPEED, ParcelBuffers, kept_only

RAYS = 4
"""Into so many parcels two turn: an even number, so that none keeps to the bisector."""
HELD = 2
"""For so many meetings each ray keeps its direction, so that its parcels may become one: fewer to carry."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
WIDEST = -0.5  # cosine of 120 degrees: wider ones are opposed
NARROWEST = math.cos(math.radians(20))  # jets that cross at less merge
LEAST_SPEED_M_S = 0.03  # of a parcel alone at its centre; collisions of weaker ones are ignored


@njit(nogil=True)
def ray_azimuths(lean: float, phase: float, out: Array) -> None:
    """Write cosine and sine of the rays' azimuths from the bisector, shape (rays, 2); `lean` is cos alpha.

    Each ray lies within its own equal share of w, at `phase` of it, from 0 to 1.
    """
    rays = out.shape[0]
    flat = math.sqrt(1.0 - lean * lean)
    for k in range(rays):
        mean = 2.0 * math.pi * (k + phase) / rays
        E = math.pi
        for _ in range(20):
            E -= (E - lean * math.sin(E) - mean) / (1.0 - lean * math.cos(E))
        near = 1.0 - lean * math.cos(E)
        # Seen from the focus the far end of the ellipse is the bisector.
        out[k, 0], out[k, 1] = (lean - math.cos(E)) / near, -flat * math.sin(E) / near


@njit(nogil=True)
def spread_crossing_jets(jets: ParcelBuffers, count: int, streams: int, met: int) -> tuple[int, int]:
    """Turn what crosses among the first `count` parcels into rays behind them; parcels and meetings there are then.

    Streams below `streams` are the thrusters' own; only those meet. `met` is how many meetings there were before.
    Without room for its rays a meeting waits.
    """
    X, m, sigma = jets.position, jets.impulse, jets.sigma
    some, unit = np.empty(count, np.int64), np.empty((count, 3))
    many = 0
    for i in range(count):
        size = math.sqrt(m[i, 0] ** 2 + m[i, 1] ** 2 + m[i, 2] ** 2)
        if jets.stream[i] < streams and CENTRE_SPEED * size > LEAST_SPEED_M_S * sigma[i] ** 3:
            some[many] = i
            for k in range(3):
                unit[many, k] = m[i, k] / size
            many += 1
    pairs = _crossing_pairs(X, sigma, jets.stream, some[:many], unit)
    if pairs.shape[0] == 0:
        return count, met
    keep, azimuths = np.ones(jets.sigma.shape[0], np.bool_), np.empty((RAYS, 2))
    before = count
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        one = math.sqrt(m[a, 0] ** 2 + m[a, 1] ** 2 + m[a, 2] ** 2)
        two = math.sqrt(m[b, 0] ** 2 + m[b, 1] ** 2 + m[b, 2] ** 2)
        share = min(one, two)
        if share <= 1e-3 * max(one, two):
            continue
        if count + RAYS > jets.sigma.shape[0]:
            break
        _rays(jets, count, a, b, one, two, share, streams, (GOLDEN * (met // HELD)) % 1.0, azimuths)
        count, met = count + RAYS, met + 1
        for k in range(3):
            m[a, k] *= 1.0 - share / one
            m[b, k] *= 1.0 - share / two
        # What is left of one that turned wholly is rounding.
        keep[a], keep[b] = one - share > 1e-6 * one, two - share > 1e-6 * two
    return kept_only(jets, count, keep[:count]) if count > before else count, met


@njit(nogil=True)
def _rays(
    jets: ParcelBuffers,
    count: int,
    a: int,
    b: int,
    one: float,
    two: float,
    share: float,
    streams: int,
    phase: float,
    azimuths: Array,
) -> None:
    """Write the rays of one meeting behind the first `count`: of impulses of lengths one and two a share of each."""
    along, normal, across = np.empty(3), np.empty(3), np.empty(3)
    both = apart = 0.0
    for k in range(3):
        p, q = jets.impulse[a, k] / one, jets.impulse[b, k] / two
        along[k], normal[k] = p + q, p - q
        both, apart = both + along[k] ** 2, apart + normal[k] ** 2
    both, apart = math.sqrt(both), math.sqrt(apart)
    lean = 0.5 * both
    for k in range(3):
        along[k] /= both
        normal[k] /= apart
    for k in range(3):
        across[k] = normal[(k + 1) % 3] * along[(k + 2) % 3] - normal[(k + 2) % 3] * along[(k + 1) % 3]
    ray_azimuths(lean, phase, azimuths)
    # What the rays' mean lacks of the bisector's share, and has too much across it.
    more, less = lean, 0.0
    for r in range(RAYS):
        more, less = more - azimuths[r, 0] / RAYS, less + azimuths[r, 1] / RAYS
    first, second = min(jets.stream[a], jets.stream[b]), max(jets.stream[a], jets.stream[b])
    each = 2.0 * share / RAYS
    for r in range(RAYS):
        n = count + r
        jets.stream[n] = streams + 1 + (first * streams + second) * RAYS + r
        jets.sigma[n] = 0.5 * (jets.sigma[a] + jets.sigma[b])
        jets.diameter[n] = 0.5 * (jets.diameter[a] + jets.diameter[b])
        jets.share[n], jets.held[n] = 0.5 * (jets.share[a] + jets.share[b]), np.inf
        # A row of less momentum is slower by the root.
        jets.start[n] = 0.5 * (jets.start[a] + jets.start[b]) * math.sqrt(2.0 / RAYS)
        like = a if r % 2 == 0 else b
        for k in range(3):
            out, middle = (
                azimuths[r, 0] * along[k] + azimuths[r, 1] * across[k],
                jets.position[a, k] + jets.position[b, k],
            )
            jets.position[n, k] = 0.5 * middle + STRIKE_HEIGHT * jets.sigma[n] * out
            jets.impulse[n, k] = each * (out + more * along[k] - less * across[k])
            jets.gust[n, k] = jets.gust[like, (k + r // 2) % 3]
            jets.disk[n, k] = 0.5 * (jets.disk[a, k] + jets.disk[b, k])
            jets.flow[n, k] = 0.0


@njit(nogil=True)
def _crossing_pairs(X: Array, sigma: Array, stream: IntArray, some: IntArray, unit: Array) -> IntArray:
    """Pairs whose ways cross ahead of both, as near to the plane midway as a jet is to the wall that it strikes.

    Of those that one may meet, the one that comes to the crossing at the most nearly equal distance.
    """
    n = some.shape[0]
    found, used = np.empty((n, 2), np.int64), np.zeros(n, np.bool_)
    count = 0
    for p in range(n):
        if used[p]:
            continue
        i, best, least = some[p], -1, np.inf
        for q in range(p + 1, n):
            j = some[q]
            c = unit[p, 0] * unit[q, 0] + unit[p, 1] * unit[q, 1] + unit[p, 2] * unit[q, 2]
            if c > NARROWEST or c <= WIDEST or stream[i] == stream[j] or used[q]:
                continue
            dx, dy, dz = X[j, 0] - X[i, 0], X[j, 1] - X[i, 1], X[j, 2] - X[i, 2]
            ahead = dx * unit[p, 0] + dy * unit[p, 1] + dz * unit[p, 2]
            back = dx * unit[q, 0] + dy * unit[q, 1] + dz * unit[q, 2]
            s, t = ahead - c * back, c * ahead - back
            if s <= 0.0 or t <= 0.0:  # as of all but one in a hundred: nothing need be divided for them
                continue
            s, t = s / (1.0 - c * c), t / (1.0 - c * c)
            slant = math.sqrt(0.5 * (1.0 - c))  # sin alpha
            if slant * s > STRIKE_HEIGHT * sigma[i] or slant * t > STRIKE_HEIGHT * sigma[j]:
                continue
            gap2 = dx * dx + dy * dy + dz * dz + s * s + t * t + 2.0 * (t * back - s * ahead - s * t * c)
            if gap2 > (0.5 * (sigma[i] + sigma[j])) ** 2 or abs(s - t) >= least:
                continue
            best, least = q, abs(s - t)
        if best >= 0:
            used[p] = used[best] = True
            found[count, 0], found[count, 1] = i, some[best]
            count += 1
    return found[:count]


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

"""Jets that meet head-on: they turn aside and run out in the plane where they met.

By symmetry two equal jets that blow at each other are each a jet that strikes a wall without friction, so what they
lose on meeting becomes rings of a radial jet (`wakewise.water.bedjets`) on both sides of that plane. Of unequal jets
the weaker one's share turns aside and the rest goes on. The radial jet of two that strike each other spreads about
three times as fast as one that is led out between walls: P. O. Witze and H. A. Dwyer 1976, J. Fluid Mech. 75, 401, doi
10.1017/S0022112076000293 (from memory, not looked up again).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit
from wakewise.water.bedjets import STRIKE_HEIGHT, Rings, rings_from_strikes
from wakewise.water.parcels import CENTRE_SPEED, Parcels

_OPPOSED = -0.5  # cosine of 120 degrees; jets that cross at less merge
_LEAST_SPEED_M_S = 0.03  # of a parcel alone at its centre; meetings of weaker ones are let be
_SAME_PLACE = 1.0  # sheets of the same two jets closer than this many sigma are one
_SAME_NORMAL = math.cos(math.radians(15))
_MOST_SHEETS = 8
_SPREADS_FASTER = 3.0  # than a wall jet: see above


@dataclass(frozen=True, eq=False)
class Sheet:
    """A plane in the water with a jet on both sides.

    Parameters
    ----------
    origin_m : ndarray, shape (3,)
    R : ndarray, shape (3, 3)
        Rows: two directions in the plane and its normal.
    thickness_m : float
        The jets' sigma where they met. The plane of two turbulent jets swings to and fro by about as much, so their
        radial jet is no thinner on average: in the lattice (`head-on` case) it is 5 to 6 cm thick 7 cm from the axis
        of jets with sigma 2.7 cm.
    stretch : float
        How many times as fast as a wall jet the radial jet spreads.
    """

    origin_m: Array
    R: Array
    thickness_m: float
    depth_m: float = 0.0
    stretch: float = _SPREADS_FASTER

    @cached_property
    def frame(self) -> Array:
        """Origin, the rows of the turn from the world, depth in that frame, and the stretch: shape (14,)."""
        return np.concatenate([self.origin_m, self.R.ravel(), [self.depth_m, self.stretch]])

    @classmethod
    def across(cls, origin_m: Array, normal: Array, thickness_m: float) -> Sheet:
        """The plane through a point across a unit vector."""
        along = np.eye(3)[np.argmin(np.abs(normal))]
        first = np.cross(normal, along)
        first /= np.linalg.norm(first)
        return cls(origin_m, np.stack([first, np.cross(normal, first), normal]), thickness_m)

    def local(self, points_W_m: Array) -> Array:
        """Points of the world, shape (n, 3), in the plane's frame."""
        return self.turned(points_W_m - self.origin_m)

    def world(self, points_m: Array) -> Array:
        """Inverse of `local`."""
        return self.origin_m + self.back(points_m)

    def turned(self, vectors_W: Array) -> Array:
        """Vectors of the world, shape (n, 3), in the plane's frame."""
        out: Array = vectors_W @ self.R.T
        return out

    def back(self, vectors: Array) -> Array:
        """Inverse of `turned`."""
        out: Array = vectors @ self.R
        return out


class Meetings:
    """Remembers in which plane which jets met, so that the rings of one meeting add up."""

    def __init__(self) -> None:
        self._sheets: dict[tuple[int, int], Sheet] = {}

    def turn_aside(self, parcels: Parcels) -> tuple[Parcels, list[tuple[Sheet, Rings]], float]:
        """Take from parcels what meets head-on: those left, rings of each plane, and the impulse taken (m4/s)."""
        size = parcels.size_m4_s
        strong = np.flatnonzero(CENTRE_SPEED * size > _LEAST_SPEED_M_S * parcels.sigma_m**3)
        if len(strong) < 2:
            return parcels, [], 0.0
        pairs = _meeting_pairs(
            parcels.position_m[strong], parcels.impulse_m4_s[strong], parcels.sigma_m[strong], parcels.stream[strong]
        )
        if not len(pairs):
            return parcels, [], 0.0
        impulse, taken = parcels.impulse_m4_s.copy(), 0.0
        born: list[tuple[Sheet, Rings]] = []
        for a, b in strong[pairs]:
            one, two = np.linalg.norm(impulse[a]), np.linalg.norm(impulse[b])
            share = min(one, two)
            if share <= 1e-3 * max(one, two):
                continue
            sigma = 0.5 * (parcels.sigma_m[a] + parcels.sigma_m[b])
            normal = impulse[a] / one - impulse[b] / two
            normal /= np.linalg.norm(normal)
            middle = 0.5 * (parcels.position_m[a] + parcels.position_m[b])
            key = (int(parcels.stream[a]), int(parcels.stream[b]))
            sheet = self._sheet(key, middle, normal, sigma)
            turned = sheet.turned((share / one) * impulse[a : a + 1])
            place = sheet.local(middle[None])
            born.append((sheet, rings_from_strikes(place, turned, np.array([sigma]))))
            impulse[a] *= 1 - share / one
            impulse[b] *= 1 - share / two
            taken += 2 * float(share)
        left = replace(parcels, impulse_m4_s=impulse)
        return left.take(left.size_m4_s > 1e-6 * size), born, taken

    def _sheet(self, key: tuple[int, int], middle: Array, normal: Array, sigma: float) -> Sheet:
        sheet = self._sheets.pop(key, None)
        if sheet is not None:
            off = abs(float(sheet.local(middle[None])[0, 2]))
            if off > _SAME_PLACE * sigma or float(sheet.R[2] @ normal) < _SAME_NORMAL:
                sheet = None
        if sheet is None:
            sheet = Sheet.across(middle, normal, sigma)
        self._sheets[key] = sheet
        while len(self._sheets) > _MOST_SHEETS:
            del self._sheets[next(iter(self._sheets))]
        return sheet


@njit
def _meeting_pairs(X: Array, m: Array, sigma: Array, stream: IntArray) -> IntArray:
    """Pairs that blow at each other nearly on one line and are as near as a jet is to the wall that it strikes."""
    n = sigma.shape[0]
    found = np.empty((n, 2), np.int64)
    used = np.zeros(n, np.bool_)
    count = 0
    length = np.sqrt(m[:, 0] ** 2 + m[:, 1] ** 2 + m[:, 2] ** 2)
    for i in range(n):
        if used[i]:
            continue
        for j in range(i + 1, n):
            if used[j] or stream[i] == stream[j]:
                continue
            dot = m[i, 0] * m[j, 0] + m[i, 1] * m[j, 1] + m[i, 2] * m[j, 2]
            if dot > _OPPOSED * length[i] * length[j]:
                continue
            dx, dy, dz = X[j, 0] - X[i, 0], X[j, 1] - X[i, 1], X[j, 2] - X[i, 2]
            gap2 = dx * dx + dy * dy + dz * dz
            reach = STRIKE_HEIGHT * (sigma[i] + sigma[j])
            if gap2 > reach * reach:
                continue
            ahead = (dx * m[i, 0] + dy * m[i, 1] + dz * m[i, 2]) / length[i]
            back = -(dx * m[j, 0] + dy * m[j, 1] + dz * m[j, 2]) / length[j]
            aside2 = gap2 - ahead * ahead
            if ahead <= 0.0 or back <= 0.0 or aside2 > (0.5 * (sigma[i] + sigma[j])) ** 2:
                continue
            used[i] = used[j] = True
            found[count, 0], found[count, 1] = i, j
            count += 1
            break
    return found[:count]

"""Ways to share a flight's wrench out among its thrusters, from the least thrusts out to where thrusters rest.

Of all thrusts that make a wrench, T_0(t) + lambda z are those that differ along one line z of the null space. On such a
line each thruster rests at one place, r_i = -T_0i / z_i, and wash is made of roots of thrusts: it has its minima where
a thruster rests, or nearly. So a sharing is said by these places, which move with the wrench: at the least thrusts, at
the first, second ... rest, half of the way to the inner ones, and beyond the last. Two lines (level, vertical) give
all pairs.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from wakewise.allocation import Layout
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

HALF, BEYOND = 0.5, 1.4
"""Shares of the way from the least thrusts to an inner and to an outermost rest that are looked at besides."""
ALIKE_N = 0.03
"""Places on a line nearer to each other than this, in the mean over a flight, are one."""
_NOT_IN_IT = 1e-3


def candidate_allocations(layout: Layout, least_N: Array) -> Array:
    """Thrusts of all sharings, shape (j, k, n), the first of them the least thrusts themselves, shape (k, n).

    Raises
    ------
    InputError
        If the null space is not made of lines that share no thruster.
    """
    if not len(layout.lines):
        raise InputError("bound: the vehicle's spare thrusts are not lines that share no thruster, so it has no grid")
    along = [line_places(layout, line, least_N) for line in layout.lines]
    return np.array([least_N + sum(moves) for moves in product(*along)])


def line_places(layout: Layout, line: Array, least_N: Array) -> list[Array]:
    """Moves along one line, shape (k, n) each, that lead from the least thrusts to its places; the first is none."""
    rests = np.sort(_rests(line, least_N), axis=1)
    low, high = _room(layout, line, least_N)
    places = [np.zeros(len(least_N))]
    last = rests.shape[1] - 1
    looked_at = [(number, 1.0) for number in range(last + 1)] + [(number, HALF) for number in range(1, last)]
    for number, share in (*looked_at, (0, BEYOND), (last, BEYOND)):
        place = np.clip(share * rests[:, number], low, high)
        if all(np.abs(place - other).mean() >= ALIKE_N for other in places):
            places.append(place)
    return [place[:, None] * line for place in places]


def _rests(line: Array, least_N: Array) -> Array:
    """Where on a line each of its thrusters rests, shape (k, those that it has)."""
    own = np.abs(line) > _NOT_IN_IT
    return np.asarray(-least_N[:, own] / line[own])


def _room(layout: Layout, line: Array, least_N: Array) -> tuple[Array, Array]:
    """How far the limits let each step go along a line, down and up, shape (k,) each."""
    own = np.abs(line) > _NOT_IN_IT
    ends = np.stack([(limit[own] - least_N[:, own]) / line[own] for limit in (layout.lower_N, layout.upper_N)])
    low, high = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return np.minimum(low, 0.0), np.maximum(high, 0.0)


def split(layout: Layout, thrusts_N: Array) -> tuple[Array, Array]:
    """Least thrusts of the same wrenches, and what is spare in these thrusts; shape (k, n) each."""
    spare = thrusts_N @ layout.null @ layout.null.T
    return thrusts_N - spare, spare

"""Choice of photographs at even steps along a track: the sharpest near each step."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray

NEAR_SHARE, WIDEST_SHARE = 0.25, 0.5
"""A photograph is taken this share of a step from its place on the grid, or else from the last one's step."""


def path_length(position_W_m: Array, ruler_m: float) -> Array:
    """Way flown to n positions, shape (n, 3), measured by a ruler: noise of the positions below it adds nothing."""
    way = np.zeros(len(position_W_m))
    anchor, done = position_W_m[0], 0.0
    for k, place in enumerate(position_W_m):
        ahead = float(np.linalg.norm(place - anchor))
        way[k] = max(way[k - 1], done + ahead) if k else 0.0
        if ahead >= ruler_m:
            anchor, done = place, done + ahead
            way[k] = max(way[k], done)
    return way


def choose_spaced(way: Array, sharpness: Array, usable: BoolArray, step: float) -> IntArray:
    """Indices of the chosen of n pictures, one for each step of the way.

    `way`, shape (n,), never falls; `sharpness` and `usable` have shape (n,). `step`: in units of `way`. The sharpest is
    taken of those within a quarter of a step of the next place of an even grid; where none is there, of those half a
    step to one and a half from the last one. So two chosen ones are further apart than 1.5 steps only where no usable
    picture lies between.
    """
    left = np.flatnonzero(usable)
    if not len(left):
        return left
    start = way[left[0]]
    first = left[way[left] <= start + NEAR_SHARE * step]
    out = [int(first[np.argmax(sharpness[first])])]
    while True:
        last = way[out[-1]]
        later = left[(left > out[-1]) & (way[left] > last)]
        if not len(later):
            return np.array(out, dtype=np.int64)
        place = start + step * (round((last - start) / step) + 1)
        ahead = way[later] - last
        near = later[np.abs(way[later] - place) <= NEAR_SHARE * step]
        within = later[(ahead >= WIDEST_SHARE * step) & (ahead <= (1.0 + WIDEST_SHARE) * step)]
        some = near[(way[near] - last <= (1.0 + WIDEST_SHARE) * step) & (way[near] - last >= WIDEST_SHARE * step)]
        some = some if len(some) else within
        if len(some):
            out.append(int(some[np.argmax(sharpness[some])]))
            continue
        before = later[ahead < WIDEST_SHARE * step]
        beyond = later[ahead > (1.0 + WIDEST_SHARE) * step]
        if not len(beyond):
            return np.array(out, dtype=np.int64)
        out.append(int(before[-1] if len(before) else beyond[0]))

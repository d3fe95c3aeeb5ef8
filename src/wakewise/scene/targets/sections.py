"""Level sections of a closed surface: area, stiffness against bending, and the water that moves along with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.arrays import Array, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Sections:
    """Level sections through a body, which may consist of several loops (branches, fingers, tentacles).

    `area_m2` (n,) is that of all loops. `second_m4` (n, 2, 2) is the sum over loops of the integral of r r^T over the
    loop, r from its own middle: times Young's modulus the stiffness against bending of branches that bend side by side.
    `displaced_m2` (n, 2, 2) times the water's density is the added mass per height of loops that move sideways, each
    taken as the ellipse of its second moments: pi b^2 across a half axis b (J. N. Newman, Marine Hydrodynamics, MIT
    Press 1977, table 4.3). `reach_m2` (n, 2, 2) is that of the thickest loop: e . reach . e is the square of half its
    width along e.
    """

    area_m2: Array
    second_m4: Array
    displaced_m2: Array
    reach_m2: Array


def sections(places_m: Array, faces: IntArray, heights_m: Array) -> Sections:
    """Cut a closed surface at some heights.

    Parameters
    ----------
    places_m : ndarray, shape (n, 3)
        Vertices; the third coordinate is the height.
    faces : ndarray, shape (m, 3)
        Turned alike.
    heights_m : ndarray, shape (k,)

    Returns
    -------
    Sections
        Zero where nothing is cut.
    """
    k = len(heights_m)
    area, second, displaced = np.zeros(k), np.zeros((k, 2, 2)), np.zeros((k, 2, 2))
    reach = np.zeros((k, 2, 2))
    if not len(faces):
        return Sections(area_m2=area, second_m4=second, displaced_m2=displaced, reach_m2=reach)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge = np.unique(ends[:, 0] * len(places_m) + ends[:, 1], return_inverse=True)[1].reshape(-1, 3)
    middle = places_m[np.unique(faces), :2].mean(axis=0)
    plan, height = places_m[:, :2] - middle, places_m[:, 2]
    low, high = height[faces].min(axis=1), height[faces].max(axis=1)
    for i, level in enumerate(heights_m):
        cut = np.nonzero((low <= level) & (high > level))[0]
        if not len(cut):
            continue
        start, end, loop = _loops(plan, height, faces[cut], edge[cut], float(level))
        whole, moments = _moments(start, end, loop)
        kept = np.abs(whole) > 1e-12
        whole, moments = whole[kept], moments[kept]
        if not len(whole):
            continue
        turned = np.sign(whole.sum())  # a section seen from below runs the other way round
        trace = np.trace(moments, axis1=1, axis2=2)
        around = 4.0 * np.pi / whole[:, None, None] * (trace[:, None, None] * np.eye(2) - moments)
        solid = whole * turned > 0.0  # not a cavity
        area[i] = turned * whole.sum()
        second[i] = turned * moments.sum(axis=0)
        displaced[i] = around[solid].sum(axis=0)
        thickest = np.argmax(np.where(solid, trace / whole, -np.inf))
        reach[i] = 4.0 * moments[thickest] / whole[thickest]
    return Sections(area_m2=area, second_m4=second, displaced_m2=displaced, reach_m2=reach)


def _loops(plan: Array, height: Array, faces: IntArray, edge: IntArray, level: float) -> tuple[Array, Array, IntArray]:
    """Segments in which faces are cut, start and end (m, 2) with the body on one side, and the loop of each (m,)."""
    here = height[faces]
    above = here > level
    m = len(faces)
    rows = np.arange(m)
    # The two edges that cross the level leave the one corner that is alone on its side.
    alone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmin(above, axis=1))
    after, before = (alone + 1) % 3, (alone + 2) % 3

    def crossing(other: IntArray) -> Array:
        a, b = faces[rows, alone], faces[rows, other]
        share = (level - height[a]) / (height[b] - height[a])
        place: Array = plan[a] + share[:, None] * (plan[b] - plan[a])
        return place

    one, two = crossing(after), crossing(before)
    first, second = edge[rows, alone], edge[rows, before]
    upward = above[rows, alone][:, None]
    start, end = np.where(upward, one, two), np.where(upward, two, one)
    names, ends = np.unique(np.concatenate([first, second]), return_inverse=True)
    n = len(names)
    joined = coo_array((np.ones(m, dtype=np.int8), (ends[:m], ends[m:])), (n, n))
    piece = connected_components(joined, directed=False)[1]
    return start, end, piece[ends[:m]].astype(np.int64)


def _moments(start: Array, end: Array, loop: IntArray) -> tuple[Array, Array]:
    """Signed area (l,) of each loop and signed second moments about its middle (l, 2, 2), by Green's theorem."""
    count = int(loop.max()) + 1

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(loop, values, count), dtype=np.float64)

    # From a place on each loop: far from the origin, differences of large numbers would spoil thin branches.
    anchor = np.zeros((count, 2))
    anchor[loop] = start
    a, b = start - anchor[loop], end - anchor[loop]
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = 0.5 * total(cross)
    safe = np.where(np.abs(area) > 1e-30, area, 1.0)
    middle = np.stack([total((a[:, i] + b[:, i]) * cross) for i in range(2)], axis=1) / (6.0 * safe[:, None])
    moments = np.empty((count, 2, 2))
    for i in range(2):
        for j in range(2):
            both = 2.0 * a[:, i] * a[:, j] + 2.0 * b[:, i] * b[:, j] + a[:, i] * b[:, j] + b[:, i] * a[:, j]
            moments[:, i, j] = total(both * cross) / 24.0 - safe * middle[:, i] * middle[:, j]
    return area, moments

"""Exact distance from points to a triangle mesh, by a bounding-box tree."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit, prange

_LEAF = 8


@njit(inline="always")
def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit
def _squared_to_triangle(p: Array, triangle: Array) -> float:
    """Squared distance from p to a triangle, shape (3, 3), a corner in each row.

    By the region of the triangle's plane that p falls in: C. Ericson, Real-Time Collision Detection, Morgan Kaufmann
    2005, section 5.1.5. In tuples, since an array for each difference would take five times as long as the arithmetic.
    """
    a = (triangle[0, 0], triangle[0, 1], triangle[0, 2])
    ab = (triangle[1, 0] - a[0], triangle[1, 1] - a[1], triangle[1, 2] - a[2])
    ac = (triangle[2, 0] - a[0], triangle[2, 1] - a[1], triangle[2, 2] - a[2])
    ap = (p[0] - a[0], p[1] - a[1], p[2] - a[2])
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return _dot(ap, ap)
    bp = (ap[0] - ab[0], ap[1] - ab[1], ap[2] - ab[2])
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return _dot(bp, bp)
    cp = (ap[0] - ac[0], ap[1] - ac[1], ap[2] - ac[2])
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return _dot(cp, cp)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0 and d1 > d3:
        return _past(ap, ab, d1 / (d1 - d3), ac, 0.0)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0 and d2 > d6:
        return _past(ap, ab, 0.0, ac, d2 / (d2 - d6))
    va = d3 * d6 - d5 * d4
    e, f = d4 - d3, d5 - d6
    if va <= 0.0 and e >= 0.0 and f >= 0.0 and e + f > 0.0:
        return _past(ap, ab, f / (e + f), ac, e / (e + f))
    total = va + vb + vc
    if total <= 0.0:  # no area: the corners and edges above missed only by rounding
        return min(_dot(ap, ap), _dot(bp, bp), _dot(cp, cp))
    return _past(ap, ab, vb / total, ac, vc / total)


@njit(inline="always")
def _past(
    ap: tuple[float, float, float],
    ab: tuple[float, float, float],
    v: float,
    ac: tuple[float, float, float],
    w: float,
) -> float:
    """Squared distance to the triangle's point a + v ab + w ac."""
    q = (ap[0] - v * ab[0] - w * ac[0], ap[1] - v * ab[1] - w * ac[1], ap[2] - v * ab[2] - w * ac[2])
    return _dot(q, q)


@njit
def _squared_to_box(p: Array, low: Array, high: Array) -> float:
    """Squared distance from p to an axis-aligned box, zero inside."""
    total = 0.0
    for k in range(3):
        gap = max(low[k] - p[k], 0.0, p[k] - high[k])
        total += gap * gap
    return total


@njit(parallel=True)
def _closest(
    points: Array, corners: Array, low: Array, high: Array, left: IntArray, first: IntArray, count: IntArray
) -> Array:
    """Distance of each point to the nearest triangle; each row is found by one thread on its own."""
    out = np.empty(len(points))
    for i in prange(len(points)):
        p = points[i]
        best = np.inf
        stack = np.empty(128, np.int64)
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if _squared_to_box(p, low[node], high[node]) >= best:
                continue
            if left[node] < 0:
                for t in range(first[node], first[node] + count[node]):
                    best = min(best, _squared_to_triangle(p, corners[t]))
                continue
            one, two = left[node], left[node] + 1
            # The nearer child goes on top, so that the other one is mostly skipped.
            if _squared_to_box(p, low[one], high[one]) < _squared_to_box(p, low[two], high[two]):
                one, two = two, one
            stack[top], stack[top + 1] = one, two
            top += 2
        out[i] = np.sqrt(best)
    return out


def _halved(centres: Array) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Tree over points, SciPy's, as arrays.

    Gives the order of the points, and for each node its first child (-1 for a leaf; the other child follows it), the
    first of its points in that order, and their number.
    """
    tree = cKDTree(centres, leafsize=_LEAF)
    nodes: list[Any] = [tree.tree]
    left: list[int] = []
    for node in nodes:  # it grows meanwhile
        if node.split_dim < 0:
            left.append(-1)
        else:
            left.append(len(nodes))
            nodes.extend((node.lesser, node.greater))
    first = np.array([node.start_idx for node in nodes])
    count = np.array([node.end_idx for node in nodes]) - first
    return np.asarray(tree.indices), np.array(left), first, count


@njit
def _boxes(corners: Array, first: IntArray, count: IntArray) -> tuple[Array, Array]:
    """Lowest and highest corner of the box round the triangles of every node, shapes (nodes, 3)."""
    low, high = np.full((len(first), 3), np.inf), np.full((len(first), 3), -np.inf)
    for node in range(len(first)):
        for t in range(first[node], first[node] + count[node]):
            for v in range(3):
                for k in range(3):
                    low[node, k] = min(low[node, k], corners[t, v, k])
                    high[node, k] = max(high[node, k], corners[t, v, k])
    return low, high


class MeshDistance:
    """Exact unsigned distance to a triangle mesh, for many points.

    Shapes: `vertices_m` (n, 3); `faces` (m, 3).
    """

    def __init__(self, vertices_m: Array, faces: IntArray) -> None:
        if len(faces) == 0:
            raise InputError("mesh: no faces, needs at least one")
        corners = np.ascontiguousarray(np.asarray(vertices_m, dtype=np.float64)[np.asarray(faces)])
        order, left, first, count = _halved(corners.mean(axis=1))
        corners = np.ascontiguousarray(corners[order])
        self._tree = (corners, *_boxes(corners, first, count), left, first, count)

    def __call__(self, points_m: Array) -> Array:
        """Distance in m of points, shape (n, 3), to the nearest triangle; shape (n,)."""
        return _closest(np.ascontiguousarray(points_m, dtype=np.float64).reshape(-1, 3), *self._tree)

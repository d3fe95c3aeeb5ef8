"""Ray casting on a triangle mesh: bounding-box tree and a watertight ray-triangle test.

Faces are halved across the longest side of their box; the leaves of a complete binary tree hold a few each, node i has
the children 2 i + 1 and 2 i + 2. The test is that of S. Woop, C. Benthin and I. Wald (Watertight Ray/Triangle
Intersection, Journal of Computer Graphics Techniques 2 (2013) 65): faces that share an edge compute the same number
there. Double precision in one order, so results do not depend on the number of threads. Photographs use Embree
(`wakewise.vision.imaging`).
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit, prange
from wakewise.scene.targets.mesh import Mesh

LEAF = 4
"""Faces held by a leaf, at most."""
_NEVER = 1e-300
"""Stands for a direction's component of zero, which cannot be divided by."""


class Rays:
    """Casts rays at one mesh.

    `mesh`: in any frame; faces of no area are never hit.
    """

    def __init__(self, mesh: Mesh) -> None:
        corners = mesh.triangles_m
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._faces = _halved(0.5 * (low + high))
        self._corners = np.ascontiguousarray(corners[self._faces])
        # No rounding may put a face outside of its box.
        spare = 1e-12 * float(np.abs(corners).max())
        self._low = _joined(low[self._faces].min(axis=1) - spare, np.minimum)
        self._high = _joined(high[self._faces].max(axis=1) + spare, np.maximum)

    def first(self, starts_m: Array, directions: Array) -> tuple[IntArray, Array]:
        """First face on each ray, and its distance.

        `starts_m`, `directions`, shape (n, 3): in the mesh's frame; distances are in lengths of the direction. Returns
        `face`, shape (n,): number of the face, the lowest of several at one distance; -1 where nothing is hit. Returns
        `distance`, shape (n,): greater than 0; infinite where nothing is hit.
        """
        face = np.full(len(starts_m), -1, dtype=np.int64)
        distance = np.full(len(starts_m), np.inf)
        # Copies: read-only arrays would be another type to the compiler, and compiled once more.
        starts = np.array(starts_m, dtype=np.float64, order="C")
        ways = np.array(np.broadcast_to(directions, starts.shape), dtype=np.float64, order="C")
        _cast(self._low, self._high, self._corners, self._faces, starts, ways, face, distance)
        return face, distance


def _halved(middles: Array) -> IntArray:
    """Numbers of the faces of each leaf, shape (leaves, faces of a leaf), from their middles, shape (m, 3).

    Leaves are equally large: some faces, spread over all, are there twice.
    """
    count = len(middles)
    leaves = 1 << max(0, math.ceil(math.log2(count / LEAF)))
    slots = leaves * math.ceil(count / leaves)
    groups = (np.arange(slots) * count // slots)[None]
    while len(groups) < leaves:
        at = middles[groups]
        longest = np.argmax(np.ptp(at, axis=1), axis=1)
        order = np.argsort(np.take_along_axis(at, longest[:, None, None], axis=2)[:, :, 0], axis=1, kind="stable")
        groups = np.take_along_axis(groups, order, axis=1).reshape(2 * len(groups), -1)
    return groups


def _joined(level: Array, join: np.ufunc) -> Array:
    """One side of every node's box, root first, from those of the leaves, shape (leaves, 3)."""
    levels = [level]
    while len(level) > 1:
        level = join(level[0::2], level[1::2])
        levels.append(level)
    return np.ascontiguousarray(np.concatenate(levels[::-1]))


@njit(inline="always")
def _entry(low: Array, high: Array, start: Array, inverse: Array, best: float) -> float:
    """Where a ray enters a box, infinity if it does not before `best`."""
    near, far = 0.0, best
    for k in range(3):
        one, two = (low[k] - start[k]) * inverse[k], (high[k] - start[k]) * inverse[k]
        near, far = max(near, min(one, two)), min(far, max(one, two))
    return near if near <= far * (1.0 + 1e-12) else np.inf


@njit(parallel=True)
def _cast(
    low: Array, high: Array, corners: Array, faces: IntArray, starts: Array, ways: Array, face: IntArray,
    distance: Array,
) -> None:  # fmt: skip
    """Fill `face` and `distance`, both (n,), for rays from `starts` along `ways`, both (n, 3)."""
    first_leaf = low.shape[0] // 2
    for ray in prange(starts.shape[0]):
        start = starts[ray]
        inverse = np.empty(3)
        z = 0
        for k in range(3):
            inverse[k] = 1.0 / (ways[ray, k] if abs(ways[ray, k]) > _NEVER else _NEVER)
            if abs(ways[ray, k]) > abs(ways[ray, z]):
                z = k
        x, y = (z + 1) % 3, (z + 2) % 3
        shear_x, shear_y, scale = ways[ray, x] / ways[ray, z], ways[ray, y] / ways[ray, z], 1.0 / ways[ray, z]
        best, hit = np.inf, -1
        nodes, entries = np.empty(64, dtype=np.int64), np.empty(64)
        nodes[0], entries[0], held = 0, _entry(low[0], high[0], start, inverse, best), 1
        while held > 0:
            held -= 1
            node = nodes[held]
            if not entries[held] <= best * (1.0 + 1e-12) or entries[held] == np.inf:
                continue
            if node < first_leaf:
                left, right = 2 * node + 1, 2 * node + 2
                to_left = _entry(low[left], high[left], start, inverse, best)
                to_right = _entry(low[right], high[right], start, inverse, best)
                # The nearer child is looked at first.
                if to_left < to_right:
                    left, right, to_left, to_right = right, left, to_right, to_left
                for child, entry in ((left, to_left), (right, to_right)):
                    if entry < np.inf:
                        nodes[held], entries[held] = child, entry
                        held += 1
                continue
            leaf = node - first_leaf
            for slot in range(faces.shape[1]):
                a, b, c = corners[leaf, slot, 0], corners[leaf, slot, 1], corners[leaf, slot, 2]
                az, bz, cz = a[z] - start[z], b[z] - start[z], c[z] - start[z]
                ax, ay = a[x] - start[x] - shear_x * az, a[y] - start[y] - shear_y * az
                bx, by = b[x] - start[x] - shear_x * bz, b[y] - start[y] - shear_y * bz
                cx, cy = c[x] - start[x] - shear_x * cz, c[y] - start[y] - shear_y * cz
                u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
                if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
                    continue
                size = u + v + w
                if size == 0.0:
                    continue
                way = scale * (u * az + v * bz + w * cz) / size
                if way > 0.0 and (way < best or (way == best and faces[leaf, slot] < hit)):
                    best, hit = way, faces[leaf, slot]
        face[ray], distance[ray] = hit, best

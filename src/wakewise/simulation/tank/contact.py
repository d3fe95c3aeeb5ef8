"""Contact of a box-shaped hull with floor, walls and target, and the stop there."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

_NONE = np.zeros((0, 3))
_TOUCH_M = 1e-6  # a hull that was set back onto something still touches it


class CollisionGeometry:
    """Floor, walls and target round a box-shaped hull.

    Contact is inelastic and without friction: the hull is set back out of what it is in, along the shortest way for
    the target, and the part of its velocity that points into it is taken away. It is not turned by the blow.

    - `hull_m`, shape (3,): size of the box in body axes, centred on the body origin.
    - `size_m`: length, width and depth of the tank.
    - `target_W_m`, shape (n, 3): points on the target's surface, dense enough that the hull touches one.
    """

    def __init__(self, hull_m: Array, size_m: tuple[float, float, float], target_W_m: Array) -> None:
        self._half = 0.5 * np.asarray(hull_m, dtype=np.float64)
        self._size = size_m
        self.corners_B_m: Array = self._half * np.array(list(product((-1.0, 1.0), repeat=3)))
        self._target = np.ascontiguousarray(target_W_m, dtype=np.float64)
        self._tree = KDTree(self._target)
        self._middle = self._target.mean(axis=0)
        self._radius = float(np.linalg.norm(self._target - self._middle, axis=1).max())
        ball = float(np.linalg.norm(self._half)) + 2 * _TOUCH_M
        room = (size_m[0] / 2, size_m[1] / 2, size_m[2])
        self.packed: Array = np.array([*self._half, *room, *self._middle, self._radius, ball])
        """Inputs of `surely_clear`."""

    def touches(self, p_W_m: Array, R_WB: Array) -> str:
        """Name what the hull is in or on: the floor, a wall, the target, or nothing (an empty string)."""
        reach = np.abs(R_WB) @ self._half + _TOUCH_M
        if p_W_m[2] + reach[2] > self._size[2]:
            return "the floor"
        if abs(p_W_m[0]) + reach[0] > self._size[0] / 2 or abs(p_W_m[1]) + reach[1] > self._size[1] / 2:
            return "a wall"
        return "the target" if len(self._inside(p_W_m, R_WB, _TOUCH_M)) else ""

    def held(self, p_W_m: Array, R_WB: Array, nu_B: Array) -> tuple[Array, Array, str]:
        """Position (3,), twist (6,) and what was touched, after the hull was set back out of all that it was in."""
        over = self._inside(p_W_m, R_WB, 0.0)
        reach = np.abs(R_WB) @ self._half
        room = (self._size[0] / 2, self._size[1] / 2, self._size[2])
        beyond = [float(abs(p_W_m[k]) + reach[k]) - room[k] for k in range(3)]
        if not len(over) and max(beyond) <= 0.0:
            return p_W_m, nu_B, ""
        p, v, touched = p_W_m.copy(), R_WB @ nu_B[:3], ""
        if len(over):
            # Away from an axis' high face until the lowest point in the hull is out, or the other way round.
            ways = np.concatenate([self._half - over.min(axis=0), self._half + over.max(axis=0)])
            face = int(np.argmin(ways))
            out = R_WB[:, face % 3] * (1.0 if face >= 3 else -1.0)
            p += ways[face] * out
            v -= min(float(v @ out), 0.0) * out
            touched = "the target"
        # The surface holds nothing back: only the floor's side of z counts.
        for axis, name in ((0, "a wall"), (1, "a wall"), (2, "the floor")):
            side = 1.0 if axis == 2 or p[axis] > 0.0 else -1.0
            deep = side * float(p[axis]) + float(reach[axis]) - room[axis]
            if deep > 0.0:
                p[axis] -= side * deep
                v[axis] -= side * max(side * v[axis], 0.0)
                touched = name
        return p, np.concatenate([R_WB.T @ v, nu_B[3:]]), touched

    def _inside(self, p_W_m: Array, R_WB: Array, margin_m: float) -> Array:
        """Points of the target inside the hull, in body axes, shape (k, 3)."""
        gap = np.maximum(np.abs((self._middle - p_W_m) @ R_WB) - self._half, 0.0)
        if float(gap @ gap) > (self._radius + margin_m) ** 2:
            return _NONE
        near = self._tree.query_ball_point(p_W_m, float(np.linalg.norm(self._half)) + 2.0 * margin_m)
        points = (self._target[np.sort(near).astype(np.int64)] - p_W_m) @ R_WB
        inside: Array = points[np.all(np.abs(points) < self._half + margin_m, axis=1)]
        return inside


@njit
def surely_clear(around: Array, p_W_m: Array, R_WB: Array) -> bool:
    """Whether a hull, by a quick look, surely touches nothing.

    `around` is `CollisionGeometry.packed`; `p_W_m` is the hull's place (the first three numbers), `R_WB` its attitude.
    """
    half, room, middle, radius, ball = around[0:3], around[3:6], around[6:9], around[9], around[10]
    away2, inside = 0.0, p_W_m[2] + ball <= room[2]
    for k in range(2):
        inside &= abs(p_W_m[k]) + ball <= room[k]
    for k in range(3):
        away2 += (p_W_m[k] - middle[k]) ** 2
    if inside and away2 > (ball + radius) ** 2:
        return True
    # The box itself, against the ball round the target.
    gap2 = 0.0
    for i in range(3):
        reach = along = 0.0
        for k in range(3):
            reach += abs(R_WB[i, k]) * half[k]
            along += (middle[k] - p_W_m[k]) * R_WB[k, i]
        if (p_W_m[i] if i == 2 else abs(p_W_m[i])) + reach + _TOUCH_M > room[i]:
            return False
        gap2 += max(abs(along) - half[i], 0.0) ** 2
    return gap2 > (radius + math.sqrt(3.0) * _TOUCH_M) ** 2

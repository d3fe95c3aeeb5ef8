"""What a current does to the vehicle at rest, taken out of its motion and put into the load that nothing explains.

At rest a current's drag and Munk moment cannot be told from any other load, and nothing need tell them apart. Yet they
go with the square of the current: a filter that reckons with them as such holds for knowledge of the current what is
only the bend of that curve, taken at one estimate after the other. So the unmodelled force and moment of the filter
are those *at rest*, in one attitude, the first one, with drag and Munk moment of the current in them; to the
equations of motion comes only by how much either differs once the vehicle moves or has turned. That is the same
model, in variables in which hovering says nothing of the current.

The current is `mean[25:28]`, `own` the vehicle's packed numbers with drag and inertia as believed (see
`wakewise.vehicles.kernels`), `rest_q` the attitude.
"""

from __future__ import annotations

import numpy as np

from wakewise.arrays import Array
from wakewise.compiled import assign, njit
from wakewise.vehicles.kernels import LINEAR, QUADRATIC, coriolis, damping, rotate

DRAG = 27
"""Where the error's drag begins; inertia comes six places later."""


@njit
def turn(q: Array, v: Array, sign: float) -> Array:
    """Vector R(q) v for sign = 1, R(q)' v for sign = -1."""
    w, x, y, z = q[0], sign * q[1], sign * q[2], sign * q[3]
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array([v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx])


@njit
def _past_at_rest(mean: Array, rest_q: Array) -> tuple[float, float, float, float, float, float]:
    x, y, z = rotate(-rest_q[0], rest_q[1], rest_q[2], rest_q[3], mean[25], mean[26], mean[27])
    return -x, -y, -z, 0.0, 0.0, 0.0


@njit(apart=True)
def at_rest(own: Array, mean: Array, rest_q: Array) -> Array:
    """Drag and Munk moment of the current on the vehicle at rest, as the equations of motion subtract them, shape (6,).

    Force in W, moment in B.
    """
    past = _past_at_rest(mean, rest_q)
    drag, munk = damping(own, past), coriolis(own, past)
    wrench = np.empty(6)
    assign(wrench[:3], turn(rest_q, np.array([drag[0], drag[1], drag[2]]), 1.0))
    assign(wrench[3:], np.array([drag[3] + munk[3], drag[4] + munk[4], drag[5] + munk[5]]))
    return wrench


@njit(apart=True)
def rest_effects(own: Array, mean: Array, rest_q: Array) -> Array:
    """By what `at_rest`, with its force in B, changes with current (3), drag (6) and inertia (6), shape (6, 15)."""
    past, q = _past_at_rest(mean, rest_q), mean[3:7]
    v, drag = np.array([past[0], past[1], past[2]]), damping(own, past)
    M = np.ascontiguousarray(own[:3, :3])
    h = M @ v
    effect = np.zeros((6, 15))
    for j in range(3):
        axis = np.zeros(3)
        axis[j] = -1.0
        seen = turn(rest_q, axis, -1.0)
        for i in range(6):
            for k in range(3):
                effect[i, j] += own[LINEAR + i, k] * seen[k]
            if i < 3:
                effect[i, j] += 2.0 * own[QUADRATIC, i] * abs(v[i]) * seen[i]
        assign(effect[3:, j], effect[3:, j] + np.cross(seen, h) + np.cross(v, M @ seen))
    for i in range(6):
        effect[i, 3 + i] = drag[i] / (1.0 + mean[1 + DRAG + i])
    for i in range(3):
        share = 0.5 / (1.0 + mean[1 + DRAG + 6 + i])
        change = np.zeros(3)
        for j in range(3):
            change[i] += share * M[i, j] * v[j]
            change[j] += share * M[j, i] * v[i]
        assign(effect[3:, 9 + i], np.cross(v, change))
    for j in range(9):
        assign(effect[:3, j], turn(q, turn(rest_q, effect[:3, j].copy(), 1.0), -1.0))
    return effect

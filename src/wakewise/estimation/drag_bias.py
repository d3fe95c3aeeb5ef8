"""What a current does to the vehicle at rest, taken out of its motion and put into the load that nothing explains.

At rest a current's drag and Munk moment cannot be told from any other load, and nothing need tell them apart. Yet they
go with the square of the current: a filter that reckons with them as such holds for knowledge of the current what is
only the bend of that curve, taken at one estimate after the other. So the unmodelled force and moment of the filter
are those *at rest*, in one attitude, the first one, with drag and Munk moment of the current in them; to the
equations of motion comes only by how much either differs once the vehicle moves or has turned. That is the same
model, in variables in which hovering says nothing of the current.

The current is `mean[25:28]`, `own` the vehicle's packed numbers with drag and inertia as believed (see
`wakewise.robot.vehicles.kernels`), `rest_q` the attitude.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, njit
from wakewise.robot.vehicles.kernels import LINEAR, QUADRATIC, Three, coriolis, damping, rotate

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
def drag_at_rest(own: Array, mean: Array, rest_q: Array) -> Array:
    """Drag and Munk moment of the current on the vehicle at rest, as the equations of motion subtract them, shape (6,).

    Force in W, moment in B.
    """
    past = _past_at_rest(mean, rest_q)
    drag, munk = damping(own, past), coriolis(own, past)
    wrench = np.empty(6)
    assign(wrench[:3], turn(rest_q, np.array([drag[0], drag[1], drag[2]]), 1.0))
    assign(wrench[3:], np.array([drag[3] + munk[3], drag[4] + munk[4], drag[5] + munk[5]]))
    return wrench


@njit(inline="always")
def _cross(a: Three, b: Three) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def _momentum(own: Array, v: Three) -> Three:
    """Linear momentum at a linear velocity."""
    return (
        own[0, 0] * v[0] + own[0, 1] * v[1] + own[0, 2] * v[2],
        own[1, 0] * v[0] + own[1, 1] * v[1] + own[1, 2] * v[2],
        own[2, 0] * v[0] + own[2, 1] * v[1] + own[2, 2] * v[2],
    )


@njit(apart=True)
def drag_at_rest_jacobian(own: Array, mean: Array, rest_q: Array) -> Array:
    """By what `drag_at_rest`, with its force in B, changes with current (3), drag (6) and inertia (6), shape (6,
    15).
    """
    past = _past_at_rest(mean, rest_q)
    v, drag = (past[0], past[1], past[2]), damping(own, past)
    h = _momentum(own, v)
    effect = np.zeros((6, 15))
    for j in range(3):
        axis = (-1.0 if j == 0 else 0.0, -1.0 if j == 1 else 0.0, -1.0 if j == 2 else 0.0)
        seen = rotate(-rest_q[0], rest_q[1], rest_q[2], rest_q[3], axis[0], axis[1], axis[2])
        turning, turned = _cross(seen, h), _cross(v, _momentum(own, seen))
        for i in range(6):
            for k in range(3):
                effect[i, j] += own[LINEAR + i, k] * seen[k]
        for i in range(3):
            effect[i, j] += 2.0 * own[QUADRATIC, i] * abs(v[i]) * seen[i]
            effect[3 + i, j] += turning[i] + turned[i]
    for i in range(6):
        effect[i, 3 + i] = drag[i] / (1.0 + mean[1 + DRAG + i])
    for i in range(3):
        share = 0.5 / (1.0 + mean[1 + DRAG + 6 + i])
        change = np.zeros(3)
        for j in range(3):
            change[i] += share * own[i, j] * v[j]
            change[j] += share * own[j, i] * v[i]
        turning = _cross(v, (change[0], change[1], change[2]))
        for k in range(3):
            effect[3 + k, 9 + i] = turning[k]
    for j in range(9):
        _turn_as_at_rest(effect[:3, j], mean[3:7], rest_q)
    return effect


@njit(inline="always")
def _turn_as_at_rest(force: Array, q: Array, rest_q: Array) -> None:
    """A force in the body at rest, in place, as the body at q sees it that has turned since."""
    x, y, z = rotate(rest_q[0], rest_q[1], rest_q[2], rest_q[3], force[0], force[1], force[2])
    force[0], force[1], force[2] = rotate(-q[0], q[1], q[2], q[3], x, y, z)

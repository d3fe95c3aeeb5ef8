"""What a goal asks of the next seconds: the wished states that a plan is held against.

A goal tells where to be and how to move now. Carried on at constant speed it is right on legs and orbits, but wherever
a mission or an operator speeds up every plan would come late, by its age and the thrusters' lag, and would then hurry
after the place that has moved on. So the goal's change of twist is carried on, too, for as long as such changes last.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Goal
from wakewise.core.jit.njit import assign, njit

RAMP_S = 0.5
"""How long a change of speed goes on, on average, once it is seen: half of the second that an operator (0.1 m/s at
0.1 m/s2) or a leg of a mission (0.06 m/s at 0.05 m/s2) needs to reach its speed. Nobody knows when it ends, so it fades
with this time constant, as a change does that may end at any moment."""


def reference_of(goal: Goal, stages: int, stage_s: float, change_B: Array | None = None) -> Array:
    """Wished states at the ends of the stages: position, quaternion and twist.

    Parameters
    ----------
    goal : Goal
        Of now; its twist is carried on in its own body frame.
    stages, stage_s : int, float
    change_B : ndarray, shape (6,), optional
        How fast the goal's twist changes, in its body frame; it fades with `RAMP_S`. None: not at all.

    Returns
    -------
    ndarray, shape (stages + 1, 13)
        The first row is the goal itself.
    """
    reference = np.empty((stages + 1, 13))
    change = np.zeros(6) if change_B is None else np.asarray(change_B, dtype=np.float64)
    _carry_on(goal.X_WB.p_m, goal.X_WB.q, goal.nu_B, change, stage_s, reference)
    return reference


@njit
def _carry_on(p, q, nu, change, stage_s, out):  # type: ignore[no-untyped-def]
    assign(out[0, :3], p)
    assign(out[0, 3:7], q)
    assign(out[0, 7:], nu)
    twist, half, middle = np.empty(6), np.empty(4), np.empty(4)
    for k in range(1, out.shape[0]):
        before, after = out[k - 1], out[k]
        # Over the stage it moves with the twist of its middle, on an arc.
        so_far = RAMP_S * (1.0 - np.exp(-(k - 0.5) * stage_s / RAMP_S))
        for r in range(6):
            twist[r] = nu[r] + so_far * change[r]
            after[7 + r] = nu[r] + RAMP_S * (1.0 - np.exp(-k * stage_s / RAMP_S)) * change[r]
        rate = np.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
        angle = 0.5 * rate * stage_s
        sine = np.sin(0.5 * angle) / rate if rate > 1e-12 else 0.25 * stage_s
        half[0] = np.cos(0.5 * angle)
        for r in range(3):
            half[1 + r] = sine * twist[3 + r]
        _times(before[3:7], half, middle)
        _times(middle, half, after[3:7])
        # The chord of a screw: along the velocity half way, shortened across the axis of the turn by sin(a)/a.
        shorter = np.sin(angle) / angle if angle > 1e-6 else 1.0
        along = 0.0
        if rate > 1e-12:
            along = (1.0 - shorter) * (twist[0] * twist[3] + twist[1] * twist[4] + twist[2] * twist[5]) / (rate * rate)
        w, x, y, z = middle[0], middle[1], middle[2], middle[3]
        for r in range(3):
            twist[r] = shorter * twist[r] + along * twist[3 + r]
        u, v, s = twist[0], twist[1], twist[2]
        a, b, c = 2.0 * (y * s - z * v), 2.0 * (z * u - x * s), 2.0 * (x * v - y * u)
        after[0] = before[0] + stage_s * (u + w * a + y * c - z * b)
        after[1] = before[1] + stage_s * (v + w * b + z * a - x * c)
        after[2] = before[2] + stage_s * (s + w * c + x * b - y * a)


@njit
def _times(a, b, out):  # type: ignore[no-untyped-def]
    """Quaternion product."""
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@njit
def between(a: Array, b: Array, share: float) -> Array:
    """State, shape (13,), a share of the way from one to the next: the pose along the turn, the rest straight."""
    state = (1.0 - share) * a + share * b
    turn, half = np.empty(4), np.empty(4)
    back = np.array([a[3], -a[4], -a[5], -a[6]])
    _times(back, b[3:7], turn)
    if turn[0] < 0.0:
        assign(turn, -turn)
    sine = np.sqrt(turn[1] ** 2 + turn[2] ** 2 + turn[3] ** 2)
    angle = share * np.arctan2(sine, turn[0])
    scale = np.sin(angle) / sine if sine > 1e-12 else share
    half[0] = np.cos(angle)
    assign(half[1:], scale * turn[1:])
    _times(a[3:7], half, state[3:7])
    return state

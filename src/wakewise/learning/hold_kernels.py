"""One step of many vehicles that hold their place: motors, motion, load, wash, power and observation, on all cores.

Each vehicle moves as `step_batch` moves it. The wash is the velocity of all jets, added up, at weighted points: the
law of one jet is that of `wakewise.wake.jets`, `speed_and_slope`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit, prange
from wakewise.robot.vehicles.kernels import rate_kernel, rk4_stages, rotate, times
from wakewise.wake.jets import speed_and_slope

BLOCK = 32
"""Vehicles that one thread takes at a time, with one set of work arrays."""
LOAD_TIME_S = 1.0
"""Time constant of the observed load; an estimate: a state estimator needs about as long to find a new load."""


class HoldCase(NamedTuple):
    """What no step changes, n thrusters and P points.

    `bodies` (K, 20, 6) and `gains` (K, n): vehicles that are drawn from. `nominal` (20, 6): the nominal one.
    `allocation` (6, n), `arms` and `axes` (n, 3), `lags_s` (n,). `watts` (n, 2): power over |T|^1.5, forward and in
    reverse. `kind`, `numbers` (7,), `own` (n, 6): law of the jets. `points` (P, 3) and `weights` (P,), which sum to 1.
    `centre` (3,): of the target.
    """

    bodies: Array
    gains: Array
    nominal: Array
    allocation: Array
    arms: Array
    axes: Array
    lags_s: Array
    watts: Array
    kind: int
    numbers: Array
    own: Array
    points: Array
    weights: Array
    centre: Array


@njit
def wash_speed(case: HoldCase, state: Array, thrusts: Array) -> float:
    """Root mean square of the water's speed at the points (m/s), of thrusts, shape (n,), at a state, shape (13,)."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    law = case.numbers
    numbers = (law[0], law[1], law[2], law[3], law[4], law[5], law[6])
    total = 0.0
    for j in range(case.points.shape[0]):
        a, b, c = case.points[j, 0] - state[0], case.points[j, 1] - state[1], case.points[j, 2] - state[2]
        q0, q1, q2 = rotate(-w, x, y, z, a, b, c)
        u0, u1, u2 = 0.0, 0.0, 0.0
        for i in range(thrusts.shape[0]):
            if thrusts[i] == 0.0:
                continue
            e0, e1, e2 = q0 - case.arms[i, 0], q1 - case.arms[i, 1], q2 - case.arms[i, 2]
            sign = -1.0 if thrusts[i] > 0.0 else 1.0  # the jet runs against the force
            along = sign * (case.axes[i, 0] * e0 + case.axes[i, 1] * e1 + case.axes[i, 2] * e2)
            r2 = e0 * e0 + e1 * e1 + e2 * e2
            own = case.own[i]
            if along > 0.0 and r2 <= own[3] + own[4] * along + own[5] * along * along:
                f, _, _ = speed_and_slope(case.kind, numbers, own[0], own[1], own[2], along, r2)
                speed = sign * np.sqrt(abs(thrusts[i])) * f
                u0 += speed * case.axes[i, 0]
                u1 += speed * case.axes[i, 1]
                u2 += speed * case.axes[i, 2]
        total += case.weights[j] * (u0 * u0 + u1 * u1 + u2 * u2)
    return np.sqrt(total)


@njit
def observe(case: HoldCase, goal: Array, state: Array, load: Array, out: Array) -> None:
    """Write observations 0 to 17 and the target's place in B, shape (21,), for a goal, shape (7,), in W."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    out[0], out[1], out[2] = rotate(-w, x, y, z, goal[0] - state[0], goal[1] - state[1], goal[2] - state[2])
    # q_BG = conj(q_WB) q_WG, the shorter way round.
    a = w * goal[3] + x * goal[4] + y * goal[5] + z * goal[6]
    b = w * goal[4] - x * goal[3] - y * goal[6] + z * goal[5]
    c = w * goal[5] + x * goal[6] - y * goal[3] - z * goal[4]
    d = w * goal[6] - x * goal[5] + y * goal[4] - z * goal[3]
    half = np.sqrt(b * b + c * c + d * d)
    factor = 2.0 * np.arctan2(half, abs(a)) / half if half > 1e-12 else 2.0
    if a < 0.0:
        factor = -factor
    out[3], out[4], out[5] = factor * b, factor * c, factor * d
    for i in range(6):
        out[6 + i] = state[7 + i]
        out[12 + i] = load[i]
    away0, away1, away2 = case.centre[0] - state[0], case.centre[1] - state[1], case.centre[2] - state[2]
    out[18], out[19], out[20] = rotate(-w, x, y, z, away0, away1, away2)


@njit
def _unexplained(case: HoldCase, state: Array, motors: Array, inputs: Array, rate: Array) -> None:
    """Write the rate of the nominal vehicle in still water under nominal thrusts to `rate`, shape (13,)."""
    for r in range(6):
        inputs[r] = 0.0
        for i in range(motors.shape[0]):
            inputs[r] += case.allocation[r, i] * motors[i]
    inputs[6], inputs[7], inputs[8] = 0.0, 0.0, 0.0
    rate_kernel(case.nominal, state, inputs, rate)


@njit(parallel=True)
def hold_kernel(
    case: HoldCase, which: IntArray, goals: Array, currents: Array, commands: Array, step_s: float, steps: int,
    states: Array, motors: Array, loads: Array, figures: Array, observed: Array,
) -> None:  # fmt: skip
    """Advance N vehicles by `steps` steps of `step_s` under commands, shape (N, n), in newtons; no steps only measures.

    `which` (N,): row of `bodies`. `goals` (N, 7), `currents` (N, 3). `states` (N, 13), `motors` (N, n) and `loads`
    (N, 6) change in place. Written: `figures` (N, 4), errors of position and attitude, wash, power; `observed` (N, 21).
    """
    n, m = states.shape[0], motors.shape[1]
    for block in prange((n + BLOCK - 1) // BLOCK):
        stages, inputs, before, after = np.empty((5, 13)), np.empty(9), np.empty(13), np.empty(13)
        thrusts, start = np.empty(m), np.empty(6)
        for k in range(block * BLOCK, min(n, (block + 1) * BLOCK)):
            body, state = which[k], states[k]
            _unexplained(case, state, motors[k], inputs, before)
            for r in range(6):
                start[r] = state[7 + r]
            for _ in range(steps):
                for r in range(6):
                    inputs[r] = 0.0
                for i in range(m):
                    kept = np.exp(-step_s / case.lags_s[i]) if case.lags_s[i] > 0.0 else 0.0
                    turned = commands[k, i] + kept * (motors[k, i] - commands[k, i])
                    thrust = case.gains[body, i] * 0.5 * (motors[k, i] + turned)  # right to second order
                    motors[k, i] = turned
                    for r in range(6):
                        inputs[r] += case.allocation[r, i] * thrust
                for r in range(3):
                    inputs[6 + r] = currents[k, r]
                rk4_stages(case.bodies[body], state, inputs, step_s, stages)
            if steps > 0:
                _unexplained(case, state, motors[k], inputs, after)
                span = step_s * steps
                more = (
                    (state[7] - start[0]) / span - 0.5 * (before[7] + after[7]),
                    (state[8] - start[1]) / span - 0.5 * (before[8] + after[8]),
                    (state[9] - start[2]) / span - 0.5 * (before[9] + after[9]),
                    (state[10] - start[3]) / span - 0.5 * (before[10] + after[10]),
                    (state[11] - start[4]) / span - 0.5 * (before[11] + after[11]),
                    (state[12] - start[5]) / span - 0.5 * (before[12] + after[12]),
                )
                unexplained = times(case.nominal, 0, more)
                share = 1.0 - np.exp(-span / LOAD_TIME_S)
                for r in range(6):
                    loads[k, r] += share * (unexplained[r] - loads[k, r])
            power = 0.0
            for i in range(m):
                thrusts[i] = case.gains[body, i] * motors[k, i]
                power += case.watts[i, 0 if thrusts[i] >= 0.0 else 1] * abs(thrusts[i]) ** 1.5
            out = observed[k]
            observe(case, goals[k], state, loads[k], out)
            figures[k, 0] = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
            figures[k, 1] = np.sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5])
            figures[k, 2] = wash_speed(case, state, thrusts)
            figures[k, 3] = power

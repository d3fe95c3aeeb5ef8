"""Compiled prediction of the error-state filter: mean, covariance and thrusts from one time to the next.

Mean and covariance are laid out as in `kernels`. A covariance that is symmetric to the bit stays so: `corrections`
reads rows of it for columns.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.estimation.eskf_kernels import CURRENT, FORCE, MOVING, propagate_mean
from wakewise.robot.vehicles.kernels import rotate

TICK_S = 1e-9
"""Times closer than this are one."""


@njit
def advance(
    packed: Array,
    allocation: Array,
    lag_s: Array,
    mean: Array,
    P: Array,
    thrusts_N: Array,
    rest_q: Array,
    since_s: Array,
    commands_N: Array,
    time_s: float,
    until_s: float,
    noise: Array,
    scale: float,
    spread: Array,
    lasts_s: Array,
) -> float:
    """Move mean, covariance and thrusts on in place from a time to another, command by command; returns when it is.

    Parameters
    ----------
    packed, allocation : ndarray, shape (20, 6) and (6, n)
        The vehicle (see `wakewise.robot.vehicles.kernels`).
    lag_s : ndarray, shape (n,)
        Time constants of the thrusters, whose thrusts are `thrusts_N`, shape (n,).
    rest_q : ndarray, shape (4,)
        Attitude that the unmodelled load is told for.
    since_s, commands_N : ndarray, shape (k,) and (k, n)
        From when which thrusts were commanded, one at least.
    noise, spread, lasts_s : ndarray
        As `predict` has them; the model's part of the noise, its first four, is `scale` times as large.
    """
    loud = noise.copy()
    for i in range(4):
        loud[i] *= scale
    push = np.empty_like(thrusts_N)
    while until_s - time_s > TICK_S:
        now = 0
        while now + 1 < since_s.shape[0] and since_s[now + 1] <= time_s + TICK_S:
            now += 1
        end_s = min(until_s, since_s[now + 1]) if now + 1 < since_s.shape[0] else until_s
        dt_s = end_s - time_s
        for k in range(push.shape[0]):
            kept, ahead = np.exp(-dt_s / lag_s[k]), thrusts_N[k] - commands_N[now, k]
            # Mean thrust over the step, exact for the first-order lag.
            push[k] = commands_N[now, k] + ahead * (lag_s[k] / dt_s) * (1.0 - kept)
            thrusts_N[k] = commands_N[now, k] + kept * ahead
        predict(packed, allocation, mean, P, push, rest_q, dt_s, loud, spread, lasts_s)
        time_s = end_s
    return time_s


@njit
def predict(
    packed: Array,
    allocation: Array,
    mean: Array,
    P: Array,
    thrusts_N: Array,
    rest_q: Array,
    dt_s: float,
    noise: Array,
    spread: Array,
    lasts_s: Array,
) -> None:
    """Advance mean and covariance in place by dt_s, some hundredths at most.

    `noise`, shape (6,), are spectral densities (amplitudes) of the errors of the modelled linear and angular
    acceleration and of the random walks of force, moment, gyro bias and accelerometer bias. What comes after the
    accelerometer's bias is a first-order Gauss-Markov process each, of standard deviation `spread` and time `lasts_s`,
    both of shape (E - 24,).
    """
    q = mean[3:7].copy()
    F = propagate_mean(packed, allocation, mean, thrusts_N, rest_q, dt_s, P.shape[0])
    _carry(P, F)
    _add_noise(P, q, dt_s, noise)
    _fade(mean, P, dt_s, spread, lasts_s)


@njit
def _carry(P: Array, F: Array) -> None:
    """Carry the covariance on by the Jacobian F of what moves; the other errors stay."""
    top = F @ P
    block = top @ F.T
    for i in range(MOVING):
        for j in range(MOVING):
            P[i, j] = 0.5 * (block[i, j] + block[j, i])
        for j in range(MOVING, P.shape[0]):
            P[i, j] = top[i, j]
            P[j, i] = top[i, j]


@njit
def _fade(mean: Array, P: Array, dt_s: float, spread: Array, lasts_s: Array) -> None:
    """Let the Markov processes forget, and new chance at them."""
    kept = np.ones(P.shape[0])
    for k in range(spread.shape[0]):
        i = CURRENT + k
        # Neighbours mostly last as long as each other.
        again = k > 0 and lasts_s[k] == lasts_s[k - 1]
        kept[i] = kept[i - 1] if again else np.exp(-dt_s / lasts_s[k])
        mean[1 + i] *= kept[i]
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            P[i, j] *= kept[i] * kept[j]
    for k in range(spread.shape[0]):
        i = CURRENT + k
        P[i, i] += spread[k] ** 2 * (1.0 - kept[i] * kept[i])


@njit
def _add_noise(P: Array, q: Array, dt_s: float, noise: Array) -> None:
    linear, angular = noise[0] ** 2, noise[1] ** 2
    for i in range(3):
        P[i, i] += linear * dt_s**3 / 3.0
        P[6 + i, 6 + i] += linear * dt_s
        P[3 + i, 3 + i] += angular * dt_s**3 / 3.0
        P[9 + i, 9 + i] += angular * dt_s
        P[3 + i, 9 + i] += angular * dt_s**2 / 2.0
        P[9 + i, 3 + i] += angular * dt_s**2 / 2.0
        # The body's axis i, as the world sees it.
        x, y, z = 1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0
        column = rotate(q[0], q[1], q[2], q[3], x, y, z)
        for j in range(3):
            P[j, 6 + i] += column[j] * linear * dt_s**2 / 2.0
            P[6 + i, j] += column[j] * linear * dt_s**2 / 2.0
    for block in range(4):
        for i in range(3):
            k = FORCE + 3 * block + i
            P[k, k] += noise[2 + block] ** 2 * dt_s

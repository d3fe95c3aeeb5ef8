"""Compiled steps of the pose filter; see `pose_filter` for what they mean.

The mean is one array: position in W (0:3), velocity in W (3:6), unmodelled acceleration in W (6:9), quaternion q_WB
(9:13), body rate (13:16), gyro bias (16:19).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from wakewise.arrays import Array


@njit(cache=True)
def turn(q: Array, v: Array, sign: float) -> Array:
    """Vector R(q) v for sign = 1, R(q)' v for sign = -1."""
    w, x, y, z = q[0], sign * q[1], sign * q[2], sign * q[3]
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array([v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx])


@njit(cache=True)
def turned_by(q: Array, rotvec: Array) -> Array:
    """Unit quaternion q exp(rotvec): a further turn, expressed in the body."""
    angle = np.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    c = np.cos(0.5 * angle)
    s = np.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    x, y, z = s * rotvec[0], s * rotvec[1], s * rotvec[2]
    result = np.array(
        [
            q[0] * c - q[1] * x - q[2] * y - q[3] * z,
            q[0] * x + q[1] * c + q[2] * z - q[3] * y,
            q[0] * y - q[1] * z + q[2] * c + q[3] * x,
            q[0] * z + q[1] * y - q[2] * x + q[3] * c,
        ]
    )
    return result / np.sqrt(np.dot(result, result))


@njit(cache=True)
def turn_between(q: Array, other: Array) -> Array:
    """Rotation vector, shorter way, that turns q into `other`, expressed in the body of q."""
    w = q[0] * other[0] + q[1] * other[1] + q[2] * other[2] + q[3] * other[3]
    x = q[0] * other[1] - q[1] * other[0] - q[2] * other[3] + q[3] * other[2]
    y = q[0] * other[2] + q[1] * other[3] - q[2] * other[0] - q[3] * other[1]
    z = q[0] * other[3] - q[1] * other[2] + q[2] * other[1] - q[3] * other[0]
    half = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 * np.arctan2(half, abs(w)) / half if half > 1e-12 else 2.0
    if w < 0.0:
        factor = -factor
    return np.array([factor * x, factor * y, factor * z])


@njit(cache=True)
def body_twist(mean: Array) -> Array:
    """Twist relative to the world, expressed in B, shape (6,)."""
    twist = np.empty(6)
    twist[:3] = turn(mean[9:13], mean[3:6], -1.0)
    twist[3:] = mean[13:16]
    return twist


@njit(cache=True)
def predict(mean: Array, twist_rate_B: Array, dt_s: float, gyro: Array, gyro_seen: bool, gyro_gain: float) -> Array:
    """Advance the mean in place by dt_s.

    `twist_rate_B`, shape (6,), is the modelled rate of the body twist; `gyro` the mean of the gyro samples of the step.
    Returns the acceleration in W, shape (3,).
    """
    q, rate = mean[9:13].copy(), mean[13:16].copy()
    v_B = turn(q, mean[3:6], -1.0)
    # The twist's rate is seen from the turning body: the world sees omega x v more.
    a_B = np.array(
        [
            twist_rate_B[0] + rate[1] * v_B[2] - rate[2] * v_B[1],
            twist_rate_B[1] + rate[2] * v_B[0] - rate[0] * v_B[2],
            twist_rate_B[2] + rate[0] * v_B[1] - rate[1] * v_B[0],
        ]
    )
    a_W = turn(q, a_B, 1.0)
    for i in range(3):
        a_W[i] += mean[6 + i]
        a = a_W[i]
        mean[i] += mean[3 + i] * dt_s + 0.5 * a * dt_s * dt_s
        mean[3 + i] += a * dt_s
        mean[13 + i] += twist_rate_B[3 + i] * dt_s
        if gyro_seen:
            mean[13 + i] += gyro_gain * (gyro[i] - mean[16 + i] - mean[13 + i])
    mean[9:13] = turned_by(q, 0.5 * dt_s * (rate + mean[13:16]))
    return a_W


@njit(cache=True)
def take_pose(
    mean: Array, p_W: Array, q_WB: Array, age_s: float, move_gain: Array, turn_gain: Array, rate_gain: float, a_W: Array
) -> None:
    """Correct the mean in place by a pose that was true `age_s` ago.

    `move_gain`, shape (3,): of position, velocity, unmodelled acceleration; `turn_gain`, shape (2,): of attitude and
    gyro bias; `rate_gain` of the body rate (used while the gyro is silent); `a_W`, shape (3,), the acceleration since.
    """
    for i in range(3):
        error = p_W[i] - (mean[i] - mean[3 + i] * age_s + 0.5 * a_W[i] * age_s**2)
        mean[i] += move_gain[0] * error
        mean[3 + i] += move_gain[1] * error
        mean[6 + i] += move_gain[2] * error
    then = turned_by(mean[9:13], -age_s * mean[13:16])
    tilt = turn_between(then, q_WB)
    mean[9:13] = turned_by(mean[9:13], turn_gain[0] * tilt)
    for i in range(3):
        mean[13 + i] += rate_gain * tilt[i]
        mean[16 + i] += turn_gain[1] * tilt[i]


@njit(cache=True)
def take_depth(mean: Array, depth_m: float, age_s: float, gain: Array, a_W: Array) -> None:
    """Correct the mean in place by a depth that was true `age_s` ago; `gain` as `move_gain` of `take_pose`."""
    error = depth_m - (mean[2] - mean[5] * age_s + 0.5 * a_W[2] * age_s**2)
    mean[2] += gain[0] * error
    mean[5] += gain[1] * error
    mean[8] += gain[2] * error

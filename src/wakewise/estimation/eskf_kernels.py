"""Compiled motion of the error-state filter; see `error_state` for what it means.

`mean`, shape (40 + n [+ up to 10],) for n thrusters: position in W (0:3), quaternion q_WB (3:7), twist in B (7:13),
unmodelled force in W (13:16) and moment in B (16:19), what the current does at rest included (`resting`), gyro bias
(19:22), accelerometer bias (22:25), current in W (25:28); then by how much of itself the truth differs from the nominal
in drag (28:34) and inertia (34:40) per degree of freedom and in each thruster's gain (40:40 + n); last, if asked for,
the sensors' slow errors: the camera's shift in W and turn in B, the tracking's shift in W, the depth's bias. `P` is the
covariance of the error, which has one entry less: position in W (0:3), turn, a rotation vector in B (3:6), then as in
`mean`, each place one lower.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, njit
from wakewise.estimation.drag_bias import DRAG, drag_at_rest, drag_at_rest_jacobian
from wakewise.robot.vehicles.kernels import INVERSE, LINEAR, QUADRATIC, Three, damping, rate_kernel, rotate
from wakewise.robot.vehicles.runge_kutta import rk4_jacobian_kernel

_INSTANT_S = 1e-7
TURNING, MOVING, FORCE, MOMENT, GYRO, FELT, CURRENT, INERTIA, GAINS = 9, 12, 12, 15, 18, 21, 24, 33, 39
"""Where blocks of the error begin, the body rate's first; MOVING is how many entries the equations of motion move."""


@njit
def quat_plus(q: Array, rotvec: Array) -> Array:
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


@njit
def quat_minus(q: Array, other: Array) -> Array:
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


@njit(apart=True)
def adapted_parameters(packed: Array, mean: Array) -> Array:
    """The vehicle's packed numbers with the drag and the inertia that the mean now believes in, shape (20, 6)."""
    own = packed.copy()
    for i in range(6):
        drag, root = 1.0 + mean[1 + DRAG + i], np.sqrt(1.0 + mean[1 + INERTIA + i])
        less = 1.0 / root
        for j in range(6):
            own[i, j] *= root
            own[j, i] *= root
            own[INVERSE + i, j] *= less
            own[INVERSE + j, i] *= less
            own[LINEAR + i, j] *= drag
        own[QUADRATIC, i] *= drag
    return own


@njit(apart=True)
def model_residual(own: Array, mean: Array, rest_q: Array) -> Array:
    """Wrench in B of what the model does not explain, shape (6,)."""
    wrench, q = drag_at_rest(own, mean, rest_q), mean[3:7]
    x, y, z = mean[13] + wrench[0], mean[14] + wrench[1], mean[15] + wrench[2]
    wrench[0], wrench[1], wrench[2] = rotate(-q[0], q[1], q[2], q[3], x, y, z)
    for i in range(3):
        wrench[3 + i] += mean[16 + i]
    return wrench


@njit
def _push(wrench: Array, allocation: Array, mean: Array, thrusts_N: Array) -> None:
    """Add to a wrench in B that of thrusts, with the gains believed in."""
    for k in range(thrusts_N.shape[0]):
        thrust = (1.0 + mean[1 + GAINS + k]) * thrusts_N[k]
        for i in range(6):
            wrench[i] += allocation[i, k] * thrust


@njit
def _past(mean: Array) -> tuple[float, float, float, float, float, float]:
    """Twist relative to the water, in B."""
    x, y, z = rotate(-mean[3], mean[4], mean[5], mean[6], mean[25], mean[26], mean[27])
    return mean[7] - x, mean[8] - y, mean[9] - z, mean[10], mean[11], mean[12]


@njit
def residual_wrench(packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array) -> Array:
    """Wrench in B, shape (6,), that the nominal vehicle in still water lacks to move as the mean has it."""
    vehicle = adapted_parameters(packed, mean)
    wrench = model_residual(vehicle, mean, rest_q)
    _push(wrench, allocation, mean, thrusts_N)
    own = damping(vehicle, _past(mean))
    still = damping(packed, (mean[7], mean[8], mean[9], mean[10], mean[11], mean[12]))
    for i in range(6):
        for k in range(thrusts_N.shape[0]):
            wrench[i] -= allocation[i, k] * thrusts_N[k]
        wrench[i] += still[i] - own[i]
    return wrench


@njit(apart=True)
def _effects(own: Array, mean: Array, inputs: Array) -> Array:
    """Wrench, shape (6, 12), by the relative change of drag and of inertia in each degree of freedom."""
    rate = np.empty(13)
    rate_kernel(own, mean[:13], inputs, rate)
    past, w = _past(mean), mean[10:13]
    b = (mean[7] - past[0], mean[8] - past[1], mean[9] - past[2])
    # Acceleration relative to the water, which in B turns against the body.
    a = rate[7:].copy()
    a[0] += w[1] * b[2] - w[2] * b[1]
    a[1] += w[2] * b[0] - w[0] * b[2]
    a[2] += w[0] * b[1] - w[1] * b[0]
    drag = damping(own, past)
    effect = np.zeros((6, 12))
    for i in range(6):
        effect[i, i] = -drag[i] / (1.0 + mean[1 + DRAG + i])
        # What the momentum h = M n and the force M a change by, with M = S M S and S the roots of the factors.
        share = 0.5 / (1.0 + mean[1 + INERTIA + i])
        h, force = np.zeros(6), np.zeros(6)
        for j in range(6):
            h[i] += share * own[i, j] * past[j]
            h[j] += share * own[j, i] * past[i]
            force[i] += share * own[i, j] * a[j]
            force[j] += share * own[j, i] * a[i]
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            force[k] += w[m] * h[n] - w[n] * h[m]
            force[3 + k] += w[m] * h[3 + n] - w[n] * h[3 + m] + past[m] * h[n] - past[n] * h[m]
        for j in range(6):
            effect[j, 6 + i] = -force[j]
    return effect


@njit(apart=True)
def _add_current(F: Array, A: Array, mean: Array, dt_s: float) -> None:
    """Add to F's columns of the current: it acts as a velocity the other way, and turns in B."""
    q, w = mean[3:7], mean[10:13]
    for j in range(3):
        seen = _world_axis(q, j)
        change = np.zeros(6)
        for i in range(6):
            for k in range(3):
                change[i] -= (A[6 + i, 6 + k] - (1.0 if i == k else 0.0)) * seen[k]
        change[0] -= dt_s * (w[1] * seen[2] - w[2] * seen[1])
        change[1] -= dt_s * (w[2] * seen[0] - w[0] * seen[2])
        change[2] -= dt_s * (w[0] * seen[1] - w[1] * seen[0])
        propagate_mean = rotate(q[0], q[1], q[2], q[3], change[0], change[1], change[2])
        for i in range(3):
            F[i, CURRENT + j] += 0.5 * dt_s * propagate_mean[i]
            F[3 + i, CURRENT + j] += 0.5 * dt_s * change[3 + i]
            F[6 + i, CURRENT + j] += change[i]
            F[9 + i, CURRENT + j] += change[3 + i]


@njit(inline="always")
def _world_axis(q: Array, j: int) -> Three:
    """The world's axis j, as the body sees it."""
    x, y, z = 1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0
    return rotate(-q[0], q[1], q[2], q[3], x, y, z)


@njit
def _wrench_by_error(
    own: Array, allocation: Array, mean: Array, load_B: Array, thrusts_N: Array, rest_q: Array, errors: int
) -> Array:
    """What the wrench in B changes by with the errors at the step's start, shape (6, errors)."""
    by = np.zeros((6, errors))
    # A turn of the body turns the force that it sees by S(load_B).
    by[1, 3], by[2, 3] = load_B[2], -load_B[1]
    by[0, 4], by[2, 4] = -load_B[2], load_B[0]
    by[0, 5], by[1, 5] = load_B[1], -load_B[0]
    for j in range(3):
        seen = _world_axis(mean[3:7], j)
        for i in range(3):
            by[i, FORCE + j] = seen[i]
        by[3 + j, MOMENT + j] = 1.0
    resting = drag_at_rest_jacobian(own, mean, rest_q)
    for i in range(6):
        for j in range(3):
            by[i, CURRENT + j] = resting[i, j]
        for j in range(12):
            by[i, DRAG + j] = resting[i, 3 + j]
        for k in range(thrusts_N.shape[0]):
            by[i, GAINS + k] = allocation[i, k] * thrusts_N[k]
    return by


@njit(apart=True)
def propagate_mean(
    packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array, dt_s: float, errors: int
) -> Array:
    """Advance the mean's motion in place by dt_s, some hundredths at most; return its Jacobian, shape (12, errors).

    Drag and inertia enter the Jacobian as they act half-way, the current as it does at the start of the step.
    """
    own = adapted_parameters(packed, mean)
    load_B = model_residual(own, mean, rest_q)
    by = _wrench_by_error(own, allocation, mean, load_B, thrusts_N, rest_q, errors)
    inputs = np.empty(9)
    assign(inputs[:6], load_B)
    assign(inputs[6:], mean[25:28])
    _push(inputs, allocation, mean, thrusts_N)
    before = mean.copy()
    A, B = np.empty((MOVING, MOVING)), np.empty((MOVING, 6))
    rk4_jacobian_kernel(own, mean[:13], inputs, dt_s, A, B)
    effect = _effects(own, _halfway(before, mean), inputs)
    for i in range(6):
        for j in range(12):
            by[i, DRAG + j] += effect[i, j]
    F = B @ by
    for i in range(MOVING):
        for j in range(MOVING):
            F[i, j] += A[i, j]
    _add_current(F, A, before, dt_s)
    return F


@njit(inline="always")
def _halfway(before: Array, after: Array) -> Array:
    """Mean half-way through a step, its quaternion of unit length."""
    halfway = after.copy()
    for i in range(13):
        halfway[i] = 0.5 * (before[i] + after[i])
    length = np.sqrt(halfway[3] ** 2 + halfway[4] ** 2 + halfway[5] ** 2 + halfway[6] ** 2)
    for i in range(3, 7):
        halfway[i] /= length
    return halfway


@njit
def specific_force(
    packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array, down_B: Array, H: Array
) -> Array:
    """Specific force at the body origin as an accelerometer tells it, bias included, shape (3,).

    dv/dt + omega x v - down_B, with gravity `down_B` in B; writes its Jacobian to H, shape (3, E).
    """
    after, v, w = mean.copy(), mean[7:10], mean[10:13]
    F = propagate_mean(packed, allocation, after, thrusts_N, rest_q, _INSTANT_S, H.shape[1])
    force = np.empty(3)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        force[i] = (after[7 + i] - mean[7 + i]) / _INSTANT_S + w[a] * v[b] - w[b] * v[a] - down_B[i] + mean[22 + i]
        for j in range(H.shape[1]):
            H[i, j] = (F[6 + i, j] - (1.0 if j == 6 + i else 0.0)) / _INSTANT_S
        H[i, 6 + b] += w[a]
        H[i, 6 + a] -= w[b]
        H[i, 9 + a] += v[b]
        H[i, 9 + b] -= v[a]
        H[i, 3 + a] += down_B[b]
        H[i, 3 + b] -= down_B[a]
        H[i, FELT + i] += 1.0
    return force

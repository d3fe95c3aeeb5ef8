"""Compiled prediction of the error-state extended Kalman filter (`eskf`): mean, covariance, thrusts.

`mean`, shape (40 + n [+ up to 10],) for n thrusters:

| index | entry |
|---|---|
| 0:3, 3:7 | position in W, quaternion q_WB |
| 7:13 | twist in B |
| 13:16, 16:19 | unmodelled force in W, moment in B, both at rest |
| 19:22, 22:25 | gyro bias, accelerometer bias |
| 25:28 | current in W |
| 28:34, 34:40 | relative error of drag and inertia, per degree of freedom |
| 40:40 + n | relative error of each thruster's gain |
| then, optional | camera: shift in W, turn in B; tracking: shift in W; depth: bias |

`P` is the covariance of the error, which has one entry less: the attitude error is a rotation vector in B at 3:6, every
later entry is one index lower. P is symmetric to the last bit; `corrections` uses its rows as columns.

The unmodelled force and moment are those at rest in the first attitude `rest_q`: they include drag and Munk moment of
the current, which cannot be told from other loads there. The equations of motion add only the difference that motion
and rotation make. In these variables hover carries no information on the current; as separate states the curvature of
the quadratic drag would appear as information.

The module is long because mean and covariance are advanced together, by derivatives of the same equations.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, njit
from wakewise.robot.vehicles.kernels import (
    INVERSE,
    LINEAR,
    QUADRATIC,
    Three,
    coriolis,
    damping,
    rate_kernel,
    rk4_jacobian_kernel,
    rotate,
)

DRAG = 27
"""Where the error's drag begins; inertia comes six places later."""


@njit
def turn(q: Array, v: Array, sign: float) -> Array:
    """Vector R(q) v for sign = 1, R(q)' v for sign = -1."""
    w, x, y, z = q[0], sign * q[1], sign * q[2], sign * q[3]
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array([v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx])


@njit
def _relative_twist_at_rest(mean: Array, rest_q: Array) -> tuple[float, float, float, float, float, float]:
    x, y, z = rotate(-rest_q[0], rest_q[1], rest_q[2], rest_q[3], mean[25], mean[26], mean[27])
    return -x, -y, -z, 0.0, 0.0, 0.0


@njit(apart=True)
def drag_at_rest(own: Array, mean: Array, rest_q: Array) -> Array:
    """Drag and Munk moment of the current on the vehicle at rest, as the equations of motion subtract them, shape (6,).

    Force in W, moment in B.
    """
    past = _relative_twist_at_rest(mean, rest_q)
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
    """Jacobian of `drag_at_rest`, force in B, by current (3), drag (6) and inertia (6), shape (6, 15)."""
    past = _relative_twist_at_rest(mean, rest_q)
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


_INSTANT_S = 1e-7
TURNING, MOVING, FORCE, MOMENT, GYRO, ACCELEROMETER, CURRENT, INERTIA, GAINS = 9, 12, 12, 15, 18, 21, 24, 33, 39
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
    """The vehicle's packed numbers with the estimated drag and inertia, shape (20, 6)."""
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
    """Unmodelled wrench in B, shape (6,)."""
    wrench, q = drag_at_rest(own, mean, rest_q), mean[3:7]
    x, y, z = mean[13] + wrench[0], mean[14] + wrench[1], mean[15] + wrench[2]
    wrench[0], wrench[1], wrench[2] = rotate(-q[0], q[1], q[2], q[3], x, y, z)
    for i in range(3):
        wrench[3 + i] += mean[16 + i]
    return wrench


@njit
def _add_thrust_wrench(wrench: Array, allocation: Array, mean: Array, thrusts_N: Array) -> None:
    """Add to a wrench in B that of thrusts with the estimated gains."""
    for k in range(thrusts_N.shape[0]):
        thrust = (1.0 + mean[1 + GAINS + k]) * thrusts_N[k]
        for i in range(6):
            wrench[i] += allocation[i, k] * thrust


@njit
def _relative_twist(mean: Array) -> tuple[float, float, float, float, float, float]:
    """Twist relative to the water, in B."""
    x, y, z = rotate(-mean[3], mean[4], mean[5], mean[6], mean[25], mean[26], mean[27])
    return mean[7] - x, mean[8] - y, mean[9] - z, mean[10], mean[11], mean[12]


@njit
def residual_wrench(packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array) -> Array:
    """Wrench in B, shape (6,), to add to the nominal vehicle in still water so that it moves like the mean."""
    vehicle = adapted_parameters(packed, mean)
    wrench = model_residual(vehicle, mean, rest_q)
    _add_thrust_wrench(wrench, allocation, mean, thrusts_N)
    own = damping(vehicle, _relative_twist(mean))
    still = damping(packed, (mean[7], mean[8], mean[9], mean[10], mean[11], mean[12]))
    for i in range(6):
        for k in range(thrusts_N.shape[0]):
            wrench[i] -= allocation[i, k] * thrusts_N[k]
        wrench[i] += still[i] - own[i]
    return wrench


@njit(apart=True)
def _parameter_jacobian(own: Array, mean: Array, inputs: Array) -> Array:
    """Wrench, shape (6, 12), by the relative change of drag and of inertia in each degree of freedom."""
    rate = np.empty(13)
    rate_kernel(own, mean[:13], inputs, rate)
    past, w = _relative_twist(mean), mean[10:13]
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
    """Add to F's columns of the current, which acts as a velocity of the opposite sign and turns in B."""
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
        moved = rotate(q[0], q[1], q[2], q[3], change[0], change[1], change[2])
        for i in range(3):
            F[i, CURRENT + j] += 0.5 * dt_s * moved[i]
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
    """Jacobian of the wrench in B by the errors at the start of the step, shape (6, errors)."""
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
    _add_thrust_wrench(inputs, allocation, mean, thrusts_N)
    before = mean.copy()
    A, B = np.empty((MOVING, MOVING)), np.empty((MOVING, 6))
    rk4_jacobian_kernel(own, mean[:13], inputs, dt_s, A, B)
    effect = _parameter_jacobian(own, _halfway(before, mean), inputs)
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
    """Specific force at the body origin as an accelerometer measures it, bias included, shape (3,).

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
        H[i, ACCELEROMETER + i] += 1.0
    return force


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
    time_constants_s: Array,
) -> float:
    """Move mean, covariance and thrusts on in place from a time to another, command by command; returns when it is.

    - `packed`, `allocation`, shape (20, 6) and (6, n): the vehicle (see `wakewise.robot.vehicles.kernels`).
    - `lag_s`, shape (n,): time constants of the thrusters, whose thrusts are `thrusts_N`, shape (n,).
    - `rest_q`, shape (4,): attitude that the unmodelled load is told for.
    - `since_s`, `commands_N`, shape (k,) and (k, n): from when which thrusts were commanded, one at least.
    - `noise`, `spread`, `time_constants_s`: as `predict` has them; the model's part of the noise, its first four, is
    `scale`
      times as large.
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
        predict(packed, allocation, mean, P, push, rest_q, dt_s, loud, spread, time_constants_s)
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
    time_constants_s: Array,
) -> None:
    """Advance mean and covariance in place by dt_s, some hundredths at most.

    `noise`, shape (6,), are spectral densities (amplitudes) of the errors of the modelled linear and angular
    acceleration and of the random walks of force, moment, gyro bias and accelerometer bias. What comes after the
    accelerometer's bias is a first-order Gauss-Markov process each, of standard deviation `spread` and time
    `time_constants_s`, both of shape (E - 24,).
    """
    q = mean[3:7].copy()
    F = propagate_mean(packed, allocation, mean, thrusts_N, rest_q, dt_s, P.shape[0])
    _propagate_covariance(P, F)
    _add_noise(P, q, dt_s, noise)
    _decay_markov_states(mean, P, dt_s, spread, time_constants_s)


@njit
def _propagate_covariance(P: Array, F: Array) -> None:
    """P = F P F' in place, for the Jacobian F of the moving errors; the other errors are constant."""
    top = F @ P
    block = top @ F.T
    for i in range(MOVING):
        for j in range(MOVING):
            P[i, j] = 0.5 * (block[i, j] + block[j, i])
        for j in range(MOVING, P.shape[0]):
            P[i, j] = top[i, j]
            P[j, i] = top[i, j]


@njit
def _decay_markov_states(mean: Array, P: Array, dt_s: float, spread: Array, time_constants_s: Array) -> None:
    """Decay of the first-order Gauss-Markov processes, and their driving noise."""
    kept = np.ones(P.shape[0])
    for k in range(spread.shape[0]):
        i = CURRENT + k
        # Neighbours mostly last as long as each other.
        again = k > 0 and time_constants_s[k] == time_constants_s[k - 1]
        kept[i] = kept[i - 1] if again else np.exp(-dt_s / time_constants_s[k])
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

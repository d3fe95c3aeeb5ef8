"""Compiled steps of the error-state filter; see `error_state` for what they mean.

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

from wakewise.arrays import Array
from wakewise.compiled import assign, njit
from wakewise.estimation.resting import DRAG, at_rest, rest_effects, turn
from wakewise.vehicles.kernels import INVERSE, LINEAR, QUADRATIC, damping, rate_kernel, rotate
from wakewise.vehicles.runge_kutta import rk4_jacobian_kernel

_INSTANT_S = 1e-7
MOVING, FORCE, MOMENT, GYRO, FELT, CURRENT, INERTIA, GAINS = 12, 12, 15, 18, 21, 24, 33, 39
"""Where each block of the error begins; the first is how many entries the equations of motion move."""


@njit
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


@njit
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


@njit(apart=True)
def believed(packed: Array, mean: Array) -> Array:
    """The vehicle's packed numbers with the drag and the inertia that the mean now believes in, shape (20, 6)."""
    own = packed.copy()
    for i in range(6):
        drag, root = 1.0 + mean[1 + DRAG + i], np.sqrt(1.0 + mean[1 + INERTIA + i])
        for j in range(6):
            own[i, j] *= root
            own[j, i] *= root
            own[INVERSE + i, j] /= root
            own[INVERSE + j, i] /= root
            own[LINEAR + i, j] *= drag
        own[QUADRATIC, i] *= drag
    return own


@njit(apart=True)
def pushed(own: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array) -> Array:
    """Wrench in B of thrusts, with the gains believed in, and of what the model does not explain, shape (6,)."""
    wrench = at_rest(own, mean, rest_q)
    load_B = turn(mean[3:7], mean[13:16] + wrench[:3], -1.0)
    for i in range(3):
        wrench[i] = load_B[i]
        wrench[3 + i] += mean[16 + i]
    for k in range(thrusts_N.shape[0]):
        thrust = (1.0 + mean[1 + GAINS + k]) * thrusts_N[k]
        for i in range(6):
            wrench[i] += allocation[i, k] * thrust
    return wrench


@njit
def _past(mean: Array) -> tuple[float, float, float, float, float, float]:
    """Twist relative to the water, in B."""
    x, y, z = rotate(-mean[3], mean[4], mean[5], mean[6], mean[25], mean[26], mean[27])
    return mean[7] - x, mean[8] - y, mean[9] - z, mean[10], mean[11], mean[12]


@njit
def unexplained(packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array) -> Array:
    """Wrench in B, shape (6,), that the nominal vehicle in still water lacks to move as the mean has it."""
    vehicle = believed(packed, mean)
    wrench = pushed(vehicle, allocation, mean, thrusts_N, rest_q)
    own = damping(vehicle, _past(mean))
    still = damping(packed, (mean[7], mean[8], mean[9], mean[10], mean[11], mean[12]))
    for i in range(6):
        for k in range(thrusts_N.shape[0]):
            wrench[i] -= allocation[i, k] * thrusts_N[k]
        wrench[i] += still[i] - own[i]
    return wrench


@njit(inline="always")
def _inputs(own: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array) -> Array:
    inputs = np.empty(9)
    assign(inputs[:6], pushed(own, allocation, mean, thrusts_N, rest_q))
    assign(inputs[6:], mean[25:28])
    return inputs


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
    """Fill F's columns of the current: it acts as a velocity the other way, and turns in B."""
    q, w = mean[3:7], mean[10:13]
    for j in range(3):
        axis = np.zeros(3)
        axis[j] = 1.0
        seen = turn(q, axis, -1.0)
        change = np.zeros(6)
        for i in range(6):
            for k in range(3):
                change[i] -= (A[6 + i, 6 + k] - (1.0 if i == k else 0.0)) * seen[k]
        change[0] -= dt_s * (w[1] * seen[2] - w[2] * seen[1])
        change[1] -= dt_s * (w[2] * seen[0] - w[0] * seen[2])
        change[2] -= dt_s * (w[0] * seen[1] - w[1] * seen[0])
        moved = turn(q, change[:3].copy(), 1.0)
        for i in range(3):
            F[i, CURRENT + j] = 0.5 * dt_s * moved[i]
            F[3 + i, CURRENT + j] = 0.5 * dt_s * change[3 + i]
            F[6 + i, CURRENT + j] = change[i]
            F[9 + i, CURRENT + j] = change[3 + i]


@njit
def moved(
    packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array, dt_s: float, errors: int
) -> Array:
    """Advance the mean's motion in place by dt_s, some hundredths at most; return its Jacobian, shape (12, errors).

    Drag and inertia enter the Jacobian as they act half-way, the current as it does at the start of the step.
    """
    own = believed(packed, mean)
    inputs = _inputs(own, allocation, mean, thrusts_N, rest_q)
    load_B = turn(mean[3:7], mean[13:16] + at_rest(own, mean, rest_q)[:3], -1.0)
    before = mean.copy()
    A, B = np.empty((MOVING, MOVING)), np.empty((MOVING, 6))
    rk4_jacobian_kernel(own, mean[:13], inputs, dt_s, A, B)
    halfway = mean.copy()
    assign(halfway[:13], 0.5 * (before[:13] + mean[:13]))
    assign(halfway[3:7], halfway[3:7] / np.sqrt(np.dot(halfway[3:7], halfway[3:7])))
    effect = _effects(own, halfway, inputs)
    F = np.zeros((MOVING, errors))
    for i in range(MOVING):
        assign(F[i, :MOVING], A[i])
    _add_current(F, A, before, dt_s)
    driven = B @ effect
    for i in range(MOVING):
        assign(F[i, DRAG:GAINS], driven[i])
    resting = B @ rest_effects(own, before, rest_q)
    for i in range(MOVING):
        for j in range(3):
            F[i, CURRENT + j] += resting[i, j]
        for j in range(12):
            F[i, DRAG + j] += resting[i, 3 + j]
    by_gain = B @ allocation
    for i in range(MOVING):
        # A turn of the body turns the force that it sees by S(load_B).
        b0, b1, b2 = B[i, 0], B[i, 1], B[i, 2]
        F[i, 3] += b1 * load_B[2] - b2 * load_B[1]
        F[i, 4] += b2 * load_B[0] - b0 * load_B[2]
        F[i, 5] += b0 * load_B[1] - b1 * load_B[0]
        row = turn(before[3:7], B[i, :3].copy(), 1.0)
        for j in range(3):
            F[i, FORCE + j] = row[j]
            F[i, MOMENT + j] = B[i, 3 + j]
        for k in range(thrusts_N.shape[0]):
            F[i, GAINS + k] = by_gain[i, k] * thrusts_N[k]
    return F


def felt(
    packed: Array, allocation: Array, mean: Array, thrusts_N: Array, rest_q: Array, down_B: Array, H: Array
) -> Array:
    """Specific force at the body origin as an accelerometer tells it, bias included, shape (3,).

    dv/dt + omega x v - down_B, with gravity `down_B` in B; writes its Jacobian to H, shape (3, E).
    """
    after = mean.copy()
    F = moved(packed, allocation, after, np.array(thrusts_N), rest_q, _INSTANT_S, H.shape[1])
    return np.asarray(_felt(mean, after, F, down_B, H))


@njit
def _felt(mean: Array, after: Array, F: Array, down_B: Array, H: Array) -> Array:
    v, w, instant_s = mean[7:10], mean[10:13], _INSTANT_S
    force = np.empty(3)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        force[i] = (after[7 + i] - mean[7 + i]) / instant_s + w[a] * v[b] - w[b] * v[a] - down_B[i] + mean[22 + i]
        for j in range(H.shape[1]):
            H[i, j] = (F[6 + i, j] - (1.0 if j == 6 + i else 0.0)) / instant_s
        H[i, 6 + b] += w[a]
        H[i, 6 + a] -= w[b]
        H[i, 9 + a] += v[b]
        H[i, 9 + b] -= v[a]
        H[i, 3 + a] += down_B[b]
        H[i, 3 + b] -= down_B[a]
        H[i, FELT + i] += 1.0
    return force


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
    # Two kernels: that of the motion is the largest of the room, and `felt` calls it as well.
    F = moved(packed, allocation, mean, np.array(thrusts_N), rest_q, dt_s, P.shape[0])
    _spread(mean, P, F, q, dt_s, noise, spread, lasts_s)


@njit
def _spread(
    mean: Array, P: Array, F: Array, q: Array, dt_s: float, noise: Array, spread: Array, lasts_s: Array
) -> None:
    """Carry the covariance on by the Jacobian F, and let noise and the Markov processes at it."""
    top = F @ P
    block = top @ F.T
    for i in range(MOVING):
        for j in range(MOVING):
            P[i, j] = 0.5 * (block[i, j] + block[j, i])
        for j in range(MOVING, P.shape[0]):
            P[i, j] = top[i, j]
            P[j, i] = top[i, j]
    _add_noise(P, q, dt_s, noise)
    _fade(mean, P, dt_s, spread, lasts_s)


@njit(inline="always")
def _fade(mean: Array, P: Array, dt_s: float, spread: Array, lasts_s: Array) -> None:
    for k in range(spread.shape[0]):
        i, kept = CURRENT + k, np.exp(-dt_s / lasts_s[k])
        mean[1 + i] *= kept
        for j in range(P.shape[0]):
            P[i, j] *= kept
            P[j, i] *= kept
        P[i, i] += spread[k] ** 2 * (1.0 - kept * kept)


@njit(inline="always")
def _add_noise(P: Array, q: Array, dt_s: float, noise: Array) -> None:
    linear, angular = noise[0] ** 2, noise[1] ** 2
    for i in range(3):
        P[i, i] += linear * dt_s**3 / 3.0
        P[6 + i, 6 + i] += linear * dt_s
        P[3 + i, 3 + i] += angular * dt_s**3 / 3.0
        P[9 + i, 9 + i] += angular * dt_s
        P[3 + i, 9 + i] += angular * dt_s**2 / 2.0
        P[9 + i, 3 + i] += angular * dt_s**2 / 2.0
        axis = np.zeros(3)
        axis[i] = 1.0
        column = turn(q, axis, 1.0)  # the body's axis i, as the world sees it
        for j in range(3):
            P[j, 6 + i] += column[j] * linear * dt_s**2 / 2.0
            P[6 + i, j] += column[j] * linear * dt_s**2 / 2.0
    for block in range(4):
        for i in range(3):
            k = FORCE + 3 * block + i
            P[k, k] += noise[2 + block] ** 2 * dt_s


@njit
def correct(mean: Array, P: Array, H: Array, residual: Array, R: Array, gate: float) -> float:
    """Kalman update in place by a measurement with rows H (m, E), residual (m,) and covariance R (m, m).

    Returns the squared Mahalanobis distance of the residual; where it exceeds `gate` nothing is changed.
    """
    m, errors = H.shape
    PH = P @ H.T
    S = H @ PH + R
    # S = L L'; with X = PH / L', the gain's part of the covariance is X X', the change X (residual / L).
    distance = 0.0
    for i in range(m):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(total) if i == j else total / S[j, j]
    whitened = np.empty(m)
    for i in range(m):
        total = residual[i]
        for k in range(i):
            total -= S[i, k] * whitened[k]
        whitened[i] = total / S[i, i]
        distance += whitened[i] ** 2
    if distance > gate:
        return distance
    change = np.zeros(errors)
    for r in range(errors):
        for i in range(m):
            total = PH[r, i]
            for k in range(i):
                total -= S[i, k] * PH[r, k]
            PH[r, i] = total / S[i, i]
            change[r] += PH[r, i] * whitened[i]
    for i in range(errors):
        for j in range(i + 1):
            total = 0.5 * (P[i, j] + P[j, i])
            for k in range(m):
                total -= PH[i, k] * PH[j, k]
            P[i, j] = P[j, i] = total
    for i in range(3):
        mean[i] += change[i]
    assign(mean[3:7], turned_by(mean[3:7], change[3:6]))
    for i in range(6, P.shape[0]):
        mean[1 + i] += change[i]
    # No vehicle has a tenth, or ten times, of the drag and inertia that it is believed to have.
    for i in range(DRAG, GAINS):
        mean[1 + i] = min(max(mean[1 + i], -0.9), 9.0)
    return distance

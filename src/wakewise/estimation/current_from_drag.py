"""Current from drag: the horizontal current whose drag equals the estimated horizontal load of a vehicle at rest.

Trim is a vertical force, so the horizontal load is the current's drag unless a tether pulls. Drag of the nominal
vehicle is inverted for a horizontal current. A vertical current cannot be told from trim. A tether's pull is taken for
a current: 0.3 N look like 4 cm/s on a small vehicle.

The covariance is that of the force (which contains the thrusters' gains) and of the drag coefficients. Published
coefficients of one vehicle (its `drag_cases`) differ in their linear part, which dominates below 0.1 m/s: the load of
1.5 cm/s by one set is that of 4 cm/s by another. The result is the mean over all sets, and their spread is in its
covariance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit
from wakewise.robot.vehicles.kernels import damping, rotate

KNOWN_M_S = 0.02
"""Standard deviation per axis below which a current is reported: half of the current in a still tank or calm bay."""
_START_M_S = 0.1
_STEP_M_S = 1e-4
_CLOSE_M_S = 1e-6
_ROUNDS = 30


@njit
def level_drag(packed: Array, q: Array, north_m_s: float, east_m_s: float) -> tuple[float, float]:
    """North and east of the force on a vehicle at rest, attitude q, in a level current."""
    c = rotate(-q[0], q[1], q[2], q[3], north_m_s, east_m_s, 0.0)
    drag = damping(packed, (c[0], c[1], c[2], 0.0, 0.0, 0.0))
    north_N, east_N, _ = rotate(q[0], q[1], q[2], q[3], drag[0], drag[1], drag[2])
    return north_N, east_N


@njit
def current_from_force(packed: Array, q: Array, north_N: float, east_N: float) -> Array:
    """Horizontal current whose drag on a vehicle at rest is a given force, and the slope of that drag; Newton's method.

    `packed`: the vehicle's numbers (see `wakewise.robot.vehicles.kernels`). `q`, shape (4,): attitude q_WB at rest.
    Returns shape (6,): North and east in m/s, then d force / d current row by row in N s/m; all NaN where none was
    found.
    """
    size = np.sqrt(north_N**2 + east_N**2)
    c = np.zeros(2)
    if size > 0.0:
        c[0], c[1] = _START_M_S * north_N / size, _START_M_S * east_N / size
    h = _STEP_M_S
    answer = np.full(6, np.nan)
    for _ in range(_ROUNDS):
        f0, f1 = level_drag(packed, q, c[0], c[1])
        a0, a1 = level_drag(packed, q, c[0] + h, c[1])
        b0, b1 = level_drag(packed, q, c[0], c[1] + h)
        j00, j10, j01, j11 = (a0 - f0) / h, (a1 - f1) / h, (b0 - f0) / h, (b1 - f1) / h
        det = j00 * j11 - j01 * j10
        if not det > 1e-12:
            return answer
        r0, r1 = north_N - f0, east_N - f1
        d0, d1 = (j11 * r0 - j01 * r1) / det, (j00 * r1 - j10 * r0) / det
        c[0] += d0
        c[1] += d1
        if d0**2 + d1**2 < _CLOSE_M_S**2:
            answer[0], answer[1] = c[0], c[1]
            answer[2], answer[3], answer[4], answer[5] = j00, j01, j10, j11
            return answer
    return answer


@njit
def _sigma_points(force_W_N: Array, covariance: Array) -> Array:
    """Four sigma points of the horizontal force, shape (4, 2), with its mean and covariance."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    middle, half, angle = 0.5 * (a + c), np.hypot(0.5 * (a - c), b), 0.5 * np.arctan2(2.0 * b, a - c)
    forces = np.empty((4, 2))
    for k in range(2):
        # The covariance's principal axes, longer one first.
        turned, value = angle + 0.5 * np.pi * k, middle + half * (1.0 - 2.0 * k)
        reach = np.sqrt(2.0 * max(value, 0.0))
        for sign in range(2):
            along = reach * (1.0 - 2.0 * sign)
            forces[2 * k + sign, 0] = force_W_N[0] + along * np.cos(turned)
            forces[2 * k + sign, 1] = force_W_N[1] + along * np.sin(turned)
    return forces


@njit
def _current_samples(sets: Array, rest_q: Array, force_W_N: Array, force_covariance: Array) -> Array:
    """North and east by each set of drag and each likely force, shape (sets * 4, 2), the first set's first."""
    forces = _sigma_points(force_W_N, force_covariance)
    samples = np.empty((sets.shape[0] * 4, 2))
    for k in range(samples.shape[0]):
        found = current_from_force(sets[k // 4], rest_q, forces[k % 4, 0], forces[k % 4, 1])
        samples[k, 0], samples[k, 1] = found[0], found[1]
    return samples


@njit
def _estimated_current(
    sets: Array, rest_q: Array, force_W_N: Array, force_covariance: Array, drag_std: float, answer: Array
) -> bool:
    """Write current and covariance, row by row, to `answer`, shape (4, 3); False while it is not known."""
    samples = _current_samples(sets, rest_q, force_W_N, force_covariance)
    own, many = samples[:4], samples.shape[0]
    unsure = 0.0
    for i in range(2):
        middle = 0.25 * (own[0, i] + own[1, i] + own[2, i] + own[3, i])
        for k in range(4):
            unsure += 0.25 * (own[k, i] - middle) ** 2
    answer[:] = 0.0
    for i in range(2):
        for k in range(many):
            answer[0, i] += samples[k, i] / many
    north, east = answer[0, 0], answer[0, 1]
    # NaN, where one set has no solution, is not known either.
    if not (0.5 * unsure <= KNOWN_M_S**2 and np.isfinite(north + east)):
        return False
    for i in range(2):
        for j in range(2):
            answer[1 + i, j] = drag_std**2 * answer[0, i] * answer[0, j]
            for k in range(many):
                answer[1 + i, j] += (samples[k, i] - answer[0, i]) * (samples[k, j] - answer[0, j]) / many
    return True


def current_if_known(
    sets: Array | Sequence[Array], rest_q: Array, force_W_N: Array, force_covariance: Array, drag_std: float
) -> tuple[Array, Array] | None:
    """Level current and its covariance, shapes (3,) and (3, 3), or None while it is not known to `KNOWN_M_S`.

    - `sets`, shape (k, 20, 6): numbers of the vehicle with each drag that it may have, each alike; the nominal one
      first.
    - `rest_q`, shape (4,): attitude at which the force is given.
    - `force_W_N`, `force_covariance`, shape (3,) and (3, 3): force at rest that the model does not explain, and how
      sure that is.
    - `drag_std`: relative error of each drag.
    """
    # Unscented transform, because drag without a linear part has no slope at rest (S. J. Julier and J. K. Uhlmann,
    # Proc.
    # IEEE 92 (2004) 401).
    answer = np.empty((4, 3))
    known = _estimated_current(
        np.asarray(sets), rest_q, np.array(force_W_N), np.array(force_covariance), float(drag_std), answer
    )
    return (answer[0], answer[1:]) if known else None

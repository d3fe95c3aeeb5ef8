"""Compiled measurement updates of the error-state Kalman filter.

Mean and covariance are laid out as in `eskf_kernels`. P stays symmetric to the last bit. Where a measurement is an
entry of the error or a sum of two, H P consists of rows of P.

Every kernel returns the squared Mahalanobis distance of its innovation; beyond `gate` nothing is changed.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.jit.njit import assign, njit
from wakewise.estimation.eskf_kernels import DRAG, GAINS, quat_minus, quat_plus, specific_force, turn

NOTHING = -1
"""Index in place of a second error, if a measurement has only one."""
_MEMORY = 15  # poses that the mean of innovations goes back, a quarter of a second at 62 Hz
_EXPECTED_SQUARE = 9.0 / (2 * _MEMORY - 1)  # square of three sigmas of that mean for a filter whose noise is right
_CLIP = 3.0  # sigmas at which one innovation is clipped
_MAX_SURPRISE = 10.0
_ADAPTATION_RATE = 0.1  # growth of the noise per pose: at most tenfold in 3 poses, halved in 7
_NOISIEST = 300.0


@njit(apart=True)
def _update(mean: Array, P: Array, PH: Array, S: Array, residual: Array, gate: float) -> float:
    """Kalman update in place, PH = H P, shape (m, E), and S = H P H' + R, shape (m, m), both used up."""
    m, errors = PH.shape
    # S = L L'; with X = L^-1 H P, the change of the covariance is X' X, that of the mean X' (L^-1 residual).
    whitened, distance = np.empty(m), 0.0
    for i in range(m):
        whitened[i] = residual[i]
        for j in range(i + 1):
            for k in range(j):
                S[i, j] -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(S[i, j]) if i == j else S[i, j] / S[j, j]
        for k in range(i):
            whitened[i] -= S[i, k] * whitened[k]
        whitened[i] /= S[i, i]
        distance += whitened[i] ** 2
    if distance > gate:
        return distance
    change = np.zeros(errors)
    for i in range(m):
        for k in range(i):
            for r in range(errors):
                PH[i, r] -= S[i, k] * PH[k, r]
        for r in range(errors):
            PH[i, r] /= S[i, i]
            change[r] += PH[i, r] * whitened[i]
    for i in range(errors):
        for k in range(m):
            for j in range(errors):
                P[i, j] -= PH[k, i] * PH[k, j]
    _shift(mean, change)
    return distance


@njit
def _shift(mean: Array, change: Array) -> None:
    """Move the mean in place by an error, shape (E,)."""
    for i in range(3):
        mean[i] += change[i]
    assign(mean[3:7], quat_plus(mean[3:7], change[3:6]))
    for i in range(6, change.shape[0]):
        mean[1 + i] += change[i]
    # No vehicle has a tenth, or ten times, of the drag and inertia that it is believed to have.
    for i in range(DRAG, GAINS):
        mean[1 + i] = min(max(mean[1 + i], -0.9), 9.0)


@njit
def correct(mean: Array, P: Array, H: Array, residual: Array, std: float, gate: float) -> float:
    """Correct by a measurement with rows H, shape (m, E), residual (m,) and the same white noise in each."""
    PH = np.zeros(H.shape)
    for i in range(H.shape[0]):
        # Only the rows of P with a nonzero entry of H: for few rows faster than a product of matrices.
        for k in range(H.shape[1]):
            if H[i, k] != 0.0:
                for r in range(H.shape[1]):
                    PH[i, r] += H[i, k] * P[k, r]
    S = PH @ H.T
    for i in range(S.shape[0]):
        S[i, i] += std**2
    return float(_update(mean, P, PH, S, residual, gate))


@njit
def _rows(P: Array, first: int, second: int, size: int) -> tuple[Array, Array]:
    """H P and H P H', shapes (m, E) and (m, m), of m sums of an error from `first` on and one from `second` on."""
    errors = P.shape[0]
    PH, S = np.empty((size, errors)), np.empty((size, size))
    for i in range(size):
        for r in range(errors):
            PH[i, r] = P[first + i, r]
            if second != NOTHING:
                PH[i, r] += P[second + i, r]
        for j in range(size):
            S[i, j] = PH[i, first + j]
            if second != NOTHING:
                S[i, j] += PH[i, second + j]
    return PH, S


@njit
def correct_by_sum(mean: Array, P: Array, measured: Array, first: int, second: int, std: float, gate: float) -> float:
    """Correct by a sensor that measures entries of the mean (position, depth, body rate), with a slow error of its own.

    - `first`, `second`: where what it tells and its slow error begin among the errors; `NOTHING` for a sensor without
      one.
    - `std`: its white noise.
    - Shapes: `mean`, `P` (E + 1,) and (E, E); `measured` (m,).
    """
    size = measured.shape[0]
    PH, S = _rows(P, first, second, size)
    residual, at = np.empty(size), first if first < 3 else first + 1
    for i in range(size):
        residual[i] = measured[i] - mean[at + i]
        if second != NOTHING:
            residual[i] -= mean[second + 1 + i]
        S[i, i] += std**2
    return float(_update(mean, P, PH, S, residual, gate))


@njit
def correct_by_pose(
    mean: Array,
    P: Array,
    p_m: Array,
    q: Array,
    slow: int,
    std_m: float,
    std_rad: float,
    gate: float,
    innovation_mean: Array,
    scale: float,
) -> tuple[float, float]:
    """Correct by a camera's pose; returns the distance, and the scale of the model's noise from now on.

    - `p_m`, `q`, shape (3,) and (4,): the pose.
    - `slow`: where the camera's slow error, shift in W and turn in B, begins among the errors, or `NOTHING`.
    - `std_m`, `std_rad`: white noise.
    - `innovation_mean`, shape (6,): running mean of the normalised innovations; taken on in place.
    - `scale`: scale of the model's noise so far.
    - Shapes: `mean`, `P` (E + 1,) and (E, E).
    """
    PH, S = _rows(P, 0, slow, 6)
    expected_p, expected_q, residual = mean[:3].copy(), mean[3:7].copy(), np.empty(6)
    if slow != NOTHING:
        for i in range(3):
            expected_p[i] += mean[slow + 1 + i]
        assign(expected_q, quat_plus(expected_q, mean[slow + 4 : slow + 7]))
    for i in range(3):
        residual[i] = p_m[i] - expected_p[i]
    assign(residual[3:], quat_minus(expected_q, q))
    for i in range(6):
        S[i, i] += std_m**2 if i < 3 else std_rad**2
    scale = _adapt_noise(innovation_mean, residual, S, scale)
    return float(_update(mean, P, PH, S, residual, gate)), scale


@njit
def _adapt_noise(innovation_mean: Array, residual: Array, S: Array, scale: float) -> float:
    """Scale of the process noise, adapted to the running mean of the normalised innovations of covariance S."""
    most = 0.0
    for i in range(6):
        innovation = min(max(residual[i] / np.sqrt(S[i, i]), -_CLIP), _CLIP)
        innovation_mean[i] += (innovation - innovation_mean[i]) / _MEMORY
        most = max(most, innovation_mean[i] ** 2)
    surprise = min(most / _EXPECTED_SQUARE, _MAX_SURPRISE)
    return float(min(max(scale * np.exp(_ADAPTATION_RATE * (surprise - 1.0)), 1.0), _NOISIEST))


@njit
def correct_by_force(
    packed: Array,
    allocation: Array,
    mean: Array,
    P: Array,
    thrusts_N: Array,
    rest_q: Array,
    force_B_m_s2: Array,
    std_m_s2: float,
    gate: float,
) -> float:
    """Correct by an accelerometer: dv/dt + omega x v - R' g, by tilt, unmodelled force and bias."""
    H = np.empty((3, P.shape[0]))
    down_B = turn(mean[3:7], np.array([0.0, 0.0, GRAVITY_M_S2]), -1.0)
    expected = specific_force(packed, allocation, mean, thrusts_N, rest_q, down_B, H)
    return float(correct(mean, P, H, force_B_m_s2 - expected, std_m_s2, gate))

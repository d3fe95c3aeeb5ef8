"""Compiled corrections of the error-state filter: what each kind of measurement does to mean and covariance.

Mean and covariance are laid out as in `kernels`. The covariance is symmetric to the bit and left so: where a
measurement tells single errors or sums of two, its product with the Jacobian is made of the covariance's own rows.

Every kernel returns the squared Mahalanobis distance of its residual; where that exceeds `gate` nothing is changed.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.jit.njit import assign, njit
from wakewise.estimation.eskf_kernels import DRAG, GAINS, quat_minus, quat_plus, specific_force, turn

NOTHING = -1
"""In place of where a second error begins, if a measurement tells only one."""
_MEMORY = 15  # poses that the mean of innovations goes back, a quarter of a second at 62 Hz
_CHANCE = 9.0 / (2 * _MEMORY - 1)  # square of three sigmas of that mean for a filter whose noise is right
_CLIP = 3.0  # one wrong pose counts for no more sigmas than this
_LARGEST_SURPRISE = 10.0
_HASTE = 0.1  # growth of the noise per pose and unit of surprise: at most tenfold in 3 poses, back by half in 7
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
        # Row by row of P, as much of it as the measurement knows of: for few rows quicker than a product of matrices.
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
    """Correct by what a sensor tells of the mean itself: a place, a depth, a rate, and its own slow error on top.

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
    leaning: Array,
    scale: float,
) -> tuple[float, float]:
    """Correct by a camera's pose; returns the distance, and the scale of the model's noise from now on.

    - `p_m`, `q`, shape (3,) and (4,): the pose.
    - `slow`: where the camera's slow error, shift in W and turn in B, begins among the errors, or `NOTHING`.
    - `std_m`, `std_rad`: white noise.
    - `leaning`, shape (6,): running mean of the normalised innovations; taken on in place.
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
    scale = _heed(leaning, residual, S, scale)
    return float(_update(mean, P, PH, S, residual, gate)), scale


@njit
def _heed(leaning: Array, residual: Array, S: Array, scale: float) -> float:
    """Let the model's noise follow what the innovations of poses, of covariance S, say about it."""
    most = 0.0
    for i in range(6):
        innovation = min(max(residual[i] / np.sqrt(S[i, i]), -_CLIP), _CLIP)
        leaning[i] += (innovation - leaning[i]) / _MEMORY
        most = max(most, leaning[i] ** 2)
    surprise = min(most / _CHANCE, _LARGEST_SURPRISE)
    return float(min(max(scale * np.exp(_HASTE * (surprise - 1.0)), 1.0), _NOISIEST))


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
    """Correct by an accelerometer: dv/dt + omega x v - R' g, seen through tilt, the unmodelled force and the bias."""
    H = np.empty((3, P.shape[0]))
    down_B = turn(mean[3:7], np.array([0.0, 0.0, GRAVITY_M_S2]), -1.0)
    expected = specific_force(packed, allocation, mean, thrusts_N, rest_q, down_B, H)
    return float(correct(mean, P, H, force_B_m_s2 - expected, std_m_s2, gate))

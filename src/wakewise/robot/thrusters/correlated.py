"""What readings that are correlated in time are worth."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array


def samples_per_reading(residual: Array) -> float:
    """Samples of a series, shape (m,), that count as one independent reading, at least 1.

    1 + 2 x the sum of autocorrelations over a window of the root of m, with Bartlett's weights.
    """
    window = max(1, round(math.sqrt(residual.size)))
    centred = residual - residual.mean()
    variance = float(centred @ centred)
    if variance == 0.0:
        return 1.0
    total = sum(
        (1.0 - lag / (window + 1)) * float(centred[lag:] @ centred[:-lag]) / variance for lag in range(1, window + 1)
    )
    return max(1.0, 1.0 + 2.0 * total)


def newey_west_errors(jacobian: Array, residual: Array) -> Array:
    """Standard errors, shape (p,), of least squares with Jacobian, shape (m, p), and residuals, shape (m,), in time.

    W. Newey, K. West, Econometrica 55, 1987, 703, with a window of the root of m; infinite where nothing depends on a
    parameter.
    """
    scores = jacobian * residual[:, None]
    middle = scores.T @ scores
    window = max(1, round(math.sqrt(residual.size)))
    for lag in range(1, window + 1):
        cross = scores[lag:].T @ scores[:-lag]
        middle += (1.0 - lag / (window + 1)) * (cross + cross.T)
    # Columns differ by orders of magnitude; scaled, the inverse keeps its digits.
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = math.inf
    bread = np.linalg.pinv((jacobian / size).T @ (jacobian / size))
    covariance = bread @ (middle / np.outer(size, size)) @ bread
    spare = max(residual.size - jacobian.shape[1], 1)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) * residual.size / spare) / size
    return np.where(np.isinf(size), math.inf, errors)

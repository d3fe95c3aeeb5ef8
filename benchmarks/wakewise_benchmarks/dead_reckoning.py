"""Position from velocity over ground and attitude alone, as a Doppler log and a gyrocompass give it."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat

_FLATTENING = 1.0 / 298.257223563
_EQUATOR_M = 6378137.0  # WGS 84 (NIMA TR8350.2)


def dead_reckoned(time_s: Array, q_WB: Array, v_B_m_s: Array) -> Array:
    """Positions from the first instant on, shape (n, 3), by the trapezoidal rule.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Ascending.
    q_WB : ndarray, shape (n, 4)
    v_B_m_s : ndarray, shape (n, 3)
        Velocity over ground, in B.

    Raises
    ------
    InputError
        If times do not ascend or shapes do not match.
    """
    n = len(time_s)
    if q_WB.shape != (n, 4) or v_B_m_s.shape != (n, 3):
        raise InputError(f"dead reckoning: {n} times, attitudes {q_WB.shape}, velocities {v_B_m_s.shape}: must match")
    steps = np.diff(time_s)
    if n < 2 or np.any(~(steps > 0.0)):
        raise InputError("dead reckoning: times must ascend, and there must be at least two")
    v_W = np.einsum("nij,nj->ni", matrix_from_quat(q_WB), v_B_m_s)
    path = np.zeros((n, 3))
    path[1:] = np.cumsum(0.5 * (v_W[1:] + v_W[:-1]) * steps[:, None], axis=0)
    return path


def local_north_east_down(latitude_rad: Array, longitude_rad: Array, altitude_m: Array) -> Array:
    """Positions in the tangent plane of the first one, shape (n, 3), good to a metre over a few kilometres.

    Radii of curvature of the WGS 84 ellipsoid at the first point (P. D. Groves, Principles of GNSS, Inertial, and
    Multisensor Integrated Navigation Systems, 2nd ed. 2013, eq. 2.105 and 2.106).
    """
    e2 = _FLATTENING * (2.0 - _FLATTENING)
    sine = np.sin(latitude_rad[0])
    across_m = _EQUATOR_M / np.sqrt(1.0 - e2 * sine**2)
    along_m = across_m * (1.0 - e2) / (1.0 - e2 * sine**2)
    height_m = altitude_m[0]
    return np.column_stack(
        [
            (latitude_rad - latitude_rad[0]) * (along_m + height_m),
            (longitude_rad - longitude_rad[0]) * (across_m + height_m) * np.cos(latitude_rad[0]),
            height_m - altitude_m,
        ]
    )

"""When a jet's water arrives, so that a planner knows for which moment it pushes.

The front of a jet of 0.3 to 3 N needs 0.5 to 3 s over 0.3 to 0.5 m.

Two times bound it. `front`: the jet starts into still water; its front slows down with distance,
x = 2.57 M^(1/4) t^(1/2), M = T / rho, and near the disk runs at half the exit speed:

    t = 2 x / U0                        for x <= x1,  U0 = sqrt(M / A)
    t = (x^2 + x1^2) / (2.57^2 sqrt(M))   beyond,       x1 = 2.57^2 sqrt(A)

Position and speed are continuous at x1 = 5.9 D. `steady`: the jet has been running; the water that leaves now rides at
the centreline speed of the round jet (`RoundJet`), t = integral of dx / U. No water is earlier; half of that speed is
nearer to what a change in thrust rides on.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.physics import FRESH_WATER_KG_M3
from wakewise.wake.jets import RoundJet

Arrival = Literal["front", "steady"]
FRONT = 2.57
"""Front of a starting round jet over M^(1/4) t^(1/2)."""

_NODES, _GAUSS = np.polynomial.legendre.leggauss(16)


def arrival_time_s(
    distance_m: ArrayLike,
    thrust_N: ArrayLike,
    area_m2: ArrayLike,
    how: Arrival = "front",
    water_density_kg_m3: float = FRESH_WATER_KG_M3,
) -> Array:
    """Time in s until water that leaves the disk now is at a distance along the jet; the arguments broadcast.

    Infinite at no thrust, and for distances that are negative (upstream of the disk). Time goes with 1 / sqrt(|T|), so
    one table serves all thrusts.

    Raises
    ------
    InputError
        For NaN, a disk without area, or an unknown way of travelling.
    """
    if how not in get_args(Arrival):
        raise InputError(f"arrival time '{how}': unknown, allowed: {', '.join(get_args(Arrival))}")
    x, thrust, area = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (distance_m, thrust_N, area_m2)))
    for what, value in (("distance_m", x), ("thrust_N", thrust), ("area_m2", area)):
        if np.any(np.isnan(value)):
            raise InputError(f"arrival time: {what} holds NaN, every element must be a number")
    if np.any(area <= 0.0):
        raise InputError(f"arrival time: area_m2 {np.min(area):g}, a disk's area must be more than 0")
    ahead = np.maximum(x, 0.0)
    if how == "front":
        x1 = FRONT**2 * np.sqrt(area)
        far = (ahead**2 + x1**2) / FRONT**2
        unit = np.where(ahead <= x1, 2.0 * ahead * np.sqrt(area), far)
    else:
        # 1 / U = ((x^6 + L^6)^(1/6)) / (K sqrt(M)); smooth, so few nodes of Gauss and Legendre on two pieces do.
        decay = RoundJet().decay
        L = decay * np.sqrt(area)
        middle = np.minimum(ahead, L)
        unit = _slowness(np.zeros_like(middle), middle, L) / decay + _slowness(middle, ahead, L) / decay
    with np.errstate(divide="ignore", invalid="ignore"):
        time = unit / np.sqrt(np.abs(thrust) / water_density_kg_m3)
    return np.where((x < 0.0) | (thrust == 0.0), np.inf, time)


def _slowness(start: Array, end: Array, L: Array) -> Array:
    """Integral of (x^6 + L^6)^(1/6) from start to end."""
    half = 0.5 * (end - start)
    x = 0.5 * (end + start)[..., None] + half[..., None] * _NODES
    return np.asarray(half * ((x**6 + L[..., None] ** 6) ** (1.0 / 6.0) @ _GAUSS))


def arrival_times_s(
    points_W_m: Array,
    origins_W_m: Array,
    axes_W: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
    how: Arrival = "front",
    water_density_kg_m3: float = FRESH_WATER_KG_M3,
) -> Array:
    """Time in s until each jet's water is abreast of each point, shape (n, m); infinite upstream and at no thrust.

    Parameters
    ----------
    points_W_m : ndarray, shape (n, 3)
    origins_W_m, axes_W : ndarray, shape (m, 3)
        Centre of each thruster's disk and unit axis of its *force* for T > 0; its jet leaves the other way.
    areas_m2, thrusts_N : ndarray, shape (m,)
    """
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    jets = -np.sign(thrusts)[:, None] * np.asarray(axes_W, dtype=np.float64)
    along = np.einsum("nmx,mx->nm", points_W_m[:, None, :] - origins_W_m[None, :, :], jets)
    return arrival_time_s(along, thrusts, areas_m2, how, water_density_kg_m3)

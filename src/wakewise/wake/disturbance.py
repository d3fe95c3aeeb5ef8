"""The disturbance D of a target: the weighted sum of squared water speeds at the points of its region.

D = sum_j w_j |sum_i v_i(p_j)|^2 with v_i proportional to sqrt(|T_i|), so D = s' G s with s = (sqrt(T+), sqrt(T-)): the
matrix G depends on where the thrusters are and not on how hard they push.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from wakewise.arrays import Array
from wakewise.interfaces import WakeModel
from wakewise.wake.jets import AxialJet


def gram(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    origins_W: Array,
    axes_W: Array,
    areas_m2: Array,
) -> Array:
    """Matrix G of D = s' G s at given thruster places, symmetric and positive semidefinite.

    Parameters
    ----------
    model : WakeModel
    region_points_W : ndarray, shape (n, 3)
    weights : ndarray, shape (n,)
    origins_W, axes_W : ndarray, shape (m, 3)
        Centres of the thrusters' disks and unit *force* axes (for T > 0), in the world.
    areas_m2 : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (2 m, 2 m), in (m/s)^2/N
        Row i is thruster i with T > 0 (jet along -axis), row m + i the same thruster with T < 0 (jet along +axis).
    """
    directions = np.concatenate([-axes_W, axes_W])
    if isinstance(model, AxialJet):
        return np.asarray(
            _weighted_products(model.split_speed(region_points_W, origins_W, axes_W, areas_m2), weights, directions)
        )
    velocity = model.unit_velocity(
        region_points_W, np.concatenate([origins_W, origins_W]), directions, np.concatenate([areas_m2, areas_m2])
    )
    return np.asarray(np.einsum("n,inx,jnx->ij", weights, velocity, velocity))


def split_roots(thrusts_N: ArrayLike) -> Array:
    """Vector s = (sqrt(T+), sqrt(T-)), shape (2 m,), of thrusts, shape (m,), T+ = max(T, 0) and T- = max(-T, 0)."""
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    return np.sqrt(np.concatenate([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)]))


def disturbance(gram: Array, thrusts_N: ArrayLike) -> float:
    """D = s' G s in (m/s)^2, of G, shape (2 m, 2 m), and thrusts, shape (m,)."""
    s = split_roots(thrusts_N)
    return float(s @ gram @ s)


def point_disturbance(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    origins_W: Array,
    axes_W: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
) -> float:
    """D in (m/s)^2, point by point as the definition reads; slow, and the check on `gram`. Arguments as there."""
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    jets = -np.sign(thrusts)[:, None] * axes_W
    velocity = model.unit_velocity(region_points_W, origins_W, jets, areas_m2)
    total = np.sum(np.sqrt(np.abs(thrusts))[:, None, None] * velocity, axis=0)
    return float(np.sum(weights * np.sum(total**2, axis=1)))


@njit(cache=True)
def _weighted_products(speed, weights, directions):  # type: ignore[no-untyped-def]
    """G_ik = (d_i . d_k) sum_j w_j speed_ji speed_jk, skipping the jets that miss a point (most of them do)."""
    n, k = speed.shape
    G = np.zeros((k, k))
    hit = np.empty(k, np.int64)
    for j in range(n):
        hits = 0
        for i in range(k):
            if speed[j, i] != 0.0:
                hit[hits] = i
                hits += 1
        for a in range(hits):
            i = hit[a]
            ws = weights[j] * speed[j, i]
            for c in range(a + 1):
                G[i, hit[c]] += ws * speed[j, hit[c]]
    for i in range(k):
        for c in range(i + 1):
            dot = (
                directions[i, 0] * directions[c, 0]
                + directions[i, 1] * directions[c, 1]
                + directions[i, 2] * directions[c, 2]
            )
            G[i, c] *= dot
            G[c, i] = G[i, c]
    return G

"""The lattice's step written plainly in NumPy: slow, readable, float64; the kernel is held against it."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.simulation.lattice.stencil import HERMITE, SHAPES, VELOCITIES, WEIGHTS


def twin_step(g: Array, tau_x: Array, tau_yz: Array, eddies: float) -> Array:
    """Stream and collide all cells inside.

    Parameters
    ----------
    g : ndarray, shape (19, nx + 2, ny + 2, nz + 2)
        Deviations of the populations from rest, halo filled.
    tau_x, tau_yz : ndarray, shapes (nx + 2,) and (ny + 2, nz + 2)
    eddies : float
        `smagorinsky_factor`.

    Returns
    -------
    ndarray, shape (19, nx, ny, nz)
    """
    c, w = VELOCITIES, WEIGHTS
    f = np.stack([np.roll(g[i], c[i], axis=(0, 1, 2))[1:-1, 1:-1, 1:-1] + w[i] for i in range(19)])
    rho = f.sum(0)
    u = np.einsum("ia,ixyz->axyz", c, f) / rho
    f_eq = equilibrium(rho, u)
    stress = np.einsum("ia,ib,ixyz->abxyz", c, c, f - f_eq)
    tau0 = tau_x[1:-1, None, None] + tau_yz[1:-1, 1:-1]
    tau = 0.5 * (tau0 + np.sqrt(tau0**2 + eddies * np.sqrt(np.sum(stress**2, axis=(0, 1))) / rho))
    return f_eq + (1 - 1 / tau) * np.einsum("i,iab,abxyz->ixyz", w, HERMITE, stress) - w[:, None, None, None]


def equilibrium(rho: Array, u: Array) -> Array:
    """Populations of a fluid in equilibrium, shape (19, ...), to second order in u, shape (3, ...)."""
    moved = 1 + 3 * np.einsum("ia,a...->i...", VELOCITIES, u) + np.einsum("iab,a...,b...->i...", SHAPES, u, u)
    return np.asarray(WEIGHTS.reshape(-1, *[1] * rho.ndim) * rho * moved)

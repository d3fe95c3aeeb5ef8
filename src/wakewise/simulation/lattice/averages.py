"""Time averages of a lattice run, and their averages around the axis."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit, prange

MOMENTS = 8
"""What is averaged in every cell: p, u, v, w, uu, vv, ww, vw."""


@njit(parallel=True)
def accumulate(field: np.ndarray, sums: Array) -> None:
    """Add the moments of one instant, `field` of shape (4, nx, ny, nz), to `sums`, shape (MOMENTS, nx, ny, nz)."""
    for x in prange(field.shape[1]):
        for y in range(field.shape[2]):
            for z in range(field.shape[3]):
                u, v, w = field[1, x, y, z], field[2, x, y, z], field[3, x, y, z]
                sums[0, x, y, z] += field[0, x, y, z]
                sums[1, x, y, z] += u
                sums[2, x, y, z] += v
                sums[3, x, y, z] += w
                sums[4, x, y, z] += u * u
                sums[5, x, y, z] += v * v
                sums[6, x, y, z] += w * w
                sums[7, x, y, z] += v * w


def around_axis(means: Array, y: Array, z: Array, radii: Array, angles: int = 96) -> dict[str, Array]:
    """Average over circles about y = z = 0.

    Parameters
    ----------
    means : ndarray, shape (MOMENTS, nx, ny, nz)
    y, z : ndarray
        Cell centres across the axis, evenly spaced.
    radii : ndarray, shape (m,)
    angles : int
        Points on each circle; values there by cubic splines.

    Returns
    -------
    dict of ndarray, shape (nx, m)
        pressure, axial, radial, swirl (positive from y to z) and axial_rms, radial_rms, swirl_rms.
    """
    turn = 2 * np.pi * (np.arange(angles) + 0.5) / angles
    cos, sin = np.cos(turn), np.sin(turn)
    at = np.stack(
        [
            (np.outer(radii, cos) - y[0]).ravel() / (y[1] - y[0]),
            (np.outer(radii, sin) - z[0]).ravel() / (z[1] - z[0]),
        ]
    )
    out = np.empty((7, means.shape[1], len(radii)))
    for x in range(means.shape[1]):
        p, u, v, w, uu, vv, ww, vw = (
            map_coordinates(plane, at, order=3, mode="nearest").reshape(len(radii), angles) for plane in means[:, x]
        )
        radial, swirl = cos * v + sin * w, cos * w - sin * v
        rr = cos**2 * vv + sin**2 * ww + 2 * sin * cos * vw
        tt = sin**2 * vv + cos**2 * ww - 2 * sin * cos * vw
        out[:4, x] = [q.mean(1) for q in (p, u, radial, swirl)]
        # The scatter of a time average around its circle is error of averaging, and belongs to the fluctuations.
        out[4:, x] = [q.mean(1) for q in (uu, rr, tt)]
    out[4:] = np.sqrt(np.maximum(out[4:] - out[1:4] ** 2, 0))
    names = ("pressure", "axial", "radial", "swirl", "axial_rms", "radial_rms", "swirl_rms")
    return dict(zip(names, out, strict=True))

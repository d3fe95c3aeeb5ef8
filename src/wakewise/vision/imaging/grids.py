"""Values of a field on grids, between their nodes."""

from __future__ import annotations

from typing import Any

from wakewise.core.jit.njit import njit


@njit
def sample_grid(values: Any, origin: Any, spacing: float, x: float, y: float, z: float) -> float:
    """Trilinear value of a grid at a point; zero outside."""
    u, v, w = (x - origin[0]) / spacing, (y - origin[1]) / spacing, (z - origin[2]) / spacing
    nx, ny, nz = values.shape
    if not (0.0 <= u <= nx - 1 and 0.0 <= v <= ny - 1 and 0.0 <= w <= nz - 1):
        return 0.0
    i, j, k = min(int(u), max(nx - 2, 0)), min(int(v), max(ny - 2, 0)), min(int(w), max(nz - 2, 0))
    a, b, c = u - i, v - j, w - k
    i1, j1, k1 = min(i + 1, nx - 1), min(j + 1, ny - 1), min(k + 1, nz - 1)
    low = (values[i, j, k] * (1 - a) + values[i1, j, k] * a) * (1 - b)
    low += (values[i, j1, k] * (1 - a) + values[i1, j1, k] * a) * b
    high = (values[i, j, k1] * (1 - a) + values[i1, j, k1] * a) * (1 - b)
    high += (values[i, j1, k1] * (1 - a) + values[i1, j1, k1] * a) * b
    return low * (1 - c) + high * c


@njit
def sample_levels(
    values: Any, origin: Any, spacing: float, outer: Any, outer_origin: Any, outer_spacing: float, x: float, y: float,
    z: float,
) -> float:  # fmt: skip
    """Trilinear value at a point: of the grid, outside it of the outer grid, zero outside both."""
    u, v, w = (x - origin[0]) / spacing, (y - origin[1]) / spacing, (z - origin[2]) / spacing
    nx, ny, nz = values.shape
    if 0.0 <= u <= nx - 1 and 0.0 <= v <= ny - 1 and 0.0 <= w <= nz - 1:
        return sample_grid(values, origin, spacing, x, y, z)
    return sample_grid(outer, outer_origin, outer_spacing, x, y, z)

"""Clearance of the hull, a box, to planes and spheres, as a log barrier with its tangent removed.

    phi(h) = -ln(h / h0) + h / h0 - 1   for h < h0, else 0,

so that nothing is felt beyond the reach h0 and the first derivative is continuous there. Below `least` (delta) it
goes on as the parabola of same value, slope and curvature, so that a start that is too close still has a way out (a
relaxed log barrier: C. Feller and C. Ebenbauer, IEEE Trans. Automatic Control 62 (2017) 1223, doi
10.1109/TAC.2016.2582040).
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

ROUNDED = 0.05
"""Sine of the tilt within which the corner nearest to a plane changes: |c| is rounded to sqrt(c^2 + 0.05^2), which
is on the safe side. A level hull over a level floor would otherwise sit on a kink that no gradient can leave."""


@njit(inline="always")
def barrier_value(h: float, reach: float, least: float) -> tuple[float, float, float]:
    """Phi and its first two derivatives at clearance h."""
    if h >= reach:
        return 0.0, 0.0, 0.0
    near = max(h, least)
    value = -np.log(near / reach) + near / reach - 1.0
    slope = 1.0 / reach - 1.0 / near
    curvature = 1.0 / (near * near)
    if h < least:
        gap = h - least
        value += slope * gap + 0.5 * curvature * gap * gap
        slope += curvature * gap
    return value, slope, curvature


@njit(apart=True)
def plane_gap(p: Array, R: Array, half: Array, plane: Array, slope: Array) -> float:
    """Distance of the box's nearest corner to a plane (less up to 5 % of its half size); `slope`, (6,), by position
    in W and rotation vector in B.
    """
    n0, n1, n2 = plane[0], plane[1], plane[2]
    gap = n0 * p[0] + n1 * p[1] + n2 * p[2] - plane[3]
    slope[0], slope[1], slope[2] = n0, n1, n2
    c = np.empty(3)
    s = np.empty(3)
    for i in range(3):
        # The normal in B; the corner that is nearest lies against it.
        c[i] = R[0, i] * n0 + R[1, i] * n1 + R[2, i] * n2
        size = np.sqrt(c[i] * c[i] + ROUNDED * ROUNDED)
        gap -= half[i] * size
        s[i] = -half[i] * c[i] / size
    # The gap changes by s . dc with dc = -theta x c, so the slope is s x c.
    slope[3] = s[1] * c[2] - s[2] * c[1]
    slope[4] = s[2] * c[0] - s[0] * c[2]
    slope[5] = s[0] * c[1] - s[1] * c[0]
    return gap


@njit(apart=True)
def sphere_gap(p: Array, R: Array, half: Array, sphere: Array, slope: Array) -> float:
    """Distance of the box to a sphere, negative when they meet; `slope` as in `plane_gap`."""
    d0, d1, d2 = sphere[0] - p[0], sphere[1] - p[1], sphere[2] - p[2]
    c = np.empty(3)
    out = np.empty(3)
    square, deepest, axis = 0.0, -np.inf, 0
    for i in range(3):
        c[i] = R[0, i] * d0 + R[1, i] * d1 + R[2, i] * d2
        over = abs(c[i]) - half[i]
        out[i] = max(over, 0.0)
        square += out[i] * out[i]
        if over > deepest:
            deepest, axis = over, i
    n = np.zeros(3)
    if square > 0.0:
        distance = np.sqrt(square)
        for i in range(3):
            n[i] = (out[i] if c[i] > 0.0 else -out[i]) / distance
    else:
        distance = deepest
        n[axis] = 1.0 if c[axis] > 0.0 else -1.0
    for i in range(3):
        slope[i] = -(R[i, 0] * n[0] + R[i, 1] * n[1] + R[i, 2] * n[2])
    # c = R'(centre - p) turns by -theta x c.
    slope[3] = n[1] * c[2] - n[2] * c[1]
    slope[4] = n[2] * c[0] - n[0] * c[2]
    slope[5] = n[0] * c[1] - n[1] * c[0]
    return distance - sphere[3]


@njit(apart=True)
def add_barrier(  # type: ignore[no-untyped-def]
    p, R, half, planes, spheres, reach, least, weight, gradient, hessian
):
    """Add weight phi of every clearance to the first six of `gradient` and `hessian` (Gauss-Newton).

    Returns the weighted sum of phi and the least clearance.
    """
    total, closest = 0.0, np.inf
    slope = np.empty(6)
    for i in range(planes.shape[0] + spheres.shape[0]):
        if i < planes.shape[0]:
            h = plane_gap(p, R, half, planes[i], slope)
        else:
            h = sphere_gap(p, R, half, spheres[i - planes.shape[0]], slope)
        closest = min(closest, h)
        if h < reach:
            value, first, second = barrier_value(h, reach, least)
            total += weight * value
            for r in range(6):
                gradient[r] += weight * first * slope[r]
                for c in range(6):
                    hessian[r, c] += weight * second * slope[r] * slope[c]
    return total, closest


@njit(apart=True)
def least_gap(p: Array, R: Array, half: Array, planes: Array, spheres: Array) -> float:
    """Least clearance to planes and spheres; infinite where there are none."""
    closest, slope = np.inf, np.empty(6)
    for i in range(planes.shape[0]):
        closest = min(closest, plane_gap(p, R, half, planes[i], slope))
    for i in range(spheres.shape[0]):
        closest = min(closest, sphere_gap(p, R, half, spheres[i], slope))
    return closest

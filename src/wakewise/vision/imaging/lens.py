"""Pixels to rays in the water and back: pinhole, OpenCV's distortion, and a flat port; compiled, one point at a time.

A camera is one row of numbers (`lens_row`), so that every kernel of this room takes any camera.

Distortion is that of OpenCV and of COLMAP's OPENCV model: k1, k2 radial, p1, p2 tangential (Brown 1971,
"Close-range camera calibration", Photogrammetric Engineering 37). A flat port is a pane at right angles to the optical
axis, air on the lens's side: a ray bends at both faces by Snell's law, n sin(angle) staying the same. Rays of one pixel
still meet the axis, but each at its own height (Agrawal, Ramalingam, Taguchi & Chari 2012, "A theory of multi-layer
flat refractive geometry", doi 10.1109/CVPR.2012.6248073): a ray is (0, 0, z0) + t (sx, sy, 1), so that z0 + t is the
depth along the axis from the lens's pupil.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

IDEAL, DISTORTED, PORT = 0.0, 1.0, 2.0
NEWTON_STEPS = 30


def lens_row(
    focal_px: float,
    centre_px: tuple[float, float],
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    port: tuple[float, float, float, float] | None = None,
) -> Array:
    """Numbers that the kernels read, shape (14,).

    Parameters
    ----------
    focal_px : float
        Of the lens, in air where there is a port.
    centre_px : (cx, cy)
    distortion : (k1, k2, p1, p2)
    port : (air_m, glass_m, glass index, water index), optional
        Gap of air between pupil and glass, thickness of the glass, refractive indices relative to air.
    """
    kind = PORT if port is not None else DISTORTED if any(distortion) else IDEAL
    air, glass, n_glass, n_water = port if port is not None else (0.0, 0.0, 1.0, 1.0)
    return np.array([kind, focal_px, focal_px, *centre_px, *distortion, air, glass, n_glass, n_water, air + glass])


@njit
def distort(row: Any, x: float, y: float) -> tuple[float, float]:
    """Distorted slopes of ideal ones."""
    k1, k2, p1, p2 = row[5], row[6], row[7], row[8]
    r2 = x * x + y * y
    m = 1.0 + r2 * (k1 + r2 * k2)
    return x * m + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * m + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y


@njit
def undistort(row: Any, xd: float, yd: float) -> tuple[float, float]:
    """Ideal slopes of distorted ones, by Newton's method on both at once."""
    k1, k2, p1, p2 = row[5], row[6], row[7], row[8]
    x, y = xd, yd
    for _ in range(NEWTON_STEPS):
        r2 = x * x + y * y
        m, slope = 1.0 + r2 * (k1 + r2 * k2), k1 + 2.0 * r2 * k2
        ex = x * m + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) - xd
        ey = y * m + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y - yd
        a = m + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        b = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        d = m + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        det = a * d - b * b
        sx, sy = (d * ex - b * ey) / det, (a * ey - b * ex) / det
        x -= sx
        y -= sy
        if abs(sx) + abs(sy) < 1e-13:
            break
    return x, y


@njit
def refracted(slope: float, index: float) -> float:
    """Tangent of a ray's angle to the axis in a medium of `index`, of its tangent in air."""
    sine = slope / (index * math.sqrt(1.0 + slope * slope))
    return sine / math.sqrt(1.0 - sine * sine)


@njit
def ray_at(row: Any, u: float, v: float) -> tuple[float, float, float]:
    """Ray (sx, sy, z0) in the water of a pixel."""
    x, y = (u - row[3]) / row[1], (v - row[4]) / row[2]
    if row[0] == IDEAL:
        return x, y, 0.0
    x, y = undistort(row, x, y)
    if row[0] == DISTORTED:
        return x, y, 0.0
    slope = math.sqrt(x * x + y * y)
    if slope < 1e-9:
        return x / row[12], y / row[12], row[13] - row[12] * (row[9] + row[10] / row[11])
    water = refracted(slope, row[12])
    out = row[9] * slope + row[10] * refracted(slope, row[11])
    return x * water / slope, y * water / slope, row[13] - out / water


@njit
def pixel_at(row: Any, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel of a point of the water in the camera frame; NaN for a point that is not before the camera."""
    if z <= row[13] or z <= 0.0:
        return math.nan, math.nan
    if row[0] == PORT:
        aside = math.sqrt(x * x + y * y)
        slope = _slope_in_air(row, aside, z)
        scale = slope / aside if aside > 0.0 else 0.0
        x, y = x * scale, y * scale
    else:
        x, y = x / z, y / z
    if row[0] != IDEAL:
        x, y = distort(row, x, y)
    return row[1] * x + row[3], row[2] * y + row[4]


@njit
def _slope_in_air(row: Any, aside: float, z: float) -> float:
    """Slope at which the ray to a point `aside` off the axis at depth z leaves the lens.

    The distance off the axis grows with the slope, so Newton's steps are kept between bounds that close in.
    """
    air, glass, n_glass, n_water, start = row[9], row[10], row[11], row[12], row[13]
    low, high = 0.0, 1e6
    slope = aside / z * n_water
    for _ in range(3 * NEWTON_STEPS):
        in_glass, in_water = refracted(slope, n_glass), refracted(slope, n_water)
        excess = air * slope + glass * in_glass + (z - start) * in_water - aside
        if excess > 0.0:
            high = slope
        else:
            low = slope
        # d tan(b) / d tan(a) = n_a cos(a)^3 / (n_b cos(b)^3)
        cube = (1.0 + slope * slope) ** 1.5
        rate = air + glass * (1.0 + in_glass * in_glass) ** 1.5 / (n_glass * cube)
        rate += (z - start) * (1.0 + in_water * in_water) ** 1.5 / (n_water * cube)
        step = excess / rate
        slope -= step
        if abs(step) < 1e-12 * (1.0 + slope):
            break
        if not low < slope < high:
            slope = 0.5 * (low + high)
    return slope


@njit
def rays_of(row: Any, pixels: Any) -> Any:
    """`ray_at` of pixels, shape (n, 2) to (n, 3)."""
    out = np.empty((pixels.shape[0], 3))
    for k in range(pixels.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = ray_at(row, pixels[k, 0], pixels[k, 1])
    return out


@njit
def pixels_of(row: Any, points_C_m: Any) -> Any:
    """`pixel_at` of points, shape (n, 3) to (n, 2)."""
    out = np.empty((points_C_m.shape[0], 2))
    for k in range(points_C_m.shape[0]):
        out[k, 0], out[k, 1] = pixel_at(row, points_C_m[k, 0], points_C_m[k, 1], points_C_m[k, 2])
    return out

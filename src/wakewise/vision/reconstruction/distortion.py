"""What a lens does to slopes: OpenCV's two models of distortion, there and back.

A slope is (x / z, y / z) of a direction, its image is (pixel - centre) / focal length. Perspective: D. C. Brown,
Photogrammetric Engineering 37(8), 1971, with k1, k2, p1, p2. Fisheye: the distance from the middle is a polynomial of
the angle from the axis, J. Kannala and S. S. Brandt, IEEE TPAMI 28(8), 2006, doi 10.1109/TPAMI.2006.153, with k1 to k4.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array

NEWTON_STEPS = 12
WIDEST = np.radians(89.0)
"""Angle from the axis of a fisheye's outermost rays: beyond, a direction has no slope."""


def distort(slopes: Array, params: Array, *, fisheye: bool) -> Array:
    """Images, shape (n, 2), of slopes, shape (n, 2), by a lens of four parameters."""
    return _fisheye(slopes, params) if fisheye else _brown(slopes, params)


def undistort(images: Array, params: Array, *, fisheye: bool) -> Array:
    """Slopes, shape (n, 2), that a lens of four parameters brings to these images, shape (n, 2).

    Where the lens folds the image over, or a fisheye sees sideways, there is none; what comes out is finite.
    """
    return _fisheye_back(images, params) if fisheye else _brown_back(images, params)


def _brown(slopes: Array, params: Array) -> Array:
    k1, k2, p1, p2 = params
    x, y = slopes.T
    r2 = x * x + y * y
    grown = 1.0 + r2 * (k1 + r2 * k2)
    return np.stack(
        [
            x * grown + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * grown + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=1,
    )


def _brown_back(images: Array, params: Array) -> Array:
    k1, k2, p1, p2 = params
    xy: Array = np.array(images)
    for _ in range(NEWTON_STEPS):
        x, y = xy.T
        r2 = x * x + y * y
        grown, slope = 1.0 + r2 * (k1 + r2 * k2), k1 + 2.0 * r2 * k2
        a = grown + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        b = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        d = grown + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        # Where the lens would fold the image over there is no ray: the step is kept small there, nothing is found.
        determinant = np.maximum(a * d - b * b, 0.05)
        ex, ey = (_brown(xy, params) - images).T
        xy = xy - np.stack([(d * ex - b * ey) / determinant, (a * ey - b * ex) / determinant], axis=1)
    return xy


def _fisheye(slopes: Array, params: Array) -> Array:
    r = np.linalg.norm(slopes, axis=1)
    reach = _reach(np.arctan(r), params)
    return np.asarray(slopes * np.where(r > 1e-12, reach / np.maximum(r, 1e-12), 1.0)[:, None])


def _fisheye_back(images: Array, params: Array) -> Array:
    wanted = np.linalg.norm(images, axis=1)
    k1, k2, k3, k4 = params
    angle = np.minimum(wanted, WIDEST)
    for _ in range(NEWTON_STEPS):
        a2 = angle * angle
        slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
        angle = np.clip(angle - (_reach(angle, params) - wanted) / np.maximum(slope, 0.05), 0.0, WIDEST)
    return np.asarray(images * np.where(wanted > 1e-12, np.tan(angle) / np.maximum(wanted, 1e-12), 1.0)[:, None])


def _reach(angle: Array, params: Array) -> Array:
    """Distance from the middle of the image, in focal lengths, of rays at an angle from the axis."""
    k1, k2, k3, k4 = params
    a2 = angle * angle
    return np.asarray(angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))))

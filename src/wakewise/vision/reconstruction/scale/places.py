"""Where in the model something is that several of its photographs show, and how surely.

Rays meet in the least-squares sense, then the squared distances in pixels are brought to their minimum (R. Hartley and
A. Zisserman, Multiple View Geometry, 2nd ed., Cambridge 2004, sections 12.2 and 12.5).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.vision.reconstruction.registered_photos import RegisteredPhoto

MOST_ERROR_PX = 3.0
"""Farther from where the others put it, a photograph shows something else: a misread target, or a moved one."""
LEAST_SIGMA_PX = 0.1
"""Of a corner in a photograph, however well the photographs agree (refined corners in sharp pictures reach this)."""
LEAST_ANGLE_DEG = 2.0
STEPS, SHIFT = 10, 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangulatedPoint:
    """A point of the model, its covariance, shape (3, 3), photographs it rests on and their rms error in px."""

    point_W: Array
    covariance: Array
    photos: tuple[str, ...]
    error_px: float
    angle_deg: float

    def __post_init__(self) -> None:
        freeze(self, point_W=(3,), covariance=(3, 3))


def place(views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array]) -> TriangulatedPoint | None:
    """The point that photographs show at these pixels, each of shape (2,); None where fewer than two agree on one.

    Photographs that stick out are left out one after the other, the worst first.
    """
    names = [name for name in sorted(seen) if name in views]
    while len(names) >= 2:
        point = _met(views, seen, names)
        if point is None:
            return None
        point, error, slope = _refined(views, seen, names, point)
        worst = np.linalg.norm(error.reshape(-1, 2), axis=1)
        if worst.max() <= MOST_ERROR_PX:
            angle = _widest_deg(views, names, point)
            if angle < LEAST_ANGLE_DEG:
                return None
            freedom = max(error.size - 3, 1)
            sigma = max(LEAST_SIGMA_PX, float(np.sqrt((error**2).sum() / freedom)))
            return TriangulatedPoint(
                point_W=point,
                covariance=np.asarray(sigma**2 * np.linalg.inv(slope.T @ slope), dtype=np.float64),
                photos=tuple(names),
                error_px=float(np.sqrt((worst**2).mean())),
                angle_deg=angle,
            )
        if len(names) == 2:
            return None
        names.pop(int(worst.argmax()))
    return None


def _met(views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array], names: list[str]) -> Array | None:
    """The point nearest to all rays; None where they run side by side or it lies behind a camera."""
    total, sums = np.zeros((3, 3)), np.zeros(3)
    for name in names:
        ray = views[name].R_CW.T @ views[name].rays(seen[name][None])[0]
        ray = ray / np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        total += across
        sums += across @ views[name].p_WC_m
    if np.linalg.eigvalsh(total)[0] < 1e-9 * len(names):
        return None
    point = np.asarray(np.linalg.solve(total, sums), dtype=np.float64)
    ahead = all(float(views[name].depth_of(point)) > 0.0 for name in names)
    return point if ahead else None


def _refined(
    views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array], names: list[str], point: Array
) -> tuple[Array, Array, Array]:
    """The point of least squares in pixels, its errors, shape (2 n,), and their slopes, shape (2 n, 3)."""

    def errors(at: Array) -> Array:
        return np.concatenate([views[name].project(at[None])[0][0] - seen[name] for name in names])

    slope = np.zeros((2 * len(names), 3))
    for _ in range(STEPS):
        here = errors(point)
        step = SHIFT * max(float(views[names[0]].depth_of(point)), 1e-12)
        for axis in range(3):
            move = step * np.eye(3)[axis]
            slope[:, axis] = (errors(point + move) - errors(point - move)) / (2.0 * step)
        change = np.linalg.lstsq(slope, -here, rcond=None)[0]
        point = np.asarray(point + change, dtype=np.float64)
        if np.linalg.norm(change) < 1e-3 * step:
            break
    return point, errors(point), slope


def _widest_deg(views: Mapping[str, RegisteredPhoto], names: list[str], point: Array) -> float:
    """Largest angle between two lines of sight."""
    rays = np.array([point - views[name].p_WC_m for name in names])
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return float(np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1.0, 1.0))))

"""The plane that a flat subject lies in, such as a bed or a wall, and points told from it: along it and above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import StageError

ROUNDS, FAR = 12, 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPlane:
    """A plane in the model's frame: a place in it, and axes as rows: across, along, up (towards the cameras)."""

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        freeze(self, origin=(3,), axes=(3, 3))

    def told(self, points: Array) -> Array:
        """Across, along and above, shape (n, 3)."""
        return np.asarray((np.asarray(points) - self.origin) @ self.axes.T)

    def back(self, told: Array) -> Array:
        """Points of the model, shape (n, 3)."""
        return np.asarray(np.asarray(told) @ self.axes + self.origin)


def level_of(points: Array, eyes: Array) -> GroundPlane:
    """Plane of least squares of points, less those far above or below it, which are the subject's relief.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    eyes : ndarray, shape (k, 3)
        Cameras: they are above.

    Raises
    ------
    StageError
        If the points lie on a line.
    """
    kept = points
    for _ in range(ROUNDS):
        middle = kept.mean(axis=0)
        _, spread, axes = np.linalg.svd(kept - middle, full_matrices=False)
        if spread[1] < 1e-6 * max(spread[0], 1e-300):
            raise StageError("level: the points lie on a line, a subject that is flat spans a plane")
        height = (points - middle) @ axes[2]
        far = FAR * 1.4826 * float(np.median(np.abs(height - np.median(height))))
        kept = points[np.abs(height - np.median(height)) <= max(far, 1e-9)]
    up = axes[2] * (1.0 if float((eyes.mean(axis=0) - middle) @ axes[2]) >= 0.0 else -1.0)
    across = axes[0] * (1.0 if axes[0][np.argmax(np.abs(axes[0]))] > 0.0 else -1.0)
    return GroundPlane(origin=middle, axes=np.stack([across, np.cross(up, across), up]))


def heights(told: Array, cell: float) -> tuple[Array, Array]:
    """Mean height of points in square cells, shape (rows, columns), NaN where none is, and the corner of the first.

    Rows run along, columns across, both growing; the corner is (across, along).
    """
    low = np.floor(told[:, :2].min(axis=0) / cell) * cell
    place: IntArray = np.floor((told[:, :2] - low) / cell).astype(np.int64)
    columns, rows = place.max(axis=0) + 1
    flat = place[:, 1] * columns + place[:, 0]
    count = np.bincount(flat, minlength=rows * columns)
    total = np.bincount(flat, told[:, 2], minlength=rows * columns)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean.reshape(rows, columns), low

"""The ideal pinhole camera; lens distortion is taken to have been removed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wakewise.arrays import Array
from wakewise.errors import InputError


@dataclass(frozen=True)
class PinholeCamera:
    """Square pixels, principal point in the middle of the image; pixel centres at +0.5 as COLMAP has them.

    Parameters
    ----------
    width, height : int
        Image size in pixels.
    fov_rad : float
        Horizontal field of view (in water), between 0 and pi.

    Raises
    ------
    InputError
        If a size is below 1 or the field of view is outside (0, pi).
    """

    width: int
    height: int
    fov_rad: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise InputError(f"camera: image of {self.width} x {self.height} px, both must be at least 1")
        if not 0.0 < self.fov_rad < math.pi:
            raise InputError(f"camera: fov_rad {self.fov_rad:g}, allowed above 0 and below pi")

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same in x and y."""
        return 0.5 * self.width / math.tan(0.5 * self.fov_rad)

    @property
    def K(self) -> Array:
        """Calibration matrix, shape (3, 3)."""
        f = self.focal_px
        return np.array([[f, 0.0, 0.5 * self.width], [0.0, f, 0.5 * self.height], [0.0, 0.0, 1.0]])

    def project(self, points_C_m: ArrayLike) -> Array:
        """Pixels, shape (n, 2), of points, shape (n, 3), in the camera frame; NaN for points not before the camera."""
        points = np.asarray(points_C_m, dtype=np.float64)
        z = np.where(points[:, 2] > 0.0, points[:, 2], np.nan)
        return self.focal_px * points[:, :2] / z[:, None] + np.array([0.5 * self.width, 0.5 * self.height])

    def rays(self, pixels: ArrayLike) -> Array:
        """Directions with unit z, shape (n, 3), in the camera frame, of pixels, shape (n, 2)."""
        centred = np.asarray(pixels, dtype=np.float64) - np.array([0.5 * self.width, 0.5 * self.height])
        return np.concatenate([centred / self.focal_px, np.ones((len(centred), 1))], axis=1)

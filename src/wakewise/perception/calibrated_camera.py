"""Calibrated camera of the perception: pixels to rays and back, with OpenCV's lens distortion.

It is the camera as the crew knows it. The simulated camera, which has a flat port, is never used here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError

DISTORTIONS = 4
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-12)
"""OpenCV's own five rounds leave a pixel in the corners of a strong lens."""


@dataclass(frozen=True, kw_only=True)
class CalibratedCamera:
    """OpenCV's model: size and intrinsics in px, distortion k1, k2, p1, p2; the first pixel's centre is (0, 0).

    A rolling shutter reads the rows within `readout_s`, top row first; 0 of a global one.

    COLMAP puts that centre at (0.5, 0.5): its cx and cy are half a pixel more.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    readout_s: float = 0.0

    def __post_init__(self) -> None:
        if len(self.distortion) != DISTORTIONS:
            raise InputError(f"camera: {len(self.distortion)} distortions, needs k1, k2, p1, p2")
        numbers = np.array([self.fx, self.fy, self.cx, self.cy, *self.distortion, self.readout_s])
        if not (np.isfinite(numbers).all() and self.fx > 0.0 and self.fy > 0.0 and min(self.width, self.height) > 0):
            raise InputError(f"camera: {self}, needs a size and focal lengths above 0 and finite numbers")

    @property
    def focal_px(self) -> float:
        """Mean focal length."""
        return 0.5 * (self.fx + self.fy)

    def scaled(self, width: int) -> CalibratedCamera:
        """The same camera with pictures of another width."""
        share = width / self.width
        return CalibratedCamera(
            width=width,
            height=max(1, round(self.height * share)),
            fx=self.fx * share,
            fy=self.fy * share,
            cx=(self.cx + 0.5) * share - 0.5,
            cy=(self.cy + 0.5) * share - 0.5,
            distortion=self.distortion,
            readout_s=self.readout_s,
        )

    def slopes(self, pixels: ArrayLike) -> Array:
        """Slopes (x / z, y / z) of the rays through pixels, both shape (n, 2)."""
        px = np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if not len(px):
            return np.zeros((0, 2))
        if not any(self.distortion):
            return np.asarray((px[:, 0] - (self.cx, self.cy)) / (self.fx, self.fy))
        return np.asarray(
            cv2.undistortPoints(px, self._matrix, np.array(self.distortion), criteria=_CRITERIA)[:, 0], dtype=np.float64
        )

    def pixels(self, points_C_m: Array) -> Array:
        """Pixels, shape (n, 2), of points in the camera frame, shape (n, 3); NaN of those that are not before it."""
        z = points_C_m[:, 2]
        ahead = z > 1e-6
        x, y = (points_C_m[:, :2] / np.where(ahead, z, np.nan)[:, None]).T
        k1, k2, p1, p2 = self.distortion
        if any(self.distortion):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * k2)
            # Beyond its fold a lens's polynomial brings rays back into the picture.
            radial = np.where(1.0 + r2 * (3.0 * k1 + 5.0 * r2 * k2) > 0.0, radial, np.nan)
            x, y = (
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            )
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=1)

    def inside(self, pixels: Array, margin_px: float = 0.0) -> BoolArray:
        """Which pixels, shape (n, 2), lie in the picture, a margin from its edge, shape (n,)."""
        u, v = pixels.T
        right, low = self.width - 1 - margin_px, self.height - 1 - margin_px
        within = (u >= margin_px) & (u <= right) & (v >= margin_px) & (v <= low)
        return np.asarray(within & np.isfinite(u) & np.isfinite(v))

    @cached_property
    def straightening(self) -> tuple[Array, Array]:
        """Where the pixels of a picture without distortion lie in one with it, x and y, shapes (h, w), float32."""
        straight = cv2.initUndistortRectifyMap(
            self._matrix,
            np.array(self.distortion),
            np.eye(3),
            self._matrix,
            (self.width, self.height),
            cv2.CV_32FC1,
        )
        return np.asarray(straight[0]), np.asarray(straight[1])

    @cached_property
    def _matrix(self) -> Array:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

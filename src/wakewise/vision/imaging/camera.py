"""Cameras: the ideal pinhole, and a real lens with distortion, maybe behind a flat port."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.vision.imaging.lens import lens_row, pixels_of, rays_of


class Camera(Protocol):
    """What renderer, blur and flakes need of a camera; pixel centres at +0.5 as COLMAP has them.

    `focal_px` is the focal length at the middle of the image, in water: pixels per unit of slope there. `row` holds
    the numbers that compiled kernels read, see `lens_row`.
    """

    @property
    def width(self) -> int:
        """Image width, px."""
        ...

    @property
    def height(self) -> int:
        """Image height, px."""
        ...

    @property
    def focal_px(self) -> float:
        """Pixels per unit of slope in water, in the middle of the image."""
        ...

    @property
    def row(self) -> Array:
        """Numbers for compiled kernels, shape (14,)."""
        ...

    def project(self, points_C_m: ArrayLike) -> Array:
        """Pixels, shape (n, 2), of points, shape (n, 3), in the camera frame; NaN for points not before the camera."""
        ...

    def unproject(self, pixels: ArrayLike, depths_m: ArrayLike) -> Array:
        """Points, shape (n, 3), in the camera frame that pixels, shape (n, 2), see at depths, shape (n,)."""
        ...


def _check_size(width: int, height: int, fov_rad: float) -> None:
    if width < 1 or height < 1:
        raise InputError(f"camera: image of {width} x {height} px, both must be at least 1")
    if not 0.0 < fov_rad < math.pi:
        raise InputError(f"camera: fov_rad {fov_rad:g}, allowed above 0 and below pi")


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
        _check_size(self.width, self.height, self.fov_rad)

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same in x and y."""
        return 0.5 * self.width / math.tan(0.5 * self.fov_rad)

    @property
    def K(self) -> Array:
        """Calibration matrix, shape (3, 3)."""
        f = self.focal_px
        return np.array([[f, 0.0, 0.5 * self.width], [0.0, f, 0.5 * self.height], [0.0, 0.0, 1.0]])

    @property
    def row(self) -> Array:
        """Numbers for compiled kernels, shape (14,)."""
        return lens_row(self.focal_px, (0.5 * self.width, 0.5 * self.height))

    def project(self, points_C_m: ArrayLike) -> Array:
        """Pixels, shape (n, 2), of points, shape (n, 3), in the camera frame; NaN for points not before the camera."""
        points = np.asarray(points_C_m, dtype=np.float64)
        z = np.where(points[:, 2] > 0.0, points[:, 2], np.nan)
        return self.focal_px * points[:, :2] / z[:, None] + np.array([0.5 * self.width, 0.5 * self.height])

    def rays(self, pixels: ArrayLike) -> Array:
        """Directions with unit z, shape (n, 3), in the camera frame, of pixels, shape (n, 2)."""
        centred = np.asarray(pixels, dtype=np.float64) - np.array([0.5 * self.width, 0.5 * self.height])
        return np.concatenate([centred / self.focal_px, np.ones((len(centred), 1))], axis=1)

    def unproject(self, pixels: ArrayLike, depths_m: ArrayLike) -> Array:
        """Points, shape (n, 3), in the camera frame that pixels, shape (n, 2), see at depths, shape (n,)."""
        return self.rays(pixels) * np.asarray(depths_m, dtype=np.float64)[:, None]


@dataclass(frozen=True)
class FlatPort:
    """A pane at right angles to the optical axis, air behind it and water before it.

    Parameters
    ----------
    air_m : float
        From the lens's entrance pupil to the pane.
    glass_m : float
        Thickness of the pane.
    glass_index, water_index : float
        Refractive indices relative to air: 1.49 for acrylic, 1.333 for water (589 nm, 20 C; Hale & Querry 1973,
        doi 10.1364/AO.12.000555).
    """

    air_m: float = 0.02
    glass_m: float = 0.005
    glass_index: float = 1.49
    water_index: float = 1.333

    def __post_init__(self) -> None:
        if not (self.air_m >= 0.0 and self.glass_m >= 0.0):
            raise InputError(f"port: air {self.air_m:g} m, glass {self.glass_m:g} m, neither may be negative")
        if not (1.0 <= self.glass_index <= 3.0 and 1.0 < self.water_index <= 2.0):
            raise InputError(
                f"port: indices {self.glass_index:g} and {self.water_index:g}, allowed 1 to 3 and above 1 to 2"
            )


@dataclass(frozen=True)
class LensCamera:
    """A lens with OpenCV's distortion, in the water itself or in air behind a flat port.

    Parameters
    ----------
    width, height : int
        Image size in pixels; the principal point is in the middle.
    fov_rad : float
        Field of view in water between the middles of the left and the right edge, radial distortion included.
    distortion : (k1, k2, p1, p2)
        OpenCV's, of the lens in the medium that it stands in.
    port : FlatPort, optional

    Raises
    ------
    InputError
        If a size or angle is out of range, the distortion folds the image over, or a flat port cannot show that much:
        from air, no more than 2 asin(1 / 1.333) = 97 degrees of the water can be seen.
    """

    width: int
    height: int
    fov_rad: float
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    port: FlatPort | None = None

    def __post_init__(self) -> None:
        _check_size(self.width, self.height, self.fov_rad)
        if not all(math.isfinite(k) for k in self.distortion) or len(self.distortion) != 4:
            raise InputError(f"camera: distortion {self.distortion}, must be four finite numbers k1, k2, p1, p2")
        if self.port is not None and self.port.water_index * math.sin(0.5 * self.fov_rad) >= 0.999:
            most = 2.0 * math.degrees(math.asin(0.999 / self.port.water_index))
            raise InputError(
                f"camera: {math.degrees(self.fov_rad):g} deg of water behind a flat port, at most {most:.1f}"
            )
        k1, k2, _, _ = self.distortion
        slope = self._edge_slope
        reach = slope * math.hypot(1.0, self.height / self.width) * 1.2
        r2 = np.linspace(0.0, reach, 200) ** 2
        if float(np.min(1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2**2)) <= 0.05:
            raise InputError(f"camera: distortion k1 {k1:g}, k2 {k2:g} folds the image over before its corners")

    @property
    def _edge_slope(self) -> float:
        """Slope, in the lens's own medium, of the ray to the middle of the left or right edge."""
        if self.port is None:
            return math.tan(0.5 * self.fov_rad)
        return math.tan(math.asin(self.port.water_index * math.sin(0.5 * self.fov_rad)))

    @property
    def lens_focal_px(self) -> float:
        """Focal length of the lens itself, in air where there is a port."""
        slope, (k1, k2, _, _) = self._edge_slope, self.distortion
        return 0.5 * self.width / (slope * (1.0 + slope**2 * (k1 + slope**2 * k2)))

    @property
    def focal_px(self) -> float:
        """Pixels per unit of slope in water, in the middle of the image."""
        return self.lens_focal_px * (1.0 if self.port is None else self.port.water_index)

    @cached_property
    def row(self) -> Array:
        """Numbers for compiled kernels, shape (14,)."""
        p = self.port
        pane = None if p is None else (p.air_m, p.glass_m, p.glass_index, p.water_index)
        return lens_row(self.lens_focal_px, (0.5 * self.width, 0.5 * self.height), self.distortion, pane)

    def project(self, points_C_m: ArrayLike) -> Array:
        """Pixels, shape (n, 2), of points, shape (n, 3), in the camera frame; NaN for points not before the camera."""
        return np.asarray(pixels_of(self.row, np.ascontiguousarray(points_C_m, dtype=np.float64)))

    def unproject(self, pixels: ArrayLike, depths_m: ArrayLike) -> Array:
        """Points, shape (n, 3), in the camera frame that pixels, shape (n, 2), see at depths, shape (n,)."""
        ray = np.asarray(rays_of(self.row, np.ascontiguousarray(pixels, dtype=np.float64)))
        depth = np.asarray(depths_m, dtype=np.float64)
        return np.column_stack([ray[:, :2] * (depth - ray[:, 2])[:, None], depth])

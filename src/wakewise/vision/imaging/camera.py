"""Camera models: ideal pinhole, lens with distortion, lens behind a flat port; and COLMAP's OPENCV fitted to them.

A camera is one row of numbers (`lens_row`) that every kernel takes. Distortion is that of OpenCV and COLMAP's OPENCV:
k1, k2 radial, p1, p2 tangential (Brown 1971, "Close-range camera calibration", Photogrammetric Engineering 37). A flat
port is a pane normal to the optical axis with air on the lens's side. Rays refract at both faces by Snell's law and
meet the axis at heights that depend on their slope (Agrawal, Ramalingam, Taguchi & Chari 2012, "A theory of multi-layer
flat refractive geometry", doi 10.1109/CVPR.2012.6248073): a ray is (0, 0, z0) + t (sx, sy, 1), and z0 + t is the depth
from the pupil.

No central model is exact behind a flat port. The fit moves the centre of projection along the axis and spreads the
error over a range of depths; the residual is stated (Treibitz, Schechner, Kunz & Singh 2012, "Flat refractive
geometry", doi 10.1109/TPAMI.2011.105).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.files import write_json, write_text
from wakewise.core.geometry import Pose
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

    `focal_px`: of the lens, in air where there is a port. `centre_px` is (cx, cy). `distortion` is (k1, k2, p1, p2).
    `port`, (air_m, glass_m, glass index, water index): gap of air between pupil and glass, thickness of the glass,
    refractive indices relative to air.
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

    `width`, `height`: image size in pixels. `fov_rad`: horizontal field of view (in water), between 0 and pi. Raises
    InputError if a size is below 1 or the field of view is outside (0, pi).
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

    `air_m`: from the lens's entrance pupil to the pane. `glass_m`: thickness of the pane. `glass_index`, `water_index`:
    refractive indices relative to air: 1.49 for acrylic, 1.333 for water (589 nm, 20 C; Hale & Querry 1973, doi
    10.1364/AO.12.000555).
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

    `width`, `height`: image size in pixels; the principal point is in the middle. `fov_rad`: field of view in water
    between the middles of the left and the right edge, radial distortion included. `distortion`, (k1, k2, p1, p2):
    OpenCV's, of the lens in the medium that it stands in. Raises InputError if a size or angle is out of range, the
    distortion folds the image over, or a flat port cannot show that much: from air, no more than 2 asin(1 / 1.333) = 97
    degrees of the water can be seen.
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


FIT_DEPTHS_M = (0.3, 0.4, 0.55, 0.75, 1.0)
"""Distances at which targets are photographed."""
PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenCVCamera:
    """COLMAP's OPENCV camera that stands for a camera in water.

    `params` (8,) are fx, fy, cx, cy in pixels, k1, k2, p1, p2; pixel centres at +0.5. `ahead_m` is how far before the
    lens's pupil, along the optical axis, the model's centre of projection lies (behind it where negative). `rms_px` and
    `max_px` are what is left between the model and the true rays over the whole image at `depths_m`; 0 without a port.
    """

    width: int
    height: int
    params: Array
    ahead_m: float
    rms_px: float
    max_px: float
    depths_m: Array

    def __post_init__(self) -> None:
        freeze(self, params=(8,), depths_m=(None,))

    @property
    def X_CM(self) -> Pose:
        """Pose of the model's camera M in the frame of the lens C."""
        return Pose(np.array([0.0, 0.0, self.ahead_m]))

    def project(self, points_C_m: Array) -> Array:
        """Pixels, shape (n, 2), of points, shape (n, 3), in the lens's frame, as the model has them."""
        fx, fy, cx, cy, k1, k2, p1, p2 = self.params
        row = lens_row(fx, (cx, cy), (k1, k2, p1, p2))
        row[2] = fy
        return np.asarray(pixels_of(row, np.ascontiguousarray(points_C_m - self.X_CM.p_m)))

    def cameras_txt(self, note: str | None = None) -> str:
        """Text of a COLMAP cameras.txt, with a note in place of how good the model is."""
        good = f"Differs from the rays of the photographs by {self.rms_px:.3g} px rms, {self.max_px:.3g} px at most"
        numbers = " ".join(f"{value:.10g}" for value in self.params)
        return (
            "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy k1 k2 p1 p2\n"
            f"# {note or good}\n"
            f"# Projection centre {1000.0 * self.ahead_m:.3f} mm before the lens's pupil\n"
            f"1 OPENCV {self.width} {self.height} {numbers}\n"
        )

    def write(self, folder: Path) -> None:
        """Write cameras.txt for COLMAP and camera.json with the same parameters and residuals."""
        write_text(folder / "cameras.txt", self.cameras_txt())
        write_json(
            folder / "camera.json",
            {
                "model": "OPENCV",
                "width": self.width,
                "height": self.height,
                **dict(zip(PARAMETERS, map(float, self.params), strict=True)),
                "projection_centre_ahead_m": self.ahead_m,
                "residual_rms_px": self.rms_px,
                "residual_max_px": self.max_px,
                "fitted_at_depths_m": [float(d) for d in self.depths_m],
            },
        )


def calibrate(camera: Camera, depths_m: tuple[float, ...] = FIT_DEPTHS_M) -> OpenCVCamera:
    """COLMAP's OPENCV model of a camera: its own numbers without a port, the least-squares fit behind one."""
    w, h = camera.width, camera.height
    distortion = camera.distortion if isinstance(camera, LensCamera) else (0.0, 0.0, 0.0, 0.0)
    start = np.array([camera.focal_px, camera.focal_px, 0.5 * w, 0.5 * h, *distortion, 0.0])
    if not (isinstance(camera, LensCamera) and camera.port is not None):
        return OpenCVCamera(
            width=w, height=h, params=start[:8], ahead_m=0.0, rms_px=0.0, max_px=0.0, depths_m=np.array(depths_m)
        )
    grid = np.stack(np.meshgrid(np.linspace(0.0, w, 21), np.linspace(0.0, h, 16)), axis=-1).reshape(-1, 2)
    points = np.concatenate([camera.unproject(grid, np.full(len(grid), d)) for d in depths_m])
    pixels = np.tile(grid, (len(depths_m), 1))

    def model(x: Array) -> OpenCVCamera:
        return OpenCVCamera(
            width=w, height=h, params=x[:8], ahead_m=float(x[8]), rms_px=0.0, max_px=0.0, depths_m=np.array(depths_m)
        )

    def residual(x: Array) -> Array:
        return np.asarray((model(x).project(points) - pixels).ravel())

    scale = np.array([w, w, w, w, 1.0, 1.0, 0.1, 0.1, 0.1])
    fit = least_squares(residual, start, x_scale=scale, max_nfev=60)
    error = np.linalg.norm(model(fit.x).project(points) - pixels, axis=1)
    return OpenCVCamera(
        width=w,
        height=h,
        params=fit.x[:8],
        ahead_m=float(fit.x[8]),
        rms_px=float(np.sqrt(np.mean(error**2))),
        max_px=float(error.max()),
        depths_m=np.array(depths_m),
    )

"""The camera model that goes with the photographs: COLMAP's OPENCV, fitted where a flat port bends the rays.

A pinhole with distortion has one centre of projection; behind a flat port rays of different slopes meet the axis at
different heights, so that no such model is exact at all depths. The fit moves the centre along the axis and shares the
error out over a range of depths; what remains is stated (Treibitz, Schechner, Kunz & Singh 2012, "Flat refractive
geometry", doi 10.1109/TPAMI.2011.105).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, freeze
from wakewise.core.files import write_json, write_text
from wakewise.core.geometry import Pose
from wakewise.vision.imaging.camera import Camera, LensCamera
from wakewise.vision.imaging.lens import lens_row, pixels_of

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
        """Write cameras.txt for COLMAP and camera.json, which says the same and how good it is."""
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

"""Pictures of tracers in a light sheet: a pair of frames, a pulse apart, as a 120 fps camera would take them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Flow
from wakewise.core.jit.njit import njit
from wakewise.core.settings import Settings
from wakewise.vision.piv.tracers import LightSheet, TracerSettings, carried, seed_sheet

Picture = NDArray[np.uint8]


class CameraSettings(Settings):
    """A camera that looks squarely at the light sheet, without perspective."""

    width_px: int = Field(1152, ge=128, le=4096, description="columns of the picture")
    height_px: int = Field(1024, ge=128, le=4096, description="rows of the picture")
    m_per_px: float = Field(0.5e-3, gt=0.0, le=0.01, description="size of a pixel in the light sheet")
    frame_rate_hz: float = Field(120.0, gt=0.0, le=10_000.0, description="frames per second")
    pulse_gap_s: float | None = Field(
        None, gt=0.0, description="time between the two light pulses of a pair; none: one frame period"
    )
    particle_px: float = Field(2.5, ge=1.0, le=10.0, description="diameter of a particle's image, at 1/e^2 brightness")
    brightness: float = Field(180.0, gt=0.0, le=255.0, description="grey levels at the peak of a particle in mid sheet")
    background: float = Field(8.0, ge=0.0, le=100.0, description="grey level of empty water")
    noise: float = Field(3.0, ge=0.0, le=50.0, description="rms of the sensor's noise in grey levels")

    @property
    def dt_s(self) -> float:
        """Time between the two frames of a pair."""
        return self.pulse_gap_s if self.pulse_gap_s is not None else 1.0 / self.frame_rate_hz


@dataclass(frozen=True, kw_only=True, eq=False)
class ImagePair:
    """Two 8-bit pictures, shape (rows, columns), and the time between them."""

    first: Picture
    second: Picture
    dt_s: float


def photograph_pair(
    flow: Flow, sheet: LightSheet, camera: CameraSettings, tracers: TracerSettings, rng: np.random.Generator
) -> ImagePair:
    """Photograph tracers half a gap before and half a gap after this instant of a flow.

    Particles are strewn in the middle of the gap, wide enough that those which enter the picture are there as well;
    those which leave the sheet through its faces are lost, as in a real one.
    """
    half_m = (0.5 * camera.width_px * camera.m_per_px, 0.5 * camera.height_px * camera.m_per_px)
    margin = 1.15
    # The sheet's light, integrated through its depth, is that of a sheet 1.25 half thicknesses deep; seeded are 4.
    share = 4.0 / math.sqrt(math.pi / 2.0)
    count = round(tracers.per_pixel * camera.width_px * camera.height_px * margin**2 * share)
    middle = seed_sheet(sheet, (margin * half_m[0], margin * half_m[1]), count, rng)
    # Light scattered grows with the cross-section of a particle; suspensions are not all of one size.
    own = rng.uniform(0.5, 1.0, count)
    frames = []
    for sign in (-0.5, 0.5):
        place = sheet.to_local(carried(flow, middle, sign * camera.dt_s) - sheet.centre_W_m)
        light = own * np.exp(-2.0 * (place[:, 2] / sheet.half_thickness_m) ** 2)
        columns = place[:, 0] / camera.m_per_px + 0.5 * camera.width_px
        rows = place[:, 1] / camera.m_per_px + 0.5 * camera.height_px
        frames.append(picture(columns, rows, camera.brightness * light, camera, rng))
    return ImagePair(first=frames[0], second=frames[1], dt_s=camera.dt_s)


def picture(columns: Array, rows: Array, peak: Array, camera: CameraSettings, rng: np.random.Generator) -> Picture:
    """8-bit picture, shape (rows, columns), of particles at places in pixels (centres at +0.5), shape (n,).

    A particle is a Gaussian spot with 1/e^2 diameter `particle_px`, integrated over each pixel; `peak`, shape (n,), is
    the grey level at its middle. Background and Gaussian noise are added, then levels are rounded and clipped.
    """
    light = np.full((camera.height_px, camera.width_px), camera.background)
    bright = peak > 0.1
    _add_spots(columns[bright], rows[bright], peak[bright], camera.particle_px / 4.0, light)
    light += rng.normal(0.0, camera.noise, light.shape) if camera.noise > 0.0 else 0.0
    return np.asarray(np.clip(np.rint(light), 0, 255), dtype=np.uint8)


@njit
def _add_spots(columns, rows, peak, sigma, light):  # type: ignore[no-untyped-def]
    """Add spots to `light`; a pixel gets the mean of the Gaussian over its area, by differences of erf."""
    height, width = light.shape
    reach = int(np.ceil(4.0 * sigma)) + 1
    scale = 1.0 / (math.sqrt(2.0) * sigma)
    # A spot's integral is peak 2 pi sigma^2; erf differences halve to shares of it along each axis.
    whole = 2.0 * math.pi * sigma * sigma * 0.25
    across = np.empty(2 * reach + 1)
    for k in range(columns.shape[0]):
        i0, j0 = int(np.floor(rows[k])), int(np.floor(columns[k]))
        if i0 < -reach or j0 < -reach or i0 >= height + reach or j0 >= width + reach:
            continue
        for b in range(2 * reach + 1):
            left = j0 - reach + b - columns[k]
            across[b] = math.erf((left + 1.0) * scale) - math.erf(left * scale)
        for a in range(2 * reach + 1):
            i = i0 - reach + a
            if i < 0 or i >= height:
                continue
            top = i - rows[k]
            along = peak[k] * whole * (math.erf((top + 1.0) * scale) - math.erf(top * scale))
            for b in range(2 * reach + 1):
                j = j0 - reach + b
                if 0 <= j < width:
                    light[i, j] += along * across[b]

"""Synthetic PIV pictures: tracer particles that follow a flow, in a light sheet, two frames a pulse gap apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3 as WATER_DENSITY_KG_M3
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.interfaces import Flow
from wakewise.core.jit.njit import njit
from wakewise.core.settings import Settings

WATER_VISCOSITY_PA_S = 1.0e-3
"""Fresh water at 20 deg C (CRC Handbook of Chemistry and Physics)."""


class TracerSettings(Settings):
    """The seeding of the water."""

    diameter_um: float = Field(20.0, ge=10.0, le=50.0, description="diameter of a tracer particle")
    density_kg_m3: float = Field(1050.0, ge=500.0, le=3000.0, description="polyamide 1020-1060, hollow glass 1100")
    per_pixel: float = Field(0.02, gt=0.0, le=0.2, description="particles in the light sheet per pixel of the picture")


def relaxation_s(diameter_m: float, density_kg_m3: float) -> float:
    """Stokes relaxation time tau = rho_p d^2 / (18 mu) in seconds (Raffel et al., Particle Image Velocimetry)."""
    return density_kg_m3 * diameter_m**2 / (18.0 * WATER_VISCOSITY_PA_S)


def settling_speed_m_s(diameter_m: float, density_kg_m3: float) -> float:
    """Stokes settling speed in still water in m/s, positive downward."""
    return (density_kg_m3 - WATER_DENSITY_KG_M3) * GRAVITY_M_S2 * diameter_m**2 / (18.0 * WATER_VISCOSITY_PA_S)


@dataclass(frozen=True, kw_only=True, eq=False)
class LightSheet:
    """A plane of light in the world: picture axes `right_W` and `down_W`, unit vectors, shape (3,), about `centre_W_m`.

    Depth through the sheet is along right x down. Its brightness is exp(-2 (depth / half_thickness_m)^2).
    """

    centre_W_m: Array
    right_W: Array
    down_W: Array
    half_thickness_m: float

    def to_world(self, local_m: Array) -> Array:
        """World points, shape (n, 3), of points (right, down, depth) of the sheet, shape (n, 3)."""
        axes = np.stack([self.right_W, self.down_W, np.cross(self.right_W, self.down_W)])
        return np.asarray(self.centre_W_m + local_m @ axes)

    def to_local(self, vectors_W: Array) -> Array:
        """Components along right, down and depth, shape (n, 3), of vectors of the world, shape (n, 3)."""
        axes = np.stack([self.right_W, self.down_W, np.cross(self.right_W, self.down_W)])
        return np.asarray(vectors_W @ axes.T)


def seed_sheet(sheet: LightSheet, half_extent_m: tuple[float, float], count: int, rng: np.random.Generator) -> Array:
    """Uniformly strewn particles in world coordinates, shape (count, 3).

    They fill |right| and |down| below `half_extent_m` and |depth| below twice the half thickness, where less than
    1/2000 of the light is left.
    """
    reach = np.array([*half_extent_m, 2.0 * sheet.half_thickness_m])
    return sheet.to_world(rng.uniform(-1.0, 1.0, (count, 3)) * reach)


def carried(flow: Flow, start_W_m: Array, dt_s: float, substeps: int = 2) -> Array:
    """Where a flow that stands still in time carries particles within `dt_s`, shape (n, 3); negative dt_s goes back.

    Each substep is a midpoint (second-order Runge-Kutta) step. Inertia is left out: at 50 um a particle lags 0.15 ms.
    """
    position = np.array(start_W_m, dtype=np.float64)
    h = dt_s / substeps
    for _ in range(substeps):
        half = position + 0.5 * h * flow.velocity(position)
        position = position + h * flow.velocity(half)
    return position


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
def _add_spots(columns: Array, rows: Array, peak: Array, sigma: float, light: Array) -> None:
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

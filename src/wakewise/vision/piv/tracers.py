"""Tracer particles that mark moving water: how closely they follow it, and where it carries them between two frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3 as WATER_DENSITY_KG_M3
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.interfaces import Flow
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

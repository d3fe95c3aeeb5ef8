"""What a swell does to the bed: its orbital motion there and the drag of its thin boundary layer.

R. L. Soulsby, Dynamics of Marine Sands, Thomas Telford 1997, chapter 4: tau_w = rho f_w U_w^2 / 2, with the larger of
the rough f_w = 1.39 (A / z0)^-0.52, z0 = d / 12, and the smooth f_w = 2 Re^-0.5 (0.0521 Re^-0.187 above Re = 5e5),
where A is the orbit's half width at the bed and Re = U_w A / nu.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.simulation.tank.grains import VISCOSITY_M2_S
from wakewise.simulation.water.currents import AiryWave

_TURBULENT = 5e5


def wave_friction_factor(orbital_m_s: float, period_s: float, grain_m: float) -> float:
    """Friction factor f_w of a bed of grains under an orbital velocity's amplitude at the bed."""
    orbit_m = orbital_m_s * period_s / (2 * math.pi)
    reynolds = orbital_m_s * orbit_m / VISCOSITY_M2_S
    smooth = 2.0 * reynolds**-0.5 if reynolds <= _TURBULENT else 0.0521 * reynolds**-0.187
    return max(smooth, 1.39 * (orbit_m * 12.0 / grain_m) ** -0.52)


@dataclass(frozen=True, kw_only=True, eq=False)
class Swell:
    """A linear wave over a flat bed of grains.

    The stress follows the orbital velocity in time, without its lead of an eighth of a period over a laminar layer.
    """

    wave: AiryWave
    grain_m: float
    density_kg_m3: float

    @property
    def amplitude_m_s(self) -> float:
        """Of the orbital velocity at the bed, U_w = a w / sinh(k h)."""
        wave = self.wave
        return wave.amplitude_m * 2 * math.pi / wave.period_s / math.sinh(wave.number_per_m * wave.depth_m)

    @property
    def ahead(self) -> Array:
        """Unit vector, shape (2,), along which the wave runs."""
        return np.array([math.cos(self.wave.heading_rad), math.sin(self.wave.heading_rad)])

    def speed_m_s(self, places_W_m: Array, time_s: float) -> Array:
        """Water's velocity along `ahead` at the bed, shape (n,), at places (x, y), shape (n, 2); of either sign."""
        phase = self.wave.number_per_m * (places_W_m @ self.ahead) - 2 * math.pi / self.wave.period_s * time_s
        speed: Array = self.amplitude_m_s * np.cos(phase)
        return speed

    def stress_Pa(self, places_W_m: Array, time_s: float) -> Array:
        """Size of its stress on the bed, shape (n,), at places (x, y), shape (n, 2), at an instant."""
        factor = wave_friction_factor(self.amplitude_m_s, self.wave.period_s, self.grain_m)
        return 0.5 * self.density_kg_m3 * factor * self.amplitude_m_s * np.abs(self.speed_m_s(places_W_m, time_s))

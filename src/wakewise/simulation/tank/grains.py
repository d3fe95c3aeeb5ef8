"""Sediment grains: settling velocity, threshold of motion, bed shear stress of flow and waves, beam attenuation.

R. L. Soulsby, Dynamics of Marine Sands, Thomas Telford 1997: dimensionless grain size (eq. 98), threshold (SC 77),
settling velocity (SC 102), bed roughness of flat beds.

Waves (chapter 4): tau_w = rho f_w U_w^2 / 2, with the larger of the rough f_w = 1.39 (A / z0)^-0.52, z0 = d / 12, and
the smooth f_w = 2 Re^-0.5 (0.0521 Re^-0.187 above Re = 5e5), A the orbit's half width at the bed, Re = U_w A / nu.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.currents import AiryWave

VISCOSITY_M2_S = 1.0e-6  # of fresh water at 20 degrees
VON_KARMAN = 0.40
_FASTEST_M_S, _NODES = 4.0, 2049  # of a table of friction velocities
STRESS_INTENSITY = 0.4
"""Rms of a bed's stress over its mean under turbulence, of boundary layers (0.36 to 0.40).

Alfredsson, Johansson, Haritonidis and Eckelmann 1988, doi 10.1063/1.866783; log-normal: Cheng 2006, Phys. Fluids 18,
096602. Where jets strike it is higher; no figure was found for that, so that what is lifted there is rather too little.
"""
_SUBLAYER = 11.6  # height of the viscous sublayer in nu / u*
SAND_M = 62.5e-6  # from here on grains are sand (Wentworth 1922), which van Rijn's law is for


def grain_number(grain_m: float, grain_density_kg_m3: float, density_kg_m3: float) -> float:
    """Dimensionless grain size D* = d (g (s - 1) / nu^2)^(1/3)."""
    _check_grain(grain_m, grain_density_kg_m3, density_kg_m3)
    lighter = grain_density_kg_m3 / density_kg_m3 - 1.0
    return grain_m * (GRAVITY_M_S2 * lighter / VISCOSITY_M2_S**2) ** (1 / 3)


def settling_speed_m_s(grain_m: float, grain_density_kg_m3: float, density_kg_m3: float) -> float:
    """Speed at which a grain sinks in still water."""
    number = grain_number(grain_m, grain_density_kg_m3, density_kg_m3)
    return VISCOSITY_M2_S / grain_m * (math.sqrt(10.36**2 + 1.049 * number**3) - 10.36)


def threshold_stress_Pa(grain_m: float, grain_density_kg_m3: float, density_kg_m3: float) -> float:
    """Bed shear stress that moves loose grains without cohesion.

    For 20 um of calcite 0.063 Pa. A bed that has consolidated or holds clay or biofilm resists more; that is what
    `SiltSettings.threshold_Pa` is for.
    """
    number = grain_number(grain_m, grain_density_kg_m3, density_kg_m3)
    shields = 0.30 / (1 + 1.2 * number) + 0.055 * (1 - math.exp(-0.020 * number))
    return shields * GRAVITY_M_S2 * (grain_density_kg_m3 - density_kg_m3) * grain_m


def friction_velocity_m_s(speed_m_s: ArrayLike, height_m: float, grain_m: float) -> Array:
    """Friction velocity under water that moves at a speed, any shape, at a height above a flat bed.

    Log law u = (u*/0.40) ln(z/z0) with z0 = k/30 + nu/(9 u*) (smooth to rough; Soulsby 1997), k = 2.5 d; below
    z = 11.6 nu/u* the viscous sublayer u = u*^2 z / nu takes over.
    """
    speed = np.abs(np.asarray(speed_m_s, dtype=np.float64))
    viscous, star = np.sqrt(speed * VISCOSITY_M2_S / height_m), _log_law_m_s(speed, height_m, grain_m)
    return np.where(star * height_m / VISCOSITY_M2_S < _SUBLAYER, viscous, star)


def _log_law_m_s(speed: Array, height_m: float, grain_m: float) -> Array:
    stars = speed.flatten()
    _follow_log_law(stars, height_m, grain_m)
    return stars.reshape(speed.shape)


@njit(nogil=True)
def _follow_log_law(speeds: Array, height_m: float, grain_m: float) -> None:
    """Turn speeds, shape (n,), in place into the friction velocities of the log law."""
    for k in range(speeds.shape[0]):
        star = max(0.05 * speeds[k], 1e-9)
        for _ in range(8):  # each round shrinks the error about tenfold
            rough = 2.5 * grain_m / 30 + VISCOSITY_M2_S / (9 * star)
            star = max(VON_KARMAN * speeds[k] / math.log(max(height_m / rough, 3.0)), 1e-9)
        speeds[k] = star


def friction_table_m_s(height_m: float, grain_m: float) -> Array:
    """For `friction_from`: height, then the log law at speeds of evenly spaced roots from 0 to 4 m/s, shape (2050,)."""
    speeds = _FASTEST_M_S * np.linspace(0.0, 1.0, _NODES) ** 2
    return np.concatenate([[height_m], _log_law_m_s(speeds, height_m, grain_m)])


@njit(nogil=True)
def friction_from(table: Array, speed_m_s: float) -> float:
    """`friction_velocity_m_s` under a speed, from a table, to 1e-4 of it; beyond 4 m/s the last slope goes on."""
    place = math.sqrt(speed_m_s / _FASTEST_M_S) * (_NODES - 1)
    k = min(int(place), _NODES - 2)
    star = table[k + 1] + (place - k) * (table[k + 2] - table[k + 1])
    if star * table[0] / VISCOSITY_M2_S < _SUBLAYER:
        return math.sqrt(speed_m_s * VISCOSITY_M2_S / table[0])
    return star


def speed_at_stress_m_s(stress_over_density_m2_s2: float, height_m: float, grain_m: float) -> float:
    """Speed at a height above the bed under which the bed feels a stress; the inverse of `friction_velocity_m_s`."""
    star = math.sqrt(stress_over_density_m2_s2)
    if star * height_m / VISCOSITY_M2_S < 11.6:
        return star**2 * height_m / VISCOSITY_M2_S
    rough = 2.5 * grain_m / 30 + VISCOSITY_M2_S / (9 * star)
    return star / VON_KARMAN * math.log(max(height_m / rough, 3.0))


@njit(nogil=True)
def mean_excess(mean: float, intensity: float) -> float:
    """Mean of max(x - 1, 0) of a log-normal x with a mean and an rms fluctuation of `intensity` times it.

    With s^2 = ln(1 + I^2) and d = ln(m) / s + s / 2 it is m Phi(d) - Phi(d - s), Phi the normal distribution; for
    strong stress it goes over into m - 1, so that a threshold read off a line through measured rates keeps its meaning.
    """
    if mean <= 0.0:
        return 0.0
    if intensity <= 0.0:
        return max(mean - 1.0, 0.0)
    s = math.sqrt(math.log1p(intensity * intensity))
    d = math.log(mean) / s + 0.5 * s
    below, above = 0.5 * math.erfc(-d / math.sqrt(2.0)), 0.5 * math.erfc((s - d) / math.sqrt(2.0))
    return max(mean * below - above, 0.0)


def least_mean(intensity: float, excess: float = 1e-4) -> float:
    """Mean stress over the threshold at which `mean_excess` is so small; below it erosion counts as none."""
    if intensity <= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if mean_excess(middle, intensity) > excess else (middle, high)
    return low


@njit(nogil=True)
def erosion_rates_kg_m2_s(stress: Array, threshold: Array, rate_kg_m2_s: float, intensity: float) -> Array:
    """Partheniades' law under stresses that fluctuate: M times `mean_excess` over the thresholds, all shape (n,).

    Partheniades 1965, J. Hydraul. Div. ASCE 91 HY1; its mean over a distribution of stress: Winterwerp, van Kesteren,
    van Prooijen and Jacobs 2012, doi 10.1029/2012JC008072. M of silts is usually taken as 1e-5 to 1e-4 kg/m2/s.
    """
    rates = np.empty(stress.shape[0])
    for k in range(stress.shape[0]):
        # Where no jet reaches, one cell after another feels the same.
        if k and stress[k] == stress[k - 1] and threshold[k] == threshold[k - 1]:
            rates[k] = rates[k - 1]
        else:
            rates[k] = rate_kg_m2_s * mean_excess(stress[k] / threshold[k], intensity)
    return rates


def mean_pickup_rates_kg_m2_s(
    stress_Pa: Array,
    threshold_Pa: Array,
    grain_m: float,
    grain_density_kg_m3: float,
    density_kg_m3: float,
    intensity: float,
) -> Array:
    """`pickup_rate_kg_m2_s` under stresses, shape (n,), that fluctuate log-normally about their means.

    T^1.5 has no closed mean: 24 nodes of Gauss and Legendre over the part of the normal distribution above the
    threshold, up to 8 standard deviations.
    """
    grain = grain_m, grain_density_kg_m3, density_kg_m3
    if intensity <= 0.0:
        return pickup_rate_kg_m2_s(stress_Pa, threshold_Pa, *grain)
    s = math.sqrt(math.log1p(intensity * intensity))
    first = (np.log(threshold_Pa / np.maximum(stress_Pa, 1e-12)) + 0.5 * s * s) / s
    first = np.clip(first, -8.0, 8.0)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    z = first + 0.5 * (nodes + 1.0) * (8.0 - first)
    rates = pickup_rate_kg_m2_s(stress_Pa[:, None] * np.exp(s * z - 0.5 * s * s), threshold_Pa[:, None], *grain)
    density = np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)
    mean: Array = (0.5 * (8.0 - first) * weights * rates * density).sum(axis=1)
    return mean


def pickup_rate_kg_m2_s(
    stress_Pa: ArrayLike, threshold_Pa: ArrayLike, grain_m: float, grain_density_kg_m3: float, density_kg_m3: float
) -> Array:
    """Van Rijn's pickup of sand E = 0.00033 rho_s ((s - 1) g d)^0.5 D*^0.3 T^1.5, T = stress over threshold less 1.

    L. C. van Rijn 1984, Sediment pick-up functions, J. Hydraul. Eng. 110, 1494 (grains of 0.13 to 1.5 mm). It was
    measured up to a Shields number of about 1 and is far too high beyond, so it is divided by the Shields number there
    (van Rijn, Bisschop and van Rhee 2019, J. Hydraul. Eng. 145, 04018084).

    `stress_Pa`: on the bed; the result has its shape. `threshold_Pa`: one, or one for each stress.
    """
    number = grain_number(grain_m, grain_density_kg_m3, density_kg_m3)
    stress = np.asarray(stress_Pa, dtype=np.float64)
    weight_Pa = GRAVITY_M_S2 * (grain_density_kg_m3 - density_kg_m3) * grain_m
    scale = 0.00033 * grain_density_kg_m3 * math.sqrt(weight_Pa / density_kg_m3) * number**0.3
    damped = np.minimum(1.0, weight_Pa / np.maximum(stress, 1e-12))
    rate: Array = scale * np.maximum(stress / np.asarray(threshold_Pa) - 1.0, 0.0) ** 1.5 * damped
    return rate


def beam_attenuation_per_m(concentration_kg_m3: ArrayLike, grain_m: float, density_kg_m3: float) -> Array:
    """Beam attenuation c = 1.5 Q C / (rho_s d), Q = 2, of suspended grains; any shape.

    Grains much larger than a wavelength take twice their cross-section from a beam (van de Hulst 1957, Light
    Scattering by Small Particles).

    `density_kg_m3`: of the grains.
    """
    _check_grain(grain_m, density_kg_m3, 0.0)
    extinction_efficiency = 2.0
    scale = 1.5 * extinction_efficiency / (density_kg_m3 * grain_m)
    return scale * np.asarray(concentration_kg_m3, dtype=np.float64)


def _check_grain(grain_m: float, grain_density_kg_m3: float, density_kg_m3: float) -> None:
    if not (math.isfinite(grain_m) and grain_m > 0.0):
        raise InputError(f"grain_m: {grain_m:g}, must be more than 0")
    if not grain_density_kg_m3 > density_kg_m3:
        raise InputError(
            f"grain_density_kg_m3: {grain_density_kg_m3:g}, must be more than the water's {density_kg_m3:g}"
        )


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

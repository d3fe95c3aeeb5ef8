"""Wake models of an actuator-disk jet: the paper's cone with cos^4 attenuation, free cones, turbulent round jets.

The velocity is along the jet's axis and grows with the square root of thrust, so a model is a speed per square root of
newton. The jet leaves opposite to the force on the vehicle: T > 0 along -axis, T < 0 along +axis. Cones:

    v = G sqrt(|T| / (2 pi rho A)) (r_ref / sqrt(r^2 + r_s^2))^p cos^m(theta) s(theta)

r is the distance from the disk's centre, theta the angle off the jet's axis, s the edge of the cone: 1 inside its half
angle, 0 outside, sharp or smooth in between.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.wake import kernels


class JetLaw(NamedTuple):
    """What the compiled kernels need to know of a jet: which kernel, and its numbers (see `wakewise.wake.kernels`)."""

    kind: int
    parameters: Array


class AxialJet(ABC):
    """A jet whose water moves along the jet's direction everywhere downstream of the disk, and is still upstream."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name used in scenario files and tables."""

    @property
    @abstractmethod
    def law(self) -> JetLaw:
        """Kernel and numbers."""

    def speed(self, along_m: ArrayLike, across_m: ArrayLike, thrust_N: ArrayLike, area_m2: ArrayLike) -> Array:
        """Speed in m/s of single jets, one per element; the arguments broadcast against each other.

        - `along_m`, `across_m`: distance from the disk's centre along the jet (negative: upstream, where the water is
          still), and off its axis. The second must not be negative.
        - `thrust_N`: its sign does not matter: the jet points where `along_m` counts.
        - `area_m2`: disk area, more than 0.

        Raises InputError for a negative distance off the axis, a disk without area, or NaN.
        """
        given = (np.asarray(a, dtype=np.float64) for a in (along_m, across_m, thrust_N, area_m2))
        along, across, thrust, area = (np.array(a) for a in np.broadcast_arrays(*given))
        for what, value in (("along_m", along), ("across_m", across), ("thrust_N", thrust), ("area_m2", area)):
            if not np.all(np.isfinite(value)):
                raise InputError(f"wake model {self.name}: {what} holds NaN or infinity, every element must be finite")
        if np.any(across < 0.0):
            raise InputError(f"wake model {self.name}: across_m {np.min(across):g}, a radius must not be negative")
        if np.any(area <= 0.0):
            raise InputError(f"wake model {self.name}: area_m2 {np.min(area):g}, a disk's area must be more than 0")
        unit = np.empty(along.size)
        kernels.fill_speed(along.ravel(), across.ravel(), area.ravel(), *self.law, unit)
        return np.asarray(np.sqrt(np.abs(thrust)) * unit.reshape(along.shape))

    def split_speed(self, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array) -> Array:
        """Speed per square root of newton at every point, for either sign of every thrust.

        `origins_W_m`, `axes_W`, shape (m, 3): centre of each thruster's disk and unit axis of its *force* for T > 0.
        Shapes: `points_W_m` (n, 3); `areas_m2` (m,). Returns shape (n, 2 m), in m/s/sqrt(N): column i: thruster i with
        T > 0, whose jet goes along -axis. Column m + i: T < 0, along +axis.
        """
        speed = np.zeros((len(points_W_m), 2 * len(origins_W_m)))
        kernels.fill_split_speed(points_W_m, origins_W_m, axes_W, areas_m2, *self.law, speed)
        return speed

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton, shape (m, n, 3): see `wakewise.core.interfaces.WakeModel`."""
        directions = np.asarray(directions_W, dtype=np.float64)
        speed = self.split_speed(points_W_m, origins_W_m, -directions, area_m2)[:, : len(directions)]
        return np.asarray(speed.T[:, :, None] * directions[:, None, :])


def check_ranges(record: object, what: str, **ranges: tuple[float, float]) -> None:
    """Refuse a dataclass whose number lies outside its range, or is NaN.

    Raises InputError: naming the model, the field, the value and what is allowed.
    """
    for name, (low, high) in ranges.items():
        value = getattr(record, name)
        if not low <= value <= high:
            raise InputError(f"{what}: {name} {value:g}, allowed {low:g} to {high:g}")


@dataclass(frozen=True, kw_only=True)
class RoundJet(AxialJet):
    """A turbulent round jet that leaves the disk with speed sqrt(T / (rho A)) and carries T / rho through every plane.

    With R the disk's radius, s the slope of the 1/e width, x the distance along the jet and x_c = sqrt(2) R / s:

        width of the shear layer  b = s x
        centreline                U_c = U_0 (1 + (x / x_c)^6)^(-1/6), U_0 = sqrt(T / (rho A))
        profile                   U_c for r < a, else U_c exp(-(r - a)^2 / b^2)
        core radius a             from a^2 + sqrt(pi/2) a b + b^2 / 2 = R^2 (U_0 / U_c)^2, which is flux = T / rho

    Near the disk this is a top hat whose core dies out at x_c = 6.1 D (Albertson et al. 1950 measured 6.2 D); far away
    it is the Gaussian self-similar jet with U_c = 6.9 sqrt(T / rho) / x. The power 6 of the passage between the two is
    a choice of smoothing, not a measured constant: it leaves 99 % of the exit speed at 4 D and 90 % at 6 D, and meets
    the decay law within 1 % at 10 D. The water is still upstream of the disk; the slow inflow towards the jet's sides
    is left out, and so are walls (see `wakewise.wake.wall_jet`) and the time a jet needs to
    arrive.
    """

    water_density_kg_m3: float = FRESH_WATER_KG_M3
    # Radius of half the centreline speed over distance. 0.096 is N. R. Panchapakesan and J. L. Lumley, J. Fluid Mech.
    # 246 (1993) 197, doi 10.1017/S0022112093000096; H. J. Hussein, S. P. Capp and W. K. George, J. Fluid Mech. 258
    # (1994) 31, doi 10.1017/S002211209400323X, have 0.094 to 0.102. For a propeller's jet see `of_propeller`.
    half_width_slope: float = 0.096

    def __post_init__(self) -> None:
        check_ranges(self, "round jet", water_density_kg_m3=(900.0, 1100.0), half_width_slope=(0.05, 0.4))

    @classmethod
    def of_propeller(cls) -> RoundJet:
        """The jet of a free propeller, which swirl makes about twice as wide: profile exp(-22.2 (r/x)^2).

        M. Fuehrer and K. Roemisch, 24th International Navigation Congress (PIANC), Leningrad 1977. The momentum flux
        along the axis is still taken as T / rho at every distance, which swirl's low pressure makes true only far off.
        """
        return cls(half_width_slope=float(np.sqrt(np.log(2.0) / 22.2)))

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "jet"

    @property
    def width_slope(self) -> float:
        """Slope s of the 1/e width: the half width over sqrt(ln 2)."""
        return float(self.half_width_slope / np.sqrt(np.log(2.0)))

    @property
    def decay(self) -> float:
        """K of U_c = K sqrt(T / rho) / x far away: sqrt(2 / pi) / s, from the momentum of a Gaussian profile."""
        return float(np.sqrt(2.0 / np.pi) / self.width_slope)

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = kernels.jet_parameters(self.decay, 0.0, 0.0, self.width_slope, True, self.water_density_kg_m3)
        return JetLaw(kernels.ROUND_JET, numbers)


@dataclass(frozen=True, kw_only=True)
class GaussianJet(AxialJet):
    """A jet with a virtual origin and a Gaussian profile from the disk on; meant to be fitted to a measured flow.

        U = K sqrt(T / rho) / (x + x0) exp(-r^2 / b^2),   b = b0 + s x,   s = half_width_slope / sqrt(ln 2)

    Lengths at the disk are in disk diameters D, so that a fit made with one disk can be carried to another. Momentum is
    not conserved by construction: `momentum_ratio` tells what the numbers carry.
    """

    decay: float  # K; a round jet has 6.5 to 7.0 (Hussein et al. 1994), one widened by swirl about half of it.
    # virtual_origin_diameters, start_width_diameters: X0 / D and b0 / D.
    virtual_origin_diameters: float
    start_width_diameters: float
    half_width_slope: float  # growth of the radius of half the centreline speed
    water_density_kg_m3: float = FRESH_WATER_KG_M3

    def __post_init__(self) -> None:
        check_ranges(
            self,
            "jet with virtual origin",
            decay=(0.01, 100.0),
            virtual_origin_diameters=(0.01, 100.0),
            start_width_diameters=(0.0, 10.0),
            half_width_slope=(0.001, 1.0),
            water_density_kg_m3=(900.0, 1100.0),
        )

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "jet-fitted"

    @property
    def width_slope(self) -> float:
        """Slope s of the 1/e width: the half width over sqrt(ln 2)."""
        return float(self.half_width_slope / np.sqrt(np.log(2.0)))

    def momentum_ratio(self, distance_diameters: ArrayLike) -> Array:
        """Momentum flux through a plane across the jet over T / rho, at distances in disk diameters."""
        x = np.asarray(distance_diameters, dtype=np.float64)
        width = self.start_width_diameters + self.width_slope * x
        return np.asarray(0.5 * np.pi * (self.decay * width / (x + self.virtual_origin_diameters)) ** 2)

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = kernels.jet_parameters(
            self.decay,
            self.virtual_origin_diameters,
            self.start_width_diameters,
            self.width_slope,
            False,
            self.water_density_kg_m3,
        )
        return JetLaw(kernels.ROUND_JET, numbers)


@dataclass(frozen=True)
class PaperJet(AxialJet):
    """The paper's proxy exactly as printed; its constants are not fields, so that nothing can change them.

    v = sqrt(T / (2 pi rho A)) (r_ref^2 / r^2) n cos^4(theta) for theta <= 45 deg, else 0; r is the distance from the
    disk's centre and theta the angle off the jet's direction n. As printed it is several times too fast near the disk;
    that is left as it is. At the disk's centre itself, where theta has no value, the speed is taken as 0.
    """

    reference_distance_m: ClassVar[float] = 1.0
    water_density_kg_m3: ClassVar[float] = FRESH_WATER_KG_M3
    half_angle_rad: ClassVar[float] = np.pi / 4

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "paper"

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = kernels.cone_parameters(
            1.0, self.reference_distance_m, 2.0, 4.0, 0.0, self.half_angle_rad, 0.0, self.water_density_kg_m3
        )
        return JetLaw(kernels.PRINTED_CONE, numbers)


@dataclass(frozen=True, kw_only=True)
class PowerJet(AxialJet):
    """A cone with free numbers; the defaults are the paper's, so that each model states only what it changes."""

    label: str  # name used in scenario files and tables
    gain: float = 1.0  # G. The reference distance is one number with it (G r_ref^p), so it is fixed and never fitted.
    # decay_power, cosine_power: P and m.
    decay_power: float = 2.0
    cosine_power: float = 4.0
    soft_radius_m: float = 0.0  # r_s, which keeps the speed finite at the disk
    half_angle_rad: float = np.pi / 4  # theta_c, the middle of the edge
    # Full width of the edge, 0 for a sharp one. Within it s = 3 t^2 - 2 t^3, with t linear in cos(theta) from the outer
    # to the inner end: the first derivative is continuous.
    edge_width_rad: float = 0.0
    water_density_kg_m3: float = FRESH_WATER_KG_M3

    reference_distance_m: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        what = f"wake model {self.label}"
        check_ranges(
            self,
            what,
            gain=(1e-6, 1e3),
            decay_power=(0.0, 10.0),
            cosine_power=(0.0, 1000.0),
            soft_radius_m=(0.0, 10.0),
            half_angle_rad=(0.01, np.pi / 2),
            edge_width_rad=(0.0, np.pi / 2),
            water_density_kg_m3=(900.0, 1100.0),
        )
        if self.edge_width_rad > 0.0 and not (
            0.5 * self.edge_width_rad <= self.half_angle_rad <= 0.5 * (np.pi - self.edge_width_rad)
        ):
            raise InputError(
                f"{what}: edge_width_rad {self.edge_width_rad:g} about half_angle_rad {self.half_angle_rad:g}, "
                "the edge must lie between 0 and 90 deg"
            )

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return self.label

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = kernels.cone_parameters(
            self.gain,
            self.reference_distance_m,
            self.decay_power,
            self.cosine_power,
            self.soft_radius_m,
            self.half_angle_rad,
            self.edge_width_rad,
            self.water_density_kg_m3,
        )
        plain = (self.decay_power, self.cosine_power, self.soft_radius_m, self.edge_width_rad) == (2.0, 4.0, 0.0, 0.0)
        return JetLaw(kernels.PRINTED_CONE if plain else kernels.POWER_CONE, numbers)

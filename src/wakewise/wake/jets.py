"""Two beliefs about a thruster's jet: the paper's cone as printed, and a turbulent round jet that conserves momentum.

Both give the speed along the jet's own direction. Speed grows with the square root of thrust, so a model is a speed per
square root of newton. The jet leaves opposite to the force on the vehicle: T > 0 along -axis, T < 0 along +axis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.interfaces import WakeModel

FRESH_WATER_KG_M3 = 998.0
"""Fresh water at 20-21 deg C, the density of the paper (CRC Handbook of Chemistry and Physics: 998.2 at 20 deg C)."""


class AxialJet(ABC):
    """A jet whose water moves along the jet's direction everywhere downstream of the disk, and is still upstream."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name used in scenario files and tables."""

    @abstractmethod
    def split_speed(self, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array) -> Array:
        """Speed per square root of newton at every point, for either sign of every thrust.

        Parameters
        ----------
        points_W_m : ndarray, shape (n, 3)
        origins_W_m, axes_W : ndarray, shape (m, 3)
            Centre of each thruster's disk and unit axis of its *force* for T > 0.
        areas_m2 : ndarray, shape (m,)

        Returns
        -------
        ndarray, shape (n, 2 m), in m/s/sqrt(N)
            Column i: thruster i with T > 0, whose jet goes along -axis. Column m + i: T < 0, along +axis.
        """

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton, shape (m, n, 3): see `wakewise.interfaces.WakeModel`."""
        force_axes = -np.asarray(directions_W, dtype=np.float64)
        speed = self.split_speed(points_W_m, origins_W_m, force_axes, area_m2)[:, : len(force_axes)]
        return np.asarray(speed.T[:, :, None] * np.asarray(directions_W, dtype=np.float64)[:, None, :])


@dataclass(frozen=True)
class PaperJet(AxialJet):
    """The paper's proxy exactly as printed; its constants are not fields, so that nothing can change them.

    v = sqrt(T / (2 pi rho A)) (r_ref^2 / r^2) n cos^4(theta) for theta <= 45 deg, else 0; r is the distance from the
    disk's centre and theta the angle off the jet's direction n. As printed it is several times too fast near the disk;
    that is left as it is. At the disk's centre itself, where theta has no value, the speed is taken as 0.
    """

    reference_distance_m: ClassVar[float] = 1.0
    water_density_kg_m3: ClassVar[float] = 998.0
    half_angle_rad: ClassVar[float] = np.pi / 4

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "paper"

    def split_speed(self, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array) -> Array:
        """Speed per square root of newton, shape (n, 2 m): see `AxialJet`."""
        speed = np.zeros((len(points_W_m), 2 * len(origins_W_m)))
        gain = self.reference_distance_m**2 / np.sqrt(2 * np.pi * self.water_density_kg_m3 * areas_m2)
        _fill_paper(points_W_m, origins_W_m, axes_W, gain, speed)
        return speed


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
    is left out, and so are swirl, walls and the time a jet needs to arrive.

    Parameters
    ----------
    water_density_kg_m3 : float
    half_width_slope : float
        Radius of half the centreline speed over distance. 0.096 is N. R. Panchapakesan and J. L. Lumley, J. Fluid Mech.
        246 (1993) 197, doi 10.1017/S0022112093000096; H. J. Hussein, S. P. Capp and W. K. George, J. Fluid Mech. 258
        (1994) 31, doi 10.1017/S002211209400323X, have 0.094 to 0.102. A propeller's swirl widens the jet to about 0.18.
    """

    water_density_kg_m3: float = FRESH_WATER_KG_M3
    half_width_slope: float = 0.096

    def __post_init__(self) -> None:
        for field, low, high in (
            ("water_density_kg_m3", 900.0, 1100.0),
            ("half_width_slope", 0.05, 0.4),
        ):
            value = getattr(self, field)
            if not low <= value <= high:
                raise InputError(f"round jet: {field} {value:g}, allowed {low:g} to {high:g}")

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "jet"

    @property
    def width_slope(self) -> float:
        """Slope s of the 1/e width: the half width over sqrt(ln 2)."""
        return float(self.half_width_slope / np.sqrt(np.log(2.0)))

    def split_speed(self, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array) -> Array:
        """Speed per square root of newton, shape (n, 2 m): see `AxialJet`."""
        speed = np.zeros((len(points_W_m), 2 * len(origins_W_m)))
        exit_speed = 1.0 / np.sqrt(self.water_density_kg_m3 * areas_m2)
        radius = np.sqrt(areas_m2 / np.pi)
        _fill_round(points_W_m, origins_W_m, axes_W, exit_speed, radius, self.width_slope, speed)
        return speed


def wake_model(name: str) -> WakeModel:
    """Wake model of that name.

    Raises
    ------
    InputError
        If there is no such model.
    """
    models: dict[str, WakeModel] = {model.name: model for model in (PaperJet(), RoundJet())}
    if name not in models:
        raise InputError(f"wake model '{name}': unknown, allowed: {', '.join(sorted(models))}")
    return models[name]


# A point lies downstream of one of a thruster's two possible jets and upstream of the other, so one pass over points
# and thrusters fills both columns: the sign of the coordinate along the force axis says which.


@njit(cache=True)
def _fill_paper(points, origins, axes, gain, speed):  # type: ignore[no-untyped-def]
    m = origins.shape[0]
    for j in range(points.shape[0]):
        for i in range(m):
            x = points[j, 0] - origins[i, 0]
            y = points[j, 1] - origins[i, 1]
            z = points[j, 2] - origins[i, 2]
            r2 = x * x + y * y + z * z
            along = x * axes[i, 0] + y * axes[i, 1] + z * axes[i, 2]
            along2 = along * along
            # cos^2(theta) >= 1/2 is theta <= 45 deg.
            if r2 > 0.0 and along2 >= 0.5 * r2:
                cos2 = along2 / r2
                speed[j, i if along < 0.0 else m + i] = gain[i] / r2 * cos2 * cos2


@njit(cache=True)
def _fill_round(points, origins, axes, exit_speed, radius, slope, speed):  # type: ignore[no-untyped-def]
    m = origins.shape[0]
    for j in range(points.shape[0]):
        for i in range(m):
            x = points[j, 0] - origins[i, 0]
            y = points[j, 1] - origins[i, 1]
            z = points[j, 2] - origins[i, 2]
            along = x * axes[i, 0] + y * axes[i, 1] + z * axes[i, 2]
            distance = abs(along)
            b = slope * distance
            r2 = x * x + y * y + z * z - along * along
            # Beyond R + 4.3 b less than 1e-8 of the centreline speed is left: call it nothing.
            reach = radius[i] + 4.3 * b
            if distance > 0.0 and r2 < reach * reach:
                R2, b2 = radius[i] * radius[i], b * b
                xi2 = 0.5 * b2 / R2
                slowing2 = np.cbrt(1.0 + xi2 * xi2 * xi2)
                # pi/8 - 1/2 < 0, yet the root is real: b^2 <= 2 R^2 slowing^2 always.
                a = np.sqrt(R2 * slowing2 + (np.pi / 8.0 - 0.5) * b2) - np.sqrt(np.pi / 8.0) * b
                outside = np.sqrt(max(r2, 0.0)) - a
                fade = np.exp(-outside * outside / b2) if outside > 0.0 else 1.0
                speed[j, i if along < 0.0 else m + i] = exit_speed[i] / np.sqrt(slowing2) * fade

"""Cone models of a jet: the paper's proxy with cos^4 attenuation as printed, and the family with free numbers.

    v = G sqrt(|T| / (2 pi rho A)) (r_ref / sqrt(r^2 + r_s^2))^p cos^m(theta) s(theta)

r is the distance from the disk's centre, theta the angle off the jet's axis, s the edge of the cone: 1 inside its half
angle, 0 outside, sharp or smooth in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.wake.jets import POWER_CONE, PRINTED_CONE, AxialJet, JetLaw, check_ranges, cone_parameters


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
        numbers = cone_parameters(
            1.0, self.reference_distance_m, 2.0, 4.0, 0.0, self.half_angle_rad, 0.0, self.water_density_kg_m3
        )
        return JetLaw(PRINTED_CONE, numbers)


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
        numbers = cone_parameters(
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
        return JetLaw(PRINTED_CONE if plain else POWER_CONE, numbers)

"""Closure of a turbulent round jet made of impulse parcels: their growth and advection.

A parcel grows with its travelled path and moves at a share eta of the water's speed at its centre:

    core      sigma from D/(2 sqrt 2) to D/2 over the core's length,   eta = (D/(2 sqrt 2) / sigma)^2
    beyond    dsigma/dpath = spread,                                    eta = 1/2

A row of such parcels carries the thrust's momentum at every distance. Without swirl: core of 6.27 D, spread 0.0798; on
the axis the exit speed sqrt(T/(rho A)) in the core (Albertson et al. 1950: 6.2 D) and 7.07 sqrt(T/rho)/x beyond, half
width 0.094 x (Hussein, Capp and George 1994, doi 10.1017/S002211209400323X). A propeller's jet is about twice as wide
and its core 2.6 D long (Fuehrer and Roemisch 1977, Blaauw and van de Kaa 1978: profiles exp(-22.2 (r/x)^2) and
exp(-15.4 (r/x)^2), sigma 0.15 and 0.18 x).

*Current.* A jet starts with the velocity of its disk and takes on the current's by entrainment: of the volume flux Q
the share Q0/Q came through the disk, eta in the core and D/(4 sigma) beyond. A strong cross-current adds 2 b U per
length, b = 2 sigma the top-hat radius, U the current across the row; the larger of the two counts (projected area
entrainment: J. H. W. Lee and V. Cheung 1990, J. Environ. Eng. 116, 1085, from memory). Bent over, a jet spreads as a
line puff: 2 sigma grows by 0.34 of the path (J. H. W. Lee and V. H. Chu, Turbulent Jets and Plumes: A Lagrangian
Approach, Kluwer 2003). In between both are weighted by the motion along and across the row.

*Width.* `JetSpreading.of_width` interpolates between both widths. Momentum does not depend on the spread; the volume
flux is Q/Q0 = 4 spread x/D, 0.32 x/D without swirl.

*Life.* A parcel slower than its fed row, f = u / (u0 (D/2)/sigma) < 1, grows by the share 1 - (1 - 1/life) (1 - f) of
what it otherwise would: the water of a stopped thruster decays as in the lattice as far as `water` says.

*Wakes.* A hull's drag F leaves a deficit of impulse F/rho per second. Far behind, sigma = 1.14 theta (x/theta)^(1/3)
and the deficit on the axis is 0.77 U (x/theta)^(-2/3), theta the momentum thickness, F = 2 pi rho U^2 theta^2 (P. B. V.
Johansson, W. K. George and M. J. Gourlay 2003, Phys. Fluids 15, 603, doi 10.1063/1.1536976; constants from memory, 0.77
= 1/1.14^2). As growth: dsigma/dt = 0.494 of the deficit on the axis, twelve times a jet's 0.0399. Since the deficit
falls as 1/sigma^2, sigma^3 grows linearly in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array

PUFF_SPREAD = 0.34 / 2
FIRST_D = 1 / math.sqrt(8)
"""Sigma at the disk over its diameter."""
CORE_END_D = 0.5
"""Sigma at the core's end over the diameter."""
WAKE_ENTRAINMENT = 1.14**3 / 3
"""Growth of a wake's sigma with time over the deficit on its axis."""


@dataclass(frozen=True)
class JetSpreading:
    """Length of the core in diameters, and growth of sigma with the path beyond it."""

    core_D: float
    spread: float

    @property
    def core_spread(self) -> float:
        """Growth of sigma with the path in the core."""
        return (CORE_END_D - FIRST_D) / self.core_D

    @property
    def half_width_growth(self) -> float:
        """Growth of the half width, where the speed is half of the axis', with the path beyond the core."""
        return self.spread * _HALF_WIDTHS

    @classmethod
    def of_width(cls, half_width_growth: float) -> JetSpreading:
        """The jet whose half width grows so with the path: `PLAIN` at 0.094, `SWIRLING` at 0.1766.

        The far cone starts at the disk without swirl and 0.73 D before it for a propeller's jet, as their two cores
        say; in between the place of its tip goes evenly with the spread. Measured free jets lie between 0.086 (I.
        Wygnanski and H. Fiedler 1969, J. Fluid Mech. 38, 577) and 0.18.
        """
        spread = half_width_growth / _HALF_WIDTHS
        tip_D = (spread - PLAIN.spread) / (SWIRLING.spread - PLAIN.spread) * _tip_D(SWIRLING)
        return cls(core_D=CORE_END_D / spread + tip_D, spread=spread)


def _tip_D(spreading: JetSpreading) -> float:
    """Where the far cone of a jet has its tip, in diameters down the jet."""
    return spreading.core_D - CORE_END_D / spreading.spread


_HALF_WIDTHS = math.sqrt(2 * math.log(2))
"""Half width of a Gaussian over its sigma."""
_PLAIN_SPREAD = 0.094 / _HALF_WIDTHS
PLAIN = JetSpreading(core_D=CORE_END_D / _PLAIN_SPREAD, spread=_PLAIN_SPREAD)
"""Without swirl: beyond the core sigma is 0.0798 of the whole path."""

SWIRLING = JetSpreading(core_D=2.6, spread=0.15)
"""A propeller's jet: wide and soon slow. Its turning about the axis is left out; what it does to the width is in."""


def first_sigma_m(diameter_m: Array) -> Array:
    """Size of a parcel at its disk."""
    return diameter_m * FIRST_D


def disk_share(sigma_m: Array, diameter_m: Array) -> Array:
    """Share Q0/Q of the water at a parcel that came through the disk, from 1 at the disk to 0 far down the jet."""
    core = sigma_m < CORE_END_D * diameter_m
    share: Array = np.where(core, (FIRST_D * diameter_m / sigma_m) ** 2, 0.25 * diameter_m / sigma_m)
    return np.minimum(share, 1.0)

"""How a jet's parcels grow and travel: the closure that makes a row of them a turbulent round jet.

A parcel grows with the path that it has travelled and is carried at a share eta of the water's speed at its centre:

    core      sigma from D/(2 sqrt 2) to D/2 over the core's length,   eta = (D/(2 sqrt 2) / sigma)^2
    beyond    dsigma/dpath = spread,                                    eta = 1/2

With these a row of parcels carries the thrust's momentum at every distance. A jet without swirl has a core of 6.27 D
and spreads by 0.0798: on the axis it has the exit speed sqrt(T/(rho A)) in the core (Albertson et al. 1950: 6.2 D
long) and 7.07 sqrt(T/rho)/x beyond, with a half width of 0.094 x (Hussein, Capp and George 1994,
doi 10.1017/S002211209400323X). A propeller's swirling jet is about twice as wide and its core 2.6 D long (Fuehrer and
Roemisch 1977, Blaauw and van de Kaa 1978: profiles exp(-22.2 (r/x)^2) and exp(-15.4 (r/x)^2), sigma 0.15 and 0.18 x).

In a current, a jet's water starts with the velocity of its disk and takes on the current's with what it entrains: of
the volume flux Q at a place the share Q0/Q came through the disk, eta in the core and D/(4 sigma) beyond where the jet
entrains by its own motion only. A strong current blows more into its side than it would draw in: 2 b U across per
length, b = 2 sigma the top-hat radius and U the current across the row; the larger of the two counts (projected area
entrainment: J. H. W. Lee and V. Cheung 1990, J. Environ. Eng. 116, 1085, and the book below; both from memory). Once
bent over, so that it moves sideways to its own length, a jet spreads as a line puff does: the radius 2 sigma of a
top-hat profile grows by 0.34 of the path (J. H. W. Lee and V. H. Chu, Turbulent Jets and Plumes: A Lagrangian Approach,
Kluwer 3). In between both add up, each weighted with how much of the motion is along the row and across it.

*Width.* A world may have jets of any width between those two (`JetSpreading.of_width`). Momentum is kept at any of
them, since eta and not the spread carries it, and the volume flux follows: Q/Q0 = 4 spread x/D, 0.32 x/D without swirl.

*Life.* What a thruster leaves in the water when it stops dies sooner here than in the lattice
(`wakewise.simulation.water.water`). A parcel that is slower than its row would be if that were still fed, f = u / (u0
(D/2)/sigma) below 1, grows by a share 1 - (1 - 1/life) (1 - f) of what it otherwise would: by 1/life once it is left to
itself. A fed jet and one that is bent over are not touched.

*Wakes.* A hull's drag F leaves a deficit of impulse F/rho per second. Far behind it, sigma = 1.14 theta (x/theta)^(1/3)
and the deficit on the axis is 0.77 U (x/theta)^(-2/3), theta the momentum thickness, F = 2 pi rho U^2 theta^2 (P. B. V.
Johansson, W. K. George and M. J. Gourlay 2003, Phys. Fluids 15, 603, doi 10.1063/1.1536976; its two constants from
memory: they satisfy 0.77 = 1/1.14^2, as momentum asks). The same as a growth: dsigma/dt = 0.494 of the deficit on the
axis, twelve times a jet's 0.0399, so that a wake can be no jet of the same closure. Since the deficit falls as
1/sigma^2 while impulse lasts, sigma^3 grows evenly with time, by three times 0.494 of what it began with.
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


def carried_share(sigma_m: Array, diameter_m: Array) -> Array:
    """Share eta of the water's speed at its centre at which a parcel moves on."""
    eta: Array = np.where(sigma_m < CORE_END_D * diameter_m, (FIRST_D * diameter_m / sigma_m) ** 2, 0.5)
    return eta


def disk_share(sigma_m: Array, diameter_m: Array) -> Array:
    """Share Q0/Q of the water at a parcel that came through the disk, from 1 at the disk to 0 far down the jet."""
    core = sigma_m < CORE_END_D * diameter_m
    share: Array = np.where(core, (FIRST_D * diameter_m / sigma_m) ** 2, 0.25 * diameter_m / sigma_m)
    return np.minimum(share, 1.0)


def share_left(sigma_m: Array, grown_m: Array, diameter_m: Array, across_m_s: Array, dt_s: float) -> Array:
    """Part of a parcel's disk water, shape (n,), that is not yet diluted after a step in which it grew.

    The smaller of what its own entrainment leaves and of what a current across the row, shape (n,), does: dQ = 2 b U
    times the length of row that passes leaves exp(-U dt / (pi sigma)).
    """
    own = disk_share(grown_m, diameter_m) / disk_share(sigma_m, diameter_m)
    blown = np.exp(-across_m_s * dt_s / (math.pi * 0.5 * (sigma_m + grown_m)))
    left: Array = np.minimum(own, blown)
    return left


def travel(
    sigma_m: Array,
    diameter_m: Array,
    speed_m_s: Array,
    dt_s: float | Array,
    spreading: JetSpreading = PLAIN,
    spread: float | Array | None = None,
) -> tuple[Array, Array]:
    """Path that parcels cover in dt_s and their size after it, shapes (n,), given the water's speed at their centres.

    Within the step the speed is taken to fall with growth as it does along a steady jet (constant in the core, as
    1/sigma beyond), which can be integrated exactly; so steps of a good part of a diameter stay accurate. `spread`
    takes the place of the spreading's own beyond the core.
    """
    wide = spreading.spread if spread is None else spread
    first = FIRST_D * diameter_m
    end = CORE_END_D * diameter_m
    core = sigma_m < end
    # Core: dsigma/dt = c u (first/sigma)^2, so sigma^3 grows linearly, up to the core's end.
    rate = 3 * spreading.core_spread * speed_m_s * first**2
    cubed = sigma_m**3 + rate * dt_s
    beyond = core & (cubed > end**3)
    in_core = np.cbrt(np.minimum(cubed, end**3))
    left_s = np.where(beyond, (cubed - end**3) / np.maximum(rate, 1e-30), np.where(core, 0.0, dt_s))
    start = np.where(core, in_core, sigma_m)
    # Beyond: dsigma/dt = k u/2 with u falling as 1/sigma, so sigma^2 grows linearly.
    after = np.sqrt(start**2 + wide * start * speed_m_s * left_s)
    path = np.where(core, (start - sigma_m) / spreading.core_spread, 0.0) + (after - start) / wide
    return path, after


def lasting_spread(
    spread: float, sigma_m: Array, diameter_m: Array, speed_m_s: Array, start_m_s: Array, life: float
) -> Array:
    """Growth of sigma with the path, shape (n,), of parcels of a row that may no longer be fed; see the top, *Life*."""
    fed = start_m_s * np.minimum(1.0, CORE_END_D * diameter_m / sigma_m)
    lost = np.maximum(1.0 - speed_m_s / np.where(fed > 0.0, fed, np.inf), 0.0) * (fed > 0.0)
    wide: Array = spread * (1.0 - (1.0 - 1.0 / life) * lost)
    return wide


def wake_sigma_m(sigma_m: Array, first_m: Array, deficit_m_s: Array, dt_s: float, spread: float = 0.0) -> Array:
    """Size of a wake's parcels, shape (n,), after dt_s, given the wake's first size and its first deficit on the axis.

    `spread` is what `travel` lets them grow by already, on the path that the deficit itself carries them.
    """
    own = WAKE_ENTRAINMENT - 0.5 * spread
    grown: Array = np.cbrt(sigma_m**3 + 3 * own * deficit_m_s * first_m**2 * dt_s)
    return grown


def across_row_m_s(own_m_s: Array, past_m_s: Array) -> Array:
    """Speed of the water past the disk across the row, shape (n,); arguments as in `bent_spread`."""
    row = own_m_s + past_m_s
    along = np.einsum("ni,ni->n", row, past_m_s) ** 2 / np.maximum(np.einsum("ni,ni->n", row, row), 1e-20)
    across: Array = np.sqrt(np.maximum(np.einsum("ni,ni->n", past_m_s, past_m_s) - along, 0.0))
    return across


def bent_spread(spread: float, own_m_s: Array, past_m_s: Array) -> Array:
    """Growth of sigma with the path, shape (n,), of parcels that lie in a row which may be bent over.

    - `spread`: of a jet that moves along its own length.
    - `own_m_s`, shape (n, 3): a parcel's own motion through the water.
    - `past_m_s`, shape (n, 3): motion of the water past the disk; the row runs along the sum of both.
    """
    row = own_m_s + past_m_s
    along = np.einsum("ni,ni->n", row, own_m_s) ** 2
    whole = np.einsum("ni,ni->n", row, row) * np.einsum("ni,ni->n", own_m_s, own_m_s)
    sine2 = 1.0 - along / np.maximum(whole, 1e-30)
    sine2 = np.where(whole > 1e-20, np.clip(sine2, 0.0, 1.0), 0.0)
    wide: Array = spread * np.sqrt(1.0 - sine2) + max(PUFF_SPREAD, spread) * np.sqrt(sine2)
    return wide

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.arrays import Array

PUFF_SPREAD = 0.34 / 2
FIRST_D = 1 / math.sqrt(8)
"""Sigma at the disk over its diameter."""
CORE_END_D = 0.5
"""Sigma at the core's end over the diameter."""


@dataclass(frozen=True)
class Spreading:
    """Length of the core in diameters, and growth of sigma with the path beyond it."""

    core_D: float
    spread: float

    @property
    def core_spread(self) -> float:
        """Growth of sigma with the path in the core."""
        return (CORE_END_D - FIRST_D) / self.core_D


_HALF_WIDTH = 0.094 / math.sqrt(2 * math.log(2))
PLAIN = Spreading(core_D=CORE_END_D / _HALF_WIDTH, spread=_HALF_WIDTH)
"""Without swirl: beyond the core sigma is 0.0798 of the whole path."""

SWIRLING = Spreading(core_D=2.6, spread=0.15)
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
    spreading: Spreading = PLAIN,
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


def across_row_m_s(own_m_s: Array, past_m_s: Array) -> Array:
    """Speed of the water past the disk across the row, shape (n,); arguments as in `bent_spread`."""
    row = own_m_s + past_m_s
    along = np.einsum("ni,ni->n", row, past_m_s) ** 2 / np.maximum(np.einsum("ni,ni->n", row, row), 1e-20)
    across: Array = np.sqrt(np.maximum(np.einsum("ni,ni->n", past_m_s, past_m_s) - along, 0.0))
    return across


def bent_spread(spread: float, own_m_s: Array, past_m_s: Array) -> Array:
    """Growth of sigma with the path, shape (n,), of parcels that lie in a row which may be bent over.

    Parameters
    ----------
    spread : float
        Of a jet that moves along its own length.
    own_m_s : ndarray, shape (n, 3)
        A parcel's own motion through the water.
    past_m_s : ndarray, shape (n, 3)
        Motion of the water past the disk; the row runs along the sum of both.
    """
    row = own_m_s + past_m_s
    along = np.einsum("ni,ni->n", row, own_m_s) ** 2
    whole = np.einsum("ni,ni->n", row, row) * np.einsum("ni,ni->n", own_m_s, own_m_s)
    sine2 = 1.0 - along / np.maximum(whole, 1e-30)
    sine2 = np.where(whole > 1e-20, np.clip(sine2, 0.0, 1.0), 0.0)
    wide: Array = spread * np.sqrt(1.0 - sine2) + max(PUFF_SPREAD, spread) * np.sqrt(sine2)
    return wide

"""Reference implementation in NumPy of the closure that `parcel_advection` compiles."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.simulation.water.round_jet_closure import (
    CORE_END_D,
    FIRST_D,
    PLAIN,
    PUFF_SPREAD,
    WAKE_ENTRAINMENT,
    JetSpreading,
    disk_share,
)


def carried_share(sigma_m: Array, diameter_m: Array) -> Array:
    """Share eta of the water's speed at its centre at which a parcel moves on."""
    eta: Array = np.where(sigma_m < CORE_END_D * diameter_m, (FIRST_D * diameter_m / sigma_m) ** 2, 0.5)
    return eta


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

"""Strata of a scenario: which trim a seed flies, and from which side the current comes.

A Latin square: three seeds in a row have every trim and every side once, nine have every pair. It is turned from one
scenario to the next, so that not all first seeds are heavy vehicles in a current towards the target.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

Side = Literal["towards", "abeam", "away"]
SIDES: tuple[Side, ...] = get_args(Side)
"""Where the current carries the wash of a vehicle beside the target: onto it, past it, away from it."""

HALF_SIDE_RAD = np.pi / 4
"""A side reaches this far to both of its middle, so that the sides together are all directions."""


def stratum(trims: tuple[str, ...], turned: int, seed: int) -> tuple[str, Side]:
    """Trim and side of a seed (from 1) of a scenario whose square is turned by a number of sides."""
    place = seed - 1
    return trims[place % len(trims)], SIDES[(place + place // len(SIDES) + turned) % len(SIDES)]


def current_W_m_s(side: Side, azimuth_rad: float, speed_m_s: float, rng: np.random.Generator) -> tuple[float, ...]:
    """Level current that comes from a side of a vehicle at an azimuth of the target, north, east and down.

    Parameters
    ----------
    side : Side
    azimuth_rad : float
        Where the vehicle is, seen from the target.
    speed_m_s : float
    rng : numpy Generator
        Draws the angle within the side, and of `abeam` which of the two.
    """
    middle = {"towards": azimuth_rad + np.pi, "away": azimuth_rad, "abeam": azimuth_rad + 0.5 * np.pi}[side]
    off, other = rng.uniform(-HALF_SIDE_RAD, HALF_SIDE_RAD), rng.uniform() < 0.5
    heading = middle + off + (np.pi if side == "abeam" and other else 0.0)
    return (round(float(speed_m_s * np.cos(heading)), 6), round(float(speed_m_s * np.sin(heading)), 6), 0.0)

"""Where orbits are begun: as they are listed, or each at its view downstream of the target.

A vehicle that waits, approaches or climbs upstream of the target has its wash carried on to it, and what was blown
there is still felt a quarter of a minute later, on the far side of the orbit (docs/research-log/0040). Settling,
approach, climbs and the first half of each orbit, which goes up against the current, then lie where the wash is carried
away. Views are the same; only which of a circle's views is its first changes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.scene.missions.orbit import Orbit

LEAST_CURRENT_M_S = 0.01
"""A slower current has no order: it needs the better part of a minute from the camera to the target, longer than wash
is felt."""


def order_downstream_first(orbits: tuple[Orbit, ...], current_W_m_s: Array) -> tuple[Orbit, ...]:
    """The same orbits, each begun at the first of its views from downstream on, in the direction in which it is listed.

    Parameters
    ----------
    orbits : tuple of Orbit
    current_W_m_s : ndarray, shape (3,)
        Of which the level part counts; below `LEAST_CURRENT_M_S` orbits begin as listed.

    Returns
    -------
    tuple of Orbit
        With the orbits' own azimuths, but for whole turns; each goes on from where the one before ended.
    """
    north, east = float(current_W_m_s[0]), float(current_W_m_s[1])
    if math.hypot(north, east) < LEAST_CURRENT_M_S:
        return orbits
    downstream = math.atan2(east, north)
    begun = []
    for turns, orbit in enumerate(orbits):
        on = np.sort(np.mod(orbit.azimuths_rad - downstream, 2 * math.pi))
        begun.append(replace(orbit, azimuths_rad=downstream + 2 * math.pi * turns + on))
    return tuple(begun)

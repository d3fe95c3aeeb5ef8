"""What two jets that cross at right angles become: speed and width along the bisector behind the crossing.

Momentum alone says: twice cos 45 deg, sqrt 2 times that of one jet, along the bisector, and nothing sideways.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.lattice.run import LatticeRun

AWAY_D = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Distances behind the crossing at which the mean flow is looked at."""

_REACH_D = 4.0
_STEP_D = 0.05


def crossing_figures(run: LatticeRun) -> dict[str, Any]:
    """Mean flow on the bisector of a jet along +x and one along +y, at `AWAY_D` from where their axes cross.

    Returns
    -------
    dict
        speed: along the bisector, over U0. half_height_D and half_width_D: how far out of the jets' plane and in it
        half of that speed is found; None where it is not within 4 D or the box. rise: fastest speed out of the plane
        within 2 D of the crossing, over U0.

    Raises
    ------
    InputError
        If the run's case is not such a pair.
    """
    jets = run.case.jets
    if [(jet.axis, jet.along) for jet in jets] != [("x", 1), ("y", 1)]:
        raise InputError(f"lattice case {run.case.name!r}: not a jet along +x and one along +y, as the figures need")
    centre = np.array([jets[1].position_D[0], jets[0].position_D[1], jets[0].position_D[2]])
    means = run.means()[1:4]
    along = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    across = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    up = np.array([0.0, 0.0, 1.0])

    def at(points_D: Array, direction: Array) -> Array:
        cells = ((points_D - run.case.low_D) * run.case.cells_per_D - 0.5).T
        parts = [map_coordinates(mean, cells, order=1, cval=np.nan) for mean in means]
        return np.asarray(direction @ np.stack(parts))

    out = np.arange(0.0, _REACH_D, _STEP_D)
    found: dict[str, list[float | None]] = {"speed": [], "half_height_D": [], "half_width_D": []}
    for away in AWAY_D:
        here = centre + away * along
        found["speed"].append(float(at(here[None], along)[0]))
        for name, side in (("half_height_D", up), ("half_width_D", across)):
            profile = np.mean([at(here + sign * out[:, None] * side, along) for sign in (1, -1)], axis=0)
            below = np.flatnonzero(profile < 0.5 * profile[0])
            found[name].append(float(out[below[0]]) if len(below) else None)
    x, y, z = (np.abs(c - m) for c, m in zip(run.cell_centres_D(), centre, strict=True))
    near = np.ix_(x < 2.0, y < 2.0, z < 2.0)
    return {"away_D": list(AWAY_D), **found, "rise": float(np.abs(means[2][near]).max())}

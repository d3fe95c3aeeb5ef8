"""Solid bodies among the cells of a lattice: what leaves the water towards them comes back half-way.

The wall lies between a cell of water and a cell of the body, as a wall does on a face of the box (`faces`). Before a
step each population that would go into the body is put, turned round, where the water will pull it from. Cells of the
body keep nothing: the step computes them as any other, and then they are emptied.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import BoolArray
from wakewise.simulation.lattice.cases import LatticeCase
from wakewise.simulation.lattice.stencil import OPPOSITE, VELOCITIES, Lattice, origin, plane_size


def solid_cells(case: LatticeCase) -> BoolArray:
    """Cells of a case, shape (nx, ny, nz), whose middles lie in its solid boxes."""
    solid = np.zeros(case.cells, np.bool_)
    for low, high in case.boxes_D:
        inside = [
            (start + (np.arange(n) + 0.5) / case.cells_per_D > a)
            & (start + (np.arange(n) + 0.5) / case.cells_per_D < b)
            for start, n, a, b in zip(case.low_D, case.cells, low, high, strict=True)
        ]
        solid |= inside[0][:, None, None] & inside[1][:, None] & inside[2]
    return solid


class BounceBackLinks:
    """Where the populations lie that meet solid cells, in a lattice made by `still_water`.

    Parameters
    ----------
    solid : ndarray of bool, shape (nx, ny, nz)
        None of them beside a face of the box.
    """

    def __init__(self, solid: BoolArray) -> None:
        nx, ny, nz = solid.shape
        size, start = plane_size(ny, nz), origin(nz)
        padded = np.pad(solid, 1)
        leaving, arriving, skin = [], [], np.zeros_like(padded)

        def slots(i: int, cells: np.ndarray) -> np.ndarray:
            return np.asarray((i * (nx + 2) + cells[:, 0]) * size + start + cells[:, 1] * (nz + 2) + cells[:, 2])

        bodies = np.argwhere(padded)
        for i in range(1, 19):
            water = bodies - VELOCITIES[i]
            beside = ~padded[tuple(water.T)]
            leaving.append(slots(i, water[beside]))
            arriving.append(slots(int(OPPOSITE[i]), bodies[beside]))
            skin[tuple(bodies[beside].T)] = True
        self._leaving, self._arriving = np.concatenate(leaving), np.concatenate(arriving)
        self._skin = np.concatenate([slots(i, np.argwhere(skin)) for i in range(19)])

    def turn_back(self, now: Lattice) -> None:
        """Before a step: put what leaves the water towards bodies, turned round, where it will be pulled from."""
        flat = now.reshape(-1)
        flat[self._arriving] = flat[self._leaving]

    def empty(self, after: Lattice) -> None:
        """After a step: nothing is in the bodies; their inner cells, which no water reaches, never had anything."""
        after.reshape(-1)[self._skin] = 0.0

"""Where in space there may be something: a coarse grid over shrunk space, learnt beside the field."""

from __future__ import annotations

import math
from typing import Any

import torch

from wakewise_nerf.field.field import contract, unit_cube

# Mueller et al. 2022, appendix E.2: densities decay by this factor at each update, so that a cell can become empty.
DECAY = 0.95
# A cell counts as empty where an interval of the region would stop less light than this (appendix E.2).
LEAST_ALPHA = 0.01
# Cells asked at once, which bounds memory.
BATCH = 2**18


class OccupancyGrid(torch.nn.Module):
    """Grid of the largest density met of late, `cells` along each side of the contracted cube.

    Parameters
    ----------
    interval : float
        Length of an interval across the region, in radii.
    """

    density: Any
    occupied: Any
    real: Any

    def __init__(self, cells: int, interval: float) -> None:
        super().__init__()
        self.cells = cells
        self.threshold = LEAST_ALPHA / interval
        self.register_buffer("density", torch.zeros(cells**3))
        self.register_buffer("occupied", torch.ones(cells**3, dtype=torch.bool))
        centres = 4.0 * (self._corners(torch.arange(cells**3)) + 0.5) / cells - 2.0
        # The cube's corners lie outside the ball that all space is shrunk into: a third of the cells are nowhere.
        nowhere = torch.linalg.vector_norm(centres, dim=1) > 2.0 + 2.0 * math.sqrt(3.0) / cells
        self.register_buffer("real", ~nowhere, persistent=False)

    def _corners(self, index: Any) -> Any:
        """Whole coordinates of cells by their number, shape (n, 3)."""
        return torch.stack([index // self.cells**2, index // self.cells % self.cells, index % self.cells], dim=1)

    def holds(self, points: Any) -> Any:
        """Whether points, shape (n, 3) in radii, lie in an occupied cell; shape (n,)."""
        at = (unit_cube(contract(points)) * self.cells).int().clamp(0, self.cells - 1)
        return self.occupied[(at[:, 0] * self.cells + at[:, 1]) * self.cells + at[:, 2]]

    @torch.no_grad()
    def update(self, field: Any, generator: Any, *, all_cells: bool, apply: bool) -> None:
        """Ask the field about a point in each cell, or in an eighth of the cells and all occupied ones; then decide.

        Parameters
        ----------
        generator : torch.Generator
            On the device of the grid; chooses cells and the points in them.
        apply : bool
            Whether cells may become empty; before, only densities are gathered.
        """
        device, count = self.density.device, self.cells**3
        if all_cells:
            chosen = self.real.nonzero()[:, 0]
        else:
            lucky = torch.rand(count, device=device, generator=generator) < 0.125
            chosen = ((lucky | self.occupied) & self.real).nonzero()[:, 0]
        self.density[chosen] *= DECAY
        for part in chosen.split(BATCH):
            corner = self._corners(part)
            place = (corner + torch.rand(corner.shape, device=device, generator=generator)) / self.cells
            found, _ = field.density_in_cube(place)
            self.density[part] = torch.maximum(self.density[part], found)
        if apply:
            # A field that is thin everywhere must not become empty everywhere: what is denser than the mean stays.
            floor = float(self.density[self.real].mean())
            self.occupied = self.density > min(self.threshold, floor)

    def share(self) -> float:
        """Share of the cells that are occupied."""
        return float(self.occupied.float().mean())

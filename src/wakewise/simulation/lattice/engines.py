"""What advances a lattice: the processor's cores, or a graphics card that CUDA can use; the same scheme on both."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import has, how_to_install
from wakewise.simulation.lattice.averages import MOMENTS, accumulate
from wakewise.simulation.lattice.bounce_back import BounceBackLinks
from wakewise.simulation.lattice.kernel import push, step, velocity
from wakewise.simulation.lattice.stencil import Lattice, box, plane_row, still_water

DEVICES = ("cpu", "cuda", "auto")


class LatticeEngine(Protocol):
    """Populations of all cells and their sums over time, wherever they are kept; lattice units."""

    def advance(self, pushes: list[tuple[IntArray, Array]]) -> None:
        """One step; each push has cells, shape (k, 3), counted with halo, and their forces, shape (k, 3)."""

    def field(self) -> Lattice:
        """Density over rest and velocity of every cell now, float32, shape (4, nx, ny, nz); may be overwritten."""

    def along_x(self, y: int, z: int) -> Array:
        """Velocity along x, mean of the four cells about the edge (y, z), counted from 0, shape (nx,)."""

    def accumulate(self) -> None:
        """Add the moments of this instant to `sums`."""

    @property
    def sums(self) -> Array:
        """What was accumulated, shape (MOMENTS, nx, ny, nz)."""

    @property
    def populations(self) -> Lattice:
        """Deviations from rest, shape (19, nx, ny, nz)."""

    def restore(self, populations: Lattice, sums: Array) -> None:
        """Go on from there."""


class CpuEngine:
    """The lattice on the processor's cores.

    Parameters
    ----------
    tau_x, tau_yz : ndarray, shapes (nx + 2,) and (ny + 2, nz + 2)
        Their sum is the relaxation time of each cell.
    eddies : float
        `smagorinsky_factor`.
    faces : ndarray of int, shape (6,)
        OPEN or WALL.
    solid : ndarray of bool, shape (nx, ny, nz), or None
        Cells of bodies, none beside a face.
    """

    def __init__(
        self, tau_x: Array, tau_yz: Array, eddies: float, faces: IntArray, solid: BoolArray | None = None
    ) -> None:
        self._cells = (len(tau_x) - 2, tau_yz.shape[0] - 2, tau_yz.shape[1] - 2)
        self._now, self._next = still_water(self._cells), still_water(self._cells)
        self._tau_x, self._tau_yz = tau_x.astype(np.float32), plane_row(tau_yz)
        self._eddies, self._faces = eddies, faces
        self._bodies = BounceBackLinks(solid) if solid is not None and solid.any() else None
        self._field = np.zeros((4, *self._cells), np.float32)
        self._sums = np.zeros((MOMENTS, *self._cells))

    def advance(self, pushes: list[tuple[IntArray, Array]]) -> None:
        """As `LatticeEngine`."""
        _, ny, nz = self._cells
        if self._bodies:
            self._bodies.turn_back(self._now)
        step(self._now, self._next, ny, nz, self._tau_x, self._tau_yz, self._eddies, self._faces)
        for cells, forces in pushes:
            push(self._now, self._next, nz, self._tau_x, self._tau_yz, self._eddies, cells, forces)
        if self._bodies:
            self._bodies.empty(self._next)
        self._now, self._next = self._next, self._now

    def field(self) -> Lattice:
        """As `LatticeEngine`."""
        velocity(self._now, *self._cells[1:], self._field)
        return self._field

    def along_x(self, y: int, z: int) -> Array:
        """As `LatticeEngine`."""
        return self.field()[1, :, y - 1 : y + 1, z - 1 : z + 1].mean((1, 2)).astype(np.float64)

    def accumulate(self) -> None:
        """As `LatticeEngine`."""
        accumulate(self.field(), self._sums)

    @property
    def sums(self) -> Array:
        """As `LatticeEngine`."""
        return self._sums

    @property
    def populations(self) -> Lattice:
        """As `LatticeEngine`; a view."""
        return box(self._now, *self._cells[1:])[:, 1:-1, 1:-1, 1:-1]

    def restore(self, populations: Lattice, sums: Array) -> None:
        """As `LatticeEngine`."""
        self.populations[:] = populations
        self._sums[:] = sums


def make_engine(
    device: str, tau_x: Array, tau_yz: Array, eddies: float, faces: IntArray, solid: BoolArray | None = None
) -> LatticeEngine:
    """The engine for a device by name; "auto" is a graphics card if there is one. Other arguments: `CpuEngine`.

    Bodies are for processors only.

    Raises
    ------
    InputError
        If there is no such device, or "cuda" is asked for and CUDA finds no graphics card, or for bodies.
    """
    if device not in DEVICES:
        raise InputError(f"lattice device {device!r}: no such device, allowed {', '.join(DEVICES)}")
    bodies = solid is not None and bool(solid.any())
    why_not = None if device == "cpu" else "solid boxes run on processors only" if bodies else why_no_gpu()
    if device == "cuda" and why_not:
        raise InputError(f"lattice device 'cuda': {why_not}; allowed here: cpu, auto")
    if device == "cpu" or why_not:
        return CpuEngine(tau_x, tau_yz, eddies, faces, solid)
    from wakewise.simulation.lattice.cuda_engine import CudaEngine

    return CudaEngine(tau_x, tau_yz, eddies, faces)


def why_no_gpu() -> str | None:
    """Why CUDA cannot be used here, or None if it can."""
    try:
        from numba import cuda

        if cuda.is_available():
            return None
    except ImportError as fault:
        return f"Numba has no CUDA ({fault}): {how_to_install('gpu')}"
    lacking = "" if has("gpu") else f", and numba-cuda is not installed ({how_to_install('gpu')})"
    return f"CUDA finds no graphics card or no driver{lacking}"

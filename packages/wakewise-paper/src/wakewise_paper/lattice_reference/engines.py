"""What advances a lattice: the processor's cores, or a graphics card that CUDA can use; the same scheme on both.

Time averages of a lattice run, and their averages around the axis.

Solid bodies among the cells of a lattice: what leaves the water towards them comes back half-way.

The wall lies between a cell of water and a cell of the body, as a wall does on a face of the box (`faces`). Before a
step each population that would go into the body is put, turned round, where the water will pull it from. Cells of the
body keep nothing: the step computes them as any other, and then they are emptied.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit, prange
from wakewise.core.optional_dependencies import has, how_to_install
from wakewise.simulation.lattice.cases import LatticeCase
from wakewise.simulation.lattice.kernel import push, step, velocity
from wakewise.simulation.lattice.stencil import (
    OPPOSITE,
    VELOCITIES,
    Lattice,
    box,
    origin,
    plane_row,
    plane_size,
    still_water,
)

MOMENTS = 8
"""What is averaged in every cell: p, u, v, w, uu, vv, ww, vw."""


@njit(parallel=True)
def accumulate(field: np.ndarray, sums: Array) -> None:
    """Add the moments of one instant, `field` of shape (4, nx, ny, nz), to `sums`, shape (MOMENTS, nx, ny, nz)."""
    for x in prange(field.shape[1]):
        for y in range(field.shape[2]):
            for z in range(field.shape[3]):
                u, v, w = field[1, x, y, z], field[2, x, y, z], field[3, x, y, z]
                sums[0, x, y, z] += field[0, x, y, z]
                sums[1, x, y, z] += u
                sums[2, x, y, z] += v
                sums[3, x, y, z] += w
                sums[4, x, y, z] += u * u
                sums[5, x, y, z] += v * v
                sums[6, x, y, z] += w * w
                sums[7, x, y, z] += v * w


def around_axis(means: Array, y: Array, z: Array, radii: Array, angles: int = 96) -> dict[str, Array]:
    """Average over circles about y = z = 0.

    Parameters
    ----------
    means : ndarray, shape (MOMENTS, nx, ny, nz)
    y, z : ndarray
        Cell centres across the axis, evenly spaced.
    radii : ndarray, shape (m,)
    angles : int
        Points on each circle; values there by cubic splines.

    Returns
    -------
    dict of ndarray, shape (nx, m)
        pressure, axial, radial, swirl (positive from y to z) and axial_rms, radial_rms, swirl_rms.
    """
    turn = 2 * np.pi * (np.arange(angles) + 0.5) / angles
    cos, sin = np.cos(turn), np.sin(turn)
    at = np.stack(
        [
            (np.outer(radii, cos) - y[0]).ravel() / (y[1] - y[0]),
            (np.outer(radii, sin) - z[0]).ravel() / (z[1] - z[0]),
        ]
    )
    out = np.empty((7, means.shape[1], len(radii)))
    for x in range(means.shape[1]):
        p, u, v, w, uu, vv, ww, vw = (
            map_coordinates(plane, at, order=3, mode="nearest").reshape(len(radii), angles) for plane in means[:, x]
        )
        radial, swirl = cos * v + sin * w, cos * w - sin * v
        rr = cos**2 * vv + sin**2 * ww + 2 * sin * cos * vw
        tt = sin**2 * vv + cos**2 * ww - 2 * sin * cos * vw
        out[:4, x] = [q.mean(1) for q in (p, u, radial, swirl)]
        # The scatter of a time average around its circle is error of averaging, and belongs to the fluctuations.
        out[4:, x] = [q.mean(1) for q in (uu, rr, tt)]
    out[4:] = np.sqrt(np.maximum(out[4:] - out[1:4] ** 2, 0))
    names = ("pressure", "axial", "radial", "swirl", "axial_rms", "radial_rms", "swirl_rms")
    return dict(zip(names, out, strict=True))


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
    from wakewise_paper.lattice_reference.cuda_engine import CudaEngine

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

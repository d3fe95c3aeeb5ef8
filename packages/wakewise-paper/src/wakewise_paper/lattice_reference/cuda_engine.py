"""The lattice on a graphics card: arrays that stay there, and the launches that advance them.

The lattice's step for graphics cards: one thread a cell, populations apart, neighbours along z together.

Collision and faces are those of the processor (`collision`, `faces`), compiled from the same text. Arrays have shape
(19, nx, ny, pitch) with z running fastest and rows of whole lines of 32 cells, so that the threads of a warp read and
write one line at a time; there is no halo. Imports `numba.cuda` only here: it is found where the extra `gpu` is
installed, and in Numba's own simulator.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numba import cuda, float32, float64

from wakewise.core.arrays import Array, IntArray
from wakewise.simulation.lattice.collision import collide, collide_forced
from wakewise.simulation.lattice.faces import pull_outside_domain
from wakewise.simulation.lattice.stencil import OPEN, VELOCITIES, Lattice, smagorinsky_factor
from wakewise_paper.lattice_reference.engines import MOMENTS

WARP = 32

_collide = cuda.jit(device=True, fastmath=True)(collide)
_forced = cuda.jit(device=True)(collide_forced)
_beyond = cuda.jit(device=True, fastmath=True)(getattr(pull_outside_domain, "py_func", pull_outside_domain))


def pitch(nz: int) -> int:
    """Length of a row that holds nz cells."""
    return math.ceil(nz / WARP) * WARP


def launch(cells: tuple[int, int, int]) -> tuple[tuple[int, int, int], int]:
    """Blocks and threads of a block for a kernel over all cells."""
    nx, ny, nz = cells
    threads = min(pitch(nz), 256)
    return (math.ceil(nz / threads), ny, nx), threads


@cuda.jit(device=True, fastmath=True)
def _pull(src: Any, x: int, y: int, z: int, nz: int, faces: Any, pulled: Any) -> None:
    """What cell (x, y, z), counted from 0, pulls, into `pulled`, shape (19,)."""
    nx, ny = src.shape[1], src.shape[2]
    own = cuda.local.array(19, float32)
    for i in range(19):
        own[i] = src[i, x, y, z]
        a, b, c = x - VELOCITIES[i, 0], y - VELOCITIES[i, 1], z - VELOCITIES[i, 2]
        # Wrapped round; what is pulled from beyond walls and open faces is replaced below.
        pulled[i] = src[i, (a + nx) % nx, (b + ny) % ny, (c + nz) % nz]
    _beyond(own, (x + 1, y + 1, z + 1), (nx, ny, nz), faces, pulled)


@cuda.jit(fastmath=True)
def step_cells(src: Any, dst: Any, nz: int, tau_x: Any, tau_yz: Any, eddies: float, faces: Any) -> None:
    """Pull, collide and write every cell; arguments as the processor's `step`, but tau_yz is (ny + 2, nz + 2)."""
    z = cuda.blockIdx.x * cuda.blockDim.x + cuda.threadIdx.x
    y, x = cuda.blockIdx.y, cuda.blockIdx.z
    nx, ny = src.shape[1], src.shape[2]
    if z >= nz:
        return
    tau0 = tau_x[x + 1] + tau_yz[y + 1, z + 1]
    if 0 < x < nx - 1 and 0 < y < ny - 1 and 0 < z < nz - 1:
        came = (
            src[0, x, y, z],
            src[1, x - 1, y, z],
            src[2, x + 1, y, z],
            src[3, x, y - 1, z],
            src[4, x, y + 1, z],
            src[5, x, y, z - 1],
            src[6, x, y, z + 1],
            src[7, x - 1, y - 1, z],
            src[8, x + 1, y + 1, z],
            src[9, x - 1, y + 1, z],
            src[10, x + 1, y - 1, z],
            src[11, x - 1, y, z - 1],
            src[12, x + 1, y, z + 1],
            src[13, x - 1, y, z + 1],
            src[14, x + 1, y, z - 1],
            src[15, x, y - 1, z - 1],
            src[16, x, y + 1, z + 1],
            src[17, x, y - 1, z + 1],
            src[18, x, y + 1, z - 1],
        )
    else:
        p = cuda.local.array(19, float32)
        _pull(src, x, y, z, nz, faces, p)
        came = (
            p[0],
            p[1],
            p[2],
            p[3],
            p[4],
            p[5],
            p[6],
            p[7],
            p[8],
            p[9],
            p[10],
            p[11],
            p[12],
            p[13],
            p[14],
            p[15],
            p[16],
            p[17],
            p[18],
        )
    (
        dst[0, x, y, z],
        dst[1, x, y, z],
        dst[2, x, y, z],
        dst[3, x, y, z],
        dst[4, x, y, z],
        dst[5, x, y, z],
        dst[6, x, y, z],
        dst[7, x, y, z],
        dst[8, x, y, z],
        dst[9, x, y, z],
        dst[10, x, y, z],
        dst[11, x, y, z],
        dst[12, x, y, z],
        dst[13, x, y, z],
        dst[14, x, y, z],
        dst[15, x, y, z],
        dst[16, x, y, z],
        dst[17, x, y, z],
        dst[18, x, y, z],
    ) = _collide(came, tau0, eddies)


@cuda.jit
def push_cells(
    src: Any, dst: Any, nz: int, tau_x: Any, tau_yz: Any, eddies: float, faces: Any, cells: Any, forces: Any
) -> None:
    """Collide again the cells that a force acts on, one thread each; `cells` are counted with halo."""
    k = cuda.blockIdx.x * cuda.blockDim.x + cuda.threadIdx.x
    if k >= cells.shape[0]:
        return
    x, y, z = cells[k, 0] - 1, cells[k, 1] - 1, cells[k, 2] - 1
    pulled, came, went = cuda.local.array(19, float32), cuda.local.array(19, float64), cuda.local.array(19, float64)
    force, u = cuda.local.array(3, float64), cuda.local.array(3, float64)
    stress, drift = cuda.local.array((3, 3), float64), cuda.local.array((3, 3), float64)
    _pull(src, x, y, z, nz, faces, pulled)
    for i in range(19):
        came[i] = pulled[i]
    for a in range(3):
        force[a] = forces[k, a]
    _forced(came, tau_x[x + 1] + tau_yz[y + 1, z + 1], eddies, force, u, stress, drift, went)
    for i in range(19):
        dst[i, x, y, z] = went[i]


@cuda.jit(fastmath=True)
def read_cells(f: Any, out: Any) -> None:
    """Density over rest and velocity of every cell, into `out`, shape (4, nx, ny, nz)."""
    z = cuda.blockIdx.x * cuda.blockDim.x + cuda.threadIdx.x
    y, x = cuda.blockIdx.y, cuda.blockIdx.z
    if z >= out.shape[3]:
        return
    excess, jx, jy, jz = float32(0.0), float32(0.0), float32(0.0), float32(0.0)
    for i in range(19):
        g = f[i, x, y, z]
        excess += g
        jx += float32(VELOCITIES[i, 0]) * g
        jy += float32(VELOCITIES[i, 1]) * g
        jz += float32(VELOCITIES[i, 2]) * g
    over = float32(1.0) / (float32(1.0) + excess)
    out[0, x, y, z], out[1, x, y, z] = excess, jx * over
    out[2, x, y, z], out[3, x, y, z] = jy * over, jz * over


@cuda.jit
def read_column(field: Any, y: int, z: int, out: Any) -> None:
    """Velocity along x, mean of the four cells about the edge (y, z), into `out`, shape (nx,)."""
    x = cuda.blockIdx.x * cuda.blockDim.x + cuda.threadIdx.x
    if x < out.shape[0]:
        low, high = field[1, x, y - 1, z - 1] + field[1, x, y - 1, z], field[1, x, y, z - 1] + field[1, x, y, z]
        out[x] = 0.25 * (low + high)


@cuda.jit
def add_cells(field: Any, sums: Any) -> None:
    """Add the moments of one instant to `sums`, as `averages.accumulate`."""
    z = cuda.blockIdx.x * cuda.blockDim.x + cuda.threadIdx.x
    y, x = cuda.blockIdx.y, cuda.blockIdx.z
    if z >= field.shape[3]:
        return
    u, v, w = float64(field[1, x, y, z]), float64(field[2, x, y, z]), float64(field[3, x, y, z])
    sums[0, x, y, z] += field[0, x, y, z]
    sums[1, x, y, z] += u
    sums[2, x, y, z] += v
    sums[3, x, y, z] += w
    sums[4, x, y, z] += u * u
    sums[5, x, y, z] += v * v
    sums[6, x, y, z] += w * w
    sums[7, x, y, z] += v * w


def zeros(shape: tuple[int, ...], kind: type) -> Any:
    """An array of zeros on the card."""
    return cuda.to_device(np.zeros(shape, kind))


class CudaEngine:
    """As `wakewise.simulation.lattice.engines.CpuEngine`, on the first graphics card."""

    def __init__(self, tau_x: Array, tau_yz: Array, eddies: float, faces: IntArray) -> None:
        self._cells = (len(tau_x) - 2, tau_yz.shape[0] - 2, tau_yz.shape[1] - 2)
        nx, ny, nz = self._cells
        shape = (19, nx, ny, pitch(nz))
        self._now, self._next = zeros(shape, np.float32), zeros(shape, np.float32)
        self._field, self._sums = zeros((4, *self._cells), np.float32), zeros((MOMENTS, *self._cells), np.float64)
        self._column = zeros((nx,), np.float64)
        self._water: tuple[Any, ...] = (
            np.int64(nz),
            cuda.to_device(tau_x.astype(np.float32)),
            cuda.to_device(tau_yz.astype(np.float32)),
            np.float32(eddies),
            cuda.to_device(faces),
        )
        self._launch = launch(self._cells)

    def advance(self, pushes: list[tuple[IntArray, Array]]) -> None:
        """As `Engine`."""
        step_cells[self._launch](self._now, self._next, *self._water)
        for cells, forces in pushes:
            blocks = math.ceil(len(cells) / WARP)
            there = cuda.to_device(cells), cuda.to_device(np.ascontiguousarray(forces))
            push_cells[blocks, WARP](self._now, self._next, *self._water, *there)
        self._now, self._next = self._next, self._now

    def _read(self) -> Any:
        read_cells[self._launch](self._now, self._field)
        return self._field

    def field(self) -> Lattice:
        """As `Engine`; copied from the card."""
        out: Lattice = self._read().copy_to_host()
        return out

    def along_x(self, y: int, z: int) -> Array:
        """As `Engine`."""
        read_column[math.ceil(self._cells[0] / WARP), WARP](self._read(), y, z, self._column)
        out: Array = self._column.copy_to_host()
        return out

    def accumulate(self) -> None:
        """As `Engine`."""
        add_cells[self._launch](self._read(), self._sums)

    @property
    def sums(self) -> Array:
        """As `Engine`; copied from the card."""
        out: Array = self._sums.copy_to_host()
        return out

    @property
    def populations(self) -> Lattice:
        """As `Engine`; copied from the card."""
        out: Lattice = self._now.copy_to_host()[..., : self._cells[2]]
        return out

    def restore(self, populations: Lattice, sums: Array) -> None:
        """As `Engine`."""
        rows = np.zeros((19, *self._cells[:2], pitch(self._cells[2])), np.float32)
        rows[..., : self._cells[2]] = populations
        self._now, self._sums = cuda.to_device(rows), cuda.to_device(np.ascontiguousarray(sums))


def giga_updates_per_s(cells: int = 224, steps: int = 200) -> float:
    """Billion cell updates a second in a cube of so many cells to a side, 0.9 m at 4 mm if not given."""
    tau_yz = np.zeros((cells + 2, cells + 2))
    water = CudaEngine(np.full(cells + 2, 0.5005), tau_yz, smagorinsky_factor(0.12), np.full(6, OPEN))
    rates = []
    for _ in range(5):
        cuda.synchronize()
        began = time.perf_counter()
        for _ in range(steps):
            water.advance([])
        cuda.synchronize()
        rates.append(cells**3 * steps / (time.perf_counter() - began) / 1e9)
    return float(np.median(rates[1:]))

"""Compiled time step of the D3Q19 lattice: pull populations from neighbours, collide, write.

A plane is processed in pieces of `PIECE` cells: they are pulled and collide in a small array of nineteen rows, which is
written line by line past the caches unless the whole lattice fits in them.
"""

from __future__ import annotations

import numpy as np
from numba import float32

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit, prange
from wakewise.simulation.lattice.collision import collide, collide_forced
from wakewise.simulation.lattice.faces import fill_slots
from wakewise.simulation.lattice.stencil import PERIODIC, PIECE, VELOCITIES, Lattice, box, origin
from wakewise.simulation.lattice.streaming_stores import (
    LINE,
    copy_line,
    load_element,
    settle_stores,
    store_element,
    stream_line,
)

_CACHED = 2**20
"""Populations of a lattice that a core's second-level cache holds for the next step."""
_1 = float32(1.0)
_cell = njit(fastmath=True, inline="always")(collide)
_forced = njit(collide_forced)


@njit(fastmath=True)
def _collide(src: Lattice, starts: IntArray, tau_x: float, tau_yz: Lattice, p: int, eddies: float, f: Lattice) -> None:
    """Collide the `PIECE` cells that pull population i from src[starts[i]] on, `src` flat, into f[i * PIECE] on."""
    s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11, s12, s13, s14, s15, s16, s17, s18 = (
        starts[0],
        starts[1],
        starts[2],
        starts[3],
        starts[4],
        starts[5],
        starts[6],
        starts[7],
        starts[8],
        starts[9],
        starts[10],
        starts[11],
        starts[12],
        starts[13],
        starts[14],
        starts[15],
        starts[16],
        starts[17],
        starts[18],
    )
    for n in range(PIECE):
        came = (
            load_element(src, s0 + n),
            load_element(src, s1 + n),
            load_element(src, s2 + n),
            load_element(src, s3 + n),
            load_element(src, s4 + n),
            load_element(src, s5 + n),
            load_element(src, s6 + n),
            load_element(src, s7 + n),
            load_element(src, s8 + n),
            load_element(src, s9 + n),
            load_element(src, s10 + n),
            load_element(src, s11 + n),
            load_element(src, s12 + n),
            load_element(src, s13 + n),
            load_element(src, s14 + n),
            load_element(src, s15 + n),
            load_element(src, s16 + n),
            load_element(src, s17 + n),
            load_element(src, s18 + n),
        )
        went = _cell(came, tau_x + load_element(tau_yz, p + n), eddies)
        store_element(f, n, went[0])
        store_element(f, PIECE + n, went[1])
        store_element(f, 2 * PIECE + n, went[2])
        store_element(f, 3 * PIECE + n, went[3])
        store_element(f, 4 * PIECE + n, went[4])
        store_element(f, 5 * PIECE + n, went[5])
        store_element(f, 6 * PIECE + n, went[6])
        store_element(f, 7 * PIECE + n, went[7])
        store_element(f, 8 * PIECE + n, went[8])
        store_element(f, 9 * PIECE + n, went[9])
        store_element(f, 10 * PIECE + n, went[10])
        store_element(f, 11 * PIECE + n, went[11])
        store_element(f, 12 * PIECE + n, went[12])
        store_element(f, 13 * PIECE + n, went[13])
        store_element(f, 14 * PIECE + n, went[14])
        store_element(f, 15 * PIECE + n, went[15])
        store_element(f, 16 * PIECE + n, went[16])
        store_element(f, 17 * PIECE + n, went[17])
        store_element(f, 18 * PIECE + n, went[18])


@njit(parallel=True, fastmath=True)
def step(
    src: Lattice, dst: Lattice, ny: int, nz: int, tau_x: Lattice, tau_yz: Lattice, eddies: float, faces: IntArray
) -> None:
    """Pull populations from neighbours in `src`, collide, write `dst`.

    - `src`, `dst`, shape (19, nx + 2, size): made by `still_water`. Slots beside faces in the halo of `src` are filled;
      what the halo of `dst` holds afterwards means nothing.
    - `ny`, `nz`: cells inside, without halo, two or more.
    - `tau_x`, `tau_yz`, shapes (nx + 2,) and (size,): their sum is the relaxation time of the water itself in each
      cell: 1/2 + 3 nu, larger in a sponge. See `plane_row` for the second.
    - `eddies`: `smagorinsky_factor`.
    - `faces`, shape (6,): OPEN, WALL or PERIODIC for low x, high x, low y, ... ; beyond periodic ones the halo of `src`
      must be filled.
    """
    mz, planes, size = nz + 2, src.shape[1], src.shape[2]
    start = origin(nz) + mz + 1
    pieces = (ny * mz - 2 + PIECE - 1) // PIECE
    streams = dst.ctypes.data % (4 * LINE) == 0 and dst.size > _CACHED
    strength = float32(eddies)
    came, went = src.reshape(-1), dst.reshape(-1)
    for k in prange(planes - 2):
        x = np.int64(k) + 1
        f, starts = np.empty(19 * PIECE, np.float32), np.empty(19, np.int64)
        for piece in range(pieces):
            p = start + piece * PIECE
            fill_slots(src, x, p, ny, nz, faces, f)
            for i in range(19):
                c = VELOCITIES[i]
                starts[i] = (i * planes + x - c[0]) * size + p - c[1] * mz - c[2]
            _collide(came, starts, tau_x[x], tau_yz, p, strength, f)
            for i in range(19):
                at = (i * planes + x) * size + p
                for n in range(0, PIECE, LINE):
                    if streams:
                        stream_line(went, at + n, f, i * PIECE + n)
                    else:
                        copy_line(went, at + n, f, i * PIECE + n)
        settle_stores()


def wrap(f: Lattice, ny: int, nz: int, faces: IntArray) -> None:
    """Fill the halo beside periodic faces from the cells of the opposite face."""
    cells = box(f, ny, nz)
    # Edges of the halo belong to the other face unless that is periodic too.
    y = slice(None) if faces[2] == PERIODIC else slice(1, -1)
    z = slice(None) if faces[4] == PERIODIC else slice(1, -1)
    if faces[0] == PERIODIC:
        cells[:, 0, y, z], cells[:, -1, y, z] = cells[:, -2, y, z], cells[:, 1, y, z]
    if faces[2] == PERIODIC:
        cells[:, :, 0, z], cells[:, :, -1, z] = cells[:, :, -2, z], cells[:, :, 1, z]
    if faces[4] == PERIODIC:
        cells[..., 0], cells[..., -1] = cells[..., -2], cells[..., 1]


@njit
def push(
    src: Lattice,
    dst: Lattice,
    nz: int,
    tau_x: Lattice,
    tau_yz: Lattice,
    eddies: float,
    cells: IntArray,
    forces: Array,
) -> None:
    """Collide again the few cells that a body force acts on; see `collide_forced`.

    Call it right after `step`, with the same arguments.

    `cells`, shape (k, 3): indices with halo. `forces`, shape (k, 3): force per cell over the density of rest, cells per
    step squared.
    """
    mz, start = nz + 2, origin(nz)
    g, went = np.empty(19), np.empty(19)
    u, stress, drift = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for k in range(cells.shape[0]):
        x, at = cells[k, 0], start + cells[k, 1] * mz + cells[k, 2]
        for i in range(19):
            c = VELOCITIES[i]
            g[i] = src[i, x - c[0], at - c[1] * mz - c[2]]
        _forced(g, tau_x[x] + tau_yz[at], eddies, forces[k], u, stress, drift, went)
        for i in range(19):
            dst[i, x, at] = went[i]


@njit(parallel=True, fastmath=True)
def velocity(f: Lattice, ny: int, nz: int, out: Lattice) -> None:
    """Density and velocity of all cells inside: `out`, shape (4, nx, ny, nz), gets rho - 1, ux, uy, uz."""
    mz, start = nz + 2, origin(nz)
    for k in prange(f.shape[1] - 2):
        x = np.int64(k)
        for y in range(ny):
            rho, ux, uy, uz = out[0, x, y], out[1, x, y], out[2, x, y], out[3, x, y]
            rho[:] = 0.0
            ux[:] = 0.0
            uy[:] = 0.0
            uz[:] = 0.0
            for i in range(19):
                first = start + (y + 1) * mz + 1
                row = f[i, x + 1, first : first + nz]
                cx, cy, cz = float32(VELOCITIES[i, 0]), float32(VELOCITIES[i, 1]), float32(VELOCITIES[i, 2])
                for z in range(nz):
                    rho[z] += row[z]
                    ux[z] += cx * row[z]
                    uy[z] += cy * row[z]
                    uz[z] += cz * row[z]
            for z in range(nz):
                over = _1 / (_1 + rho[z])
                ux[z] *= over
                uy[z] *= over
                uz[z] *= over

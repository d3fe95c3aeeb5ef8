"""Boundary conditions on the faces of the lattice's box: walls, open faces, periodic faces.

The populations that a cell beside a face pulls from outside are written into the halo slots that it pulls from, just
before its piece is pulled (see `kernel`). Every slot belongs to one cell only, so planes do not conflict.

- Wall: half-way bounce-back; the wall is on the face.
- Open: equilibrium at the cell's velocity; outflow at rest pressure, normal inflow at -rho u^2 / 2 (Bernoulli), since
  at rest pressure an inflow would grow without bound.
- Periodic: the halo, which `wrap` fills.

Rows of cells beside one face are processed together; edges, corners and ends of rows one by one.
"""

from __future__ import annotations

import numpy as np
from numba import float32

from wakewise.core.arrays import IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.lattice.collision import Populations
from wakewise.simulation.lattice.stencil import (
    OPEN,
    OPPOSITE,
    PERIODIC,
    PIECE,
    SHAPES,
    VELOCITIES,
    WALL,
    WEIGHTS,
    Lattice,
    origin,
)
from wakewise.simulation.lattice.streaming_stores import load_element, store_element

OUTSIDE = np.array(
    [
        [next(i for i in range(1, 19) if np.array_equal(VELOCITIES[i], c)) for c in inwards]
        for axis in range(3)
        for side in (1, -1)
        for inwards in [[np.roll((side, a, b), axis) for a, b in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]]
    ]
)
"""Populations that a cell pulls from beyond each face, shape (6, 5): straight, then slanting along the next axis and
against it, along the one after and against it."""

_1, _1_5, _3, _9 = float32(1.0), float32(1.5), float32(3.0), float32(9.0)
_0, _W1, _W2 = float32(0.0), float32(1 / 18), float32(1 / 36)


@njit(fastmath=True, inline="always")
def beyond_open(own: Populations, axis: int, side: int) -> tuple[float, float, float, float, float]:
    """What a cell with these populations pulls from beyond its one open face, in the order of `OUTSIDE`.

    `side` is +1 where the face is the low one.
    """
    f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13, f14, f15, f16, f17, f18 = own
    xy_same, xy_cross, xz_same = f7 - f8, f9 - f10, f11 - f12
    xz_cross, yz_same, yz_cross = f13 - f14, f15 - f16, f17 - f18
    excess = (f0 + f1 + f2 + f3 + f4 + f5 + f6) + (f7 + f8 + f9 + f10 + f11 + f12) + (f13 + f14 + f15 + f16 + f17 + f18)
    jx = (f1 - f2) + xy_same + xy_cross + xz_same + xz_cross
    jy = (f3 - f4) + xy_same - xy_cross + yz_same + yz_cross
    jz = (f5 - f6) + xz_same - xz_cross + yz_same - yz_cross
    over = _1 / (_1 + excess)
    u, v, w = (jx, jy, jz) if axis == 0 else (jy, jz, jx) if axis == 1 else (jz, jx, jy)
    u, v, w = u * over * float32(side), v * over, w * over
    comes_in = u > _0
    v, w = _0 if comes_in else v, _0 if comes_in else w
    pressure = -_1_5 * u * u if comes_in else _0
    straight = pressure + _3 * (u + u * u - v * v - w * w)
    on_v, by_v = pressure + _3 * (u + u * u + v * v), _3 * v + _9 * u * v
    on_w, by_w = pressure + _3 * (u + u * u + w * w), _3 * w + _9 * u * w
    return _W1 * straight, _W2 * (on_v + by_v), _W2 * (on_v - by_v), _W2 * (on_w + by_w), _W2 * (on_w - by_w)


@njit(fastmath=True)
def pull_outside_domain(
    own: Lattice, at: tuple[int, int, int], cells: tuple[int, int, int], faces: IntArray, pulled: Lattice
) -> None:
    """Replace what one cell pulls from beyond all its faces, edges and corners; the rest of `pulled`, (19,), stays.

    A population that crosses a wall and an open face at once comes from the wall. Where water comes in through several
    open faces, it has no velocity along any of them. `own`, shape (19,), are the cell's populations before; `at` counts
    from 1.
    """
    x, y, z = at
    nx, ny, nz = cells
    ux = uy = uz = 0.0
    rho = 1.0
    for i in range(19):
        g = own[i]
        rho += g
        ux += g * VELOCITIES[i, 0]
        uy += g * VELOCITIES[i, 1]
        uz += g * VELOCITIES[i, 2]
    ux /= rho
    uy /= rho
    uz /= rho
    x_open = (x == 1 and faces[0] == OPEN and ux > 0) or (x == nx and faces[1] == OPEN and ux < 0)
    y_open = (y == 1 and faces[2] == OPEN and uy > 0) or (y == ny and faces[3] == OPEN and uy < 0)
    z_open = (z == 1 and faces[4] == OPEN and uz > 0) or (z == nz and faces[5] == OPEN and uz < 0)
    v = (
        0.0 if y_open or z_open else ux,
        0.0 if x_open or z_open else uy,
        0.0 if x_open or y_open else uz,
    )
    inflow = x_open or y_open or z_open
    excess = -1.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) if inflow else 0.0
    for i in range(1, 19):
        a, b, c = x - VELOCITIES[i, 0], y - VELOCITIES[i, 1], z - VELOCITIES[i, 2]
        if 1 <= a <= nx and 1 <= b <= ny and 1 <= c <= nz:
            continue
        wall = opened = False
        for beyond, face in ((a < 1, 0), (a > nx, 1), (b < 1, 2), (b > ny, 3), (c < 1, 4), (c > nz, 5)):
            wall = wall or (beyond and faces[face] == WALL)
            opened = opened or (beyond and faces[face] == OPEN)
        if wall:
            pulled[i] = own[OPPOSITE[i]]
        elif opened:
            value = excess
            for m in range(3):
                value += 3 * VELOCITIES[i, m] * v[m]
                for n in range(3):
                    value += SHAPES[i, m, n] * v[m] * v[n]
            pulled[i] = WEIGHTS[i] * value


@njit(fastmath=True)
def _open_row(src: Lattice, x: int, first: int, end: int, face: int, mz: int, made: Lattice) -> None:
    """Fill the slots of the cells first to end - 1 of plane x, all beside one open face; at most `PIECE`.

    What is made lies in five rows of its own until it is copied: the compiler then knows how far apart these are.
    """
    r0, r1, r2, r3, r4, r5, r6, r7, r8, r9, r10, r11, r12, r13, r14, r15, r16, r17, r18 = (
        src[0, x],
        src[1, x],
        src[2, x],
        src[3, x],
        src[4, x],
        src[5, x],
        src[6, x],
        src[7, x],
        src[8, x],
        src[9, x],
        src[10, x],
        src[11, x],
        src[12, x],
        src[13, x],
        src[14, x],
        src[15, x],
        src[16, x],
        src[17, x],
        src[18, x],
    )
    axis, side = face // 2, 1 - 2 * (face % 2)
    for p in range(first, end):
        n = p - first
        own = (
            load_element(r0, p),
            load_element(r1, p),
            load_element(r2, p),
            load_element(r3, p),
            load_element(r4, p),
            load_element(r5, p),
            load_element(r6, p),
            load_element(r7, p),
            load_element(r8, p),
            load_element(r9, p),
            load_element(r10, p),
            load_element(r11, p),
            load_element(r12, p),
            load_element(r13, p),
            load_element(r14, p),
            load_element(r15, p),
            load_element(r16, p),
            load_element(r17, p),
            load_element(r18, p),
        )
        straight, on_v, against_v, on_w, against_w = beyond_open(own, axis, side)
        store_element(made, n, straight)
        store_element(made, PIECE + n, on_v)
        store_element(made, 2 * PIECE + n, against_v)
        store_element(made, 3 * PIECE + n, on_w)
        store_element(made, 4 * PIECE + n, against_w)
    for k in range(5):
        i = OUTSIDE[face, k]
        slots = src[i, x - VELOCITIES[i, 0]]
        back = VELOCITIES[i, 1] * mz + VELOCITIES[i, 2]
        for p in range(first, end):
            slots[p - back] = made[k * PIECE + p - first]


@njit(fastmath=True)
def _wall_row(src: Lattice, x: int, first: int, end: int, face: int, mz: int) -> None:
    """Fill the slots of the cells first to end - 1 of plane x, all beside one wall."""
    for k in range(5):
        i = OUTSIDE[face, k]
        slots, left = src[i, x - VELOCITIES[i, 0]], src[OPPOSITE[i], x]
        back = VELOCITIES[i, 1] * mz + VELOCITIES[i, 2]
        for p in range(first, end):
            slots[p - back] = left[p]


@njit(fastmath=True)
def _face_row(src: Lattice, x: int, first: int, end: int, face: int, kind: int, mz: int, made: Lattice) -> None:
    """Fill the slots of a row of cells beside one face, as if there were no other."""
    if kind == OPEN:
        _open_row(src, x, first, end, face, mz, made)
    elif kind == WALL:
        _wall_row(src, x, first, end, face, mz)


@njit(fastmath=True)
def _open_end(src: Lattice, x: int, at: int, face: int, mz: int) -> None:
    """Fill the slots of one cell at the end of a row, beside an open face and no other."""
    own = (
        src[0, x, at],
        src[1, x, at],
        src[2, x, at],
        src[3, x, at],
        src[4, x, at],
        src[5, x, at],
        src[6, x, at],
        src[7, x, at],
        src[8, x, at],
        src[9, x, at],
        src[10, x, at],
        src[11, x, at],
        src[12, x, at],
        src[13, x, at],
        src[14, x, at],
        src[15, x, at],
        src[16, x, at],
        src[17, x, at],
        src[18, x, at],
    )
    made = beyond_open(own, 2, 1 - 2 * (face % 2))
    for k in range(5):
        i = OUTSIDE[face, k]
        src[i, x - VELOCITIES[i, 0], at - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]] = made[k]


@njit(fastmath=True)
def _any_cell(src: Lattice, x: int, y: int, z: int, ny: int, nz: int, faces: IntArray, made: Lattice) -> None:
    """Fill the slots of one cell beside any faces."""
    mz, at = nz + 2, origin(nz) + y * (nz + 2) + z
    own, pulled = made[:19], made[19:38]
    for i in range(19):
        own[i] = src[i, x, at]
        pulled[i] = src[i, x - VELOCITIES[i, 0], at - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]]
    pull_outside_domain(own, (x, y, z), (src.shape[1] - 2, ny, nz), faces, pulled)
    for i in range(19):
        a, b, c = x - VELOCITIES[i, 0], y - VELOCITIES[i, 1], z - VELOCITIES[i, 2]
        if not (1 <= a <= src.shape[1] - 2 and 1 <= b <= ny and 1 <= c <= nz):
            src[i, a, at - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]] = pulled[i]


@njit(fastmath=True)
def fill_slots(src: Lattice, x: int, p: int, ny: int, nz: int, faces: IntArray, made: Lattice) -> None:
    """Fill the slots that the piece of plane x from p on will pull from; `made` has room for five rows of a piece."""
    nx, mz, start = src.shape[1] - 2, nz + 2, origin(nz)
    end = x in (1, nx)
    # One call of each function only: the compiler makes a copy of it wherever it is called.
    for face in range(4):
        first, last = p, p + PIECE
        beside = x == (1 if face == 0 else nx)
        if face >= 2:
            row = start + (1 if face == 2 else ny) * mz
            first, last = max(p, row + 1), min(p + PIECE, row + 1 + nz)
            beside = not end and first < last
        if beside:
            _face_row(src, x, first, last, face, faces[face], mz, made)
    for y in range(max(1, (p - start) // mz), min(ny, (p + PIECE - 1 - start) // mz) + 1):
        edge = end and y in (1, ny)
        for z in range(1, nz + 1, 1 if edge else nz - 1):
            at, face = start + y * mz + z, 4 if z == 1 else 5
            inner = not end and y not in (1, ny)
            if at < p or at >= p + PIECE or (inner and faces[face] == PERIODIC):
                continue
            if inner and faces[face] == OPEN:
                _open_end(src, x, at, face, mz)
            else:
                _any_cell(src, x, y, z, ny, nz, faces, made)

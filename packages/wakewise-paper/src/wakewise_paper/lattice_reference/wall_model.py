"""Wall model of the lattice: shear stress of a turbulent boundary layer on walls that the cells do not resolve.

Half-way bounce-back makes the water on a wall stand still. Where a cell is tens of viscous lengths high, its own
velocity gradient at the wall, and with it an undamped eddy viscosity, give a stress several times too large. Here the
stress is that of the law of the wall at the speed of the cell beside the wall (Werner and Wengle 1991, Proc. 8th Symp.
Turbulent Shear Flows, 155):

    u+ = y+ up to y+ = 11.81, u+ = A (y+)^B above, A = 8.3, B = 1/7

integrated over the cell, so that the stress follows from the cell's mean speed without iteration. The law holds for a
boundary layer in equilibrium. Werner and Wengle use it where the flow is separated, too, for want of another.

It is imposed as a flux of momentum, by a velocity of slip in bounce-back (Asmuth et al. 2021, Phys. Fluids 33, 105111).
Of the populations that slant towards a wall along its tangent t, those along n + t and n - t carry the tangential
momentum f(n + t) - f(n - t) into the wall in a step. Bounce-back returns it with the opposite sign. `WallModel.impose`
exchanges the two before bounce-back, so that the momentum returns unchanged, less the stress. Mass and normal momentum
are those of bounce-back, and the tangential momentum that the wall takes is the stress exactly.

In a turbulent channel on 16 cells the friction velocity is some 10 % below Dean's correlation: the speed is taken from
the cell beside the wall, which coarse cells make too slow against those above it.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.jit.njit import njit, prange
from wakewise.simulation.lattice.stencil import OPEN, PERIODIC, VELOCITIES, WALL, Lattice, origin, plane_size

FACTOR, POWER = 8.3, 1.0 / 7.0
"""A and B of the law of the wall."""

SUBLAYER = FACTOR ** (1.0 / (1.0 - POWER))
"""Height in viscous lengths where the two parts of the law meet, 11.81."""

_NORMALS = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])


def _index(c: IntArray) -> int:
    return int(np.flatnonzero((c == VELOCITIES).all(1))[0])


SLANTING = np.array(
    [
        [[_index(n + way * np.eye(3, dtype=int)[axis]) for way in (1, -1)] for axis in range(3) if not n[axis]]
        for n in _NORMALS
    ]
)
"""Populations along n + t and n - t, shape (6, 2, 2): by normal into the wall, then by tangent axis in order."""

TANGENTS = np.array([[axis for axis in range(3) if not n[axis]] for n in _NORMALS])
"""The two axes along a wall, shape (6, 2)."""


@njit
def wall_stress(speed: float, viscosity: float, cell: float) -> float:
    """Shear stress over density on a wall, from the mean speed along it of a cell of water beside it.

    Parameters
    ----------
    speed : float
        Mean over the cell's height, 0 or more.
    viscosity : float
        Kinematic, of the water itself.
    cell : float
        Height of the cell.

    Returns
    -------
    float
        Square of the friction velocity, in the unit of speed squared. 2 viscosity speed / cell, the laminar law, where
        the cell is within the viscous sublayer.
    """
    rate = viscosity / cell
    if speed <= 0.5 * rate * FACTOR ** (2 / (1 - POWER)):
        return 2 * rate * speed
    laminar = 0.5 * (1 - POWER) * FACTOR ** ((1 + POWER) / (1 - POWER)) * rate ** (1 + POWER)
    return (laminar + (1 + POWER) / FACTOR * rate**POWER * speed) ** (2 / (1 + POWER))


def law_of_the_wall(height: Array) -> Array:
    """Mean speed over the friction velocity at heights in viscous lengths, shapes (k,)."""
    return np.where(height <= SUBLAYER, height, FACTOR * np.maximum(height, SUBLAYER) ** POWER)


@njit(parallel=True)
def _speeds(flat: Lattice, stride: int, cells: IntArray, out: Array) -> None:
    """Velocity of cells by their slots in a population's planes: `out`, shape (k, 3)."""
    for k in prange(len(cells)):
        rho, u, v, w = 1.0, 0.0, 0.0, 0.0
        for i in range(19):
            f = flat[i * stride + cells[k]]
            rho += f
            u += VELOCITIES[i, 0] * f
            v += VELOCITIES[i, 1] * f
            w += VELOCITIES[i, 2] * f
        out[k, 0], out[k, 1], out[k, 2] = u / rho, v / rho, w / rho


@njit(parallel=True)
def _exchange(
    flat: Lattice, stride: int, cells: IntArray, normals: IntArray, whole: BoolArray, velocity: Array, viscosity: float
) -> None:
    """Exchange slanting populations of cells beside walls, less the stress; in cells per step."""
    for k in prange(len(cells)):
        n = normals[k]
        u, v = velocity[k, TANGENTS[n, 0]], velocity[k, TANGENTS[n, 1]]
        speed = np.sqrt(u * u + v * v)
        over = wall_stress(speed, viscosity, 1.0) / max(speed, 1e-12)
        for t in range(2):
            if whole[k, t]:
                taken = 0.5 * over * (u if t == 0 else v)
                a, b = SLANTING[n, t, 0] * stride + cells[k], SLANTING[n, t, 1] * stride + cells[k]
                along, against = flat[a], flat[b]
                # Bounce-back returns along -n - t what leaves along n + t.
                flat[a], flat[b] = against + taken, along - taken


class WallModel:
    """Imposes the stress of the law of the wall on the walls of a lattice made by `still_water`.

    Call `impose` before bounce-back in every step. Where a wall ends at an edge or in a corner, so that only one of two
    slanting populations meets it, bounce-back remains; so it does in cells beside an open face.

    Parameters
    ----------
    solid : ndarray of bool, shape (nx, ny, nz)
        Cells of bodies.
    faces : ndarray of int, shape (6,)
        OPEN, WALL or PERIODIC; low and high x, y, z.
    viscosity : float
        Kinematic, of the water itself, in cells squared per step.
    """

    def __init__(self, solid: BoolArray, faces: IntArray, viscosity: float) -> None:
        nx, ny, nz = solid.shape
        self._viscosity = viscosity
        self._stride = (nx + 2) * plane_size(ny, nz)
        padded, inside = np.pad(solid, 1), np.ones(solid.shape, np.bool_)
        for face, kind in enumerate(faces):
            axis, high = divmod(face, 2)
            beyond, within = np.moveaxis(padded, axis, 0), np.moveaxis(inside, axis, 0)
            if kind == WALL:
                beyond[-high] = True
            elif kind == PERIODIC:
                beyond[-high] = beyond[1 if high else -2]
            elif kind == OPEN:
                within[-high] = False
        water = np.argwhere(inside & ~solid) + 1

        def is_solid(cells: IntArray, way: IntArray) -> BoolArray:
            return np.asarray(padded[tuple((cells + way).T)])

        cells, normals, whole = [], [], []
        for d, n in enumerate(_NORMALS):
            beside = water[is_solid(water, n)]
            pairs = []
            for axis in TANGENTS[d]:
                t = np.eye(3, dtype=int)[axis]
                free = ~is_solid(beside, t) & ~is_solid(beside, -t)
                pairs.append(free & is_solid(beside, n + t) & is_solid(beside, n - t))
            kept = pairs[0] | pairs[1]
            cells.append(beside[kept])
            normals.append(np.full(np.count_nonzero(kept), d))
            whole.append(np.stack(pairs, 1)[kept])
        at = np.concatenate(cells)
        self._cells = (at[:, 0] * plane_size(ny, nz) + origin(nz) + at[:, 1] * (nz + 2) + at[:, 2]).astype(np.int64)
        self._normals, self._whole = np.concatenate(normals), np.concatenate(whole)
        self._velocity = np.zeros((len(at), 3))

    def impose(self, now: Lattice) -> None:
        """Before bounce-back and step: change what leaves towards walls so that they take the stress, no more."""
        flat = now.reshape(-1)
        _speeds(flat, self._stride, self._cells, self._velocity)
        _exchange(flat, self._stride, self._cells, self._normals, self._whole, self._velocity, self._viscosity)

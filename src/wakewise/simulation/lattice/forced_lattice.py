"""Lattice Boltzmann box as the water of a flight: moving point forces, bodies at rest, a steady current.

World axes, z down: the high z face is the bed, the low one the surface (a mirror), the sides are open. Forces at moving
points are shared between their eight cells; bodies are cells at rest; the current enters through the faces.
"""

from __future__ import annotations

import copy
import math

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.jit.njit import njit
from wakewise.simulation.lattice.kernel import push, step, velocity
from wakewise.simulation.lattice.stencil import (
    OPEN,
    PERIODIC,
    SHAPES,
    VELOCITIES,
    WALL,
    WEIGHTS,
    Lattice,
    box,
    origin,
    plane_row,
    smagorinsky_factor,
    still_water,
)


@njit
def share_out(at: Array, forces: Array, grid: Array) -> IntArray:
    """Share forces, shape (k, 3), between the eight cells about each place; the cells that got some, shape (c, 3).

    `at`, shape (k, 3): places in cells, whole numbers at the middles of cells. `grid`, shape (nx, ny, nz, 3): all zero;
    gets the forces. A share that would fall outside is left out.
    """
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    cells = np.empty((8 * at.shape[0], 3), np.int64)
    count = 0
    for k in range(at.shape[0]):
        i, j, m = math.floor(at[k, 0]), math.floor(at[k, 1]), math.floor(at[k, 2])
        u, v, w = at[k, 0] - i, at[k, 1] - j, at[k, 2] - m
        for corner in range(8):
            a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
            x, y, z = i + a, j + b, m + c
            if not (0 <= x < nx and 0 <= y < ny and 0 <= z < nz):
                continue
            share = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
            if share <= 0.0:
                continue
            if grid[x, y, z, 0] == 0.0 and grid[x, y, z, 1] == 0.0 and grid[x, y, z, 2] == 0.0:
                cells[count, 0], cells[count, 1], cells[count, 2] = x, y, z
                count += 1
            for axis in range(3):
                grid[x, y, z, axis] += share * forces[k, axis]
            if grid[x, y, z, 0] == 0.0 and grid[x, y, z, 1] == 0.0 and grid[x, y, z, 2] == 0.0:
                grid[x, y, z, 0] = 1e-300  # it is listed already, although its forces cancel
    return cells[:count].copy()


@njit
def at_rest(src: Lattice, dst: Lattice, nz: int, cells: IntArray) -> None:
    """Put the water of some cells, shape (k, 3), counted with halo, to rest; what came keeps its pressure."""
    mz, start = nz + 2, origin(nz)
    for k in range(cells.shape[0]):
        x, at = cells[k, 0], start + cells[k, 1] * mz + cells[k, 2]
        excess = 0.0
        for i in range(19):
            excess += src[i, x - VELOCITIES[i, 0], at - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]]
        for i in range(19):
            dst[i, x, at] = WEIGHTS[i] * excess


@njit
def interpolated(field: Lattice, solid: BoolArray, at: Array) -> Array:
    """A field of vectors, shape (3, nx, ny, nz), at places in cells, shape (k, 3): linear between, level outside.

    Cells of solid bodies, shape (nx, ny, nz), do not count: beside a wall the value is that of the water. Where
    all cells about a place are solid it is zero.
    """
    out = np.zeros((at.shape[0], 3))
    for k in range(at.shape[0]):
        x = min(max(at[k, 0], 0.0), field.shape[1] - 1.0)
        y = min(max(at[k, 1], 0.0), field.shape[2] - 1.0)
        z = min(max(at[k, 2], 0.0), field.shape[3] - 1.0)
        i, j, m = int(x), int(y), int(z)
        i, j, m = min(i, field.shape[1] - 2), min(j, field.shape[2] - 2), min(m, field.shape[3] - 2)
        u, v, w = x - i, y - j, z - m
        whole = 0.0
        for corner in range(8):
            a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
            if solid[i + a, j + b, m + c]:
                continue
            share = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
            whole += share
            for axis in range(3):
                out[k, axis] += share * field[axis, i + a, j + b, m + c]
        if whole > 0.0:
            for axis in range(3):
                out[k, axis] /= whole
    return out


SMAGORINSKY = 0.12
REYNOLDS = 1.0e4
"""Of the fastest jet, as in the cases: beyond it round jets no longer depend on it."""
FASTEST = 0.2
"""Speed in cells per step of the fastest jet that is planned for; small against that of sound, 0.577."""
_SPONGE_VISCOSITY, _SPONGE_D = 0.4, 2.6
"""At an open face, over the fastest speed and a jet's diameter, and how many diameters it fades over. Jets leave here
at half a metre a second, not as what is left of them far from a disk: with .05 over one diameter (`run`) the face sent
back twice the jet's speed after eight seconds."""
_MIRROR = np.array(
    [next(j for j in range(19) if np.array_equal(VELOCITIES[j], VELOCITIES[i] * (1, 1, -1))) for i in range(19)]
)
_DOWN = np.flatnonzero(VELOCITIES[:, 2] == 1)


def still_populations(velocity_cells: Array) -> Array:
    """Equilibrium deviations from rest, shape (19,), of water at rest pressure that moves, in cells per step."""
    u = np.asarray(velocity_cells, dtype=np.float64)
    return WEIGHTS * (3.0 * VELOCITIES @ u + np.einsum("iab,a,b->i", SHAPES, u, u))


class ForcedLattice:
    """Water in a box; `advance` steps it, `velocity` samples it.

    - `low_W_m`, shape (3,): its low corner; z is that of the water's surface.
    - `cells`: along north, east and down.
    - `fastest_m_s`: the fastest jet that is to be expected: it sets the time step.
    - `jet_m`: diameter of such a jet.
    - `current_W_m_s`, shape (3,): steady current, level.
    - `solid`, shape `cells`: cells of bodies that stand still.

    Raises InputError if the box has too few cells, or a current that is not level or is faster than the fastest jet.
    """

    def __init__(
        self,
        low_W_m: Array,
        cells: tuple[int, int, int],
        cell_m: float,
        *,
        fastest_m_s: float,
        jet_m: float,
        current_W_m_s: Array,
        solid: BoolArray,
        density_kg_m3: float,
    ) -> None:
        if min(cells) < 8:
            raise InputError(f"lattice: {cells} cells, needs 8 or more along each side")
        current = np.asarray(current_W_m_s, dtype=np.float64)
        if abs(current[2]) > 1e-9 or np.linalg.norm(current) > fastest_m_s:
            raise InputError(
                f"lattice: a current of {current.tolist()} m/s, needs a level one of at most {fastest_m_s:g} m/s"
            )
        self.low_W_m = np.array(low_W_m, dtype=np.float64)
        self.cells, self.cell_m = cells, cell_m
        self.step_s = FASTEST * cell_m / fastest_m_s
        self._speed_m_s = cell_m / self.step_s
        self._force_N = density_kg_m3 * cell_m**4 / self.step_s**2  # of one lattice unit
        n = jet_m / cell_m
        across = math.ceil(_SPONGE_D * n)
        unit = 3 * _SPONGE_VISCOSITY * FASTEST * n
        nx, ny, nz = cells
        tau_x = 0.5 + 3 * FASTEST * n / REYNOLDS + unit * _side_ramp(nx, across)
        tau_yz = np.repeat((unit * _side_ramp(ny, across))[:, None], nz + 2, axis=1)
        self._tau_x, self._tau_yz = tau_x.astype(np.float32), plane_row(tau_yz)
        self._eddies = smagorinsky_factor(SMAGORINSKY)
        self._stream = still_populations(current / self._speed_m_s).astype(np.float32)
        enters = [current[0] > 0.0, current[0] < 0.0, current[1] > 0.0, current[1] < 0.0]
        # What a face of the first kind lets in lies in the halo, which `_fill_halo` writes.
        self._faces = np.array([PERIODIC if e else OPEN for e in enters] + [PERIODIC, WALL])
        self._bodies = np.ascontiguousarray(solid, dtype=np.bool_)
        self._solid: IntArray = np.ascontiguousarray(np.argwhere(solid) + 1)
        self._now, self._next = still_water(cells), still_water(cells)
        if current.any():
            box(self._now, ny, nz)[:] = self._stream[:, None, None, None]
        self._field: Lattice = np.zeros((4, nx, ny, nz), np.float32)
        self._fresh = False
        self._pushed = np.zeros((nx, ny, nz, 3))
        self.time_s = 0.0

    def copy(self) -> ForcedLattice:
        """The same water now, which goes its own way from here."""
        return copy.deepcopy(self)

    def advance(self, points_W_m: Array, forces_N: Array) -> None:
        """One step under forces on the water, both shape (k, 3); what lies outside the box is left out.

        Raises StageError if the flow has blown up.
        """
        _, ny, nz = self.cells
        self._fill_halo()
        now, after, tau_x, tau_yz = self._now, self._next, self._tau_x, self._tau_yz
        step(now, after, ny, nz, tau_x, tau_yz, self._eddies, self._faces)
        if len(points_W_m):
            at = (np.asarray(points_W_m) - self.low_W_m) / self.cell_m - 0.5
            cells = share_out(at, np.asarray(forces_N) / self._force_N, self._pushed)
            forces = self._pushed[cells[:, 0], cells[:, 1], cells[:, 2]]
            self._pushed[cells[:, 0], cells[:, 1], cells[:, 2]] = 0.0
            push(now, after, nz, tau_x, tau_yz, self._eddies, cells + 1, forces)
        if len(self._solid):
            at_rest(now, after, nz, self._solid)
        self._now, self._next = after, now
        self._fresh = False
        self.time_s += self.step_s

    def _fill_halo(self) -> None:
        """Write what comes in through the surface and with the current."""
        _, ny, nz = self.cells
        water = box(self._now, ny, nz)
        water[_DOWN, :, :, 0] = water[_MIRROR[_DOWN], :, :, 1]
        stream = self._stream[:, None, None]
        for face, place in enumerate(((slice(None), 0), (slice(None), -1))):
            if self._faces[face] == PERIODIC:
                water[place] = stream
        for face, side in ((2, 0), (3, -1)):
            if self._faces[face] == PERIODIC:
                water[:, :, side, :] = stream

    def field_m_s(self) -> Lattice:
        """Velocity of every cell now, shape (3, nx, ny, nz); a view that the next step overwrites.

        Raises StageError if the flow has blown up.
        """
        if not self._fresh:
            velocity(self._now, *self.cells[1:], self._field)
            self._field[1:] *= np.float32(self._speed_m_s)
            self._fresh = True
            if not np.isfinite(self._field[:, :: max(self.cells[0] // 8, 1)]).all():
                raise StageError(f"lattice: the flow blew up before {self.time_s:.1f} s; take smaller thrusts or cells")
        return self._field[1:]

    def velocity(self, points_W_m: Array, field_m_s: Lattice | None = None) -> Array:
        """Velocity in m/s at points, both shape (n, 3), now or in a field that was kept.

        Linear between the cells of water, that of the nearest cell outside the box.
        """
        at = (np.asarray(points_W_m, dtype=np.float64) - self.low_W_m) / self.cell_m - 0.5
        found: Array = interpolated(self.field_m_s() if field_m_s is None else field_m_s, self._bodies, at)
        return found

    def holds(self, points_W_m: Array) -> bool:
        """Whether all points, shape (n, 3), are inside, a cell and more from the sides."""
        at = (np.asarray(points_W_m) - self.low_W_m) / self.cell_m
        return bool(np.all(at[:, :2] > 1.0) and np.all(at[:, :2] < np.array(self.cells[:2]) - 1.0))


def _side_ramp(cells: int, depth: int) -> Array:
    """From 0 to 1, as a square, over the last cells before either end of a line of cells with halo."""
    at = np.arange(cells + 2.0)
    near = np.minimum(at, at[::-1])
    ramp: Array = np.maximum(1.0 - near / max(depth, 1), 0.0) ** 2
    return ramp


def disk_points(count: int, diameter_m: float) -> Array:
    """Points that stand for a disk, evenly over it (a sunflower's spiral), shape (count, 2)."""
    k = np.arange(count) + 0.5
    radius = 0.5 * diameter_m * np.sqrt(k / count)
    turn = k * math.pi * (3.0 - math.sqrt(5.0))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)

"""Compiled loops of the silt (`sediment`): erosion by cells, motion and settling of particles, concentration."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.simulation.tank.grains import friction_from

LEAST_LOOSE_KG_M2 = 1e-9  # less than this above the firm layer is none


@njit(nogil=True)
def stirred_cells(circles: Array, low: Array, cell: Array, margin_m: float, near: np.ndarray) -> None:
    """Mark the cells of a grid, shape (nx, ny), whose centres lie in circles (x, y, radius) widened by a margin."""
    nx, ny = near.shape
    for c in range(circles.shape[0]):
        reach = circles[c, 2] + margin_m
        first = max(math.floor((circles[c, 0] - reach - low[0]) / cell[0]), 0)
        last = min(math.floor((circles[c, 0] + reach - low[0]) / cell[0]), nx - 1)
        for i in range(first, last + 1):
            dx = low[0] + (i + 0.5) * cell[0] - circles[c, 0]
            left = reach * reach - dx * dx
            if left <= 0.0:
                continue
            half = math.sqrt(left)
            start = max(math.floor((circles[c, 1] - half - low[1]) / cell[1]), 0)
            stop = min(math.floor((circles[c, 1] + half - low[1]) / cell[1]), ny - 1)
            for j in range(start, stop + 1):
                dy = low[1] + (j + 0.5) * cell[1] - circles[c, 1]
                if dy * dy < left:
                    near[i, j] = True


@njit(nogil=True)
def cells_to_look_at(
    near: np.ndarray, looked: np.ndarray, odd: int, low: Array, cell: Array, depth: float
) -> tuple[np.ndarray, IntArray, Array]:
    """Which of the stirred cells keep what they felt, which are looked at, shape (m, 2), and the places of the look.

    A cell that was stirred and `looked` at keeps what it felt if it is of the colour `odd` of a chessboard; the others
    are looked at, at the bed under their middles. The first place, shape (m + 1, 3), is the farthest corner.
    """
    kept = near & looked
    cells, places = np.empty((near.size, 2), np.int64), np.empty((near.size + 1, 3))
    places[0, 0], places[0, 1], places[0, 2] = low[0], low[1], depth
    count = 0
    for i in range(near.shape[0]):
        for j in range(near.shape[1]):
            kept[i, j] &= (i + j) % 2 == odd
            if near[i, j] and not kept[i, j]:
                cells[count, 0], cells[count, 1] = i, j
                count += 1
                places[count, 0], places[count, 1] = low[0] + (i + 0.5) * cell[0], low[1] + (j + 0.5) * cell[1]
                places[count, 2] = depth
    return kept, cells[:count].copy(), places[: count + 1].copy()


@njit(nogil=True)
def update_friction(star: Array, kept: np.ndarray, cells: IntArray, u: Array, table: Array) -> None:
    """Renew the friction velocities of cells, shape (nx, ny), from the water's velocities `u` at `cells_to_look_at`."""
    away = friction_from(table, math.sqrt(u[0, 0] ** 2 + u[0, 1] ** 2))
    for i in range(star.shape[0]):
        for j in range(star.shape[1]):
            if not kept[i, j]:
                star[i, j] = away
    for q in range(cells.shape[0]):
        star[cells[q, 0], cells[q, 1]] = friction_from(table, math.sqrt(u[q + 1, 0] ** 2 + u[q + 1, 1] ** 2))


@njit(nogil=True)
def moved_cells(star: Array, bed: Array, least: float) -> tuple[IntArray, Array, Array]:
    """Cells, shape (m, 2), that have a load and a friction velocity above the least, and both there, shape (m,)."""
    cells, count = np.empty((star.size, 2), np.int64), 0
    stars, loads = np.empty(star.size), np.empty(star.size)
    for i in range(star.shape[0]):
        for j in range(star.shape[1]):
            if star[i, j] > least and bed[i, j] > 0.0:
                cells[count, 0], cells[count, 1] = i, j
                stars[count], loads[count] = star[i, j], bed[i, j]
                count += 1
    return cells[:count].copy(), stars[:count].copy(), loads[:count].copy()


@njit(nogil=True)
def entrain(cells: IntArray, particles: Array, birth_kg: float, area_m2: float, firm_kg_m2: float, bed: Array) -> Array:
    """Take whole particles of a mass from cells of the bed, shape (m, 2): as many as `particles`, shape (m,), holds.

    What is loose goes first: the firm layer below it gives up its first grain in the step after. Returns the particles
    in use, shape (k, 3): the two numbers of the cell, and the mass.
    """
    lifted, count = np.empty((cells.shape[0], 3)), 0
    for q in range(cells.shape[0]):
        many, i, j = math.floor(particles[q]), cells[q, 0], cells[q, 1]
        if many < 1:
            continue
        loose = bed[i, j] - firm_kg_m2
        mass = min(many * birth_kg, (loose if loose > LEAST_LOOSE_KG_M2 else bed[i, j]) * area_m2)
        bed[i, j] = max(bed[i, j] - mass / area_m2, 0.0)
        lifted[count, 0], lifted[count, 1], lifted[count, 2] = i, j, mass
        count += 1
    return lifted[:count].copy()


@njit(nogil=True)
def particles_to_sample(u: Array, age: Array, dt_s: float, held_m: float, held_s: float) -> IntArray:
    """Particles whose water velocity must be evaluated before a step; the ages of the others' velocities grow."""
    found, count = np.empty(age.shape[0], np.int64), 0
    for k in range(age.shape[0]):
        age[k] += dt_s
        speed = math.sqrt(u[k, 0] ** 2 + u[k, 1] ** 2 + u[k, 2] ** 2)
        if age[k] > held_s - 1e-9 or speed * age[k] > held_m:
            age[k] = 0.0
            found[count] = k
            count += 1
    return found[:count].copy()


@njit(nogil=True)
def deposit(
    landed: np.ndarray, position: Array, mass: Array, u: Array, age: Array, bed: Array, low: Array, cell: Array
) -> int:
    """Put particles that have landed onto the bed, shape (nx, ny) in kg/m2, and close the ranks; how many are left."""
    left = 0
    for k in range(mass.shape[0]):
        if landed[k]:
            i = min(max(math.floor((position[k, 0] - low[0]) / cell[0]), 0), bed.shape[0] - 1)
            j = min(max(math.floor((position[k, 1] - low[1]) / cell[1]), 0), bed.shape[1] - 1)
            bed[i, j] += mass[k] / (cell[0] * cell[1])
            continue
        mass[left], age[left] = mass[k], age[k]
        for c in range(3):
            position[left, c], u[left, c] = position[k, c], u[k, c]
        left += 1
    return left


@njit(nogil=True)
def advect_particles(
    position: Array, u: Array, settling_m_s: float, dt_s: float, low: Array, depth: float
) -> np.ndarray:
    """Move particles, shape (n, 3), in place with the water and down; return which of them reached the bed.

    Downward flow vanishes at the bed in proportion to the height, so water alone never carries silt into it.
    """
    n = position.shape[0]
    landed = np.zeros(n, np.bool_)
    for k in range(n):
        height = depth - position[k, 2]
        down, up = max(u[k, 2], 0.0), -min(u[k, 2], 0.0)
        settled = height * math.exp(-down * dt_s / max(height, 1e-9)) + up * dt_s - settling_m_s * dt_s
        landed[k] = settled <= 0.0
        position[k, 0] = _turned_back(position[k, 0] + u[k, 0] * dt_s, -low[0])
        position[k, 1] = _turned_back(position[k, 1] + u[k, 1] * dt_s, -low[1])
        position[k, 2] = _between(depth - settled, depth)
    return landed


@njit(nogil=True)
def mix(
    position: Array, kicks: Array, star: Array, low: Array, cell: Array, depth: float, dt_s: float, laws: Array
) -> None:
    """Random walk with drift, in place; `kicks` are standard normal, shape (n, 3).

    `star`, shape (nx, ny), is the friction velocity of the cells; `laws` are von Karman's constant, the height up to
    which mixing grows and the background diffusivity.
    """
    karman, highest, background = laws[0], laws[1], laws[2]
    nx, ny = star.shape
    for k in range(position.shape[0]):
        i = min(max(math.floor((position[k, 0] - low[0]) / cell[0]), 0), nx - 1)
        j = min(max(math.floor((position[k, 1] - low[1]) / cell[1]), 0), ny - 1)
        height = depth - position[k, 2]
        mixing = karman * min(height, highest)
        i0, i1, j0, j1 = max(i - 1, 0), min(i + 1, nx - 1), max(j - 1, 0), min(j + 1, ny - 1)
        drift_x = mixing * (star[i1, j] - star[i0, j]) / ((i1 - i0) * cell[0])
        drift_y = mixing * (star[i, j1] - star[i, j0]) / ((j1 - j0) * cell[1])
        drift_z = -karman * star[i, j] if height < highest else 0.0
        # K half a drift step on, as Visser's scheme has it, keeps the mixture even next to the bed.
        on = abs(height - 0.5 * drift_z * dt_s)
        size = math.sqrt(2 * (background + karman * star[i, j] * min(on, highest)) * dt_s)
        position[k, 0] = _turned_back(position[k, 0] + drift_x * dt_s + size * kicks[k, 0], -low[0])
        position[k, 1] = _turned_back(position[k, 1] + drift_y * dt_s + size * kicks[k, 1], -low[1])
        position[k, 2] = _between(position[k, 2] + drift_z * dt_s + size * kicks[k, 2], depth)


@njit(nogil=True)
def shared_among_nodes(position: Array, mass: Array, origin: Array, spacing: float, values: Array) -> None:
    """Add each particle's mass to the eight nodes round it, with weights linear in the distance (cloud in cell)."""
    for k in range(mass.shape[0]):
        x = (position[k, 0] - origin[0]) / spacing
        y = (position[k, 1] - origin[1]) / spacing
        z = (position[k, 2] - origin[2]) / spacing
        i, j, h = math.floor(x), math.floor(y), math.floor(z)
        a, b, c = x - i, y - j, z - h
        for di in range(2):
            if not 0 <= i + di < values.shape[0]:
                continue
            for dj in range(2):
                if not 0 <= j + dj < values.shape[1]:
                    continue
                for dh in range(2):
                    if 0 <= h + dh < values.shape[2]:
                        weight = (a if di else 1 - a) * (b if dj else 1 - b) * (c if dh else 1 - c)
                        values[i + di, j + dj, h + dh] += mass[k] * weight


@njit(nogil=True)
def _turned_back(x: float, half: float) -> float:
    """Mirrored into -half to half if it is beyond."""
    if x > half:
        x = 2 * half - x
    elif x < -half:
        x = -2 * half - x
    return min(max(x, -half), half)


@njit(nogil=True)
def _between(z: float, depth: float) -> float:
    """Mirrored into 0 to depth if it is beyond."""
    z = abs(z)
    if z > depth:
        z = 2 * depth - z
    return min(max(z, 0.0), depth)

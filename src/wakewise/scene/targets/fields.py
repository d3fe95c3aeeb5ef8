"""Signed distance fields on a regular grid, and their zero surface as a closed mesh.

Each grid value is written by one thread, so the result does not depend on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit, prange
from wakewise.scene.targets.mesh import Mesh

OUTSIDE_M = 1.0
"""Value of a field far from every solid."""
BURIED_M = 0.01
"""How far the foot of a procedural target reaches below the bed."""


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distances in metres, negative inside, at `origin_m + spacing_m * (i, j, k)`; filled by the kernels."""

    origin_m: Array
    spacing_m: float
    values: np.ndarray

    @classmethod
    def around(cls, low_m: Array, high_m: Array, spacing_m: float) -> DistanceGrid:
        """Grid that holds the box from `low_m` to `high_m` with four cells to spare, OUTSIDE_M everywhere."""
        origin = np.asarray(low_m, dtype=np.float64) - 4 * spacing_m
        shape = np.ceil((np.asarray(high_m) - origin) / spacing_m).astype(int) + 5
        return cls(origin, spacing_m, np.full(shape, OUTSIDE_M, dtype=np.float32))


def zero_surface(grid: DistanceGrid) -> Mesh:
    """Largest closed piece of the surface where the field is zero, oriented outward."""
    from skimage.measure import marching_cubes

    # Marching cubes makes a sliver or a pinched vertex where a sample is exactly zero: move those by a nanometre.
    values = np.where(np.abs(grid.values) < 1e-9, np.float32(1e-9), grid.values)
    vertices, faces, _, _ = marching_cubes(values, 0.0, spacing=(grid.spacing_m,) * 3, gradient_direction="ascent")
    n = len(vertices)
    edges = coo_array((np.ones(2 * len(faces), dtype=np.int8), (faces[:, :2].ravel(), faces[:, 1:].ravel())), (n, n))
    _, piece = connected_components(edges, directed=False)
    # A cave that is cut off inside the solid is a piece of its own and invisible.
    faces = faces[piece[faces[:, 0]] == np.argmax(np.bincount(piece))]
    used, faces = np.unique(faces, return_inverse=True)
    mesh = Mesh(vertices[used].astype(np.float64) + grid.origin_m, faces.reshape(-1, 3))
    return Mesh(mesh.vertices_m, mesh.faces[:, ::-1]) if mesh.volume_m3 < 0 else mesh


@njit(inline="always")
def _lattice(i: int, j: int, k: int, seed: int) -> float:
    """Reproducible number in [0, 1) of a lattice corner: integer mixing after T. Wang's 32-bit hash."""
    h = (i * 73856093 ^ j * 19349663 ^ k * 83492791 ^ seed * 2654435761) & 0xFFFFFFFF
    h = (h ^ 61) ^ (h >> 16)
    h = (h * 9) & 0xFFFFFFFF
    h = h ^ (h >> 4)
    h = (h * 0x27D4EB2D) & 0xFFFFFFFF
    h = h ^ (h >> 15)
    return h / 4294967296.0


@njit
def noise(x: float, y: float, z: float, seed: int) -> float:
    """Smooth value noise in [-1, 1] with features of size one: cubic fade between random lattice corners."""
    i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
    fx, fy, fz = x - i, y - j, z - k
    u, v, w = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy), fz * fz * (3 - 2 * fz)
    total = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                share = (u if a else 1 - u) * (v if b else 1 - v) * (w if c else 1 - w)
                total += share * _lattice(i + a, j + b, k + c, seed)
    return 2.0 * total - 1.0


@njit(inline="always")
def smooth_min(a: float, b: float, k: float) -> float:
    """Lower of a and b with the corner rounded over the length k (quadratic polynomial)."""
    h = max(k - abs(a - b), 0.0) / k
    return min(a, b) - 0.25 * k * h * h


@njit(parallel=True)
def add_cones(
    values: Array, origin: Array, spacing: float, start: Array, end: Array, start_radius: Array, end_radius: Array,
    blend: float,
) -> None:  # fmt: skip
    """Unite round cones, from `start` to `end` (n, 3), with what is there; joints are filleted over `blend` metres."""
    for ix in prange(values.shape[0]):
        x = origin[0] + ix * spacing
        for c in range(start.shape[0]):
            margin = max(start_radius[c], end_radius[c]) + 2.0 * blend
            if x < min(start[c, 0], end[c, 0]) - margin or x > max(start[c, 0], end[c, 0]) + margin:
                continue
            y0 = max(0, int((min(start[c, 1], end[c, 1]) - margin - origin[1]) / spacing))
            y1 = min(values.shape[1], int((max(start[c, 1], end[c, 1]) + margin - origin[1]) / spacing) + 2)
            z0 = max(0, int((min(start[c, 2], end[c, 2]) - margin - origin[2]) / spacing))
            z1 = min(values.shape[2], int((max(start[c, 2], end[c, 2]) + margin - origin[2]) / spacing) + 2)
            dx, dy, dz = end[c, 0] - start[c, 0], end[c, 1] - start[c, 1], end[c, 2] - start[c, 2]
            length2 = dx * dx + dy * dy + dz * dz
            for iy in range(y0, y1):
                py = origin[1] + iy * spacing - start[c, 1]
                for iz in range(z0, z1):
                    px, pz = x - start[c, 0], origin[2] + iz * spacing - start[c, 2]
                    t = min(1.0, max(0.0, (px * dx + py * dy + pz * dz) / length2))
                    gap = np.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2 + (pz - t * dz) ** 2)
                    gap -= start_radius[c] + (end_radius[c] - start_radius[c]) * t
                    values[ix, iy, iz] = smooth_min(values[ix, iy, iz], gap, blend)


@njit(parallel=True)
def roughen(values: Array, origin: Array, spacing: float, amplitude: float, feature: float, seed: int) -> None:
    """Shift the surface by noise of the given amplitude and feature size (metres), and half of it at half the size."""
    for ix in prange(values.shape[0]):
        x = (origin[0] + ix * spacing) / feature
        for iy in range(values.shape[1]):
            y = (origin[1] + iy * spacing) / feature
            for iz in range(values.shape[2]):
                if abs(values[ix, iy, iz]) < 2.0 * amplitude + 3.0 * spacing:
                    z = (origin[2] + iz * spacing) / feature
                    bump = noise(x, y, z, seed) + 0.5 * noise(2 * x, 2 * y, 2 * z, seed + 1)
                    values[ix, iy, iz] += amplitude / 1.5 * bump


@njit(parallel=True)
def add_dome(
    values: Array, origin: Array, spacing: float, radii: Array, relief: Array, chart_spacing: float, lump: float,
    seed: int,
) -> None:  # fmt: skip
    """Unite an ellipsoid about the origin, of half axes `radii` (3,), whose skin carries a relief.

    `relief` (n, n), in metres outward, is a chart with the pole in its middle, where a point lies as far from there,
    and in the same direction, as its arc from the pole. `lump` metres of broad noise make the dome uneven.
    """
    n = relief.shape[0]
    size = (radii[0] + radii[1] + radii[2]) / 3.0
    for ix in prange(values.shape[0]):
        x = origin[0] + ix * spacing
        for iy in range(values.shape[1]):
            y = origin[1] + iy * spacing
            for iz in range(values.shape[2]):
                z = origin[2] + iz * spacing
                ex, ey, ez = x / radii[0], y / radii[1], z / radii[2]
                level = np.sqrt(ex * ex + ey * ey + ez * ez)
                if level < 0.5 or level > 1.5:
                    # Too far from the skin to matter: only the sign counts here.
                    values[ix, iy, iz] = min(values[ix, iy, iz], (level - 1.0) * size)
                    continue
                gx, gy, gz = ex / radii[0], ey / radii[1], ez / radii[2]
                gap = level * (level - 1.0) / np.sqrt(gx * gx + gy * gy + gz * gz)
                aside = np.sqrt(ex * ex + ey * ey)
                arc = size * np.arctan2(aside, ez)
                u = 0.5 * (n - 1) + arc * ex / max(aside, 1e-9) / chart_spacing
                v = 0.5 * (n - 1) + arc * ey / max(aside, 1e-9) / chart_spacing
                u, v = min(max(u, 0.0), n - 1.001), min(max(v, 0.0), n - 1.001)
                i, j = int(u), int(v)
                fu, fv = u - i, v - j
                height = (relief[i, j] * (1 - fu) + relief[i + 1, j] * fu) * (1 - fv)
                height += (relief[i, j + 1] * (1 - fu) + relief[i + 1, j + 1] * fu) * fv
                height += lump * noise(2.5 * ex / level, 2.5 * ey / level, 2.5 * ez / level, seed)
                values[ix, iy, iz] = min(values[ix, iy, iz], gap - height)


@njit
def _sheet(u: float, v: float, length: float, flare: float, cup: float, wave: float, phase: float) -> float:
    """Height of a plate's middle sheet over its base plane: it flares outward, cups, and waves more towards the rim."""
    ruffle = wave * (u / length) ** 2 * np.sin(5.0 * np.arctan2(v, 0.35 * length + u) + phase)
    return -flare * u * u / length + cup * v * v / length + ruffle


@njit(parallel=True)
def add_plates(
    values: Array, origin: Array, spacing: float, base: Array, along: Array, across: Array, shape: Array, blend: float
) -> None:
    """Unite fan-shaped plates that grow from `base` (n, 3) along `along` (n, 3) with `across` (n, 3) as their width.

    `shape` (n, 8) has a row (length, half width, thickness at the root, thickness at the rim, flare, cup, wave, phase)
    for each plate: metres, but for the numbers flare and cup, and the phase in radians.
    """
    for ix in prange(values.shape[0]):
        x = origin[0] + ix * spacing
        for c in range(base.shape[0]):
            length, half_width, root, rim = shape[c, 0], shape[c, 1], shape[c, 2], shape[c, 3]
            flare, cup, wave, phase = shape[c, 4], shape[c, 5], shape[c, 6], shape[c, 7]
            normal = np.cross(across[c], along[c])
            for iy in range(values.shape[1]):
                y = origin[1] + iy * spacing
                for iz in range(values.shape[2]):
                    z = origin[2] + iz * spacing
                    px, py, pz = x - base[c, 0], y - base[c, 1], z - base[c, 2]
                    u = px * along[c, 0] + py * along[c, 1] + pz * along[c, 2]
                    v = px * across[c, 0] + py * across[c, 1] + pz * across[c, 2]
                    eu, ev = 2.0 * u / length - 1.0, v / half_width
                    spread = np.sqrt(eu * eu + ev * ev)
                    if spread > 1.5:
                        continue
                    lobes = 1.0 + 0.05 * np.sin(7.0 * np.arctan2(ev, eu) + 2.0 * phase)
                    outline = (spread / lobes - 1.0) * min(0.5 * length, half_width)
                    height = _sheet(u, v, length, flare, cup, wave, phase)
                    step = 1e-4
                    du = (_sheet(u + step, v, length, flare, cup, wave, phase) - height) / step
                    dv = (_sheet(u, v + step, length, flare, cup, wave, phase) - height) / step
                    w = px * normal[0] + py * normal[1] + pz * normal[2] - height
                    half = 0.5 * (root + (rim - root) * min(1.0, max(0.0, u / length)))
                    edge = 0.9 * half
                    flat = abs(w) / np.sqrt(1.0 + du * du + dv * dv) - (half - edge)
                    aside = outline + edge
                    gap = min(max(flat, aside), 0.0) + np.hypot(max(flat, 0.0), max(aside, 0.0)) - edge
                    values[ix, iy, iz] = smooth_min(values[ix, iy, iz], gap, blend)


def cut_below(grid: DistanceGrid, z_m: float) -> None:
    """Take away all that lies deeper than `z_m`, so that the solid ends in a flat foot."""
    z = grid.origin_m[2] + grid.spacing_m * np.arange(grid.values.shape[2])
    np.maximum(grid.values, (z_m - z).astype(np.float32), out=grid.values)


def labyrinth(size: int, wavelength_cells: float, rng: np.random.Generator) -> Array:
    """Meandering ridges and valleys of equal width, shape (size, size), about -1 to 1, periodic.

    They are the pattern that the Swift-Hohenberg equation u_t = r u - (1 + L^2)^2 u - u^3 grows out of noise (J. Swift
    and P. C. Hohenberg, Phys. Rev. A 15 (1977) 319, doi 10.1103/PhysRevA.15.319), linear part implicit, by FFT.
    """
    k = np.fft.fftfreq(size) * wavelength_cells
    k2 = k[:, None] ** 2 + k[None, : size // 2 + 1] ** 2
    drive, step = 0.5, 0.5
    shrink = 1.0 / (1.0 - step * (drive - (1.0 - k2) ** 2))
    u = 0.1 * rng.standard_normal((size, size))
    for _ in range(120):
        u = np.fft.irfft2(shrink * np.fft.rfft2(u - step * u**3), s=(size, size))
    return np.asarray(np.clip(u / (1.6 * np.std(u)), -1.0, 1.0), dtype=np.float64)

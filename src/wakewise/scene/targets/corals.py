"""Procedural corals: branching, brain and plate, which are stony; the soft targets are in `soft.py`.

Each is a closed mesh in a local frame with z up, in metres, 15 cm in its largest dimension above z = 0, and reaches a
little below z = 0 so that no gap opens where it stands on the bed. The same kind and seed give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.settings import seed_number
from wakewise.scene.targets.fields import (
    BURIED_M,
    DistanceGrid,
    add_cones,
    add_dome,
    add_plates,
    cut_below,
    labyrinth,
    roughen,
    zero_surface,
)
from wakewise.scene.targets.mesh import Mesh
from wakewise.scene.targets.soft import anemone, gorgonian, seagrass, soft_coral

LARGEST_DIMENSION_M = 0.15

Segment = tuple[Array, Array, float, float]


@lru_cache(maxsize=8, typed=True)
def coral(kind: str, seed: int = 0) -> Mesh:
    """Procedural coral or soft target of one of the kinds.

    Parameters
    ----------
    kind : str
        "branching", "brain" or "plate", which are stony, or one of `soft_kinds`.
    seed : int
        Which colony of that kind.

    Returns
    -------
    Mesh
        Closed, one piece (seagrass: one a blade), z up, standing through z = 0; kept in memory.

    Raises
    ------
    InputError
        If the kind is unknown or the seed negative.
    """
    if kind not in coral_kinds():
        raise InputError(f"coral '{kind}': unknown, allowed: {', '.join(coral_kinds())}")
    rng = np.random.default_rng(seed_number(seed, "coral seed"))
    if kind == "seagrass":
        return _SOFT[kind](rng)  # drawn to size: how a blade bends goes with the fourth power of its length
    return _to_size(zero_surface(_STONY[kind](rng)) if kind in _STONY else _SOFT[kind](rng))


def coral_kinds() -> list[str]:
    """Kinds that `coral` makes."""
    return [*stony_kinds(), *soft_kinds()]


def stony_kinds() -> list[str]:
    """Kinds of stony coral, which no water bends."""
    return sorted(_STONY)


def soft_kinds() -> list[str]:
    """Kinds that bend in flow; see `wakewise.scene.targets.tissues`."""
    return sorted(_SOFT)


def _to_size(mesh: Mesh) -> Mesh:
    """Scale about the origin so that the part above z = 0 has the stated largest dimension; centre it in x and y."""
    above = mesh.vertices_m[mesh.vertices_m[:, 2] > 0.0]
    low, high = above.min(axis=0), above.max(axis=0)
    low[2] = 0.0
    middle = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0])
    return Mesh((mesh.vertices_m - middle) * (LARGEST_DIMENSION_M / float(np.max(high - low))), mesh.faces)


def _branching(rng: np.random.Generator) -> DistanceGrid:
    """Staghorn-like bush (Acropora): a trunk that forks four times, each generation thinner, bent towards the light."""
    segments: list[Segment] = []

    def grow(base: Array, direction: Array, length_m: float, radius_m: float, forks: int) -> None:
        tip, tip_radius = base + length_m * direction, 0.86 * radius_m
        segments.append((base, tip, radius_m, tip_radius))
        if forks == 0:
            return
        children = 3 if forks >= 3 else 2
        turn = rng.uniform(0.0, 2 * np.pi)
        for child in range(children):
            azimuth = turn + 2 * np.pi * child / children
            aside = np.cross(direction, [np.cos(azimuth), np.sin(azimuth), 0.0])
            aside /= np.linalg.norm(aside)
            angle = np.deg2rad(rng.uniform(28.0, 44.0))
            heading = np.cos(angle) * direction + np.sin(angle) * aside + np.array([0.0, 0.0, 0.12])
            heading /= np.linalg.norm(heading)
            grow(tip, heading, length_m * rng.uniform(0.72, 0.92), tip_radius, forks - 1)

    up = np.array([0.0, 0.0, 1.0])
    grow(-BURIED_M * up, up, 0.045, 0.0125, 4)
    # The crust by which the colony holds on to the rock.
    segments.append((-BURIED_M * up, 0.006 * up, 0.024, 0.013))
    start, end = np.array([s[0] for s in segments]), np.array([s[1] for s in segments])
    radii = np.array([s[2:] for s in segments])
    width = float(radii.max())
    grid = DistanceGrid.around(
        np.minimum(start, end).min(axis=0) - width, np.maximum(start, end).max(axis=0) + width, 0.0011
    )
    add_cones(grid.values, grid.origin_m, grid.spacing_m, start, end, radii[:, 0], radii[:, 1], 0.006)
    roughen(grid.values, grid.origin_m, grid.spacing_m, 0.0011, 0.006, 5)
    cut_below(grid, -BURIED_M)
    return grid


def _brain(rng: np.random.Generator) -> DistanceGrid:
    """Brain coral (Platygyra, Diploria): a dome with meandering valleys, 9 mm from ridge to ridge and 3.5 mm deep."""
    radii = np.array([0.075, 0.075 * rng.uniform(0.86, 0.96), 0.062])
    chart_cells, cell_m = 320, 0.0009
    pattern = labyrinth(chart_cells, 0.009 / cell_m, rng)
    # Rounded ridges, narrower valleys: as the corallites stand in life.
    relief = 0.0035 * (np.sqrt(0.5 * (pattern + 1.0)) - 1.0)
    margin = 0.006
    grid = DistanceGrid.around(np.append(-radii[:2] - margin, -BURIED_M), radii + margin, 0.001)
    seed = int(rng.integers(1, 1_000_000))
    add_dome(grid.values, grid.origin_m, grid.spacing_m, radii, relief, cell_m, 0.005, seed)
    roughen(grid.values, grid.origin_m, grid.spacing_m, 0.0003, 0.003, seed + 7)
    cut_below(grid, -BURIED_M)
    return grid


def _plate(rng: np.random.Generator) -> DistanceGrid:
    """Plate coral of the vase-like sort (Turbinaria): wavy plates that rise and flare round a stalk in two whorls.

    Steep enough that the undersides can be seen from beside and the insides from above, as a survey from orbits needs.
    """
    root = np.array([0.0, 0.0, 0.012])
    base, along, across, shape = [], [], [], []
    for count, slope_deg, length, half_width, lift in ((4, 47.0, 0.088, 0.046, 0.0), (2, 70.0, 0.074, 0.034, 0.006)):
        turn = rng.uniform(0.0, 2 * np.pi)
        for plate in range(count):
            azimuth = turn + 2 * np.pi * (plate + rng.uniform(-0.08, 0.08)) / count
            slope = np.deg2rad(slope_deg + rng.uniform(-4.0, 4.0))
            out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            base.append(root + 0.002 * out + np.array([0.0, 0.0, lift]))
            along.append(np.cos(slope) * out + np.array([0.0, 0.0, np.sin(slope)]))
            across.append(np.array([-out[1], out[0], 0.0]))
            scale = rng.uniform(0.9, 1.05)
            wave, phase = rng.uniform(0.003, 0.005), rng.uniform(0.0, 2 * np.pi)
            shape.append([scale * length, scale * half_width, 0.010, 0.0066, 0.12, 0.55, wave, phase])
    reach = 0.1
    grid = DistanceGrid.around(np.array([-reach, -reach, -BURIED_M]), np.array([reach, reach, reach + 0.01]), 0.0012)
    foot = np.array([[0.0, 0.0, -BURIED_M], [0.0, 0.0, -BURIED_M]])
    top = np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 0.004]])
    lower, upper = np.array([0.016, 0.03]), np.array([0.012, 0.016])
    add_cones(grid.values, grid.origin_m, grid.spacing_m, foot, top, lower, upper, 0.008)
    plates = [np.array(part) for part in (base, along, across, shape)]
    add_plates(grid.values, grid.origin_m, grid.spacing_m, *plates, 0.006)
    roughen(grid.values, grid.origin_m, grid.spacing_m, 0.0006, 0.005, int(rng.integers(1, 1_000_000)))
    cut_below(grid, -BURIED_M)
    return grid


_STONY: dict[str, Callable[[np.random.Generator], DistanceGrid]] = {
    "branching": _branching,
    "brain": _brain,
    "plate": _plate,
}
_SOFT: dict[str, Callable[[np.random.Generator], Mesh]] = {
    "anemone": anemone,
    "gorgonian": gorgonian,
    "seagrass": seagrass,
    "soft-coral": soft_coral,
}

"""Procedural targets: branching, brain and plate corals (stony); gorgonian, soft coral, anemone, seagrass (soft).

Each is a closed mesh in a local frame with z up, in metres, 15 cm in its largest dimension above z = 0, and reaches
below z = 0 so that no gap opens on the bed. The same kind and seed give the same bytes.
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

UP = np.array([0.0, 0.0, 1.0])


def gorgonian(rng: np.random.Generator) -> Mesh:
    """Sea fan: a stem that forks in one plane, six times, into twigs 4 mm thick that lean towards the light."""
    segments: list[Segment] = []
    turn = rng.uniform(0.0, 2 * np.pi)
    across = np.array([np.cos(turn), np.sin(turn), 0.0])
    through = np.array([-np.sin(turn), np.cos(turn), 0.0])

    def grow(base: Array, lean: float, length_m: float, radius_m: float, forks: int) -> None:
        heading = np.sin(lean) * across + np.cos(lean) * UP + rng.uniform(-0.09, 0.09) * through
        tip = base + length_m * heading / np.linalg.norm(heading)
        thin = max(0.93 * radius_m, 0.0019)
        segments.append((base, tip, radius_m, thin))
        if forks == 0:
            return
        angle = rng.uniform(0.26, 0.42)
        for side in (-1.0, 1.0):
            towards = 0.86 * lean + side * angle * rng.uniform(0.8, 1.2)
            grow(tip, towards, rng.uniform(0.018, 0.026), max(0.84 * thin, 0.0019), forks - 1)

    root = -BURIED_M * UP
    middle = 0.022 * UP
    segments.append((root, middle, 0.0042, 0.0038))
    segments.append((root, 0.004 * UP, 0.020, 0.010))
    for lean in (-0.62, 0.02, 0.60):
        grow(middle, lean + rng.uniform(-0.06, 0.06), rng.uniform(0.022, 0.028), 0.0032, 5)
    return _united(segments, 0.0010, 0.003, 0.0003, int(rng.integers(1, 1_000_000)))


def soft_coral(rng: np.random.Generator) -> Mesh:
    """Finger leather coral (Sinularia): thirty slender fingers of 6 to 8 mm that rise from a low, fleshy crust."""
    segments: list[Segment] = []
    count = 30
    for k in range(count):
        share = np.sqrt((k + 0.5) / count)
        azimuth = 2.399963 * k + rng.uniform(-0.25, 0.25)  # the golden angle spreads them evenly
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        place = 0.030 * share * out - BURIED_M * UP
        lean = 0.85 * share * rng.uniform(0.75, 1.1)
        length = rng.uniform(0.105, 0.135) * (1.0 - 0.25 * share)
        radius = rng.uniform(0.0033, 0.0040)
        pieces = 4
        for _ in range(pieces):
            heading = np.sin(lean) * out + np.cos(lean) * UP
            after = place + length / pieces * heading
            thin = radius * 0.95
            segments.append((place, after, radius, thin))
            place, radius, lean = after, thin, 0.8 * lean + rng.uniform(-0.08, 0.08)
    segments.append((-BURIED_M * UP, 0.008 * UP, 0.040, 0.028))
    return _united(segments, 0.0011, 0.004, 0.0005, int(rng.integers(1, 1_000_000)))


def anemone(rng: np.random.Generator) -> Mesh:
    """Plumose sort of anemone (Metridium): a smooth column, a wider disc, and tentacles in four rings."""
    height = 0.085
    segments: list[Segment] = [
        (-BURIED_M * UP, 0.012 * UP, 0.026, 0.020),
        (0.012 * UP, 0.055 * UP, 0.020, 0.017),
        (0.055 * UP, height * UP, 0.017, 0.021),
        (height * UP, (height + 0.006) * UP, 0.021, 0.026),
    ]
    for ring, (radius, count, lean) in enumerate(
        ((0.028, 22, 1.15), (0.023, 18, 0.85), (0.017, 13, 0.5), (0.009, 7, 0.2))
    ):
        for k in range(count):
            azimuth = 2 * np.pi * (k + 0.5 * (ring % 2)) / count + rng.uniform(-0.1, 0.1)
            out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            place, tilt = 0.9 * radius * out + (height + 0.006 + 0.004 * ring) * UP, lean + rng.uniform(-0.15, 0.15)
            length, thick = rng.uniform(0.034, 0.046), 0.0030
            for _ in range(4):
                heading = np.sin(tilt) * out + np.cos(tilt) * UP
                after = place + 0.25 * length * heading
                segments.append((place, after, thick, 0.88 * thick))
                place, thick, tilt = after, 0.88 * thick, 0.82 * tilt + rng.uniform(-0.12, 0.12)
    return _united(segments, 0.0011, 0.004, 0.0002, int(rng.integers(1, 1_000_000)))


def seagrass(rng: np.random.Generator) -> Mesh:
    """A tuft of seagrass: sixteen blades of 9 mm by 1.2 mm that stand on their own, a little bowed and twisted."""
    blades = []
    for k in range(16):
        azimuth, share = 2.399963 * k, np.sqrt((k + 0.5) / 16)
        foot = 0.045 * share * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        bow = np.array([rng.uniform(-0.012, 0.012), rng.uniform(-0.012, 0.012), 0.0])
        blades.append(_blade(foot, rng.uniform(0.085, 0.120), bow, rng.uniform(0.0, 2 * np.pi), rng.uniform(-0.5, 0.5)))
    offsets = np.cumsum([0] + [len(blade.vertices_m) for blade in blades])
    faces = [blade.faces + first for blade, first in zip(blades, offsets[:-1], strict=True)]
    return Mesh(np.concatenate([blade.vertices_m for blade in blades]), np.concatenate(faces))


def _blade(foot: Array, height_m: float, bow_m: Array, turn: float, twist: float) -> Mesh:
    """A closed blade with a lens-shaped section, rounded at its end."""
    around, levels, half_width, half_thick = 12, 90, 0.0045, 0.0006
    angle = 2 * np.pi * np.arange(around) / around
    level = np.linspace(0.0, 1.0, levels)
    z = -BURIED_M + (height_m + BURIED_M) * level
    share = np.maximum(z, 0.0) / height_m
    # The last centimetre rounds off.
    wide = half_width * np.sqrt(np.clip(1.0 - np.maximum(0.0, (z - height_m + 0.009) / 0.0091) ** 2, 0.01, 1.0))
    heading = turn + twist * share
    u = wide[:, None] * np.cos(angle)
    v = half_thick * np.sin(angle) * np.sqrt(wide / half_width)[:, None]
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x = foot[0] + bow_m[0] * share[:, None] ** 2 + c * u - s * v
    y = foot[1] + bow_m[1] * share[:, None] ** 2 + s * u + c * v
    rings = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=2).reshape(-1, 3)
    ends = np.array([[*x[0:1].mean(axis=1), *y[0:1].mean(axis=1), z[0]], [x[-1].mean(), y[-1].mean(), z[-1]]])
    i, j = np.meshgrid(np.arange(levels - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    sides = np.concatenate([np.stack([a, b, b + around], axis=-1), np.stack([a, b + around, a + around], axis=-1)])
    k, following = np.arange(around), (np.arange(around) + 1) % around
    last, below, above = (levels - 1) * around, levels * around, levels * around + 1
    lids = [
        np.stack([np.full(around, below), following, k], 1),
        np.stack([np.full(around, above), last + k, last + following], 1),
    ]
    return Mesh(np.concatenate([rings, ends]), np.concatenate([sides.reshape(-1, 3), *lids]))


def _united(segments: list[Segment], spacing_m: float, blend_m: float, rough_m: float, seed: int) -> Mesh:
    """Surface of round cones, united with fillets and a little rough, cut off flat below the bed."""
    start, end = np.array([s[0] for s in segments]), np.array([s[1] for s in segments])
    radii = np.array([s[2:] for s in segments])
    width = float(radii.max())
    low, high = np.minimum(start, end).min(axis=0) - width, np.maximum(start, end).max(axis=0) + width
    grid = DistanceGrid.around(low, high, spacing_m)
    add_cones(grid.values, grid.origin_m, grid.spacing_m, start, end, radii[:, 0], radii[:, 1], blend_m)
    roughen(grid.values, grid.origin_m, grid.spacing_m, rough_m, 0.004, seed)
    cut_below(grid, -BURIED_M)
    return zero_surface(grid)


LARGEST_DIMENSION_M = 0.15

Segment = tuple[Array, Array, float, float]


@lru_cache(maxsize=8, typed=True)
def coral(kind: str, seed: int = 0) -> Mesh:
    """Procedural coral or soft target of one of the kinds.

    `kind`: "branching", "brain" or "plate", which are stony, or one of `soft_kinds`. `seed`: which colony of that kind.
    Returns closed, one piece (seagrass: one a blade), z up, standing through z = 0; kept in memory. Raises InputError
    if the kind is unknown or the seed negative.
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
    """Kinds that bend in flow; see `wakewise.scene.targets.elasticity`."""
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

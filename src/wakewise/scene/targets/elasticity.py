"""How a soft target bends: cantilevers that stand on the bed, each in the two shapes into which a stream bends it.

Every piece of the mesh that stands on the bed by itself is a cantilever, a *stem*: a whole colony, or one blade of
grass. Its stiffness against bending follows from Young's modulus and the level sections of the mesh, section by
section; branches cut by one section bend side by side. Each stem has two modes, along the axes in which it is softest
and stiffest, whose shape is that into which a uniform stream bends it, so that the static deflection in a stream is
that of beam theory and the natural frequency (Rayleigh's quotient) is 0.4 % high for an even beam. The mass is that of
the tissue and of the water that moves along.

Bending keeps the length of the axis: what moves aside comes down, and the stiffness grows with the slope, to the third
order (M. R. M. Crespo da Silva and C. C. Glynn 1978, J. Struct. Mech. 6, 437). Sections stay level. That holds while a
tip moves by about half of the height, `MAX_DEFLECTION_SHARE`; higher modes, torsion, and branches that swing apart are
left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.scene.targets.sections import sections
from wakewise.scene.targets.target import Target

MAX_DEFLECTION_SHARE = 0.5
"""Share of a stem's height by which its tip may move for the theory to hold."""
NODES = 48
"""Heights at which a stem is cut."""
FOOT_M = 0.002
"""What stands on the bed by itself is told apart this far above it."""
LEAST_SHARE = 0.3
"""Pieces lower than this share of the highest are stumps that do not move."""
_TIP_SHARE = 0.92  # a rounded tip has no stiffness at its very end: above this it keeps what it has here


@dataclass(frozen=True, kw_only=True)
class TissueProperties:
    """What a soft target is made of; where the numbers come from is in `wakewise.scene.targets.tissues`.

    `stiffness_Pa` is Young's modulus of the section as it is drawn, `density_kg_m3` that of the tissue, `drag` the
    coefficient on the area that a branch or blade turns to the stream, and `damping` the tissue's own, relative to
    critical; that of the water comes from the drag.
    """

    stiffness_Pa: float
    density_kg_m3: float
    drag: float
    damping: float


@dataclass(frozen=True, kw_only=True, eq=False)
class BendingModes:
    """Stems of a target and their modes; make it with `BendingModes.of`.

    Parameters
    ----------
    height_m : ndarray, shape (k,)
        Of each of k stems.
    axes_W : ndarray, shape (k, 2, 2)
        Level unit vectors (x, y) along which the first and the second mode move.
    shape, slope, drop : ndarray, shape (k, 2, nodes)
        At heights evenly spaced from the foot to the tip: how far a place moves along the axis for a tip that moves by
        one metre, its derivative by height in 1/m, and how far it comes down in 1/m, times the tip's way squared.
    mass_kg, stiffness_N_m, hardening_N_m3, damping_N_s_m, moved_water_kg : ndarray, shape (k, 2)
        Of each mode with the tip's way as coordinate q: m q'' + c q' + k q + h q^3 is the load on it, and
        `moved_water_kg` times the water's acceleration is the part of the load that comes from it.
    stress_Pa_m : ndarray, shape (k, 2)
        Largest bending stress per metre of the tip's way.
    stem : ndarray, shape (n,)
        Which stem each vertex of the target belongs to, -1 for none.
    bed_z_m : float
    """

    height_m: Array
    axes_W: Array
    shape: Array
    slope: Array
    drop: Array
    mass_kg: Array
    stiffness_N_m: Array
    hardening_N_m3: Array
    damping_N_s_m: Array
    moved_water_kg: Array
    stress_Pa_m: Array
    stem: IntArray
    z_m: Array
    bed_z_m: float

    def __post_init__(self) -> None:
        k = len(self.height_m)
        freeze(self, height_m=(k,), axes_W=(k, 2, 2), shape=(k, 2, None), slope=(k, 2, None), drop=(k, 2, None))
        freeze(self, mass_kg=(k, 2), stiffness_N_m=(k, 2), hardening_N_m3=(k, 2), damping_N_s_m=(k, 2))
        freeze(self, moved_water_kg=(k, 2), stress_Pa_m=(k, 2))

    @classmethod
    def of(cls, target: Target, tissue: TissueProperties, water_kg_m3: float) -> BendingModes:
        """Stems and modes of a target.

        Raises
        ------
        InputError
            If nothing of the target stands free of the bed, its mesh is open, or it falls over by its own weight.
        """
        mesh = target.mesh
        if not mesh.is_closed:
            raise InputError(
                f"target.sway: {target.name} has an open mesh, which has no sections; a closed one is needed"
            )
        places = mesh.vertices_m * [1.0, 1.0, -1.0] + [0.0, 0.0, target.bed_z_m]
        stem, heights = _stems(places, mesh.faces)
        parts = []
        for which, height in enumerate(heights):
            own = np.any(stem[mesh.faces] == which, axis=1)
            parts.append(_modes(places, mesh.faces[own], float(height), tissue, water_kg_m3))
        if any(float(part["stiffness_N_m"].min()) <= 0.0 for part in parts):
            raise InputError(
                f"target.sway: {target.name} of {tissue.stiffness_Pa:g} Pa and {tissue.density_kg_m3:g} kg/m3 cannot "
                "stand upright; a stiffer or lighter one can"
            )
        columns = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
        return cls(height_m=heights, stem=stem, z_m=mesh.vertices_m[:, 2], bed_z_m=target.bed_z_m, **columns)

    @property
    def frequency_Hz(self) -> Array:
        """Natural frequency of each mode in still water, shape (k, 2)."""
        return np.asarray(np.sqrt(self.stiffness_N_m / self.mass_kg) / (2.0 * np.pi))

    def at(self, stem: IntArray, z_m: Array) -> tuple[Array, Array, Array]:
        """Shape, slope and drop of both modes, each shape (n, 2), at depths z in stems; zero where there is none."""
        place = np.where(stem >= 0, stem, 0)
        span = self.height_m[place]
        nodes = self.shape.shape[2]
        along = np.clip((self.bed_z_m - z_m) / span, 0.0, 1.0) * (nodes - 1)
        low = np.minimum(along.astype(np.int64), nodes - 2)
        part = (along - low)[:, None]
        some = (stem >= 0)[:, None]
        found = [
            np.where(some, (1.0 - part) * table[place, :, low] + part * table[place, :, low + 1], 0.0)
            for table in (self.shape, self.slope, self.drop)
        ]
        return found[0], found[1], found[2]

    def moved(self, stem: IntArray, points_W_m: Array, tips_m: Array) -> Array:
        """How far points at rest have moved, shape (n, 3), when the tips have moved by `tips_m`, shape (k, 2)."""
        shape, _, drop = self.at(stem, points_W_m[:, 2])
        place = np.where(stem >= 0, stem, 0)
        return ways_m(tips_m[place], shape, drop, self.axes_W[place])

    def bent(self, tips_m: Array) -> tuple[Array, Array]:
        """How far the target's vertices have moved, shape (n, 3), and the slope (x, y) of the axis there, (n, 2).

        For tips that have moved by `tips_m`, shape (k, 2); see `turned_normals` for what the slope does to the surface.
        """
        place, axes, shape, slope, drop = self._vertices
        tips = tips_m[place]
        return ways_m(tips, shape, drop, axes), _along(tips * slope, axes)

    @cached_property
    def _vertices(self) -> tuple[IntArray, Array, Array, Array, Array]:
        """Stem, axes, shape, slope and drop at each vertex: what does not hang on how far the tips have moved."""
        place = np.where(self.stem >= 0, self.stem, 0)
        return place, self.axes_W[place], *self.at(self.stem, self.z_m)


def _along(ways: Array, axes: Array) -> Array:
    """Level vectors, shape (n, 2), of ways (n, 2) along two axes each, (n, 2, 2)."""
    return np.asarray(ways[:, :1] * axes[:, 0] + ways[:, 1:] * axes[:, 1])


def ways_m(tips: Array, shape: Array, drop: Array, axes: Array) -> Array:
    """How far points have moved, shape (n, 3): `BendingModes.moved` where each one's tip and all about its stem is
    known.

    `tips`, `shape` and `drop`, shape (n, 2), and `axes`, shape (n, 2, 2), are those of each point's own stem.
    """
    down = tips[:, 0] ** 2 * drop[:, 0] + tips[:, 1] ** 2 * drop[:, 1]
    return np.column_stack([_along(tips * shape, axes), down])


def turned_normals(normals: Array, tilt: Array) -> Array:
    """Unit normals (n, 3) of a surface whose level sections are shifted with the slope `tilt` (n, 2) over height."""
    (x, y, z), (a, b) = normals.T, tilt.T
    keeps = np.maximum(1.0 - 0.5 * (a**2 + b**2), 0.1)
    x, y, z = keeps * x, keeps * y, z + x * a + y * b
    length = np.maximum(np.sqrt(x**2 + y**2 + z**2), 1e-30)
    return np.column_stack([x / length, y / length, z / length])


def _stems(places: Array, faces: IntArray) -> tuple[IntArray, Array]:
    """Which stem each vertex belongs to (n,), and the heights (k,); `places` has heights as third coordinate."""
    n = len(places)
    used = places[:, 2] > FOOT_M
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    ends = ends[np.all(used[ends], axis=1)]
    pairs = (np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1]))
    piece = connected_components(coo_array(pairs, (n, n)), directed=False)[1]
    names, label = np.unique(piece[used], return_inverse=True)
    top = np.full(len(names), -np.inf)
    np.maximum.at(top, label, places[used, 2])
    if not len(names):
        raise InputError(f"target.sway: nothing of the target stands more than {1e3 * FOOT_M:g} mm above the bed")
    high = top >= LEAST_SHARE * top.max()
    number = np.where(high, np.cumsum(high) - 1, -1)
    stem = np.full(n, -1, dtype=np.int64)
    stem[used] = number[label]
    return stem, top[high]


def _modes(
    places: Array, faces: IntArray, height: float, tissue: TissueProperties, water_kg_m3: float
) -> dict[str, Array]:
    """Both modes of one stem; `places` has heights as third coordinate."""
    step = height / NODES
    middles = (np.arange(NODES) + 0.5) * step
    cut = sections(places, faces, np.maximum(middles, FOOT_M + 1e-6))
    second = cut.second_m4.copy()
    tip = int(_TIP_SHARE * NODES)
    second[tip:] = second[tip]
    if not np.all(np.linalg.eigvalsh(second)[:, 0] > 0.0):
        raise InputError("target.sway: the mesh has gaps: a level section through a stem cuts nothing")
    softness = np.linalg.inv(second)
    corners = places[faces]
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    row = np.clip((corners[:, :, 2].mean(axis=1) / step).astype(np.int64), 0, NODES - 1)
    vectors = vectors * (corners[:, :, 2].mean(axis=1) > 0.0)[:, None]

    def width(axis: Array | None) -> Array:
        """Width that the stem turns to a stream along an axis, or in the mean over all, at each height."""
        facing = 2.0 / np.pi * np.linalg.norm(vectors[:, :2], axis=1) if axis is None else np.abs(vectors[:, :2] @ axis)
        return np.asarray(np.bincount(row, 0.5 * facing, NODES) / step)

    def moment(load: Array) -> Array:
        lever = middles[None, :] - middles[:, None]
        return np.asarray((np.maximum(lever, 0.0) * load[None, :]).sum(axis=1) * step + load * step**2 / 8.0)

    give = np.einsum("n,nij->ij", (height - middles) * moment(width(None)), softness)
    axes = np.linalg.eigh(0.5 * (give + give.T))[1].T[::-1]  # softest first
    columns: dict[str, list[Array | float]] = {name: [] for name in _COLUMNS}
    for axis in axes:
        bend = np.einsum("i,nij,j->n", axis, softness, axis)
        curvature = moment(width(axis)) * bend
        slope = np.concatenate([[0.0], np.cumsum(curvature) * step])
        # Within a step the curvature is even, so the axis is a parabola there.
        way = np.concatenate([[0.0], np.cumsum(slope[:-1] * step + 0.5 * curvature * step**2)])
        curvature, slope, way = curvature / way[-1], slope / way[-1], way / way[-1]
        mid_slope, mid_way = (
            0.5 * (slope[1:] + slope[:-1]),
            way[:-1] + 0.5 * step * slope[:-1] + curvature * step**2 / 8,
        )
        drop = 0.5 * np.concatenate([[0.0], np.cumsum((slope[1:] ** 2 + slope[1:] * slope[:-1] + slope[:-1] ** 2) / 3)])
        drop *= step
        mid_drop = 0.5 * (drop[1:] + drop[:-1])
        added = water_kg_m3 * np.einsum("i,nij,j->n", axis, cut.displaced_m2, axis)
        lifted = (water_kg_m3 - tissue.density_kg_m3) * GRAVITY_M_S2 * cut.area_m2
        mass = float(((tissue.density_kg_m3 * cut.area_m2 + added) * mid_way**2).sum() * step)
        stiffness = float((tissue.stiffness_Pa / bend * curvature**2 + 2.0 * lifted * mid_drop).sum() * step)
        columns["axes_W"].append(axis)
        columns["shape"].append(way)
        columns["slope"].append(slope)
        columns["drop"].append(drop)
        columns["mass_kg"].append(mass)
        columns["stiffness_N_m"].append(stiffness)
        columns["hardening_N_m3"].append(
            2.0 * tissue.stiffness_Pa * float((curvature**2 * mid_slope**2 / bend).sum() * step)
        )
        columns["damping_N_s_m"].append(2.0 * tissue.damping * np.sqrt(max(stiffness, 0.0) * mass))
        columns["moved_water_kg"].append(float(((water_kg_m3 * cut.area_m2 + added) * mid_way).sum() * step))
        fibre = np.sqrt(np.einsum("i,nij,j->n", axis, cut.reach_m2, axis))
        columns["stress_Pa_m"].append(float((tissue.stiffness_Pa * curvature * fibre)[:tip].max()))
    return {name: np.array(values) for name, values in columns.items()}


_COLUMNS = (
    "axes_W", "shape", "slope", "drop", "mass_kg", "stiffness_N_m", "hardening_N_m3", "damping_N_s_m",
    "moved_water_kg", "stress_Pa_m",
)  # fmt: skip

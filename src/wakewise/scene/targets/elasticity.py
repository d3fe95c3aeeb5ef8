"""Bending of soft targets: cantilevers with two modes each, section properties from the mesh, materials by name.

Every piece of the mesh that stands on the bed is a cantilever (*stem*): a colony or a blade of grass. Its bending
stiffness follows from Young's modulus and the horizontal sections of the mesh; branches cut by one section bend side by
side. Each stem has two modes, along its softest and stiffest axes, with the shape of static bending in a uniform
stream: the deflection is that of beam theory, the natural frequency (Rayleigh's quotient) 0.4 % high for a uniform
beam. The mass includes that of the water that moves along.

The length of the axis is kept: a deflected tip comes down, and the stiffness grows with the slope to third order (M. R.
M. Crespo da Silva and C. C. Glynn 1978, J. Struct. Mech. 6, 437). Sections stay horizontal. Valid up to a deflection of
about half the height, `MAX_DEFLECTION_SHARE`. Not modelled: higher modes, torsion, branches that swing apart.

Materials. Measured moduli spread over a decade between species, seasons and rates, so each is one plausible individual;
`target.stiffness_Pa` and others override it. Estimates are marked with their reasoning.

Drag. Branches of 3 to 20 mm in 0.04 to 0.2 m/s have Reynolds numbers of 100 to 4000, where a circular cylinder has 1.0
to 1.4 (D. J. Tritton 1959, J. Fluid Mech. 6, 547, doi 10.1017/S0022112059000829, up to 100; plateau of 1.0 to 1.2
beyond): 1.2. Blades are flat plates across the stream: 1.95 (M. Luhar and H. M. Nepf 2011, Limnol. Oceanogr. 56, 2003,
doi 10.4319/lo.2011.56.6.2003). Branches do not shelter each other, which overstates the drag of a dense bush.

Damping. Four seaweeds lost 42 to 52 % of the work of loading (D. L. Harder, C. L. Hurd and T. Speck 2006, Am. J. Bot.
93, 1426). A linear tissue loses pi / 2 tan(delta), so tan(delta) is 0.3 and the damping ratio half of that, 0.15: an
estimate by analogy for all kinds.
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
from wakewise.scene.targets.target import Target


@dataclass(frozen=True, kw_only=True, eq=False)
class Sections:
    """Level sections through a body, which may consist of several loops (branches, fingers, tentacles).

    `area_m2` (n,) is that of all loops. `second_m4` (n, 2, 2) is the sum over loops of the integral of r r^T over the
    loop, r from its own middle: times Young's modulus the stiffness against bending of branches that bend side by side.
    `displaced_m2` (n, 2, 2) times the water's density is the added mass per height of loops that move sideways, each
    taken as the ellipse of its second moments: pi b^2 across a half axis b (J. N. Newman, Marine Hydrodynamics, MIT
    Press 1977, table 4.3). `reach_m2` (n, 2, 2) is that of the thickest loop: e . reach . e is the square of half its
    width along e.
    """

    area_m2: Array
    second_m4: Array
    displaced_m2: Array
    reach_m2: Array


def sections(places_m: Array, faces: IntArray, heights_m: Array) -> Sections:
    """Cut a closed surface at some heights.

    - `places_m`, shape (n, 3): vertices; the third coordinate is the height.
    - `faces`, shape (m, 3): turned alike.
    - Shapes: `heights_m` (k,).

    Returns zero where nothing is cut.
    """
    k = len(heights_m)
    area, second, displaced = np.zeros(k), np.zeros((k, 2, 2)), np.zeros((k, 2, 2))
    reach = np.zeros((k, 2, 2))
    if not len(faces):
        return Sections(area_m2=area, second_m4=second, displaced_m2=displaced, reach_m2=reach)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge = np.unique(ends[:, 0] * len(places_m) + ends[:, 1], return_inverse=True)[1].reshape(-1, 3)
    middle = places_m[np.unique(faces), :2].mean(axis=0)
    plan, height = places_m[:, :2] - middle, places_m[:, 2]
    low, high = height[faces].min(axis=1), height[faces].max(axis=1)
    for i, level in enumerate(heights_m):
        cut = np.nonzero((low <= level) & (high > level))[0]
        if not len(cut):
            continue
        start, end, loop = _loops(plan, height, faces[cut], edge[cut], float(level))
        whole, moments = _moments(start, end, loop)
        kept = np.abs(whole) > 1e-12
        whole, moments = whole[kept], moments[kept]
        if not len(whole):
            continue
        turned = np.sign(whole.sum())  # a section seen from below runs the other way round
        trace = np.trace(moments, axis1=1, axis2=2)
        around = 4.0 * np.pi / whole[:, None, None] * (trace[:, None, None] * np.eye(2) - moments)
        solid = whole * turned > 0.0  # not a cavity
        area[i] = turned * whole.sum()
        second[i] = turned * moments.sum(axis=0)
        displaced[i] = around[solid].sum(axis=0)
        thickest = np.argmax(np.where(solid, trace / whole, -np.inf))
        reach[i] = 4.0 * moments[thickest] / whole[thickest]
    return Sections(area_m2=area, second_m4=second, displaced_m2=displaced, reach_m2=reach)


def _loops(plan: Array, height: Array, faces: IntArray, edge: IntArray, level: float) -> tuple[Array, Array, IntArray]:
    """Segments in which faces are cut, start and end (m, 2) with the body on one side, and the loop of each (m,)."""
    here = height[faces]
    above = here > level
    m = len(faces)
    rows = np.arange(m)
    # The two edges that cross the level leave the one corner that is alone on its side.
    alone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmin(above, axis=1))
    after, before = (alone + 1) % 3, (alone + 2) % 3

    def crossing(other: IntArray) -> Array:
        a, b = faces[rows, alone], faces[rows, other]
        share = (level - height[a]) / (height[b] - height[a])
        place: Array = plan[a] + share[:, None] * (plan[b] - plan[a])
        return place

    one, two = crossing(after), crossing(before)
    first, second = edge[rows, alone], edge[rows, before]
    upward = above[rows, alone][:, None]
    start, end = np.where(upward, one, two), np.where(upward, two, one)
    names, ends = np.unique(np.concatenate([first, second]), return_inverse=True)
    n = len(names)
    joined = coo_array((np.ones(m, dtype=np.int8), (ends[:m], ends[m:])), (n, n))
    piece = connected_components(joined, directed=False)[1]
    return start, end, piece[ends[:m]].astype(np.int64)


def _moments(start: Array, end: Array, loop: IntArray) -> tuple[Array, Array]:
    """Signed area (l,) of each loop and signed second moments about its middle (l, 2, 2), by Green's theorem."""
    count = int(loop.max()) + 1

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(loop, values, count), dtype=np.float64)

    # From a place on each loop: far from the origin, differences of large numbers would spoil thin branches.
    anchor = np.zeros((count, 2))
    anchor[loop] = start
    a, b = start - anchor[loop], end - anchor[loop]
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = 0.5 * total(cross)
    safe = np.where(np.abs(area) > 1e-30, area, 1.0)
    middle = np.stack([total((a[:, i] + b[:, i]) * cross) for i in range(2)], axis=1) / (6.0 * safe[:, None])
    moments = np.empty((count, 2, 2))
    for i in range(2):
        for j in range(2):
            both = 2.0 * a[:, i] * a[:, j] + 2.0 * b[:, i] * b[:, j] + a[:, i] * b[:, j] + b[:, i] * a[:, j]
            moments[:, i, j] = total(both * cross) / 24.0 - safe * middle[:, i] * middle[:, j]
    return area, moments


MAX_DEFLECTION_SHARE = 0.5
"""Share of a stem's height by which its tip may move for the theory to hold."""
NODES = 48
"""Heights at which a stem is cut."""
FOOT_M = 0.002
"""Height above the bed at which separate pieces are counted."""
LEAST_SHARE = 0.3
"""Pieces lower than this share of the highest are stumps that do not move."""
_TIP_SHARE = 0.92  # a rounded tip has no stiffness at its very end: above this it keeps what it has here


@dataclass(frozen=True, kw_only=True)
class TissueProperties:
    """What a soft target is made of; where the numbers come from is in `wakewise.scene.targets.elasticity`.

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
    """Stems of a target and their modes; make it with `BendingModes.of`."""

    height_m: Array  # shape (k,): of each of k stems
    axes_W: Array  # shape (k, 2, 2): level unit vectors (x, y) along which the first and the second mode move
    # shape, slope, drop: shape (k, 2, nodes): at heights evenly spaced from the foot to the tip: how far a place moves
    # along the axis for a tip that moves by one metre, its derivative by height in 1/m, and how far it comes down in
    # 1/m, times the tip's way squared.
    shape: Array
    slope: Array
    drop: Array
    # mass_kg, stiffness_N_m, hardening_N_m3, damping_N_s_m, moved_water_kg: shape (k, 2): of each mode with the tip's
    # way as coordinate q: m q'' + c q' + k q + h q^3 is the load on it, and `moved_water_kg` times the water's
    # acceleration is the part of the load that comes from it.
    mass_kg: Array
    stiffness_N_m: Array
    hardening_N_m3: Array
    damping_N_s_m: Array
    moved_water_kg: Array
    stress_Pa_m: Array  # shape (k, 2): largest bending stress per metre of the tip's way
    stem: IntArray  # shape (n,): which stem each vertex of the target belongs to, -1 for none
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

        Raises InputError if nothing of the target stands free of the bed, its mesh is open, or it falls over by its own
        weight.
        """
        mesh = target.mesh
        if not mesh.is_closed:
            raise InputError(
                f"target.elasticity: {target.name} has an open mesh, which has no sections; a closed one is needed"
            )
        places = mesh.vertices_m * [1.0, 1.0, -1.0] + [0.0, 0.0, target.bed_z_m]
        stem, heights = _stems(places, mesh.faces)
        parts = []
        for which, height in enumerate(heights):
            own = np.any(stem[mesh.faces] == which, axis=1)
            parts.append(_modes(places, mesh.faces[own], float(height), tissue, water_kg_m3))
        if any(float(part["stiffness_N_m"].min()) <= 0.0 for part in parts):
            raise InputError(
                f"target.elasticity: {target.name} of {tissue.stiffness_Pa:g} Pa and {tissue.density_kg_m3:g} "
                "kg/m3 cannot "
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
        raise InputError(f"target.elasticity: nothing of the target stands more than {1e3 * FOOT_M:g} mm above the bed")
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
        raise InputError("target.elasticity: the mesh has gaps: a level section through a stem cuts nothing")
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


_DAMPING = 0.15

# Anemone. Mesogloea creeps to ten times its first strain in hours (R. McN. Alexander 1962, as told by S. Vogel,
# Comparative Biomechanics, Princeton 2003); its modulus then is about 0.01 MPa (O. Betz et al. in Biomimetic Research
# for Architecture and Building Construction, Springer 2016, after S. A. Wainwright et al. 1976), so that for the
# seconds of a passing wake it is about 0.1 MPa. The column is a tube of water: with a wall of a fifth of its radius, an
# estimate, its section has 1 - 0.8^4 = 0.59 of a full one's stiffness: 0.06 MPa. Flow forces on such anemones: M. A. R.
# Koehl 1977, J. Exp. Biol. 69, 87, doi 10.1242/jeb.69.1.87. Density: 98 % sea water, an estimate.
ANEMONE = TissueProperties(stiffness_Pa=6e4, density_kg_m3=1030.0, drag=1.2, damping=_DAMPING)

# Soft coral (Sinularia flexibilis and its like): mesogloea as above, made stiffer by sclerites, which does not tell its
# species apart (M.-C. Lin and C.-F. Dai 1997, Zool. Stud. 36, 58: flexible colonies bend down in flow). 0.3 MPa, three
# times the bare mesogloea, is an estimate. Density: a tenth of the volume is calcite of 2700 kg/m3, an estimate.
SOFT_CORAL = TissueProperties(stiffness_Pa=3e5, density_kg_m3=1200.0, drag=1.2, damping=_DAMPING)

# Gorgonian: a horny axis in a soft rind. The axis is a tanned collagen whose stiffness varies with sclerotization and
# calcification (K. Jeyasuria and J. C. Lewis 1987, Coral Reefs 5, 213, as told by J. C. Lewis et al. 1992, Biol. Bull.
# 183, 278). 1 GPa, the order of tanned proteins such as horn, in an axis of a third of the branch's diameter, both
# estimates, gives 1/81 of it over the whole section: 12 MPa. Density of rind and axis together: an estimate. That such
# colonies bend over and sway with the swell, at a low frequency, is observed (M. Boudina, F. P. Gosselin and S. Etienne
# 2021, J. Fluid Mech., doi 10.1017/jfm.2021.252).
GORGONIAN = TissueProperties(stiffness_Pa=1.2e7, density_kg_m3=1200.0, drag=1.2, damping=_DAMPING)

# Seagrass (eelgrass, turtle grass). Strips of low-density polyethylene, whose modulus is 0.3 GPa, stand for eelgrass in
# flumes as they bend alike (J. Lei and H. Nepf 2019, J. Fluids Struct. 87, 137); leaves of cold regions are ten times
# as flexible as those of warm ones (M. Paul and C. B. de los Santos 2019, Mar. Biol. 166, doi
# 10.1007/s00227-019-3577-2). A leaf 0.3 mm thick has 1/38 of the second moment of the lens of 1.2 mm that the
# procedural blades are drawn with, and 0.32 of its area: 8 MPa, and 0.32 of the buoyancy of a leaf of 850 kg/m3 with
# its air, an estimate. Such a blade lies down in the current of an open meadow; it is for still tanks and light
# currents.
SEAGRASS = TissueProperties(stiffness_Pa=8e6, density_kg_m3=952.0, drag=1.95, damping=_DAMPING)

TISSUES: dict[str, TissueProperties] = {
    "anemone": ANEMONE,
    "gorgonian": GORGONIAN,
    "seagrass": SEAGRASS,
    "soft-coral": SOFT_CORAL,
}
"""Tissues by the names of `target.elasticity`; a procedural target of the same name has the shape that goes with it."""

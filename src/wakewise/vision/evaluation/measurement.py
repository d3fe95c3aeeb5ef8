"""Size of a colony or of a box of a mesh: lengths, areas, volume and rugosity above the bed.

Length and width are Feret diameters of the outline seen from above (W. H. Walton, Nature 162, 1948, doi
10.1038/162329b0). Rugosity is the surface index of A. L. Dahl, Ecology 54(2), 1973, doi 10.2307/1934335. A volume is
the flux of (0, 0, height) through the surface (Gauss), which needs no closed mesh.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError
from scipy.spatial.distance import pdist, squareform

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation.bed_and_colony import (
    BedFit,
    bed_clearance_m,
    colony_faces,
    cut_above,
    fit_bed,
    in_box,
    is_coarse,
    median_edge_m,
    open_edges_m,
    pieces,
    without_wild,
)

# key: (unit, power of the scale, definition)
DEFINITIONS: dict[str, tuple[str, int, str]] = {
    "length_mm": ("mm", 1, "greatest extent seen from above (maximum Feret diameter)"),
    "width_mm": ("mm", 1, "extent across the length, seen from above"),
    "height_mm": ("mm", 1, "highest point above the plane of the bed"),
    "extent_mm": ("mm", 1, "greatest distance between any two points"),
    "planar_area_cm2": ("cm2", 2, "area of the outline seen from above (projected area)"),
    "surface_area_cm2": ("cm2", 2, "area of the surface above the bed"),
    "volume_cm3": ("cm3", 3, "volume between surface and bed plane"),
    "rugosity": ("", 0, "surface area over planar area (Dahl 1973)"),
}
LEAST_BED_SHARE_PCT, MOST_OPEN, LEAST_LEFT, MOST_UNSEEN_PCT = 25.0, 0.1, 0.75, 10.0
"""Bounds of `measuring_warnings`: share of the bed; open edges, and the length one clearance further up, in lengths of
the colony; share of the surface without dense points."""
MOST_BELOW = 5.0
"""So many times as far below a given plane as above it: which way is up may be mistaken."""
LEAST_BEHIND = 0.01
"""Share of a surface's area that must face down in all, for the colony to lie behind the faces."""
TOP, LEAST_TOP_FACES = 0.1, 10
"""Fewer triangles than this in the uppermost tenth of the height are a spike or a stray one."""
MOST_LOOSE = 0.05
"""Share of the colony's area above which pieces over it that are not joined to it are told."""
SHORTEST_MM, LONGEST_MM = 5.0, 20_000.0
CELLS = 1500
"""Cells of the raster of an outline along its longer side."""


@dataclass(frozen=True, kw_only=True)
class ColonySize:
    """Figures of `DEFINITIONS`, in the units of their names."""

    length_mm: float
    width_mm: float
    height_mm: float
    extent_mm: float
    planar_area_cm2: float
    surface_area_cm2: float
    volume_cm3: float
    rugosity: float

    def values(self) -> dict[str, float]:
        """Figures by key."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuringRule:
    """What of a model is measured: its colony, or all in a `box` (two corners, m), or the colony in the box.

    `bed`: its plane where it is known; `eyes_m`, shape (k, 3): cameras, which are above the bed.
    """

    box: tuple[Array, Array] | None = None
    colony: bool = True
    bed: BedFit | None = None
    eyes_m: Array | None = None


def measure(mesh: Mesh, rule: MeasuringRule, rng: np.random.Generator) -> tuple[ColonySize, BedFit, Mesh]:
    """Size of a colony or a box of a mesh in metres, the bed it is above, and the surface that counted.

    The foot of a colony is not told from the bed's roughness: what lies below the clearance (`bed_clearance_m`) is
    extrapolated from sections at one, two and three times the clearance. In a box without `colony` all counts, bed
    included, and what lies below the plane counts against the volume. Raises InputError if there is no bed, no colony,
    or nothing in the box.
    """
    mesh = without_wild(mesh)
    bed = rule.bed or fit_bed(mesh, rng, rule.eyes_m)
    part = mesh if rule.box is None else in_box(mesh, *rule.box)
    if not rule.colony:
        along = feret_direction(bed.to_plane(part.vertices_m)[:, :2])
        return _size([_section(part, bed, along)], 0.0), bed, part
    cut_m = bed_clearance_m(part, bed)
    middle = None if rule.box is None else 0.5 * (np.asarray(rule.box[0]) + np.asarray(rule.box[1]))
    colony = Mesh(part.vertices_m, part.faces[colony_faces(part, bed, cut_m, middle)])
    cuts = [cut_above(colony, bed.axes[2], bed.origin_m + k * cut_m * bed.axes[2]) for k in (1, 2, 3)]
    if cuts[0] is None:
        raise InputError(f"colony: nothing stands more than {1e3 * cut_m:.1f} mm above the bed")
    along = feret_direction(bed.to_plane(cuts[0].vertices_m)[:, :2])
    reach, edge_m = float(np.ptp(bed.to_plane(cuts[0].vertices_m)[:, :2] @ along)), median_edge_m(mesh)
    if reach < 4.0 * edge_m and float(bed.to_plane(cuts[0].vertices_m)[:, 2].max()) < 10.0 * bed.sigma_m:
        raise InputError(
            f"colony: nothing stands above the bed but {1e3 * reach:.1f} mm of its noise (edges of the mesh are "
            f"{1e3 * edge_m:.1f} mm long)"
        )
    sections = [_section(cut, bed, along) for cut in cuts if cut is not None]
    return _size(sections, cut_m if len(sections) == 3 else 0.0), bed, cuts[0]


def measuring_warnings(mesh: Mesh, rule: MeasuringRule, size: ColonySize, bed: BedFit) -> list[str]:
    """What makes figures of `measure` doubtful, in lines: unit, bed, sides of faces, holes, a foot that is joined."""
    out: list[str] = []
    if not SHORTEST_MM <= size.length_mm <= LONGEST_MM:
        out.append(f"length of {1e-3 * size.length_mm:.3g} m: is the model in metres? --unit-m 0.001 reads millimetres")
    if rule.bed is None and bed.share_pct < LEAST_BED_SHARE_PCT:
        out.append(f"only {bed.share_pct:.0f} % of the surface lies on the bed plane, another may be right: --bed")
    tame = without_wild(mesh)
    if wild := len(mesh.faces) - len(tame.faces):
        out.append(f"{wild} triangles reach to vertices far outside the rest and are left out: clean the model")
    mesh = tame
    part = mesh if rule.box is None else in_box(mesh, *rule.box)
    if not rule.colony:
        return out + _behind(part, bed)
    cut_m, height = bed_clearance_m(part, bed), bed.to_plane(part.vertices_m)[:, 2]
    if is_coarse(part, bed):
        out.append(f"the mesh is coarse for this colony: its lowest {1e3 * cut_m:.1f} mm are extrapolated")
    if rule.bed is not None and -height.min() > MOST_BELOW * height.max():
        out.append(
            f"the model reaches {1e3 * height.max():.1f} mm above the plane and {-1e3 * height.min():.0f} mm below it: "
            "its normal (--bed) may point down"
        )
    middle = None if rule.box is None else 0.5 * (np.asarray(rule.box[0]) + np.asarray(rule.box[1]))
    faces = colony_faces(part, bed, cut_m, middle)
    colony = Mesh(part.vertices_m, part.faces[faces])
    out += _behind(colony, bed)
    length = [0.0, 0.0]
    for k in range(2):
        cut = cut_above(colony, bed.axes[2], bed.origin_m + (k + 1) * cut_m * bed.axes[2])
        if cut is not None:
            piece = pieces(cut.faces, len(cut.vertices_m))
            largest = cut.faces[piece == np.argmax(np.bincount(piece, cut.face_areas_m2))]
            length[k] = float(pdist(_hull(bed.to_plane(cut.vertices_m[largest].reshape(-1, 3))[:, :2])).max())
    if length[1] < LEAST_LEFT * length[0]:
        out.append(
            f"length depends on the height of the cut: {1e3 * length[0]:.0f} mm at {1e3 * cut_m:.1f} mm above the bed, "
            f"{1e3 * length[1]:.0f} mm at {2e3 * cut_m:.1f} mm; humps or another colony may be joined, or it branches "
            "at its foot: look, and give --box with --colony"
        )
    heights = bed.to_plane(colony.vertices_m)[:, 2][colony.faces].max(axis=1)
    top = int((heights > (1.0 - TOP) * float(heights.max())).sum())
    if top < LEAST_TOP_FACES:
        rest_mm = 1e3 * float(np.partition(heights, -top - 1)[-top - 1]) if top < len(heights) else 0.0
        out.append(
            f"the height rests on {top} triangles: a spike, perhaps; the rest is no higher than {rest_mm:.0f} mm; give "
            "--box with --colony, or clean the model"
        )
    loose = _loose_faces(part, bed, cut_m, faces)
    if (area := float(part.face_areas_m2[loose].sum())) > MOST_LOOSE * float(colony.face_areas_m2.sum()):
        reach_mm = 1e3 * float(bed.to_plane(part.vertices_m)[:, 2][part.faces[loose]].max())
        out.append(
            f"{1e4 * area:.0f} cm2 of surface about the colony, up to {reach_mm:.0f} mm above the bed, are not joined "
            "to it, nor in the figures: a neighbour or a broken surface; look, or give --box, which measures all in it"
        )
    ends_m = open_edges_m(part, bed, 1.5 * cut_m, faces)
    if ends_m > MOST_OPEN * length[0]:
        out.append(
            f"the colony has {1e3 * ends_m:.0f} mm of open edges: it is cut by the end of the model or of the box, or "
            "has holes; what is missing is not in the figures"
        )
    return out


def _loose_faces(mesh: Mesh, bed: BedFit, cut_m: float, colony: BoolArray) -> IntArray:
    """Faces above the cut that are not of the colony and lie in its bounding box, which is doubled."""
    corners = bed.to_plane(mesh.vertices_m)[mesh.faces]
    inside = corners[colony].reshape(-1, 3)
    low, high = inside[:, :2].min(axis=0), inside[:, :2].max(axis=0)
    middle = corners.mean(axis=1)
    over = (np.abs(middle[:, :2] - 0.5 * (low + high)) <= high - low).all(axis=1)
    over &= (middle[:, 2] > 2.0 * cut_m) & (middle[:, 2] < 2.0 * float(inside[:, 2].max()))
    return np.flatnonzero(over & ~colony)


def _behind(surface: Mesh, bed: BedFit) -> list[str]:
    """A warning where up is behind the faces: what is closed but at its foot has the foot's area along its outside."""
    vectors = surface.area_vectors_m2
    # A slab that is closed below, too, has none.
    if float((vectors @ bed.axes[2]).sum()) >= -LEAST_BEHIND * float(np.linalg.norm(vectors, axis=1).sum()):
        return []
    up = " ".join(f"{value + 0.0:.2f}" for value in np.round(bed.axes[2], 2))
    return [f"the colony lies behind the faces: a pit, or faces turned; up is {up} here; --bed says which way is up"]


def unseen_pct(surface: Mesh, dense_m: Array) -> float:
    """Share of a surface in percent, by area, without dense points, shape (n, 3), near it: it is filled in.

    Near is three edges of the mesh, or three spacings of the points if that is more.
    """
    tree = KDTree(dense_m)
    spacing = float(np.median(np.asarray(tree.query(dense_m[:: max(1, len(dense_m) // 5000)], k=[2])[0])))
    away = np.asarray(tree.query(surface.triangles_m.mean(axis=1))[0])
    far = away > 3.0 * max(median_edge_m(surface), spacing)
    return 100.0 * float(surface.face_areas_m2[far].sum() / surface.face_areas_m2.sum())


@dataclass(frozen=True, kw_only=True)
class _Section:
    """Sums over the surface above a level, m: `foot` is the area of its cross-section there, seen from above."""

    area: float
    planar: float
    foot: float
    volume: float
    length: float
    width: float
    height: float
    extent: float


def _section(mesh: Mesh, bed: BedFit, along: Array) -> _Section:
    """Sums; width is the extent across a direction of the bed plane, shape (2,)."""
    corners = bed.to_plane(mesh.vertices_m)[mesh.faces]
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # An outside that is the inside everywhere only turns the signs.
    sign = 1.0 if vectors[:, 2].sum() >= 0.0 else -1.0
    points = corners.reshape(-1, 3)
    hull = _hull(points[:, :2])
    return _Section(
        area=float(np.linalg.norm(vectors, axis=1).sum()),
        planar=outline_area(corners[:, :, :2]),
        foot=sign * float(vectors[:, 2].sum()),
        volume=sign * float((corners[:, :, 2].mean(axis=1) * vectors[:, 2]).sum()),
        length=float(pdist(hull).max()),
        width=float(np.ptp(hull @ np.array([-along[1], along[0]]))),
        height=float(points[:, 2].max()),
        extent=float(pdist(_hull(points)).max()),
    )


def _size(sections: list[_Section], cut_m: float) -> ColonySize:
    """Figures down to the bed plane from one section, or from three at equal steps.

    Areas follow a parabola through the three; lengths grow with the root of the outline's area, as those of alike
    outlines do, since a parabola would blow up the noise of their single end points fourfold.
    """
    one = sections[0]
    found = {key: getattr(one, key) for key in ("length", "width", "extent", "area", "planar", "volume")}
    if cut_m > 0.0:
        two, three = sections[1:]
        keys = ("area", "planar", "foot")
        down = {key: 3.0 * (getattr(one, key) - getattr(two, key)) + getattr(three, key) for key in keys}
        if one.planar <= 0.0:
            raise InputError("colony: seen from above it has no area: a spike; give --box with --colony")
        wider = float(np.sqrt(max(down["planar"] / one.planar, 0.0)))
        down |= {key: wider * getattr(one, key) for key in ("length", "width", "extent")}
        # The integral of the cross-section from the bed to the cut, less the column that the section has counted.
        below = cut_m * ((5.0 * down["foot"] + 8.0 * one.foot - two.foot) / 12.0 - one.foot)
        found = down | {"volume": one.volume + below}
    return ColonySize(
        length_mm=1e3 * found["length"],
        width_mm=1e3 * found["width"],
        height_mm=1e3 * one.height,
        extent_mm=1e3 * found["extent"],
        planar_area_cm2=1e4 * found["planar"],
        surface_area_cm2=1e4 * found["area"],
        volume_cm3=1e6 * found["volume"],
        rugosity=found["area"] / found["planar"],
    )


def _hull(points: Array) -> Array:
    """Corners of the convex hull, or all points where they span none."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return np.unique(points, axis=0)[:2000]


def feret_direction(points: Array) -> Array:
    """Unit direction of the maximum Feret diameter of points in a plane, shape (n, 2) to (2,)."""
    hull = _hull(points)
    apart = squareform(pdist(hull))
    i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    return np.asarray((hull[j] - hull[i]) / max(float(apart[i, j]), 1e-300))


def outline_area(triangles: Array) -> float:
    """Area that triangles in a plane, shape (m, 3, 2), cover together, by the cells whose middle lies in one."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    cell = float((high - low).max()) / CELLS
    if cell <= 0.0:
        return 0.0
    columns, rows = np.ceil((high - low) / cell).astype(np.int64) + 1
    return float(_covered((triangles - low) / cell, int(columns), int(rows)).sum()) * cell**2


@njit
def _covered(triangles: Array, columns: int, rows: int) -> BoolArray:
    """Cells, shape (rows, columns), whose middle lies in a triangle of either orientation."""
    out = np.zeros((rows, columns), np.bool_)
    for k in range(len(triangles)):
        ax, ay = triangles[k, 0, 0], triangles[k, 0, 1]
        bx, by = triangles[k, 1, 0] - ax, triangles[k, 1, 1] - ay
        cx, cy = triangles[k, 2, 0] - ax, triangles[k, 2, 1] - ay
        twice = bx * cy - by * cx
        if twice == 0.0:
            continue
        left = max(int(np.floor(ax + min(0.0, bx, cx))), 0)
        right = min(int(np.ceil(ax + max(0.0, bx, cx))), columns - 1)
        bottom = max(int(np.floor(ay + min(0.0, by, cy))), 0)
        top = min(int(np.ceil(ay + max(0.0, by, cy))), rows - 1)
        for v in range(bottom, top + 1):
            for u in range(left, right + 1):
                x, y = u + 0.5 - ax, v + 0.5 - ay
                s, t = (x * cy - y * cx) / twice, (bx * y - by * x) / twice
                if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
                    out[v, u] = True
    return out

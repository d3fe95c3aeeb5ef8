"""Growth and loss between two registered surfaces, and the smallest change that can be told from their errors.

After the multiscale model-to-model cloud comparison M3C2 (D. Lague, N. Brodu and J. Leroux, ISPRS Journal of
Photogrammetry and Remote Sensing 82, 2013, doi 10.1016/j.isprsjprs.2013.04.009): distances along normals, averaged over
a small disc, with a level of detection from local roughness and registration error. Discs hold only places that face
alike, since a cylinder through a twig meets both its sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from scipy.stats import norm

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation.bed_and_colony import BedFit, bed_clearance_m, colony_faces, fit_bed, median_edge_m
from wakewise.vision.evaluation.surface_registration import DatedSurface, Registration, matches, register, sampled

COUNT, MARGIN, GROWN = 30_000, 0.6, 0.15
"""Places on the first model; what is looked at about its colony, and how far it may have grown, in lengths of it."""
DISC_SPACINGS = 5.0
"""Diameter of a disc, in spacings of the places."""
LEAST_DISCS, LEAST_SHARE = 3.0, 0.02
"""Least area of a change that is claimed, in discs and as a share of the colony."""
LEAST_EDGES = 1.5
"""Smallest change that is ever claimed, in edges of the coarser mesh: finer shape is that of the smoothing."""
MOST_SCALE_PCT = 20.0
"""Largest difference of scale that may still be growth all over."""
LEAST_SCALE_PCT = 1.0
"""Smallest difference of a scale that is not known which is told: models of one scale differ by a few per mille."""

# key: (unit, definition)
DEFINITIONS: dict[str, tuple[str, str]] = {
    "change_mm": ("mm", "mean change of the largest changed patch; null where no change can be told"),
    "largest_growth_mm": ("mm", "95th percentile of the growth over the grown surface"),
    "largest_loss_mm": ("mm", "95th percentile of the loss over the lost surface"),
    "growth_volume_cm3": ("cm3", "integral of the growth over the grown surface, mean of both dates"),
    "loss_volume_cm3": ("cm3", "the same of the loss"),
    "growth_area_cm2": ("cm2", "surface of the second date that grew by more than can be told"),
    "loss_area_cm2": ("cm2", "surface of the first date that was lost by more than can be told"),
    "compared_area_cm2": ("cm2", "surface of the colony at the second date that the first one shows, too"),
    "smallest_change_mm": ("mm", "smallest change that can be told at 95 % anywhere on the colony (familywise), at "
                           "least one and a half edges of the coarser mesh"),
    "lod95_mm": ("mm", "level of detection at 95 % of one place (M3C2, Lague et al. 2013), median"),
    "registration_mm": ("mm", "standard deviation of the distances of what did not change, averaged over discs"),
    "roughness_mm": ("mm", "standard deviation of the distances within a disc, median"),
    "disc_mm": ("mm", "diameter of a disc"),
    "unchanged_pct": ("%", "share of the second model that the registration rests on"),
    "scale_found": ("", "scale of the second model that fits the first best; growth all over looks like scale, too"),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Distances:
    """Places of a surface, m, with the mean change of their disc, m (growth is positive), its roughness, m, and number.

    seen: whether the other date shows the place. All of shape (n,) but the points, (n, 3).
    """

    surface: DatedSurface
    change_m: Array
    roughness_m: Array
    number: Array
    seen: BoolArray

    def __post_init__(self) -> None:
        freeze(self, change_m=(None,), roughness_m=(None,), number=(None,))


def distances(of: DatedSurface, to: DatedSurface, disc_m: float, sign: float) -> Distances:
    """Mean signed distances along normals over discs; `sign` is 1 where `to` is the later date."""
    facing_m = disc_m
    tree = KDTree(np.hstack([to.points_m, facing_m * to.normals]))
    nearest = matches(of, tree, facing_m)
    gap = to.points_m[nearest] - of.points_m
    normal = of.normals + to.normals[nearest]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    along = np.einsum("ij,ij->i", gap, normal)
    aside = np.linalg.norm(gap - along[:, None] * normal, axis=1)
    seen = aside <= 0.5 * disc_m + 0.5 * np.abs(along)
    change = sign * along
    own = KDTree(np.hstack([of.points_m, facing_m * of.normals]))
    near = own.query_ball_point(own.data, 0.5 * disc_m, workers=1)
    mean, rough, count = np.zeros(len(change)), np.zeros(len(change)), np.ones(len(change))
    for k, some in enumerate(near):
        kept = change[[i for i in some if seen[i]]]
        if len(kept):
            mean[k], rough[k], count[k] = kept.mean(), kept.std(), len(kept)
    return Distances(surface=of, change_m=mean, roughness_m=rough, number=count, seen=seen)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceChange:
    """Figures of `DEFINITIONS`; low and high of `change_mm`; where it is; the verdict; distances of both dates; which
    of the second are of the colony, shape (n,).
    """

    figures: dict[str, float | None]
    change_low_mm: float | None
    change_high_mm: float | None
    where: str | None
    verdict: str
    registration: Registration
    first: Distances
    second: Distances
    colony: BoolArray
    bed: BedFit | None
    scale_warning: str | None = None


def compare_models(
    first: Mesh,
    second: Mesh,
    rng: np.random.Generator,
    *,
    eyes: tuple[Array | None, Array | None] = (None, None),
    scale_sigma_pct: float = 0.0,
    scale_known: bool = True,
    align_scale: bool = False,
) -> SurfaceChange:
    """Growth and loss of the colony of a model between two dates; meshes in m, each in a frame of its own.

    `eyes`: cameras of each, shape (k, 3). `scale_sigma_pct`: standard deviation of the ratio of their scales.
    `scale_known`: whether both state their scale; else it is said where another one would look like the change.
    `align_scale`: fit the scale of the second, too. Raises InputError if their scales differ by more than 20 %;
    StageError if they do not fit each other.
    """
    A, B, near = _surfaces(first, second, eyes, rng)
    found = register(A, B, align_scale)
    if not align_scale and abs(found.free_scale - 1.0) > 0.01 * MOST_SCALE_PCT:
        thousandth = any(abs(found.free_scale * unit - 1.0) < 0.05 for unit in (1e-3, 1e3))
        what = (
            "one is in millimetres and one in metres: convert one of them"
            if thousandth
            else "give both their scale (reconstruct --bar or --fixes)"
        )
        raise InputError(
            f"models of different scale: the second fits at {found.free_scale:.4g} times its size; {what}, or fit it "
            "with --align-scale"
        )
    there = B.moved(found.similarity)
    there = there.only(near(there.points_m))
    A = A.only(near(A.points_m))
    disc_m = DISC_SPACINGS * float(np.sqrt(max(A.cell_m2, there.cell_m2)))
    old, new = distances(A, there, disc_m, 1.0), distances(there, A, disc_m, -1.0)
    edge_m = max(median_edge_m(first), found.similarity.scale * median_edge_m(second))
    change = _judge(old, new, found, A.bed, near, disc_m, 0.01 * scale_sigma_pct, LEAST_EDGES * edge_m)
    scale = found.free_scale
    if align_scale or scale_known or abs(scale - 1.0) <= 0.01 * LEAST_SCALE_PCT:
        return change
    told = "" if change.change_low_mm is None else f"; a scale of {scale:.3g} would explain it, too"
    return replace(
        change,
        verdict=change.verdict + told,
        scale_warning=f"the scale of a model is not known, and the second fits best at {scale:.3g} times its size: "
        "a wrong scale looks like growth or loss; give both models their scale (--bar, --fixes)",
    )


def _surfaces(
    first: Mesh, second: Mesh, eyes: tuple[Array | None, Array | None], rng: np.random.Generator
) -> tuple[DatedSurface, DatedSurface, _Near]:
    """Points of both models about their colonies, as dense on both, and where the first one's colony is."""
    parts: list[tuple[Mesh, BedFit | None, float]] = []
    near: list[_Near] = []
    for mesh, cameras in zip((first, second), eyes, strict=True):
        bed, cut_m, part = None, 0.0, mesh
        try:
            bed = fit_bed(mesh, rng, cameras)
            cut_m = bed_clearance_m(mesh, bed)
            colony = mesh.vertices_m[mesh.faces[colony_faces(mesh, bed, cut_m)]].reshape(-1, 3)
        except InputError:  # all is colony
            bed, colony = None, mesh.vertices_m
        about = _Near(colony)
        if bed is not None:
            kept = about(mesh.triangles_m.mean(axis=1))
            part = Mesh(mesh.vertices_m, mesh.faces[kept])
        parts.append((part, bed, cut_m))
        near.append(about)
    per_m2 = COUNT / float(parts[0][0].face_areas_m2.sum())
    alike = float(parts[1][0].face_areas_m2.sum()) * per_m2
    counts = (COUNT, int(np.clip(alike, COUNT / 2, 2 * COUNT)))
    A, B = (sampled(*part, count, rng) for part, count in zip(parts, counts, strict=True))
    return A, B, near[0]


class _Near:
    """Whether points are about a colony, whose points have shape (n, 3)."""

    def __init__(self, colony_m: Array) -> None:
        self._low, self._high = colony_m.min(axis=0), colony_m.max(axis=0)

    def __call__(self, points_m: Array, margin: float = MARGIN) -> BoolArray:
        """Mask of shape (n,): no farther from its box than this share of its longest side."""
        reach = margin * float((self._high - self._low).max())
        return np.asarray(((points_m >= self._low - reach) & (points_m <= self._high + reach)).all(axis=1))


def _judge(
    old: Distances,
    new: Distances,
    found: Registration,
    bed: BedFit | None,
    near: _Near,
    disc_m: float,
    scale_sigma: float,
    floor_m: float,
) -> SurfaceChange:
    """What changed, by how much, and what could be told."""

    def standing(one: Distances) -> BoolArray:
        points = one.surface.points_m
        high = one.surface.standing if bed is None else bed.to_plane(points)[:, 2] > disc_m / 2
        return np.asarray(high & one.seen & near(points, GROWN))

    colony, before = standing(new), standing(old)
    if not colony.any() or not before.any():
        raise InputError("compare-models: the two models share nothing that stands above the bed")
    still = ~colony & new.seen & near(new.surface.points_m, 2.0 * GROWN)
    if bed is not None and still.sum() > 100:
        spread = max(_robust(new.change_m[still]), _robust(_detail(new, colony, disc_m)))
    else:
        spread = _robust(new.change_m[colony] - np.median(new.change_m[colony]))
    points = new.surface.points_m[colony]
    reach = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    registration = float(np.hypot(spread, scale_sigma * reach))
    discs = max(new.surface.cell_m2 * colony.sum() / (0.25 * np.pi * disc_m**2), 1.0)
    familywise = float(norm.ppf(1.0 - 0.025 / discs))
    single = float(norm.ppf(0.975))

    def doubt(one: Distances) -> Array:
        return np.asarray(one.roughness_m / np.sqrt(one.number) + registration)

    def least(one: Distances) -> Array:
        return np.maximum(familywise * doubt(one), floor_m)

    grown = _told(new, colony & (new.change_m > least(new)), disc_m, LEAST_SHARE * float(colony.sum()))
    lost = _told(old, before & (old.change_m < -least(old)), disc_m, LEAST_SHARE * float(before.sum()))
    grown_before = before & (old.change_m > least(old)) & grown.any()
    lost_after = colony & (new.change_m < -least(new)) & lost.any()

    def volume(a: Distances, on_a: BoolArray, b: Distances, on_b: BoolArray) -> float:
        sides = [abs(float(one.change_m[on].sum())) * one.surface.cell_m2 for one, on in ((a, on_a), (b, on_b))]
        return 0.5e6 * sum(sides)

    smallest_mm = 1e3 * float(np.median(least(new)[colony]))
    side, mask = (new, grown) if grown.sum() * new.surface.cell_m2 >= lost.sum() * old.surface.cell_m2 else (old, lost)
    change = low = high = where = None
    if mask.any():
        patch = _largest(side, mask, disc_m)
        change = 1e3 * float(side.change_m[patch].mean())
        half = 1e3 * single * float(doubt(side)[patch].mean())
        low, high = change - half, change + half
        where = _where(side.surface.points_m, patch, colony if side is new else before, bed)
    area = 1e4 * new.surface.cell_m2
    figures = {
        "change_mm": change,
        "largest_growth_mm": 1e3 * float(np.percentile(new.change_m[grown], 95)) if grown.any() else None,
        "largest_loss_mm": -1e3 * float(np.percentile(old.change_m[lost], 5)) if lost.any() else None,
        "growth_volume_cm3": volume(new, grown, old, grown_before),
        "loss_volume_cm3": volume(old, lost, new, lost_after),
        "growth_area_cm2": area * float(grown.sum()),
        "loss_area_cm2": 1e4 * old.surface.cell_m2 * float(lost.sum()),
        "compared_area_cm2": area * float(colony.sum()),
        "smallest_change_mm": smallest_mm,
        "lod95_mm": 1e3 * single * float(np.median(doubt(new)[colony])),
        "registration_mm": 1e3 * registration,
        "roughness_mm": 1e3 * float(np.median(new.roughness_m[colony])),
        "disc_mm": 1e3 * disc_m,
        "unchanged_pct": found.unchanged_pct,
        "scale_found": found.free_scale,
    }
    return SurfaceChange(
        figures=figures,
        change_low_mm=low,
        change_high_mm=high,
        where=where,
        verdict=_verdict(change, low, high, where, smallest_mm),
        registration=found,
        first=old,
        second=new,
        colony=colony,
        bed=bed,
    )


def _robust(values: Array) -> float:
    """Standard deviation about zero by the median of the sizes."""
    return 1.4826 * float(np.median(np.abs(values)))


def _detail(side: Distances, on: BoolArray, disc_m: float) -> Array:
    """Changes less their mean within three discs, of some places: growth changes more slowly, noise does not."""
    points, change = side.surface.points_m[on], side.change_m[on]
    some = np.arange(len(points))[:: max(1, len(points) // 2000)]
    near = KDTree(points).query_ball_point(points[some], 1.5 * disc_m, workers=1)
    return np.array([change[row] - change[rows].mean() for row, rows in zip(some, near, strict=True)])


def _told(side: Distances, beyond: BoolArray, disc_m: float, fewest: float) -> BoolArray:
    """Places beyond their level, most of whose neighbours are, too, in patches of three discs and the fewest places."""
    rows = np.flatnonzero(beyond)
    if not len(rows):
        return beyond
    tree, everything = KDTree(side.surface.points_m[rows]), KDTree(side.surface.points_m)
    some = side.surface.points_m[rows]
    mine = np.asarray(tree.query_ball_point(some, disc_m, return_length=True))
    whole = np.asarray(everything.query_ball_point(some, disc_m, return_length=True))
    rows = rows[mine >= 0.5 * whole]
    out = np.zeros(len(beyond), dtype=np.bool_)
    for patch in _patches(side.surface.points_m, rows, disc_m):
        if len(patch) >= max(fewest, LEAST_DISCS * 0.25 * np.pi * disc_m**2 / side.surface.cell_m2):
            out[patch] = True
    return out


def _patches(points_m: Array, rows: IntArray, disc_m: float) -> list[IntArray]:
    """Rows in patches whose places are no farther than half a disc from the next, largest first."""
    if not len(rows):
        return []
    pairs = KDTree(points_m[rows]).query_pairs(0.5 * disc_m, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(rows), len(rows)))
    label = connected_components(graph, directed=False)[1]
    return sorted((rows[label == k] for k in range(label.max() + 1)), key=len, reverse=True)


def _largest(side: Distances, mask: BoolArray, disc_m: float) -> BoolArray:
    out = np.zeros(len(mask), dtype=np.bool_)
    out[_patches(side.surface.points_m, np.flatnonzero(mask), disc_m)[0]] = True
    return out


def _where(points_m: Array, patch: BoolArray, colony: BoolArray, bed: BedFit | None) -> str:
    """Where on the colony a patch is, in words."""
    if patch.sum() >= 0.5 * colony.sum():
        return "over most of the colony"
    if bed is None:
        return "in one part"
    height = bed.to_plane(points_m)[:, 2]
    low, high = np.percentile(height[colony], (0.0, 100.0))
    share = float((height[patch].mean() - low) / max(high - low, 1e-12))
    return "at the tips" if share > 0.67 else "at the foot" if share < 0.25 else "on its flanks"


def _verdict(change: float | None, low: float | None, high: float | None, where: str | None, smallest_mm: float) -> str:
    told = f"changes below {smallest_mm:.1f} mm cannot be told"
    if change is None or low is None or high is None:
        return f"no change can be told; {told}"
    low, high = sorted((abs(low), abs(high)))
    word = "grown" if change > 0.0 else "lost"
    return f"{word} by {abs(change):.1f} mm ({low:.1f} to {high:.1f}) {where}; {told}"

"""Accuracy and completeness of a cloud against a reference mesh; area, volume and faults of a mesh.

*Accuracy* is the distance from cloud to reference, *completeness* that from reference to cloud (DTU: H. Aanaes et al.,
Large-scale data for multiple-view stereopsis, IJCV 120, 2016, doi 10.1007/s11263-016-0902-9). The shares below a
threshold are *precision* and *recall*, their harmonic mean is the *F-score* (Tanks and Temples: A. Knapitsch et al.,
ACM TOG 36(4), 2017, doi 10.1145/3072959.3073599).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.checks import boolean
from wakewise.core.errors import InputError, StageError
from wakewise.core.optional_dependencies import need
from wakewise.scene.targets import MeshDistance
from wakewise.vision.evaluation.alignment import IcpRefinement, refine_icp

RELATIVE_PCT = (0.25, 0.5, 1.0)
"""Thresholds in percent of the diagonal of the truth's box where none are given: 1 to 4 mm of a thing of 0.4 m."""
USEFUL_PCT = 2.0
"""Largest useful threshold, in percent of the object's extent."""


@dataclass(frozen=True, kw_only=True)
class ThresholdScore:
    """Precision (accuracy_pct), recall (completeness_pct) and F-score at one threshold, 0 to 100."""

    threshold_mm: float
    accuracy_pct: float
    completeness_pct: float
    f_score: float


def shares(to_truth_mm: Array, to_model_mm: Array, thresholds_mm: tuple[float, ...]) -> tuple[ThresholdScore, ...]:
    """Shares at each threshold, of distances, shape (n,) and (m,)."""
    out = []
    for threshold in thresholds_mm:
        precision = 100.0 * float((to_truth_mm < threshold).mean())
        recall = 100.0 * float((to_model_mm < threshold).mean())
        both = precision + recall
        out.append(
            ThresholdScore(
                threshold_mm=threshold,
                accuracy_pct=precision,
                completeness_pct=recall,
                f_score=2.0 * precision * recall / both if both > 0.0 else 0.0,
            )
        )
    return tuple(out)


def read_thresholds(words: str | None, extent_mm: float) -> tuple[float, ...]:
    """Thresholds in mm from `0.5,1` (mm) or `0.5%,1%` (of the extent); by the object's size if none are given.

    Raises InputError if one is no number above 0.
    """
    parts = [f"{share}%" for share in RELATIVE_PCT] if words is None else [part.strip() for part in words.split(",")]
    out = []
    for part in parts:
        try:
            value = float(part.removesuffix("%"))
        except ValueError:
            value = 0.0
        if not 0.0 < value < 1e6:
            raise InputError(f"--thresholds '{part}': must be lengths above 0 in mm, or shares such as 0.5%,1%")
        out.append(0.01 * value * extent_mm if part.endswith("%") else value)
    return tuple(sorted(set(out)))


SAMPLES = 60_000
"""Samples of the true surface. A share p of them is off by at most sqrt(p (1 - p) / 60,000), one standard deviation:
0.09 % where p is 95 %. They are spread more evenly than by chance, and every cloud is held against the same ones."""
SUCCESS_RMSE_MM = 3.0
SUCCESS_COMPLETENESS_PCT = 85.0
# Between a millimetre or an inch taken for a metre and a scene with much around its target.
MAX_SCALE_RATIO = 20.0


class MeshArrays(Protocol):
    """Triangles: vertices, shape (n, 3), in m, and faces, shape (m, 3)."""

    @property
    def vertices_m(self) -> Array:
        """Corners, shape (n, 3)."""
        ...

    @property
    def faces(self) -> IntArray:
        """Indices of corners, shape (m, 3)."""
        ...


@dataclass(frozen=True, kw_only=True)
class Crop:
    """Region that counts, for truth and cloud alike.

    Only what is higher than `clearance_m` above the bed at `bed_z_m` (world z points down): sand touches the foot of
    the target and is no part of it. The cloud is cut to the truth's box grown by `margin_m`. No bed: nothing is cut
    off below.
    """

    bed_z_m: float | None = None
    clearance_m: float = 0.010
    margin_m: float = 0.020

    def keeps(self, points_W_m: Array, low_m: Array, high_m: Array) -> BoolArray:
        """Which points count, given the corners of the truth's box; shape (n,)."""
        keep = ((points_W_m >= low_m - self.margin_m) & (points_W_m <= high_m + self.margin_m)).all(axis=1)
        return keep & self.above_bed(points_W_m)

    def above_bed(self, points_W_m: Array) -> BoolArray:
        """Which points are higher than the clearance; shape (n,)."""
        if self.bed_z_m is None:
            return np.ones(len(points_W_m), dtype=np.bool_)
        return points_W_m[:, 2] < self.bed_z_m - self.clearance_m


@dataclass(frozen=True, kw_only=True)
class SurfaceScore:
    """Scores of a model against a reference mesh; `definitions.SURFACE` defines each by its name."""

    rmse_mm: float
    rmse_cap_mm: float
    accuracy_mean_mm: float
    accuracy_median_mm: float
    accuracy_p90_mm: float
    accuracy_1mm_pct: float
    accuracy_2mm_pct: float
    accuracy_3mm_pct: float
    completeness_mean_mm: float
    completeness_1mm_pct: float
    completeness_2mm_pct: float
    completeness_pct: float
    completeness_visible_1mm_pct: float | None
    completeness_visible_2mm_pct: float | None
    completeness_visible_pct: float | None
    visible_pct: float | None
    f_score: float
    success: bool
    icp_displacement_mm: float | None
    icp_residual_mm: float | None
    icp_matched_pct: float | None
    outside_pct: float
    cloud_points: int
    truth_samples: int


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceSamples:
    """Evenly spread samples of the true surface that counts: points and unit outward normals, shape (n, 3)."""

    points_m: Array
    normals: Array


def sample_surface(mesh: MeshArrays, crop: Crop, rng: np.random.Generator, samples: int = SAMPLES) -> SurfaceSamples:
    """Sample the truth evenly by area, then drop what does not count.

    Raises InputError if the mesh has no area or nothing of it counts.
    """
    corners = np.asarray(mesh.vertices_m, dtype=np.float64)[np.asarray(mesh.faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    if len(corners) == 0 or not twice_area.sum() > 0.0:
        raise InputError("reference mesh: has no area, it needs at least one real triangle")
    # Stratified along the cumulative area: each sample has its own share of the surface.
    where = (np.arange(samples) + rng.random(samples)) / samples
    total = np.cumsum(twice_area)
    face = np.minimum(np.searchsorted(total, where * total[-1], side="right"), len(corners) - 1)
    root, v = np.sqrt(rng.random(samples)), rng.random(samples)
    a, b, c = corners[face].transpose(1, 0, 2)
    points = a + (b - a) * (root * (1 - v))[:, None] + (c - a) * (root * v)[:, None]
    keep = crop.above_bed(points)
    if not keep.any():
        raise InputError(f"reference mesh: nothing of it is {crop.clearance_m:g} m or more above the bed")
    normals = cross[face] / np.maximum(twice_area[face], 1e-300)[:, None]
    return SurfaceSamples(points_m=points[keep], normals=normals[keep])


def count_views(
    surface: SurfaceSamples, mesh: MeshArrays, centres_W_m: Array, min_cosine: float = 0.2, enough: int | None = None
) -> IntArray:
    """How many cameras saw each sample: nothing of the mesh in between, and not at a grazing angle.

    `centres_W_m`, shape (k, 3): true camera centres; every camera is taken to face the target. `min_cosine`:
    smallest cosine between the outward normal and the way to the camera (0.2 is 78 degrees). `enough`: stop looking for
    more cameras where so many are found, which is most of the work.
    """
    need("the share of a surface that cameras see", "photos", only=("embreex",))
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, np.asarray(mesh.vertices_m, dtype=np.float32)[np.asarray(mesh.faces)])
    start = surface.points_m + 5e-4 * surface.normals
    seen = np.zeros(len(start), dtype=np.int64)
    open_rows = np.arange(len(start))
    for centre in np.asarray(centres_W_m, dtype=np.float64):
        way = centre - start[open_rows]
        length = np.sqrt(np.einsum("ij,ij->i", way, way))
        facing = np.einsum("ij,ij->i", way, surface.normals[open_rows]) > min_cosine * length
        rows = open_rows[facing]
        if len(rows):
            to = (way[facing] / length[facing, None]).astype(np.float32)
            hit = scene.run(start[rows].astype(np.float32), to, query="OCCLUDED")
            seen[rows] += np.asarray(hit) < 0
            if enough is not None:
                open_rows = open_rows[seen[open_rows] < enough]
    return seen


def voxel_downsample(points_m: Array, voxel_m: float) -> Array:
    """One point, the mean, per cell of a grid, so that dense spots do not dominate; order follows the grid."""
    if len(points_m) == 0:
        return np.zeros((0, 3))
    cells = np.floor(np.asarray(points_m) / voxel_m).astype(np.int64)
    cells -= cells.min(axis=0)
    spans = cells.max(axis=0) + 1
    key = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    _, row, count = np.unique(key, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(row, weights=points_m[:, k]) / count for k in range(3)], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceComparison:
    """A score with what it was computed from: the aligned, thinned cloud, shape (n, 3), and its errors, shape (n,).

    shares: at the requested thresholds, of the cloud thinned to half the smallest where that is finer.
    """

    score: SurfaceScore
    points_W_m: Array
    error_mm: Array
    shares: tuple[ThresholdScore, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, points_W_m=(None, 3), error_mm=(None,))


def evaluate_surface(cloud_W_m: Array, mesh: MeshArrays, **options: Any) -> SurfaceScore:
    """Score a cloud against a true mesh; takes what `compare_surface` takes."""
    return compare_surface(cloud_W_m, mesh, **options).score


def compare_surface(
    cloud_W_m: Array,
    mesh: MeshArrays,
    *,
    crop: Crop | None = None,
    camera_centres_W_m: Array | None = None,
    visible_views: int = 3,
    icp: bool = True,
    cap_mm: float = 20.0,
    voxel_m: float = 0.0008,
    rng: np.random.Generator | None = None,
    samples: int = SAMPLES,
    thresholds_mm: tuple[float, ...] = (),
    distance: MeshDistance | None = None,
) -> SurfaceComparison:
    """Score a cloud against a true mesh; `SurfaceScore` defines every figure.

    `cloud_W_m`, shape (n, 3): the model's points, already in the frame and scale of the truth (from camera positions).
    `crop`: what counts; the default keeps the truth's box and 20 mm around it. `camera_centres_W_m`, shape (k, 3):
    where the photographs were taken from, for the figures over the visible surface. `icp`: take out what is left of the
    misalignment with rigid ICP (no scale) before measuring. `voxel_m`: the cloud is thinned to one mean point per cell
    of this size first. `rng`: draws the samples of the truth; without one they are the same at every call. `samples`:
    how many are drawn. `thresholds_mm`: at which shares are wanted besides those of the score. `distance`: that of this
    mesh, where it is there already. Raises InputError if the mesh is empty or nothing of it counts; StageError if too
    little of the cloud lies near the truth to say anything, its scale is suspicious, or ICP says that the two do not
    belong together.
    """
    icp = boolean(icp, "icp")
    check_extent(cloud_W_m, np.asarray(mesh.vertices_m))
    crop = crop or Crop()
    rng = rng or np.random.default_rng(0)
    surface = sample_surface(mesh, crop, rng, samples)
    low, high = surface.points_m.min(axis=0), surface.points_m.max(axis=0)
    cloud = np.asarray(cloud_W_m, dtype=np.float64).reshape(-1, 3)
    kept = cloud[crop.keeps(cloud, low, high)]
    if len(kept) < 100:
        raise StageError(f"model: {len(kept)} of its {len(cloud)} points lie about the truth, needs at least 100")
    refinement: IcpRefinement | None = None
    if icp:
        refinement = refine_icp(kept, surface.points_m, surface.normals)
        moved = refinement.apply(cloud)
        kept = moved[crop.keeps(moved, low, high)]
    even = voxel_downsample(kept, voxel_m)
    distance = distance or MeshDistance(mesh.vertices_m, mesh.faces)
    to_truth_mm = 1e3 * distance(even)
    to_cloud_mm = 1e3 * _to_cloud_m(surface.points_m, even)
    seen = None
    if camera_centres_W_m is not None:
        seen = count_views(surface, mesh, camera_centres_W_m, enough=visible_views) >= visible_views
    precision, recall = _share(to_truth_mm, 3.0), _share(to_cloud_mm, 3.0)
    rmse = float(np.sqrt((np.minimum(to_truth_mm, cap_mm) ** 2).mean()))
    score = SurfaceScore(
        rmse_mm=rmse,
        rmse_cap_mm=cap_mm,
        accuracy_mean_mm=float(to_truth_mm.mean()),
        accuracy_median_mm=float(np.median(to_truth_mm)),
        accuracy_p90_mm=float(np.percentile(to_truth_mm, 90)),
        accuracy_1mm_pct=_share(to_truth_mm, 1.0),
        accuracy_2mm_pct=_share(to_truth_mm, 2.0),
        accuracy_3mm_pct=precision,
        completeness_mean_mm=float(to_cloud_mm.mean()),
        completeness_1mm_pct=_share(to_cloud_mm, 1.0),
        completeness_2mm_pct=_share(to_cloud_mm, 2.0),
        completeness_pct=recall,
        completeness_visible_1mm_pct=_visible_share(to_cloud_mm, seen, 1.0),
        completeness_visible_2mm_pct=_visible_share(to_cloud_mm, seen, 2.0),
        completeness_visible_pct=_visible_share(to_cloud_mm, seen, 3.0),
        visible_pct=100.0 * float(seen.mean()) if seen is not None else None,
        f_score=2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0,
        success=rmse < SUCCESS_RMSE_MM and recall > SUCCESS_COMPLETENESS_PCT,
        icp_displacement_mm=refinement.displacement_mm if refinement else None,
        icp_residual_mm=refinement.residual_mm if refinement else None,
        icp_matched_pct=refinement.matched_pct if refinement else None,
        outside_pct=100.0 * (1.0 - len(kept) / len(cloud)),
        cloud_points=len(even),
        truth_samples=len(surface.points_m),
    )
    found: tuple[ThresholdScore, ...] = ()
    if thresholds_mm:
        fine, near = to_truth_mm, to_cloud_mm
        if 0.5e-3 * min(thresholds_mm) < voxel_m:
            finer = voxel_downsample(kept, 0.5e-3 * min(thresholds_mm))
            fine, near = 1e3 * distance(finer), 1e3 * _to_cloud_m(surface.points_m, finer)
        found = shares(fine, near, thresholds_mm)
    return SurfaceComparison(score=score, points_W_m=even, error_mm=to_truth_mm, shares=found)


def _to_cloud_m(points_m: Array, cloud_m: Array) -> Array:
    """Distance of few points, shape (n, 3), to the nearest of many, shape (k, 3)."""
    tree = cKDTree(cloud_m, leafsize=32, balanced_tree=False, compact_nodes=False)  # fast to build
    return np.asarray(tree.query(points_m, workers=-1)[0])


class ScaleError(StageError):
    """Two things that differ so much in extent that one of them is hardly in metres."""


def check_extent(cloud_m: Array, truth_m: Array) -> None:
    """Check that cloud, shape (n, 3), and truth, shape (k, 3), do not differ so much that one is hardly in metres.

    A cloud may hold more than the truth or a part of it only, so that a factor of ten either way proves nothing.
    Raises ScaleError.
    """
    cloud = np.asarray(cloud_m, dtype=np.float64).reshape(-1, 3)
    if len(cloud) < 2 or len(truth_m) == 0:
        return
    # The middle nine tenths: a stray point must not enlarge the cloud.
    low, high = np.percentile(cloud, (5.0, 95.0), axis=0)
    extent = float(np.linalg.norm(high - low)) / 0.9
    length = float(np.linalg.norm(np.ptp(truth_m, axis=0)))
    if extent > 0.0 and length > 0.0 and not 1.0 / MAX_SCALE_RATIO < extent / length < MAX_SCALE_RATIO:
        raise ScaleError(
            f"reference: {length:.3g} m across while the cloud is {extent:.3g} m, a suspicious scale (ratio "
            f"{extent / length:.3g}); are both in metres?"
        )


def error_colours(error_mm: Array, top_mm: float = 3.0) -> Array:
    """Colours (red, green, blue, 0 to 1), shape (n, 3), from blue (0) over green to red (`top_mm` and more)."""
    share = np.clip(np.asarray(error_mm) / top_mm, 0.0, 1.0)
    return np.stack([np.clip(2 * share - 1, 0, 1), 1 - np.abs(2 * share - 1), np.clip(1 - 2 * share, 0, 1)], axis=1)


def _share(distance_mm: Array, threshold_mm: float) -> float:
    """Share in percent of distances below a threshold."""
    return 100.0 * float((distance_mm < threshold_mm).mean())


def _visible_share(distance_mm: Array, seen: BoolArray | None, threshold_mm: float) -> float | None:
    """The same over what was seen; None where that is not known or nothing."""
    return _share(distance_mm[seen], threshold_mm) if seen is not None and seen.any() else None


def area_and_volume(mesh: MeshArrays, crop: Crop) -> tuple[float, float]:
    """Area in m2 and volume in m3 of the part of a mesh that counts; zeros where none does.

    The volume is the flux of (0, 0, z - z0) through the surface, z0 the height at which it is cut: of that field the
    divergence is 1 and the flux through the cut is zero, so a mesh that is open there needs no lid. A mesh that is
    closed is cut likewise. Faces are counter-clockwise seen from outside; without a bed z0 is the lowest corner.

    `mesh`: in the world, z down. Only the bed of `crop` counts, not its box.
    """
    corners = mesh.vertices_m[mesh.faces]
    if crop.bed_z_m is None:
        cut_m, kept = float(corners[:, :, 2].max(initial=-np.inf)), corners
    else:
        cut_m = crop.bed_z_m - crop.clearance_m
        kept = corners[crop.above_bed(corners.mean(axis=1))]
    if len(kept) == 0:
        return 0.0, 0.0
    normal = 0.5 * np.cross(kept[:, 1] - kept[:, 0], kept[:, 2] - kept[:, 0])  # as long as the face's area
    area = float(np.linalg.norm(normal, axis=1).sum())
    volume = float(((kept[:, :, 2].mean(axis=1) - cut_m) * normal[:, 2]).sum())
    return area, abs(volume)


@dataclass(frozen=True, kw_only=True)
class MeshFaults:
    """Counts, of a mesh whose corners at one place are one.

    duplicate_faces: faces beyond the first over the same three corners, whichever way round. crowded_edges: edges of
    three and more faces, where no surface has an inside (non-manifold); duplicates count as one face. flat_faces:
    without area. open_edges: edges of one face, as at the rim of a scan.
    """

    duplicate_faces: int
    crowded_edges: int
    flat_faces: int
    open_edges: int

    def words(self) -> list[str]:
        """What is wrong and what it does to the figures; a rim is nothing wrong."""
        out = []
        if self.duplicate_faces:
            out.append(f"{self.duplicate_faces} faces come twice, their area counts twice in completeness")
        if self.crowded_edges:
            out.append(f"{self.crowded_edges} edges belong to more than two faces (non-manifold): there is no inside")
        if self.flat_faces:
            out.append(f"{self.flat_faces} faces have no area and count for nothing")
        return out


def mesh_faults(mesh: MeshArrays) -> MeshFaults:
    """Count the faults of a mesh."""
    vertices = np.asarray(mesh.vertices_m)
    order = np.lexsort(vertices.T)
    new = (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)
    number = np.empty(len(vertices), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    a, b, c = np.sort(number[np.asarray(mesh.faces)], axis=1).T
    flat = (a == b) | (b == c)
    # One whole number for each pair of corners, and one for a pair and a corner: sorted far faster than rows.
    n = len(vertices)
    _, pair = np.unique((a * n + b)[~flat], return_inverse=True)
    _, once = np.unique(pair * n + c[~flat], return_index=True)
    a, b, c = (corner[~flat][once] for corner in (a, b, c))
    count = np.unique(np.concatenate([a * n + b, b * n + c, a * n + c]), return_counts=True)[1]
    return MeshFaults(
        duplicate_faces=int((~flat).sum()) - len(once),
        crowded_edges=int((count > 2).sum()),
        flat_faces=int(flat.sum()),
        open_edges=int((count == 1).sum()),
    )

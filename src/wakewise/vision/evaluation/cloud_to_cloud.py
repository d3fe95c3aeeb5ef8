"""Accuracy and completeness of a cloud against a reference cloud, such as a laser scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.vision.evaluation.alignment import nearest_m, neighbour_tree, refine_icp
from wakewise.vision.evaluation.cloud_to_surface import (
    Crop,
    ThresholdScore,
    check_extent,
    shares,
    voxel_downsample,
)
from wakewise.vision.evaluation.definitions import DTU, TANKS_AND_TEMPLES

LEAST_POINTS = 100
ICP_SHARES, ICP_LIMIT, ICP_CELL = (0.04, 0.02), 0.1, 0.005
"""Farthest match of each round, largest displacement and cell of ICP, in diagonals of the reference's box: what the
defaults of `refine_icp` are to a coral of 0.2 m."""
MARGIN, MOST_CLEARANCE = 0.1, 0.05
"""Growth of the reference's box, and most that is left out above the bed, in the same."""


@dataclass(frozen=True, kw_only=True)
class CloudScore:
    """A model against a reference cloud; `CLOUD_DEFINITIONS` defines each figure."""

    accuracy_mean_mm: float
    accuracy_median_mm: float
    accuracy_p90_mm: float
    completeness_mean_mm: float
    completeness_median_mm: float
    extent_mm: float
    reference_spacing_mm: float
    icp_displacement_mm: float | None
    icp_residual_mm: float | None
    icp_matched_pct: float | None
    outside_pct: float
    cloud_points: int
    reference_points: int


_NEAREST = "a point has the nearest point of the other cloud as its partner: never below about half the spacing"

CLOUD_DEFINITIONS: dict[str, tuple[str, str]] = {
    "accuracy_mean_mm": ("mm", f"mean distance from model to reference; {_NEAREST}; {DTU}, without its cap"),
    "accuracy_median_mm": ("mm", "median of the same distances"),
    "accuracy_p90_mm": ("mm", "90th percentile of the same distances"),
    "completeness_mean_mm": ("mm", "mean distance from reference to model"),
    "completeness_median_mm": ("mm", "median of the same distances"),
    "extent_mm": ("mm", "diagonal of the reference's box, which thresholds in percent are of"),
    "reference_spacing_mm": ("mm", "median distance between neighbouring points of the reference"),
    "icp_displacement_mm": ("mm", "mean way that rigid ICP moved the model; more than a tenth of the extent is a "
                            "failure, not a figure"),
    "icp_residual_mm": ("mm", "root mean square distance along the normal of what ICP matched in the end"),
    "icp_matched_pct": ("%", "share of the model within a fiftieth of the extent of the reference after ICP; less than "
                        "50 is a failure"),
    "outside_pct": ("%", "share of the model that does not count: more than a tenth of the extent outside the "
                    "reference's box, or near the bed"),
    "cloud_points": ("", "points of the model that count, after thinning"),
    "reference_points": ("", "points of the reference that count, after thinning"),
    "shares": ("", f"accuracy, completeness and F-score at each threshold; {TANKS_AND_TEMPLES}"),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class CloudComparison:
    """A score, shares at thresholds, and the aligned, thinned model, shape (n, 3), with its errors, shape (n,)."""

    score: CloudScore
    shares: tuple[ThresholdScore, ...]
    points_W_m: Array
    error_mm: Array

    def __post_init__(self) -> None:
        freeze(self, points_W_m=(None, 3), error_mm=(None,))


def extent_m(points_m: Array) -> float:
    """Diagonal of the box about points, shape (n, 3), in m."""
    return float(np.linalg.norm(np.ptp(np.asarray(points_m), axis=0))) if len(points_m) else 0.0


def compare_clouds(
    cloud_W_m: Array,
    reference_W_m: Array,
    thresholds_mm: tuple[float, ...],
    *,
    bed_z_m: float | None = None,
    icp: bool = True,
) -> CloudComparison:
    """Compare a cloud with a reference cloud in the same frame and scale; `CLOUD_DEFINITIONS` defines every figure.

    Both are thinned to one mean point per cell of half the smallest threshold, or of the reference's spacing where that
    is wider, so that dense spots do not rule.

    `cloud_W_m`, `reference_W_m` have shape (n, 3). `bed_z_m`: height of the bed, world z down; what is near it does not
    count in either. Raises InputError if too little of the reference counts; StageError if too little of the model lies
    near it, its scale is suspicious, or ICP fails.
    """
    whole = extent_m(reference_W_m)
    check_extent(cloud_W_m, reference_W_m)
    crop = Crop(bed_z_m=bed_z_m, clearance_m=min(0.010, MOST_CLEARANCE * whole), margin_m=MARGIN * whole)
    truth = np.asarray(reference_W_m, dtype=np.float64)
    truth = truth[crop.above_bed(truth)]
    if len(truth) < LEAST_POINTS:
        raise InputError(f"reference cloud: {len(truth)} of its points count, needs at least {LEAST_POINTS}")
    # For few questions a tree that is fast to build.
    quick = cKDTree(truth, leafsize=32, balanced_tree=False, compact_nodes=False)
    spacing = float(np.median(np.asarray(quick.query(_some(truth), k=2)[0])[:, 1]))
    cell = max(0.5e-3 * min(thresholds_mm), spacing)
    even_truth = voxel_downsample(truth, cell)
    low, high = truth.min(axis=0), truth.max(axis=0)
    cloud = np.asarray(cloud_W_m, dtype=np.float64).reshape(-1, 3)
    kept = cloud[crop.keeps(cloud, low, high)]
    if len(kept) < LEAST_POINTS:
        raise StageError(f"model: {len(kept)} of its {len(cloud)} points lie about the truth, needs at least 100")
    tree = neighbour_tree(even_truth)
    refinement = None
    if icp:  # onto planes through the neighbours of the reference's points
        reaches, cell_m, limit_m = [share * whole for share in ICP_SHARES], ICP_CELL * whole, ICP_LIMIT * whole
        refinement = refine_icp(
            kept, even_truth, distances_m=tuple(reaches), voxel_m=cell_m, limit_m=limit_m, tree=tree
        )
        moved = refinement.apply(cloud)
        kept = moved[crop.keeps(moved, low, high)]
    even = voxel_downsample(kept, cell)
    to_truth = 1e3 * nearest_m(tree, even_truth, even)
    to_model = 1e3 * nearest_m(neighbour_tree(even), even, even_truth)
    score = CloudScore(
        accuracy_mean_mm=float(to_truth.mean()),
        accuracy_median_mm=float(np.median(to_truth)),
        accuracy_p90_mm=float(np.percentile(to_truth, 90)),
        completeness_mean_mm=float(to_model.mean()),
        completeness_median_mm=float(np.median(to_model)),
        extent_mm=1e3 * whole,
        reference_spacing_mm=1e3 * spacing,
        icp_displacement_mm=refinement.displacement_mm if refinement else None,
        icp_residual_mm=refinement.residual_mm if refinement else None,
        icp_matched_pct=refinement.matched_pct if refinement else None,
        outside_pct=100.0 * (1.0 - len(kept) / len(cloud)),
        cloud_points=len(even),
        reference_points=len(even_truth),
    )
    found = shares(to_truth, to_model, thresholds_mm)
    return CloudComparison(score=score, shares=found, points_W_m=even, error_mm=to_truth)


def _some(points: Array, most: int = 5000) -> Array:
    """An even subset of about `most` points."""
    return points[:: max(1, len(points) // most)]

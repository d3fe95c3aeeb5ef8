"""Unit, definition and source of each figure of a model."""

from __future__ import annotations

DTU = "DTU: H. Aanaes et al., IJCV 120, 2016, doi 10.1007/s11263-016-0902-9"
TANKS_AND_TEMPLES = "Tanks and Temples: A. Knapitsch et al., ACM TOG 36(4), 2017, doi 10.1145/3072959.3073599"

_CLOUD = "from a point of the model, thinned to one per 0.8 mm cell, to the nearest place on the true surface"
_TRUTH = "from a place on the true surface, sampled evenly by area, to the nearest point of the model"

# key: (unit, definition)
SURFACE: dict[str, tuple[str, str]] = {
    "rmse_mm": ("mm", f"root mean square distance {_CLOUD}, each distance capped at rmse_cap_mm"),
    "rmse_cap_mm": ("mm", "cap on a single distance in rmse_mm"),
    "accuracy_mean_mm": ("mm", f"mean distance {_CLOUD}; accuracy of {DTU}, without its cap"),
    "accuracy_median_mm": ("mm", f"median distance {_CLOUD}"),
    "accuracy_p90_mm": ("mm", f"90th percentile of the distance {_CLOUD}"),
    "accuracy_1mm_pct": ("%", f"share of the model within 1 mm of the truth; precision of {TANKS_AND_TEMPLES}"),
    "accuracy_2mm_pct": ("%", "the same within 2 mm"),
    "accuracy_3mm_pct": ("%", "the same within 3 mm"),
    "completeness_mean_mm": ("mm", f"mean distance {_TRUTH}; completeness of {DTU}, without its cap"),
    "completeness_1mm_pct": ("%", f"share of the truth within 1 mm of the model; recall of {TANKS_AND_TEMPLES}"),
    "completeness_2mm_pct": ("%", "the same within 2 mm"),
    "completeness_pct": ("%", "the same within 3 mm"),
    "completeness_visible_1mm_pct": ("%", "completeness_1mm_pct over what at least three cameras saw (DTU calls such "
                                     "a choice the observability mask)"),
    "completeness_visible_2mm_pct": ("%", "completeness_2mm_pct over what at least three cameras saw"),
    "completeness_visible_pct": ("%", "completeness_pct over what at least three cameras saw"),
    "visible_pct": ("%", "share of the true surface that at least three cameras saw: not hidden by the target, and at "
                    "less than 78 deg from its normal"),
    "f_score": ("%", f"harmonic mean of accuracy_3mm_pct and completeness_pct, 0 to 100; {TANKS_AND_TEMPLES}"),
    "success": ("", "rmse_mm < 3 and completeness_pct > 85"),
    "icp_displacement_mm": ("mm", "mean way that rigid ICP moved the model after camera positions placed it; more than "
                            "20 mm is a failure, not a figure"),
    "icp_residual_mm": ("mm", "root mean square distance along the normal of what ICP matched in the end"),
    "icp_matched_pct": ("%", "share of the model within 4 mm of the true surface after ICP; less than 50 is a failure"),
    "outside_pct": ("%", "share of the model that does not count: more than 20 mm outside the truth's box, or near the "
                    "bed"),
    "cloud_points": ("", "points of the model that count, after thinning"),
    "truth_samples": ("", "samples of the true surface that count"),
}  # fmt: skip

MESH_REFERENCE: dict[str, tuple[str, str]] = {
    "extent_mm": ("mm", "diagonal of the true surface's box, which thresholds in percent are of"),
    "shares": ("", "accuracy, completeness and F-score at each threshold, of the model thinned to a point per cell of "
               "half the smallest threshold or of 0.8 mm, whichever is finer"),
    "reference_faults": ("", "of the true surface: faces that come twice, edges of more than two faces (non-manifold), "
                         "faces without area, edges of one face (its rim)"),
    "model_faults": ("", "the same of the model, where it is a mesh"),
}  # fmt: skip
"""What `wakewise evaluate` reports besides `SURFACE`."""

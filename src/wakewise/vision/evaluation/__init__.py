"""How good a flight and a model were: alignment, accuracy and completeness, flight figures.

Pure functions whose results carry their unit in their name. Start reading in `cloud_to_surface.py` (a cloud against the
true surface) and `flight.py` (a flight's figures from its steps). `alignment.py` brings a model into the truth's frame
(Umeyama, ICP), `cloud_to_surface.py` counts what lies within, `cloud_to_surface.py` measures area and volume,
`depth_maps.py` and `cloud_to_cloud.py` judge against laser scans, `cloud_to_surface.py` counts a mesh's faults,
`definitions.py` says what each figure is.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.evaluation.alignment import IcpRefinement, Similarity, refine_icp, robust_similarity, umeyama
    from wakewise.vision.evaluation.cloud_to_cloud import CLOUD_DEFINITIONS, CloudComparison, compare_clouds, extent_m
    from wakewise.vision.evaluation.cloud_to_surface import (
        Crop,
        MeshFaults,
        SurfaceComparison,
        SurfaceSamples,
        SurfaceScore,
        ThresholdScore,
        compare_surface,
        count_views,
        error_colours,
        evaluate_surface,
        mesh_faults,
        read_thresholds,
        sample_surface,
        shares,
        suspicious_scale,
        voxel_downsample,
    )
    from wakewise.vision.evaluation.definitions import MESH_REFERENCE as MESH_REFERENCE_DEFINITIONS
    from wakewise.vision.evaluation.definitions import SURFACE as SURFACE_DEFINITIONS
    from wakewise.vision.evaluation.depth_maps import (
        DEPTH_DEFINITIONS,
        DepthScore,
        DepthView,
        compare_depths,
        read_depth_views,
    )
    from wakewise.vision.evaluation.flight import SWAY_FIGURES, attitude_rmse_deg, flight_figures

__all__ = [
    "CLOUD_DEFINITIONS",
    "DEPTH_DEFINITIONS",
    "MESH_REFERENCE_DEFINITIONS",
    "SURFACE_DEFINITIONS",
    "SWAY_FIGURES",
    "CloudComparison",
    "Crop",
    "DepthScore",
    "DepthView",
    "IcpRefinement",
    "MeshFaults",
    "Similarity",
    "SurfaceComparison",
    "SurfaceSamples",
    "SurfaceScore",
    "ThresholdScore",
    "attitude_rmse_deg",
    "compare_clouds",
    "compare_depths",
    "compare_surface",
    "count_views",
    "error_colours",
    "evaluate_surface",
    "extent_m",
    "flight_figures",
    "mesh_faults",
    "read_depth_views",
    "read_thresholds",
    "refine_icp",
    "robust_similarity",
    "sample_surface",
    "shares",
    "suspicious_scale",
    "umeyama",
    "voxel_downsample",
]

lazy_attributes(__name__, "photos")

"""Scores of models, views and flights; pure functions whose results carry their unit in their name.

- `alignment.py`: similarity of paired points (Umeyama, least median of squares), point-to-plane ICP.
- `cloud_to_surface.py`: a cloud against a reference mesh; area, volume and faults of a mesh.
- `cloud_to_cloud.py`: a cloud against a reference cloud. `depth_maps.py`: a cloud against depth maps.
- `trained_models.py`: Gaussian splats as points, the frame of nerfstudio.
- `rendered_views.py`: PSNR, SSIM and LPIPS of rendered views.
- `flight.py`: figures of a flight from the table of its steps.
- `definitions.py`: unit, definition and source of each figure.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.evaluation.alignment import IcpRefinement, Similarity, refine_icp, robust_similarity, umeyama
    from wakewise.vision.evaluation.cloud_to_cloud import CLOUD_DEFINITIONS, CloudComparison, compare_clouds, extent_m
    from wakewise.vision.evaluation.cloud_to_surface import (
        Crop,
        MeshFaults,
        ScaleError,
        SurfaceComparison,
        SurfaceSamples,
        SurfaceScore,
        ThresholdScore,
        check_extent,
        compare_surface,
        count_views,
        error_colours,
        evaluate_surface,
        mesh_faults,
        read_thresholds,
        sample_surface,
        shares,
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
    from wakewise.vision.evaluation.rendered_views import VIEW_DEFINITIONS, ViewScores, read_split, score_views
    from wakewise.vision.evaluation.trained_models import (
        SPLAT_DEFINITIONS,
        GaussianSplats,
        nerfstudio_frame,
        read_splats,
    )

__all__ = [
    "CLOUD_DEFINITIONS",
    "DEPTH_DEFINITIONS",
    "MESH_REFERENCE_DEFINITIONS",
    "SPLAT_DEFINITIONS",
    "SURFACE_DEFINITIONS",
    "SWAY_FIGURES",
    "VIEW_DEFINITIONS",
    "CloudComparison",
    "Crop",
    "DepthScore",
    "DepthView",
    "GaussianSplats",
    "IcpRefinement",
    "MeshFaults",
    "ScaleError",
    "Similarity",
    "SurfaceComparison",
    "SurfaceSamples",
    "SurfaceScore",
    "ThresholdScore",
    "ViewScores",
    "attitude_rmse_deg",
    "check_extent",
    "compare_clouds",
    "compare_depths",
    "compare_surface",
    "count_views",
    "error_colours",
    "evaluate_surface",
    "extent_m",
    "flight_figures",
    "mesh_faults",
    "nerfstudio_frame",
    "read_depth_views",
    "read_splats",
    "read_split",
    "read_thresholds",
    "refine_icp",
    "robust_similarity",
    "sample_surface",
    "score_views",
    "shares",
    "umeyama",
    "voxel_downsample",
]

lazy_attributes(__name__, "photos")

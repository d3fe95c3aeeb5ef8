"""How good a flight and a model were: alignment, accuracy and completeness, flight figures.

Pure functions whose results carry their unit in their name. Start reading in `surface.py` (a cloud against the true
surface) and `flight.py` (a flight's figures from its steps). `alignment.py` brings a model into the truth's frame
(Umeyama, ICP), `depth_maps.py` judges against laser scans, `definitions.py` says what each figure is.
"""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.evaluation.alignment import Refinement, Similarity, refine_icp, robust_similarity, umeyama
    from wakewise.evaluation.definitions import SURFACE as SURFACE_DEFINITIONS
    from wakewise.evaluation.depth_maps import (
        DEPTH_DEFINITIONS,
        DepthScore,
        DepthView,
        compare_depths,
        read_depth_views,
    )
    from wakewise.evaluation.flight import SWAY_FIGURES, attitude_rmse_deg, flight_figures
    from wakewise.evaluation.surface import (
        Comparison,
        Crop,
        Surface,
        SurfaceScore,
        compare_surface,
        count_views,
        error_colours,
        evaluate_surface,
        sample_surface,
        suspicious_scale,
        thin,
    )

__all__ = [
    "DEPTH_DEFINITIONS",
    "SURFACE_DEFINITIONS",
    "SWAY_FIGURES",
    "Comparison",
    "Crop",
    "DepthScore",
    "DepthView",
    "Refinement",
    "Similarity",
    "Surface",
    "SurfaceScore",
    "attitude_rmse_deg",
    "compare_depths",
    "compare_surface",
    "count_views",
    "error_colours",
    "evaluate_surface",
    "flight_figures",
    "read_depth_views",
    "refine_icp",
    "robust_similarity",
    "sample_surface",
    "suspicious_scale",
    "thin",
    "umeyama",
]

lazy_door(__name__, "photos")

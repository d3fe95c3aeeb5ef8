"""How good a flight and a model were: alignment, accuracy and completeness, trajectory error, flight figures.

Pure functions whose results carry their unit in their name.
"""

from wakewise.evaluation.alignment import Refinement, Similarity, refine_icp, robust_similarity, umeyama
from wakewise.evaluation.flight import flight_figures
from wakewise.evaluation.surface import (
    Crop,
    Surface,
    SurfaceScore,
    count_views,
    evaluate_surface,
    sample_surface,
    thin,
)
from wakewise.evaluation.trajectory import TrajectoryError, paired_instants, read_tum, trajectory_error

__all__ = [
    "Crop",
    "Refinement",
    "Similarity",
    "Surface",
    "SurfaceScore",
    "TrajectoryError",
    "count_views",
    "evaluate_surface",
    "flight_figures",
    "paired_instants",
    "read_tum",
    "refine_icp",
    "robust_similarity",
    "sample_surface",
    "thin",
    "trajectory_error",
    "umeyama",
]

"""A model from a set of photographs and how good it is: what benches and studies without a flight have in common."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any

from wakewise.core.errors import StageError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.experiments.trials.trial import REGION_SHARE
from wakewise.scene.targets import Target
from wakewise.vision.evaluation import Crop, evaluate_surface
from wakewise.vision.reconstruction import ReconstructionSettings, mesh_model, read_cloud, reconstruct
from wakewise_paper.photo_sets import PhotoSet

_MODEL_FIGURES = (
    "images",
    "registered_images",
    "mapping",
    "poses_refused",
    "posed_pairs",
    "pairs",
    "reprojection_px",
    "cameras_rmse_mm",
    "features_per_image",
    "inlier_matches",
    "dense_points",
    "stages_s",
)


def judge(
    photos: PhotoSet, target: Target, settings: ReconstructionSettings, folder: Path, progress: Progress = no_progress
) -> dict[str, Any]:
    """Reconstruct a photo set as a trial does, from estimated poses only, and hold the model against the truth.

    Returns
    -------
    dict
        Figures of the model and of its surface; `failure` is None, or says why there is no model, and then there are
        no figures of its surface. stages_s holds wall seconds by stage; total_s is from photographs to figures,
        total_cpu_s its CPU time. The mesh, which no figure needs, comes after them: mesh_s is in neither.

    Raises
    ------
    EnvironmentFailure
        If the disk is full, or a file cannot be read or written: that is no figure.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    figures: dict[str, Any] = {"images": len(photos.names), "failure": None}
    try:
        model = reconstruct(
            photos.folder,
            folder,
            settings.model_copy(update={"mesh": False, "lens_check": False}),  # one camera took them all
            focal_px=photos.focal_px,
            reference_positions=photos.references,
            reference_rotations=photos.rotations,
            region=(target.centre_W_m, REGION_SHARE * target.radius_m),
            progress=progress,
        ).summary()
        figures |= {key: model[key] for key in _MODEL_FIGURES}
        began = time.perf_counter()
        score = evaluate_surface(
            read_cloud(folder / "dense.ply").points_m,
            target.mesh,
            crop=Crop(bed_z_m=target.bed_z_m),
            camera_centres_W_m=photos.true_W_m,
        )
        figures |= dataclasses.asdict(score)
        figures["stages_s"] = figures["stages_s"] | {"evaluate": time.perf_counter() - began}
    except StageError as fault:
        figures |= {"failure": str(fault), "success": False}
    figures |= {"total_s": time.perf_counter() - wall, "total_cpu_s": time.process_time() - cpu, "mesh_s": None}
    if settings.mesh and figures["failure"] is None:
        began = time.perf_counter()
        mesh_model(folder, settings, progress)
        figures["mesh_s"] = time.perf_counter() - began
    return figures

"""From matches to cameras and sparse points: database.db in, sparse/ out, in metres where positions are known."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from wakewise.arrays import Array
from wakewise.errors import InputError, StageError
from wakewise.evaluation import robust_similarity
from wakewise.files import whole_folder
from wakewise.interfaces import Progress
from wakewise.reconstruction.colmap import call
from wakewise.reconstruction.settings import ReconstructionSettings


def map_photos(
    folder: Path,
    database: Path,
    sparse: Path,
    settings: ReconstructionSettings,
    *,
    photos: int,
    references: dict[str, Array] | None,
    progress: Progress,
) -> dict[str, Any]:
    """Incremental structure from motion; keep the largest model, bring it to the reference positions, write it whole.

    J. L. Schoenberger and J.-M. Frahm, Structure-from-motion revisited, CVPR 2016, doi 10.1109/CVPR.2016.445.

    Parameters
    ----------
    photos : int
        How many there are, for the progress and the messages.
    references : dict, optional
        Camera centres in m, shape (3,), by photo name. They fix place, turn and scale by a robust similarity; the
        model's shape does not bend to them.

    Returns
    -------
    dict
        registered_images, points, reprojection_px, track_length, focal_px, cameras_rmse_mm and cameras_max_mm over all
        registered photos with a reference, reference_inliers, scale; None where no references were given.

    Raises
    ------
    StageError
        If too few photos register or the model cannot be aligned.
    """
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = settings.threads
    options.random_seed = settings.random_seed
    options.mapper.random_seed = settings.random_seed
    options.min_model_size = 3
    options.max_num_models = 5
    options.extract_colors = False
    options.ba_global_max_num_iterations = 100
    done = [0]

    def one_more() -> None:
        done[0] += 1

    with tempfile.TemporaryDirectory(prefix=".mapping.", dir=sparse.parent) as scratch:
        models = call(
            partial(
                pycolmap.incremental_mapping, database, folder, scratch, options=options, next_image_callback=one_more
            ),
            "mapping",
            lambda: progress(min(done[0], photos), photos, "mapping"),
        )
    if not models:
        raise StageError(f"mapping: none of the {photos} photos register; they show too little in common")
    model = max(models.values(), key=lambda one: one.num_reg_images())
    registered = model.num_reg_images()
    if registered < settings.min_registered:
        raise StageError(f"mapping: {registered} of {photos} photos register, at least {settings.min_registered} must")
    figures: dict[str, Any] = {
        "cameras_rmse_mm": None,
        "cameras_max_mm": None,
        "reference_inliers": None,
        "scale": None,
    }
    if references is not None:
        figures = _align(model, references, settings)
    model.extract_colors_for_all_images(folder)
    figures |= {
        "registered_images": registered,
        "points": model.num_points3D(),
        "reprojection_px": float(model.compute_mean_reprojection_error()),
        "track_length": float(model.compute_mean_track_length()),
        "focal_px": float(np.median([camera.focal_length for camera in model.cameras.values()])),
    }
    with whole_folder(sparse) as temporary:
        model.write_binary(temporary)
    return figures


def _align(
    model: pycolmap.Reconstruction, references: dict[str, Array], settings: ReconstructionSettings
) -> dict[str, Any]:
    """Bring the model into the references' frame; error over every registered photo that has a reference."""
    paired = [
        (image.projection_center(), references[image.name])
        for image in model.images.values()
        if image.has_pose and image.name in references
    ]
    if len(paired) < 3:
        raise StageError(f"alignment: {len(paired)} registered photos have a reference position, at least 3 must")
    centres, wanted = (np.array(column) for column in zip(*paired, strict=True))
    try:
        similarity, inliers = robust_similarity(centres, wanted, np.random.default_rng(settings.random_seed))
    except InputError as error:
        raise StageError(f"alignment of the cameras: {error}") from None
    model.transform(pycolmap.Sim3d(similarity.scale, pycolmap.Rotation3d(similarity.R_AB), similarity.t_A_m))
    error_mm = 1e3 * np.linalg.norm(similarity.apply(centres) - wanted, axis=1)
    return {
        "cameras_rmse_mm": float(np.sqrt((error_mm**2).mean())),
        "cameras_max_mm": float(error_mm.max()),
        "reference_inliers": int(inliers.sum()),
        "scale": similarity.scale,
    }

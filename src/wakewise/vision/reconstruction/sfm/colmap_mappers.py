"""COLMAP's incremental and global mappers: a database of matches to sparse models."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import NEVER, call, call_in_process, open_database, pycolmap
from wakewise.vision.reconstruction.sfm.features import match_pairs
from wakewise.vision.reconstruction.sfm.pairs import Pairs, read_descriptors

# Most iterations of a bundle adjustment.
BUNDLE_ITERATIONS = 100
GROWTH = 1.4
MOST_RETRIED_PAIRS = 1000
"""Most pairs that are matched for photos which found no place: some minutes."""


def solve(
    folder: Path,
    database: Path,
    scratch: Path,
    settings: ReconstructionSettings,
    photos: int,
    progress: Progress,
) -> list[pycolmap.Reconstruction]:
    """Every model that comes about, the one with most photos first.

    `database`: COLMAP's, with matches; it may be written into. `scratch`: folder to work in. `photos`: how many there
    are, for the progress. Raises StageError if COLMAP fails.
    """
    done = [0]

    def one_more() -> None:
        done[0] += 1

    def watch() -> None:
        progress(min(done[0], photos), photos, "mapping")

    out = Path(tempfile.mkdtemp(prefix="models-", dir=scratch))
    if settings.mapper == "global":
        options = pycolmap.GlobalPipelineOptions()
        options.num_threads = settings.threads
        options.random_seed = RANDOM_SEED
        options.mapper.random_seed = RANDOM_SEED
        options.mapper.num_threads = settings.threads
        adjustment = options.mapper.bundle_adjustment
        adjustment.ceres.solver_options.max_num_iterations = BUNDLE_ITERATIONS
        adjustment.refine_focal_length = adjustment.refine_extra_params = settings.refine_camera
        # It takes no cancellation token.
        call_in_process("mapping", "global_mapping", database, folder, out, options, watch=watch)
        found = [pycolmap.Reconstruction(path) for path in sorted(out.iterdir()) if (path / "images.bin").is_file()]
        return largest_first(found)
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = settings.threads
    options.random_seed = RANDOM_SEED
    options.mapper.random_seed = RANDOM_SEED
    options.min_model_size = min(3, photos)
    options.ba_refine_focal_length = options.ba_refine_extra_params = settings.refine_camera
    options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = settings.refine_camera
    if photos == 2:
        # There is no third photo to confirm a point, nor another pair to begin with.
        options.triangulation.ignore_two_view_tracks = False
        options.mapper.init_min_tri_angle = 2.0
        options.mapper.init_min_num_inliers = 30
    options.max_num_models = 5
    options.extract_colors = False
    # The whole model is adjusted again when it has grown by two fifths. By a tenth, COLMAP's own, took twice as long on
    # 72 photos and gave the same cameras: those of the photos between are adjusted with their neighbours all the same.
    options.ba_global_frames_ratio = options.ba_global_points_ratio = GROWTH
    # Two threads sum in any order, so that the same photos gave a few other points; they took as long as one, too.
    options.ba_min_num_residuals_for_cpu_multi_threading = NEVER
    options.ba_global_max_num_iterations = BUNDLE_ITERATIONS
    if settings.position_priors:
        options.use_prior_position = True
        options.use_robust_loss_on_prior_position = True
    work = partial(pycolmap.incremental_mapping, database, folder, out, options=options, next_image_callback=one_more)
    return largest_first(call(work, "mapping", watch).values())


def solve_again(
    folder: Path,
    database: Path,
    scratch: Path,
    settings: ReconstructionSettings,
    models: list[pycolmap.Reconstruction],
    progress: Progress,
) -> list[pycolmap.Reconstruction]:
    """Models after those photos that are not in the largest were matched with others than they have been.

    Where all pairs were matched, or none of those that were not verifies, the models are as they were. Those that look
    most alike are tried first, up to `MOST_RETRIED_PAIRS` pairs.

    `database`: COLMAP's; what is found is written into it. `models`: from `solve`, the largest first.
    """
    with open_database(database) as link:
        names = {image.image_id: image.name for image in link.read_all_images()}
        pair_ids, _ = link.read_all_matches()
        before = link.num_inlier_matches()
    tried = {frozenset(names[k] for k in pycolmap.pair_id_to_image_pair(pair_id)) for pair_id in pair_ids}
    placed = {image.name for image in models[0].images.values() if image.has_pose}
    count = len(names)
    if len(placed) == count or len(tried) == count * (count - 1) // 2:
        return models
    described = read_descriptors(database)
    likeness = described.likeness()
    one, two = np.triu_indices(count, 1)
    pairs: Pairs = []
    for k in np.argsort(-likeness[one, two], kind="stable").tolist():
        pair = described.names[one[k]], described.names[two[k]]
        if (pair[0] not in placed or pair[1] not in placed) and frozenset(pair) not in tried:
            pairs.append(pair)
    match_pairs(database, settings, pairs[:MOST_RETRIED_PAIRS], progress)
    with open_database(database) as link:
        more = link.num_inlier_matches() > before
    if not more:
        return models
    again = solve(folder, database, scratch, settings, count, progress)
    return again if again and again[0].num_reg_images() > len(placed) else models


def largest_first(models: Iterable[pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    """Models that hold any point, the one with most photos first.

    About one mapping in 500 of six photographs, with a lens for each, came out with five of them and no point at all,
    focal lengths below zero; the same photographs gave a sound model the other times, as sums in another order do.
    """
    held = (model for model in models if model.num_points3D() > 0)
    return sorted(held, key=lambda model: (-model.num_reg_images(), -model.num_points3D()))

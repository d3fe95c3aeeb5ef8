"""Cameras and sparse points from photos whose poses are roughly known: triangulate, adjust, triangulate, adjust.

Poses that the vehicle knows to some millimetres and milliradians are off by tens of pixels, so the first points are
let stand wherever their rays nearly meet; a robust adjustment of all cameras and points then takes the errors out of
the poses, and points and tracks are made anew to COLMAP's own tolerances (J. L. Schoenberger and J.-M. Frahm,
Structure-from-motion revisited, CVPR 2016, doi 10.1109/CVPR.2016.445, sections 4.3 and 4.4, with all photos at once
instead of one after the other). Nothing holds the cameras to where they began. A model that does not pass the gate is
refused, and who asked for it goes the longer way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import call, no_stderr, open_database, pycolmap, silence_logging
from wakewise.vision.reconstruction.sfm.guided_matching import Poses

ROUGH_ANGLE_DEG, ROUGH_PX = 3.0, 40.0
"""How nearly rays must meet at first: at 0.5 m, poses off by 5 mm and 5 mrad leave 1 deg."""
ITERATIONS = (25, 30)
TOLERANCES = (1e-4, 1e-5)
"""Most iterations of the two adjustments, and the relative gain at which they end."""
FILTER_PX, MIN_ANGLE_DEG = (4.0, 2.0), 1.5
"""Largest reprojection error of an observation that stays after each adjustment, and least angle between rays."""
NEVER = 2**31 - 1
LEAST_MATCHED, LEAST_POINTS = 30, 30
"""Matched features from which on a photo is expected to register, and points that it must see (COLMAP's own 30)."""
MOST_ERROR_PX, LEAST_TRACK, LEAST_KEPT = 0.7, 2.5, 0.4
"""Gate: mean reprojection error, mean length of tracks, and share of the matched features that stand in the model."""


@dataclass(frozen=True, kw_only=True)
class SeededModel:
    """A model, or why there is none."""

    model: pycolmap.Reconstruction | None
    refusal: str | None


def map_from_poses(
    database: Path, poses: Poses, settings: ReconstructionSettings, photos: int, progress: Progress
) -> SeededModel:
    """Model from verified matches and rough poses.

    `database`: COLMAP's, with matches; it may be written into. `poses`: R_WC, shape (3, 3), and p_WC_m, shape (3,), by
    photo name; every photo with matches needs one. `photos`: how many there are, for the progress. Raises StageError if
    COLMAP fails.
    """
    silence_logging()
    with open_database(database) as link:
        options = pycolmap.DatabaseCacheOptions()
        options.min_num_matches = 15
        cache = pycolmap.DatabaseCache.create(link, options)
    graph = cache.correspondence_graph
    matched = {number: graph.num_observations_for_image(number) for number in cache.images}
    without_pose = [image.name for n, image in cache.images.items() if matched[n] and image.name not in poses]
    if without_pose:
        return SeededModel(
            model=None, refusal=f"{len(without_pose)} photos have no known pose, such as {without_pose[0]}"
        )
    mapper, model = pycolmap.IncrementalMapper(cache), pycolmap.Reconstruction()
    mapper.begin_reconstruction(model)
    manager = mapper.observation_manager
    placed = sorted(number for number in model.images if matched[number])
    for number in placed:
        image = model.images[number]
        R_WC, p_WC = poses[image.name]
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R_WC.T), -R_WC.T @ p_WC)
        image.frame.set_cam_from_world(image.camera_id, pose)
        manager.register_frame(image.frame_id)
    rough, fine = pycolmap.IncrementalTriangulatorOptions(), pycolmap.IncrementalTriangulatorOptions()
    rough.random_seed = fine.random_seed = RANDOM_SEED
    rough.create_max_angle_error = rough.continue_max_angle_error = ROUGH_ANGLE_DEG
    rough.complete_max_reproj_error = rough.merge_max_reproj_error = ROUGH_PX
    for done, number in enumerate(placed):
        progress(min(done, photos), 2 * photos, "points at the known poses")
        mapper.triangulate_image(rough, number)
    progress(photos, 2 * photos, "adjustment")
    if model.num_points3D() >= LEAST_POINTS:
        _adjust(model, settings, 0, robust=True)
        manager.filter_all_points3D(FILTER_PX[0], MIN_ANGLE_DEG)
        mapper.complete_and_merge_tracks(fine)
        mapper.retriangulate(fine)
    if model.num_points3D() >= LEAST_POINTS:
        _adjust(model, settings, 1, robust=False)
        manager.filter_all_points3D(FILTER_PX[1], MIN_ANGLE_DEG)
        model.update_point_3d_errors()
    for number in placed:
        if model.images[number].num_points3D < LEAST_POINTS:
            manager.deregister_frame(model.images[number].frame_id)
    mapper.end_reconstruction(False)
    refusal = _refusal(model, matched)
    return SeededModel(model=model if refusal is None else None, refusal=refusal)


def _refusal(model: pycolmap.Reconstruction, matched: dict[int, int]) -> str | None:
    """Why a model is not to be trusted; None if it is."""
    expected = sum(count >= LEAST_MATCHED for count in matched.values())
    if model.num_reg_images() < max(expected, 2) or model.num_points3D() < LEAST_POINTS:
        return f"{model.num_reg_images()} of {expected} photos with matches register at their poses, all must"
    error_px = float(model.compute_mean_reprojection_error())
    if not error_px <= MOST_ERROR_PX:
        return f"mean reprojection error {error_px:.2f} px, at most {MOST_ERROR_PX:g} is allowed"
    track = float(model.compute_mean_track_length())
    if not track >= LEAST_TRACK:
        return f"a point is seen by {track:.1f} photos on average, at least {LEAST_TRACK:g} must see it"
    kept = float(model.compute_num_observations()) / max(sum(matched.values()), 1)
    if not kept >= LEAST_KEPT:
        return f"{100 * kept:.0f} % of the matched features stand in the model, at least {100 * LEAST_KEPT:g} % must"
    return None


def _adjust(model: pycolmap.Reconstruction, settings: ReconstructionSettings, stage: int, *, robust: bool) -> None:
    """Adjust all cameras and points; if robust, what is more than 1 px off pulls by its distance, not by the square."""
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = options.refine_extra_params = settings.refine_camera
    solver = options.ceres.solver_options
    solver.max_num_iterations, solver.function_tolerance = ITERATIONS[stage], TOLERANCES[stage]
    solver.num_threads = settings.threads
    # Two threads sum in any order, and the same photos would give another model.
    options.ceres.min_num_residuals_for_cpu_multi_threading = NEVER
    if robust:
        options.ceres.loss_function_type, options.ceres.loss_function_scale = pycolmap.LossFunctionType.SOFT_L1, 1.0
    with no_stderr():  # it announces itself whatever the level of logging
        call(partial(pycolmap.bundle_adjustment, model, options), "bundle adjustment")

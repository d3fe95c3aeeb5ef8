"""From matches to cameras and sparse points: database.db in, sparse/ out, in metres where positions are known."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.errors import InputError, StageError
from wakewise.evaluation import robust_similarity
from wakewise.files import whole_folder
from wakewise.interfaces import Progress
from wakewise.reconstruction.colmap import call, no_stderr, pycolmap, settle, workroom
from wakewise.reconstruction.guided import Poses
from wakewise.reconstruction.photos import PhotoStore
from wakewise.reconstruction.seeded import Seeded, map_from_poses
from wakewise.reconstruction.settings import RANDOM_SEED, ReconstructionSettings

# Most iterations of a bundle adjustment; fewer registered photos than that are a failure.
BUNDLE_ITERATIONS, MIN_REGISTERED = 100, 3
# Largest reprojection errors that are let pass, one after the other, until the mean is small enough (COLMAP's own: 4).
CUTS_PX = (2.0, 1.5, 1.0, 0.75)
MIN_ANGLE_DEG = 1.5
GROWTH = 1.4
# OpenCV's remap takes no wider image.
MOST_COLUMNS = 30_000
NEVER = 2**31 - 1
MAPPINGS = {"poses": "from known poses", "incremental": "photo by photo", "global": "all photos at once"}
"""Ways to a sparse model, in words."""
# No photo sees sharply from nearer, and none of a scan from farther: beyond, the positions are hardly in metres.
SENSIBLE_RANGE_M = (0.01, 1000.0)


def map_photos(
    folder: Path,
    database: Path,
    sparse: Path,
    settings: ReconstructionSettings,
    *,
    photos: int,
    references: dict[str, Array] | None,
    progress: Progress,
    store: PhotoStore | None = None,
    poses: Poses | None = None,
) -> dict[str, Any]:
    """Structure from motion; keep the largest model, bring it to the reference positions, write it whole.

    Incremental: J. L. Schoenberger and J.-M. Frahm, Structure-from-motion revisited, CVPR 2016, doi
    10.1109/CVPR.2016.445. Global: L. Pan et al., Global structure-from-motion revisited, ECCV 2024, doi
    10.1007/978-3-031-73661-2_4.

    Parameters
    ----------
    photos : int
        How many there are, for the progress and the messages.
    references : dict, optional
        Camera centres in m, shape (3,), by photo name. They fix place, turn and scale by a robust similarity; the
        model's shape does not bend to them unless `position_priors` is set.
    store : PhotoStore, optional
        Photos that are decoded already.
    poses : dict, optional
        Rough R_WC, shape (3, 3), and p_WC_m, shape (3,), by photo name, to begin the model from (see `seeded`); where
        the result does not pass, the model is built from the photos alone.

    Returns
    -------
    dict
        mapping (how the model came about, one of `MAPPINGS`), poses_refused (why not from the poses),
        registered_images, points, reprojection_px, reprojection_met, track_length, focal_px, cameras_rmse_mm and
        cameras_max_mm over all registered photos with a reference, reference_inliers, scale, surface_distance_m (median
        from camera to sparse point), suspicion; None where no references were given.

    Raises
    ------
    StageError
        If too few photos register or the model cannot be aligned.
    """
    with workroom(sparse, 2.0 * database.stat().st_size) as room:
        # A copy, as even reading makes COLMAP write into it.
        copy = Path(shutil.copyfile(database, room / "database.db"))
        if settings.position_priors and references is not None:
            _write_priors(copy, references, settings.prior_sigma_m)
        seeded = Seeded(model=None, refusal=None)
        if poses is not None:
            seeded = map_from_poses(copy, poses, settings, photos, progress)
        model, way = seeded.model, MAPPINGS["poses"]
        if model is None:
            models = _solve(folder, copy, room, settings, photos, progress)
            model = max(models.values(), key=lambda one: one.num_reg_images(), default=None)
            way = MAPPINGS["global" if settings.mapper == "global" else "incremental"]
    if model is None:
        raise StageError(
            f"mapping: none of the {photos} photos register; they show too little in common or were taken "
            "from one place"
        )
    registered = model.num_reg_images()
    least = min(MIN_REGISTERED, photos)
    if registered < least:
        raise StageError(f"mapping: {registered} of {photos} photos register, at least {least} must")
    _tighten(model, settings)
    figures: dict[str, Any] = {
        "cameras_rmse_mm": None,
        "cameras_max_mm": None,
        "reference_inliers": None,
        "scale": None,
        "surface_distance_m": None,
        "suspicion": None,
    }
    if references is not None:
        figures = _align(model, references) | _plausibility(model)
    colour_points(model, store or PhotoStore(folder), settings.threads)
    error_px = float(model.compute_mean_reprojection_error())
    figures |= {
        "mapping": way,
        "poses_refused": seeded.refusal,
        "registered_images": registered,
        "points": model.num_points3D(),
        "reprojection_px": error_px,
        "reprojection_met": error_px < settings.reprojection_px,
        "track_length": float(model.compute_mean_track_length()),
        "focal_px": float(np.median([camera.mean_focal_length() for camera in model.cameras.values()])),
    }
    with whole_folder(sparse) as temporary:
        model.write_binary(temporary)
    return figures


def _solve(
    folder: Path,
    database: Path,
    scratch: Path,
    settings: ReconstructionSettings,
    photos: int,
    progress: Progress,
) -> dict[int, pycolmap.Reconstruction]:
    """Every model that comes about, by COLMAP's number."""
    done = [0]

    def one_more() -> None:
        done[0] += 1

    def watch() -> None:
        progress(min(done[0], photos), photos, "mapping")

    out = scratch / "models"
    out.mkdir()
    if settings.mapper == "global":
        options = pycolmap.GlobalPipelineOptions()
        options.num_threads = settings.threads
        options.random_seed = RANDOM_SEED
        options.mapper.random_seed = RANDOM_SEED
        options.mapper.num_threads = settings.threads
        adjustment = options.mapper.bundle_adjustment
        adjustment.ceres.solver_options.max_num_iterations = BUNDLE_ITERATIONS
        adjustment.refine_focal_length = adjustment.refine_extra_params = settings.refine_camera
        # It takes no cancellation token: an interrupt waits for its end.
        found = call(lambda **_: pycolmap.global_mapping(database, folder, out, options=options), "mapping", watch)
        return dict(found)
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
    return dict(
        call(
            partial(pycolmap.incremental_mapping, database, folder, out, options=options, next_image_callback=one_more),
            "mapping",
            watch,
        )
    )


def _write_priors(database: Path, references: dict[str, Array], sigma_m: float) -> None:
    """Put known camera positions into a database that is then mapped."""
    link = pycolmap.Database.open(database)
    try:
        for image in link.read_all_images():
            if image.name in references:
                prior = pycolmap.PosePrior()
                prior.corr_data_id = image.data_id
                prior.position = references[image.name]
                prior.position_covariance = sigma_m**2 * np.eye(3)
                prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
                link.write_pose_prior(prior)
    finally:
        link.close()
    settle(database)


def _tighten(model: pycolmap.Reconstruction, settings: ReconstructionSettings) -> None:
    """Cut observations that stick out and adjust again, until the mean reprojection error is below what is wished."""
    for cut_px in CUTS_PX:
        if model.compute_mean_reprojection_error() < settings.reprojection_px:
            return
        pycolmap.ObservationManager(model).filter_all_points3D(cut_px, MIN_ANGLE_DEG)
        options = pycolmap.BundleAdjustmentOptions()
        options.print_summary = False
        options.refine_focal_length = options.refine_extra_params = settings.refine_camera
        options.ceres.solver_options.max_num_iterations = BUNDLE_ITERATIONS
        options.ceres.solver_options.num_threads = settings.threads
        options.ceres.min_num_residuals_for_cpu_multi_threading = NEVER
        with no_stderr():  # it announces itself whatever the level of logging
            call(partial(pycolmap.bundle_adjustment, model, options), "bundle adjustment")
        model.update_point_3d_errors()


def colour_points(model: pycolmap.Reconstruction, store: PhotoStore, threads: int) -> None:
    """Give each sparse point the mean colour of its places in the photos, between four pixels each."""
    row_of = {point_id: row for row, point_id in enumerate(sorted(model.points3D))}
    images = sorted((image for image in model.images.values() if image.has_pose), key=lambda one: one.name)

    def of_one(image: pycolmap.Image) -> tuple[IntArray, Array]:
        seen = [(row_of[p.point3D_id], *p.xy) for p in image.points2D if p.has_point3D()]
        places = np.array(seen, dtype=np.float64).reshape(-1, 3)
        pixels = store.image(image.name)
        # COLMAP's pixel centres are at +0.5, OpenCV's at 0; a row of places is an image of one row.
        x, y = ((places[:, axis] - 0.5).astype(np.float32)[None] for axis in (1, 2))
        step = MOST_COLUMNS
        parts = [
            cv2.remap(pixels, x[:, k : k + step], y[:, k : k + step], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for k in range(0, len(places), step)
        ]
        colours = np.concatenate([part[0] for part in parts]) if parts else np.zeros((0, 3))
        return places[:, 0].astype(np.int64), np.asarray(colours[:, ::-1], dtype=np.float64)

    total, count = np.zeros((len(row_of), 3)), np.zeros(len(row_of))
    with ThreadPoolExecutor(threads) as pool:
        for rows, colours in pool.map(of_one, images):
            np.add.at(total, rows, colours)
            np.add.at(count, rows, 1.0)
    mean = np.rint(total / np.maximum(count, 1.0)[:, None]).astype(np.uint8)
    for point_id, row in row_of.items():
        model.points3D[point_id].color = mean[row]


def _align(model: pycolmap.Reconstruction, references: dict[str, Array]) -> dict[str, Any]:
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
        similarity, inliers = robust_similarity(centres, wanted, np.random.default_rng(RANDOM_SEED))
    except InputError as error:
        raise StageError(f"alignment of the cameras: {error}") from None
    error_mm = 1e3 * np.linalg.norm(similarity.apply(centres) - wanted, axis=1)
    spread_mm = 1e3 * float(np.sqrt(((wanted - wanted.mean(axis=0)) ** 2).sum(axis=1).mean()))
    median_mm = float(np.median(error_mm))
    # A right model lies within a few percent of the path's extent; an unrelated one at about its extent.
    if median_mm > MAX_MISFIT * spread_mm:
        raise StageError(
            f"alignment: the cameras lie {median_mm:.0f} mm (median) off their reference positions, which spread over "
            f"{spread_mm:.0f} mm; model and references do not belong together"
        )
    model.transform(pycolmap.Sim3d(similarity.scale, pycolmap.Rotation3d(similarity.R_AB), similarity.t_A_m))
    return {
        "cameras_rmse_mm": float(np.sqrt((error_mm**2).mean())),
        "cameras_max_mm": float(error_mm.max()),
        "reference_inliers": int(inliers.sum()),
        "scale": similarity.scale,
    }


MAX_MISFIT = 0.25
"""Median error of aligned cameras over the spread of their references from which on they are unrelated."""


def _plausibility(model: pycolmap.Reconstruction) -> dict[str, Any]:
    """How far the cameras are from what they see, and a word where that cannot be metres."""
    points = np.array([point.xyz for point in model.points3D.values()])
    rows = np.random.default_rng(0).choice(len(points), size=min(len(points), 2000), replace=False)
    depths = []
    for image in model.images.values():
        if image.has_pose:
            depth = points[rows] @ (matrix := image.cam_from_world().matrix())[2, :3] + matrix[2, 3]
            depths.append(np.median(depth[depth > 0]) if (depth > 0).any() else np.nan)
    distance = float(np.nanmedian(depths))
    low, high = SENSIBLE_RANGE_M
    suspicion = None
    if not low <= distance <= high:
        suspicion = (
            f"reference cameras: the surface would be {distance:.3g} m away, usual is {low:g} to {high:g} m; "
            "are the positions in metres?"
        )
    return {"surface_distance_m": distance, "suspicion": suspicion}

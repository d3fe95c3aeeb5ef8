"""Structure from motion: database.db to a sparse model, filtered, adjusted, tested and aligned."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_folder
from wakewise.core.interfaces import Progress
from wakewise.vision.evaluation import robust_similarity
from wakewise.vision.reconstruction.photos.photo_folder import PhotoStore
from wakewise.vision.reconstruction.quality.model_quality import (
    evidence,
    known_pose_warnings,
    quality_warnings,
    registration_warnings,
)
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import (
    bundle_adjustment,
    checkpoint_database,
    database_folder,
    open_database,
    pycolmap,
)
from wakewise.vision.reconstruction.sfm.colmap_mappers import BUNDLE_ITERATIONS, solve, solve_again
from wakewise.vision.reconstruction.sfm.guided_matching import Poses
from wakewise.vision.reconstruction.sfm.per_photo_intrinsics import (
    LEAST_POINTS,
    PerPhotoIntrinsics,
    fit_per_photo_intrinsics,
    focal_clusters,
    set_cameras,
)
from wakewise.vision.reconstruction.sfm.pose_mapping import SeededModel, map_at_poses, map_from_poses

# Least registered photos, and least photos for the test of shared intrinsics.
MIN_REGISTERED, LEAST_FOR_CHECK = 3, 5
MOST_SHIFT_PCT, MOST_FOCAL_RATIO, MOST_FOCAL_SPREAD_PCT = 10.0, 1.05, 5.0
"""Bounds for intrinsics of each photo: displacement of cameras in percent of their spread, focal lengths."""
# Largest reprojection errors that are let pass, one after the other, until the mean is small enough (COLMAP's own: 4).
CUTS_PX = (2.0, 1.5, 1.0, 0.75)
MIN_ANGLE_DEG = 1.5
# OpenCV's remap takes no wider image.
MOST_COLUMNS = 30_000
MAPPINGS = {
    "known": "at the known cameras",
    "poses": "from known poses",
    "incremental": "photo by photo",
    "global": "all photos at once",
}
"""Ways to a sparse model, as figures name them."""
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
    fixed: Poses | None = None,
) -> dict[str, Any]:
    """Structure from motion; keep the largest model, bring it to the reference positions, write it whole.

    Incremental: J. L. Schoenberger and J.-M. Frahm, Structure-from-motion revisited, CVPR 2016, doi
    10.1109/CVPR.2016.445. Global: L. Pan et al., Global structure-from-motion revisited, ECCV 2024, doi
    10.1007/978-3-031-73661-2_4.

    `photos`: how many there are, for the progress and the messages. `references`: camera centres in m, shape (3,), by
    photo name. They fix place, turn and scale by a robust similarity; the model's shape does not bend to them unless
    `position_priors` is set. `store`: photos that are decoded already. `poses`: rough R_WC, shape (3, 3), and p_WC_m,
    shape (3,), by photo name, to begin the model from (see `seeded`); where the result does not pass, the model is
    built from the photos alone. `fixed`: the same, known so well that they stay as they are, with their lenses (see
    `fixed`). Returns mapping (how the model came about, one of `MAPPINGS`), poses_refused (why not from the poses),
    registered_images, points, reprojection_px, reprojection_met, track_length, focal_px, cameras_rmse_mm and
    cameras_max_mm over all registered photos with a reference, reference_inliers, scale, surface_distance_m (median
    from camera to sparse point), suspicion; None where no references were given. Raises StageError if too few photos
    register or the model cannot be aligned.
    """
    with database_folder(sparse, 4.0 * database.stat().st_size) as room:
        # A copy, as even reading makes COLMAP write into it.
        copy = Path(shutil.copyfile(database, room / "database.db"))
        if settings.position_priors and references is not None:
            _write_priors(copy, references, settings.prior_sigma_m)
        seeded, given = SeededModel(model=None, refusal=None), None
        if fixed is not None:
            given = map_at_poses(copy, fixed, photos, progress)
        elif poses is not None:
            seeded = map_from_poses(copy, poses, settings, photos, progress)
        models, way = [seeded.model] if seeded.model is not None else [], MAPPINGS["poses"]
        if given is not None:
            models, way = [given.model], MAPPINGS["known"]
        elif not models:
            models = solve(folder, copy, room, settings, photos, progress)
            if models and models[0].num_reg_images() < photos:
                models = solve_again(folder, copy, room, settings, models, progress)
            way = MAPPINGS["global" if settings.mapper == "global" else "incremental"]
        least = min(MIN_REGISTERED, photos)
        if not models:
            raise StageError(
                f"mapping: none of the {photos} photos register; they show too little in common or were taken "
                "from one place"
            )
        own, regrouped = None, None
        if settings.check_shared_intrinsics and photos >= LEAST_FOR_CHECK and given is None:
            own = fit_per_photo_intrinsics(folder, copy, room, settings, photos, progress)
            regrouped = _by_own_lens(copy, own) if settings.refine_camera else None
            if regrouped is not None:
                set_cameras(copy, regrouped)
                models = solve(folder, copy, room, settings, photos, progress) or models
                way = MAPPINGS["incremental"]
        model = models[0]
        registered = model.num_reg_images()
        if registered < least:
            raise StageError(f"mapping: {registered} of {photos} photos register, at least {least} must")
        uncut_px, before = float(model.compute_mean_reprojection_error()), model.compute_num_observations()
        if given is None:
            _tighten(model, settings)
        cut_pct = 100.0 * (1.0 - model.compute_num_observations() / max(before, 1))
        found = evidence(model, copy)
        left = unregistered_photos(model, copy)
    shift_pct = None if own is None else _camera_shift_pct(model, own)
    if given is None:
        wrong = registration_warnings(registered, photos) + quality_warnings(found, uncut_px=uncut_px, cut_pct=cut_pct)
        wrong += lens_warnings(model, own, shift_pct)
    else:
        wrong = known_pose_warnings(found, error_px=uncut_px, kept_pct=given.kept_pct)
    in_metres = ("cameras_rmse_mm", "cameras_max_mm", "reference_inliers", "scale", "surface_distance_m", "suspicion")
    figures: dict[str, Any] = dict.fromkeys(in_metres)
    if given is not None:
        figures |= {"scale": 1.0} | _plausibility(model)
    elif references is not None:
        figures = _align(model, references) | _plausibility(model)
    colour_points(model, store or PhotoStore(folder), settings.threads)
    error_px = float(model.compute_mean_reprojection_error())
    if error_px >= settings.reprojection_px and given is None:
        wrong.append(f"mean reprojection error {error_px:.2f} px, {settings.reprojection_px:g} px is allowed")
    figures |= {
        "mapping": way,
        "poses_refused": seeded.refusal,
        "registered_images": registered,
        "points": model.num_points3D(),
        "reprojection_px": error_px,
        "reprojection_uncut_px": uncut_px,
        "cut_pct": cut_pct,
        "reprojection_met": not wrong,
        "warnings": wrong,
        **asdict(found),
        "second_opinion_pct": shift_pct,
        "lenses": _lenses(model),
        "lenses_split": regrouped is not None,
        "left_out": left,
        "sub_models": [one.num_reg_images() for one in models],
        "track_length": float(model.compute_mean_track_length()),
        "focal_px": float(np.median([camera.mean_focal_length() for camera in model.cameras.values()])),
    }
    with whole_folder(sparse) as temporary:
        model.write_binary(temporary)
    return figures


def _by_own_lens(database: Path, own: PerPhotoIntrinsics) -> list[tuple[tuple[str, ...], pycolmap.Camera]] | None:
    """Photos by lens where photos that seemed to share one have several; None where they do not.

    A photo of a split lens without a focal length of its own gets intrinsics of its own.
    """
    with open_database(database) as link:
        cameras = {camera.camera_id: camera for camera in link.read_all_cameras()}
        images = link.read_all_images()
    out = []
    for number, camera in cameras.items():
        names = [image.name for image in images if image.camera_id == number]
        parts = focal_clusters({name: own.lenses[name] for name in names if name in own.lenses})
        if len(parts) > 1:
            placed = {name for part in parts for name in part}
            out += [(part, camera) for part in parts] + [((name,), camera) for name in names if name not in placed]
    return out or None


def _camera_shift_pct(model: pycolmap.Reconstruction, own: PerPhotoIntrinsics) -> float | None:
    """Rms displacement of cameras with intrinsics for each photo, in percent of their spread."""
    mine = {image.name: image.projection_center() for image in model.images.values() if image.has_pose}
    both = sorted(mine.keys() & own.centres.keys())
    if len(both) < LEAST_FOR_CHECK:
        return None
    a, b = (np.array([centres[name] for name in both]) for centres in (own.centres, mine))
    try:
        similarity, _ = robust_similarity(a, b, np.random.default_rng(RANDOM_SEED))
    except InputError:
        return None
    error = np.linalg.norm(similarity.apply(a) - b, axis=1)
    return 100.0 * float(np.sqrt((error**2).mean()) / np.sqrt(((b - b.mean(axis=0)) ** 2).sum(axis=1).mean()))


def lens_warnings(model: pycolmap.Reconstruction, own: PerPhotoIntrinsics | None, shift_pct: float | None) -> list[str]:
    """Reasons against a model from mapping with intrinsics for each photo."""
    if own is None:
        return []
    out = []
    if shift_pct is not None and shift_pct > MOST_SHIFT_PCT:
        out.append(
            f"with a lens for each photo the cameras come out {shift_pct:.0f} % of their spread elsewhere, "
            f"{MOST_SHIFT_PCT:g} % is sound: several lenses, or photos that do not tell the lens"
        )
    for camera in model.cameras.values():
        names = [i.name for i in model.images.values() if i.camera_id == camera.camera_id and i.name in own.lenses]
        sure = [own.lenses[name].focal_px for name in names if own.lenses[name].points >= LEAST_POINTS]
        if len(sure) >= LEAST_FOR_CHECK:
            ratio = float(np.median(sure)) / camera.mean_focal_length()
            spread_pct = 100.0 * float(np.std(np.log(sure)))
            if abs(np.log(ratio)) > np.log(MOST_FOCAL_RATIO) or spread_pct > MOST_FOCAL_SPREAD_PCT:
                out.append(
                    f"lens of {names[0]}: {camera.mean_focal_length():.0f} px, its {len(sure)} photos by themselves "
                    f"have {np.median(sure):.0f} px and scatter by {spread_pct:.0f} %; a zoom, or several lenses"
                )
    return out


def _lenses(model: pycolmap.Reconstruction) -> list[dict[str, Any]]:
    """Which registered photos each lens took: focal length, size and names."""
    out = []
    for camera in model.cameras.values():
        names = sorted(i.name for i in model.images.values() if i.camera_id == camera.camera_id and i.has_pose)
        if names:
            size = {"width": camera.width, "height": camera.height}
            out.append({"focal_px": float(camera.mean_focal_length()), **size, "photos": names})
    return sorted(out, key=lambda one: str(one["photos"][0]))


def unregistered_photos(model: pycolmap.Reconstruction, database: Path) -> list[dict[str, Any]]:
    """Each unregistered photo, with the photo that shares most verified matches with it."""
    placed = {image.name for image in model.images.values() if image.has_pose}
    with open_database(database) as link:
        names = {image.image_id: image.name for image in link.read_all_images()}
        pair_ids, counts = link.read_two_view_geometry_num_inliers()
    best: dict[str, tuple[int, str]] = {name: (0, "") for name in names.values() if name not in placed}
    for pair_id, count in zip(pair_ids, counts, strict=True):
        one, two = (names[number] for number in pycolmap.pair_id_to_image_pair(pair_id))
        for name, other in ((one, two), (two, one)):
            if name in best and int(count) > best[name][0]:
                best[name] = (int(count), other)
    return [{"name": n, "partner": other or None, "matches": count} for n, (count, other) in sorted(best.items())]


def _write_priors(database: Path, references: dict[str, Array], sigma_m: float) -> None:
    """Put known camera positions into a database that is then mapped."""
    with open_database(database) as link:
        for image in link.read_all_images():
            if image.name in references:
                prior = pycolmap.PosePrior()
                prior.corr_data_id = image.data_id
                prior.position = references[image.name]
                prior.position_covariance = sigma_m**2 * np.eye(3)
                prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
                link.write_pose_prior(prior)
    checkpoint_database(database)


def _tighten(model: pycolmap.Reconstruction, settings: ReconstructionSettings) -> None:
    """Filter outliers and adjust again, until the mean reprojection error is below the bound of the settings."""
    for cut_px in CUTS_PX:
        if model.compute_mean_reprojection_error() < settings.reprojection_px:
            return
        pycolmap.ObservationManager(model).filter_all_points3D(cut_px, MIN_ANGLE_DEG)
        bundle_adjustment(
            model, refine_intrinsics=settings.refine_camera, threads=settings.threads, iterations=BUNDLE_ITERATIONS
        )
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
    """Median distance of the cameras from the points, and a remark where it cannot be in metres."""
    points = np.array([point.xyz for point in model.points3D.values()])
    if len(points) == 0:
        return {"surface_distance_m": None, "suspicion": None}
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

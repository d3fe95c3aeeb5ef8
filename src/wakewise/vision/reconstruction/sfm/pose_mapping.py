"""Sparse models from poses: approximate ones that are adjusted, or known ones that stay fixed.

Errors of some millimetres and milliradians are tens of pixels, so the first triangulation from approximate poses has
wide tolerances. After a robust bundle adjustment the second uses COLMAP's (J. L. Schoenberger and J.-M. Frahm,
Structure-from-motion revisited, CVPR 2016, doi 10.1109/CVPR.2016.445, sections 4.3 and 4.4, for all photos at once).
Cameras are free. A model that fails the tests is refused, and the caller maps without poses.

Photos 30 deg apart, as of a ring of cameras, share too few features for structure from motion. At known poses they need
none: stereo finds the surface, and the few features test the cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import bundle_adjustment, open_database, pycolmap, silence_logging
from wakewise.vision.reconstruction.sfm.guided_matching import Poses
from wakewise.vision.reconstruction.sfm.registered_photos import MIN_SHARED, RegionOfInterest

LEAST_PAIR_MATCHES = 15
"""Verified matches of an image pair that is used, COLMAP's own."""
ROUGH_ANGLE_DEG, ROUGH_PX = 3.0, 40.0
"""Largest errors of the first triangulation: at 0.5 m, poses off by 5 mm and 5 mrad leave 1 deg."""
ITERATIONS = (25, 30)
TOLERANCES = (1e-4, 1e-5)
"""Most iterations of the two adjustments, and the relative gain at which they end."""
FILTER_PX, MIN_ANGLE_DEG = (4.0, 2.0), 1.5
"""Largest reprojection error of an observation that is kept: at first (COLMAP's own), and in the end; least angle
between rays."""
LEAST_MATCHED, LEAST_POINTS = 30, 30
"""Matched features from which on a photo is expected to register, and points that it must see (COLMAP's own 30)."""
MOST_ERROR_PX, LEAST_TRACK, LEAST_KEPT = 0.7, 2.5, 0.4
"""Tests: mean reprojection error, mean track length, and share of the matched features that are in the model."""
MOST_MISS = 0.35
"""Distance at which lines of sight pass each other, over their length, for the cameras to look at one subject."""
REGION_POINTS, SPREAD_PCT, MARGIN = 50, 95.0, 1.2
"""Sparse points from which on they give the size of the subject, the share of them within it, and room about it."""


@dataclass(frozen=True, kw_only=True)
class SeededModel:
    """A model from approximate poses, or the reason against it."""

    model: pycolmap.Reconstruction | None
    refusal: str | None


@dataclass(frozen=True, kw_only=True)
class FixedPoseModel:
    """A model at fixed poses; kept_pct: share of the matched features in it, None if none matched."""

    model: pycolmap.Reconstruction
    kept_pct: float | None


def map_from_poses(
    database: Path, poses: Poses, settings: ReconstructionSettings, photos: int, progress: Progress
) -> SeededModel:
    """Model from verified matches and approximate poses.

    `database`: COLMAP's, with matches; it may be written into. `poses`: R_WC, shape (3, 3), and p_WC_m, shape (3,), by
    photo name; every photo with matches needs one. `photos`: their number, for the progress. Raises StageError if
    COLMAP fails.
    """
    cache = _cache(database, all_images=False)
    graph = cache.correspondence_graph
    matched = {number: graph.num_observations_for_image(number) for number in cache.images}
    without_pose = [image.name for n, image in cache.images.items() if matched[n] and image.name not in poses]
    if without_pose:
        reason = f"{len(without_pose)} photos have no known pose, such as {without_pose[0]}"
        return SeededModel(model=None, refusal=reason)
    mapper, model = pycolmap.IncrementalMapper(cache), pycolmap.Reconstruction()
    mapper.begin_reconstruction(model)
    manager = mapper.observation_manager
    placed = _register(model, manager, poses, [number for number in model.images if matched[number]])
    rough, fine = pycolmap.IncrementalTriangulatorOptions(), pycolmap.IncrementalTriangulatorOptions()
    rough.random_seed = fine.random_seed = RANDOM_SEED
    rough.create_max_angle_error = rough.continue_max_angle_error = ROUGH_ANGLE_DEG
    rough.complete_max_reproj_error = rough.merge_max_reproj_error = ROUGH_PX
    for done, number in enumerate(placed):
        progress(min(done, photos), 2 * photos, "points at the known poses")
        mapper.triangulate_image(rough, number)
    progress(photos, 2 * photos, "adjustment")
    for stage in (0, 1):
        if model.num_points3D() < LEAST_POINTS:
            break
        bundle_adjustment(
            model,
            refine_intrinsics=settings.refine_camera,
            threads=settings.threads,
            iterations=ITERATIONS[stage],
            tolerance=TOLERANCES[stage],
            robust=stage == 0,
        )
        manager.filter_all_points3D(FILTER_PX[stage], MIN_ANGLE_DEG)
        if stage == 0:
            mapper.complete_and_merge_tracks(fine)
            mapper.retriangulate(fine)
        else:
            model.update_point_3d_errors()
    for number in placed:
        if model.images[number].num_points3D < LEAST_POINTS:
            manager.deregister_frame(model.images[number].frame_id)
    mapper.end_reconstruction(False)
    refusal = _refusal(model, matched)
    return SeededModel(model=model if refusal is None else None, refusal=refusal)


def map_at_poses(database: Path, poses: Poses, photos: int, progress: Progress) -> FixedPoseModel:
    """Model of the photos at these poses with the points that their matches give.

    `database`: COLMAP's, with matches; its cameras are the intrinsics. `poses`: R_WC, shape (3, 3), and p_WC_m, shape
    (3,), by photo name; a photo without one is left out. `photos`: their number, for the progress.
    """
    cache = _cache(database, all_images=True)
    mapper, model = pycolmap.IncrementalMapper(cache), pycolmap.Reconstruction()
    mapper.begin_reconstruction(model)
    manager = mapper.observation_manager
    placed = _register(model, manager, poses, [n for n, image in model.images.items() if image.name in poses])
    options = pycolmap.IncrementalTriangulatorOptions()
    options.random_seed = RANDOM_SEED
    options.ignore_two_view_tracks = False  # far-apart photos have hardly any others
    for done, number in enumerate(placed):
        progress(min(done, photos), photos, "points at the known poses")
        mapper.triangulate_image(options, number)
    mapper.complete_and_merge_tracks(options)
    manager.filter_all_points3D(FILTER_PX[0], MIN_ANGLE_DEG)
    model.update_point_3d_errors()
    graph = cache.correspondence_graph
    matched = sum(graph.num_observations_for_image(number) for number in placed if graph.exists_image(number))
    mapper.end_reconstruction(False)
    return FixedPoseModel(model=model, kept_pct=100.0 * model.compute_num_observations() / matched if matched else None)


def _cache(database: Path, *, all_images: bool) -> pycolmap.DatabaseCache:
    silence_logging()
    options = pycolmap.DatabaseCacheOptions()
    options.min_num_matches = LEAST_PAIR_MATCHES
    options.load_all_images = all_images
    with open_database(database) as link:
        return pycolmap.DatabaseCache.create(link, options)


def _register(
    model: pycolmap.Reconstruction, manager: pycolmap.ObservationManager, poses: Poses, numbers: list[int]
) -> list[int]:
    """Register images at their poses; their numbers, sorted."""
    for number in sorted(numbers):
        image = model.images[number]
        R_WC, p_WC = poses[image.name]
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R_WC.T), -R_WC.T @ p_WC)
        image.frame.set_cam_from_world(image.camera_id, pose)
        manager.register_frame(image.frame_id)
    return sorted(numbers)


def _refusal(model: pycolmap.Reconstruction, matched: dict[int, int]) -> str | None:
    """Reason against a model; None if it passes the tests."""
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


def common_region(model: pycolmap.Reconstruction) -> RegionOfInterest | None:
    """Common subject of all cameras, where photos see few sparse points; None where three in four see enough.

    Raises StageError if photos see too few points, and their lines of sight do not meet.
    """
    images = [image for image in model.images.values() if image.has_pose]
    if sum(image.num_points3D >= MIN_SHARED for image in images) > 0.75 * len(images):
        return None
    centres = np.array([image.projection_center() for image in images])
    axes = np.array([image.cam_from_world().rotation.matrix()[2] for image in images])
    middle = nearest_to_lines(centres, axes)
    away = np.einsum("ij,ij->i", middle - centres, axes)
    miss = np.linalg.norm(middle - centres - away[:, None] * axes, axis=1)
    if not (away > 0.0).all() or np.median(miss / away) > MOST_MISS:
        raise StageError(
            "dense: the photos share too few points to tell how far away things are, and the known cameras do not look "
            "at one place; say which with --region X Y Z R"
        )
    half = np.array([0.5 * min(i.camera.width, i.camera.height) / i.camera.mean_focal_length() for i in images])
    radius = float(np.median(away * half / np.sqrt(1.0 + half**2)))  # the ball that fills a photo's shorter side
    points = np.array([point.xyz for point in model.points3D.values()]).reshape(-1, 3)
    if len(points) >= REGION_POINTS:
        radius = min(radius, MARGIN * float(np.percentile(np.linalg.norm(points - middle, axis=1), SPREAD_PCT)))
    return RegionOfInterest(centre_W_m=middle, radius_m=radius)


def nearest_to_lines(centres: Array, axes: Array) -> Array:
    """The point nearest to lines through centres along unit axes, shape (n, 3) each, in the sense of least squares."""
    away = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    found: Array = np.linalg.lstsq(away.sum(axis=0), np.einsum("nij,nj->i", away, centres), rcond=None)[0]
    return found

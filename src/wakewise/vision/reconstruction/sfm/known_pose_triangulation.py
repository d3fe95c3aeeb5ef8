"""Sparse points from cameras that are known and stay as they are: triangulated, never adjusted.

Photographs far apart, as of a ring of cameras 30 deg from each other, share too few features to find their places by.
Where the places are known they need to share none: stereo finds what the features do not. What features there are say
whether the cameras can be right.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.settings import RANDOM_SEED
from wakewise.vision.reconstruction.sfm.colmap import open_database, pycolmap, silence_logging
from wakewise.vision.reconstruction.sfm.guided_matching import Poses
from wakewise.vision.reconstruction.sfm.registered_photos import MIN_SHARED, RegionOfInterest

FILTER_PX, MIN_ANGLE_DEG = 4.0, 1.5
"""Largest reprojection error of an observation that stays, COLMAP's own, and least angle between rays."""
MOST_MISS = 0.35
"""How far lines of sight may pass each other, of their length, for the cameras to look at one thing."""
LEAST_POINTS, SPREAD_PCT, MARGIN = 50, 95.0, 1.2
"""Sparse points from which on they tell how large that thing is, the share of them that it holds, and room about it."""


@dataclass(frozen=True, kw_only=True)
class FixedPoseModel:
    """A model at given poses; kept_pct: share of the matched features that stand in it, None where none matched."""

    model: pycolmap.Reconstruction
    kept_pct: float | None


def map_at_poses(database: Path, poses: Poses, photos: int, progress: Progress) -> FixedPoseModel:
    """Model of the photos at these poses with what points their matches give.

    `database`: COLMAP's, with matches; its cameras are the lenses. `poses`: R_WC, shape (3, 3), and p_WC_m, shape (3,),
    by photo name; a photo without one is left out. `photos`: how many there are, for the progress.
    """
    silence_logging()
    with open_database(database) as link:
        options = pycolmap.DatabaseCacheOptions()
        options.min_num_matches = 15
        options.load_all_images = True
        cache = pycolmap.DatabaseCache.create(link, options)
    mapper, model = pycolmap.IncrementalMapper(cache), pycolmap.Reconstruction()
    mapper.begin_reconstruction(model)
    manager = mapper.observation_manager
    placed = sorted(number for number, image in model.images.items() if image.name in poses)
    for number in placed:
        image = model.images[number]
        R_WC, p_WC = poses[image.name]
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R_WC.T), -R_WC.T @ p_WC)
        image.frame.set_cam_from_world(image.camera_id, pose)
        manager.register_frame(image.frame_id)
    options = pycolmap.IncrementalTriangulatorOptions()
    options.random_seed = RANDOM_SEED
    options.ignore_two_view_tracks = False  # far-apart photos have hardly any others
    for done, number in enumerate(placed):
        progress(min(done, photos), photos, "points at the known poses")
        mapper.triangulate_image(options, number)
    mapper.complete_and_merge_tracks(options)
    manager.filter_all_points3D(FILTER_PX, MIN_ANGLE_DEG)
    model.update_point_3d_errors()
    graph = cache.correspondence_graph
    matched = sum(graph.num_observations_for_image(number) for number in placed if graph.exists_image(number))
    mapper.end_reconstruction(False)
    return FixedPoseModel(model=model, kept_pct=100.0 * model.compute_num_observations() / matched if matched else None)


def common_region(model: pycolmap.Reconstruction) -> RegionOfInterest | None:
    """What all cameras look at, where most see too few sparse points to tell; None where they do, or look about.

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
    if len(points) >= LEAST_POINTS:
        radius = min(radius, MARGIN * float(np.percentile(np.linalg.norm(points - middle, axis=1), SPREAD_PCT)))
    return RegionOfInterest(centre_W_m=middle, radius_m=radius)


def nearest_to_lines(centres: Array, axes: Array) -> Array:
    """The point nearest to lines through centres along unit axes, shape (n, 3) each, in the sense of least squares."""
    away = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    found: Array = np.linalg.lstsq(away.sum(axis=0), np.einsum("nij,nj->i", away, centres), rcond=None)[0]
    return found

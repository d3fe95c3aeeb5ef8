"""Intrinsics of each photo by itself: whether photos that seem to share a lens do.

Photos of two lenses, mapped with one, give a bent model that looks sound. Mapped with intrinsics for each photo, their
focal lengths form two clusters: real photos of one underwater lens scattered by 1 %, a crop of a tenth moved half of
them by 11 % (31 photos of a coral). The second mapping takes a fiftieth of the time of matching.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import checkpoint_database, open_database, pycolmap
from wakewise.vision.reconstruction.sfm.colmap_mappers import solve

LEAST_POINTS, LEAST_PHOTOS = 40, 3
"""Sparse points from which on a photo's own focal length counts, and photos that make a lens of their own."""
SEPARATION, LEAST_RATIO = 5.0, 1.02
"""Least distance of the means of two clusters, in standard deviations within them, and least ratio. A uniform spread
cut in half has 3.5, a normal one 2.7 (from their moments). For n photos the bound is (1 + 8/n) times as large, because
few form two clusters by chance: of 1,500 draws of 10 to 40 photos less than 1 % of uniform and 0.1 % of normal ones
passed."""
MOST_LENSES = 4


@dataclass(frozen=True, kw_only=True)
class PhotoIntrinsics:
    """Focal length in pixels that a photo has by itself, and on how many sparse points it rests."""

    focal_px: float
    points: int


@dataclass(frozen=True, kw_only=True, eq=False)
class PerPhotoIntrinsics:
    """Lenses by photo name, and camera centres, shape (3,), of the largest model that they came from."""

    lenses: dict[str, PhotoIntrinsics]
    centres: dict[str, Array]


def fit_per_photo_intrinsics(
    folder: Path, database: Path, scratch: Path, settings: ReconstructionSettings, photos: int, progress: Progress
) -> PerPhotoIntrinsics:
    """Map with a lens for each photo.

    Raises StageError if COLMAP fails.
    """
    copy = Path(shutil.copyfile(database, scratch / "own.db"))
    with open_database(copy) as link:
        cameras = {camera.camera_id: camera for camera in link.read_all_cameras()}
        images = {image.name: image.camera_id for image in link.read_all_images()}
    set_cameras(copy, [((name,), cameras[number]) for name, number in images.items()])
    free = settings.model_copy(update={"refine_camera": True, "mapper": "incremental", "position_priors": False})
    found: dict[str, PhotoIntrinsics] = {}
    centres: dict[str, Array] = {}
    for k, model in enumerate(solve(folder, copy, scratch, free, photos, progress)):
        for image in model.images.values():
            if not image.has_pose:
                continue
            if k == 0:
                centres[image.name] = np.asarray(image.projection_center())
            focal_px = float(model.cameras[image.camera_id].mean_focal_length())
            if image.name not in found and focal_px > 0.0:  # photographs that do not constrain it drive it anywhere
                found[image.name] = PhotoIntrinsics(focal_px=focal_px, points=image.num_points3D)
    return PerPhotoIntrinsics(lenses=found, centres=centres)


def set_cameras(database: Path, groups: list[tuple[tuple[str, ...], pycolmap.Camera]]) -> None:
    """Give each group of photos, by name, a camera of its own that begins as the given one is."""
    with open_database(database) as link:
        images = {image.name: image for image in link.read_all_images()}
        frames = {frame.frame_id: frame for frame in link.read_all_frames()}
        for names, camera in groups:
            number = link.write_camera(_like(camera))
            sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, number)
            rig = pycolmap.Rig()
            rig.add_ref_sensor(sensor)
            rig_id = link.write_rig(rig)
            for name in names:
                image = images[name]
                frame = pycolmap.Frame()
                frame.frame_id, frame.rig_id = frames[image.frame_id].frame_id, rig_id
                frame.add_data_id(pycolmap.data_t(sensor, image.image_id))
                link.update_frame(frame)
                image.camera_id = number
                link.update_image(image)
    checkpoint_database(database)


def _like(camera: pycolmap.Camera) -> pycolmap.Camera:
    new = pycolmap.Camera.create_from_model_name(
        pycolmap.INVALID_CAMERA_ID, camera.model.name, 1.0, camera.width, camera.height
    )
    new.params = camera.params
    new.has_prior_focal_length = camera.has_prior_focal_length
    return new


def focal_clusters(own: dict[str, PhotoIntrinsics]) -> list[tuple[str, ...]]:
    """Photos by lens: one group where focal lengths scatter, several where they form distant clusters.

    A photo that rests on few points goes where its focal length is nearest. The best cut of the sorted logarithms in
    two (least squares, as Otsu's) is made where the halves are far apart for how they scatter, and again in each half.
    """
    sure = {name: np.log(lens.focal_px) for name, lens in own.items() if lens.points >= LEAST_POINTS}
    if len(sure) < 2 * LEAST_PHOTOS:
        return [tuple(sorted(own))] if own else []
    order = sorted(sure, key=lambda name: (sure[name], name))
    edges = _cuts(np.array([sure[name] for name in order]), MOST_LENSES)
    means = [float(np.mean([sure[name] for name in order[a:b]])) for a, b in pairwise(edges)]
    groups: list[list[str]] = [[] for _ in means]
    for name, lens in own.items():
        groups[int(np.argmin(np.abs(np.array(means) - np.log(lens.focal_px))))].append(name)
    return [tuple(sorted(group)) for group in groups if group]


def _cuts(values: Array, most: int) -> list[int]:
    """Edges of the clusters in sorted values, from 0 to their number."""
    best = (0.0, 0)
    for k in range(LEAST_PHOTOS, len(values) - LEAST_PHOTOS + 1):
        low, high = values[:k], values[k:]
        within = np.sqrt((((low - low.mean()) ** 2).sum() + ((high - high.mean()) ** 2).sum()) / len(values))
        apart = float(high.mean() - low.mean())
        if apart > np.log(LEAST_RATIO):
            best = max(best, (apart / max(float(within), 1e-4), k))
    if best[0] < SEPARATION * (1.0 + 8.0 / max(len(values), 1)) or most < 2:
        return [0, len(values)]
    k = best[1]
    low_edges = _cuts(values[:k], most - 1)
    high_edges = _cuts(values[k:], most - len(low_edges) + 1)
    return low_edges + [k + edge for edge in high_edges[1:]]

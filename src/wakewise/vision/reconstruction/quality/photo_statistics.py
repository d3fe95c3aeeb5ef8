"""Figures of each photograph of a finished model, and of the image pairs, from its files."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction.photos.lenses import lens_of
from wakewise.vision.reconstruction.sfm.colmap import open_database, pycolmap


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoStatistics:
    """One photo. R_WC and p_WC: turn and place in the model, None without a place; observations: sparse points that it
    sees; error_px: their mean error; fov_deg: down the picture; aspect: width over height.
    """

    name: str
    R_WC: Array | None
    p_WC: Array | None
    features: int
    observations: int
    error_px: float | None
    focal_px: float
    fov_deg: float
    aspect: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelStatistics:
    """All photos by name, verified matches of each pair, shape (n, n), sparse points, shape (m, 3), and colours."""

    photos: tuple[PhotoStatistics, ...]
    matches: IntArray
    points: Array
    colours: Array

    def __post_init__(self) -> None:
        freeze(self, points=(None, 3), colours=(None, 3))


def model_facts(model: Path) -> ModelStatistics:
    """Read sparse/ and database.db of a model's folder.

    Raises InputError if it holds no sparse model.
    """
    if not (model / "sparse" / "images.bin").is_file() or not (model / "database.db").is_file():
        raise InputError(f"{model}: holds no model (sparse/, database.db)")
    sparse = pycolmap.Reconstruction(model / "sparse")
    with tempfile.TemporaryDirectory() as scratch:
        # A copy, as even reading makes COLMAP write into it.
        copy = shutil.copyfile(model / "database.db", Path(scratch) / "database.db")
        with open_database(copy) as link:
            listed = sorted(link.read_all_images(), key=lambda image: image.name)
            features = {image.name: link.num_keypoints_for_image(image.image_id) for image in listed}
            cameras = {camera.camera_id: camera for camera in link.read_all_cameras()}
            pair_ids, counts = link.read_two_view_geometry_num_inliers()
    row = {image.image_id: k for k, image in enumerate(listed)}
    matches = np.zeros((len(listed), len(listed)), dtype=np.int64)
    for pair_id, count in zip(pair_ids, counts, strict=True):
        i, j = (row[number] for number in pycolmap.pair_id_to_image_pair(pair_id))
        matches[i, j] = matches[j, i] = int(count)
    placed = {image.name: image for image in sparse.images.values() if image.has_pose}
    photos = tuple(
        _fact(image.name, placed.get(image.name), sparse, cameras[image.camera_id], features[image.name])
        for image in listed
    )
    points = list(sparse.points3D.values())
    return ModelStatistics(
        photos=photos,
        matches=matches,
        points=np.array([point.xyz for point in points]).reshape(-1, 3),
        colours=np.array([point.color for point in points]).reshape(-1, 3) / 255.0,
    )


def _fact(
    name: str,
    image: pycolmap.Image | None,
    sparse: pycolmap.Reconstruction,
    camera: pycolmap.Camera,
    features: int,
) -> PhotoStatistics:
    own = camera if image is None else image.camera
    try:
        focal_y = float(lens_of(own).params[1])
    except StageError:  # a lens of another kind still has a mean focal length
        focal_y = float(own.mean_focal_length())
    size = {"fov_deg": float(np.degrees(2 * np.arctan(0.5 * own.height / focal_y))), "aspect": own.width / own.height}
    if image is None:
        return PhotoStatistics(
            name=name, R_WC=None, p_WC=None, features=features, observations=0, error_px=None, focal_px=focal_y, **size
        )
    pose = image.cam_from_world().matrix()
    # The mean error of a point stands for its error in each photo that sees it.
    errors = [sparse.points3D[p.point3D_id].error for p in image.points2D if p.has_point3D()]
    return PhotoStatistics(
        name=name,
        R_WC=np.ascontiguousarray(pose[:, :3].T),
        p_WC=np.asarray(image.projection_center()),
        features=features,
        observations=len(errors),
        error_px=float(np.mean(errors)) if errors else None,
        focal_px=focal_y,
        **size,
    )

"""Photographs with the poses that structure from motion found, and the rays of the pixels that matter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction.photos.photo_folder import decode
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
MIN_PHOTOS = 5
# Rays of all photos together: 15 bytes each.
MOST_RAYS = 60_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedPhoto:
    """The part of a registered photo that shows the region.

    directions_C and directions_W: unit rays through the pixels' centres, shape (h, w, 3), from p_WC_m; colours: red
    first, shape (h, w, 3). focal_px: of the photo as it is used, which may be smaller than the file.
    """

    name: str
    R_CW: Array
    p_WC_m: Array
    focal_px: float
    directions_W: Floats
    colours: Bytes

    def __post_init__(self) -> None:
        freeze(self, R_CW=(3, 3), p_WC_m=(3,))


def read_model(sparse: Path) -> pycolmap.Reconstruction:
    """Sparse model of a folder.

    Raises InputError if there is none.
    """
    if not (sparse / "images.bin").is_file():
        raise InputError(
            f"{sparse.parent}: holds no model (sparse/images.bin is missing); `wakewise scan` and "
            "`wakewise reconstruct` leave one"
        )
    try:
        return pycolmap.Reconstruction(sparse)
    except (RuntimeError, ValueError, OSError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{sparse}: is no sparse model that can be read ({reason})") from None


def surroundings(model: pycolmap.Reconstruction) -> RegionOfInterest:
    """Ball that holds 9 in 10 sparse points, about their median: the region where none is given."""
    points = np.array([point.xyz for point in model.points3D.values()]).reshape(-1, 3)
    if len(points) < 20:
        raise StageError(f"neural field: the sparse model has {len(points)} points, at least 20 must tell the region")
    centre = np.median(points, axis=0)
    return RegionOfInterest(
        centre_W_m=centre, radius_m=1.1 * float(np.percentile(np.linalg.norm(points - centre, axis=1), 90))
    )


def read_posed(
    model: pycolmap.Reconstruction, photos: Path, region: RegionOfInterest, photo_px: int
) -> tuple[PosedPhoto, ...]:
    """Registered photos that see the region, in order of name, each cut to the rectangle about it.

    Rays follow the photo's own camera model, so that nothing is resampled to undo a distortion; COLMAP has the centre
    of the first pixel at (0.5, 0.5).

    Raises InputError if a photo is missing or is not the one that was registered, or there are too many pixels;
    StageError if too few photos see the region.
    """
    found = []
    grids: dict[tuple[int, int, int], Array] = {}
    total = 0
    for image in sorted(model.images.values(), key=lambda one: one.name):
        if not image.has_pose:
            continue
        colours, scale = _read_photo(photos / image.name, image.camera, photo_px)
        height, width = colours.shape[:2]
        place = (image.camera_id, width, height)
        if place not in grids:
            grids[place] = pixel_rays(image.camera, width, height)
        pose = image.cam_from_world().matrix()
        R_CW, centre = pose[:, :3], np.asarray(image.projection_center())
        rays = grids[place]
        rows, columns = window(sees(rays, R_CW @ (region.centre_W_m - centre), region.radius_m))
        if rows.stop == rows.start:
            continue
        cut = rays[rows, columns] @ R_CW
        total += cut.shape[0] * cut.shape[1]
        if total > MOST_RAYS:
            raise InputError(
                f"{photos}: has more than {MOST_RAYS:,} pixels that show the region; give a smaller --region"
            )
        found.append(
            PosedPhoto(
                name=image.name,
                R_CW=R_CW,
                p_WC_m=centre,
                focal_px=float(image.camera.mean_focal_length()) * scale,
                directions_W=cut.astype(np.float32),
                colours=np.ascontiguousarray(colours[rows, columns]),
            )
        )
    if len(found) < MIN_PHOTOS:
        raise StageError(f"neural field: {len(found)} registered photos see the region, at least {MIN_PHOTOS} must")
    return tuple(found)


def pixel_rays(camera: pycolmap.Camera, width: int, height: int) -> Array:
    """Unit directions in the camera's frame through the pixels' centres of a photo of this size, shape (h, w, 3).

    The photo may be smaller than the camera's own size; pixels that no ray reaches are NaN.
    """
    u, v = np.meshgrid(
        (np.arange(width) + 0.5) * (camera.width / width), (np.arange(height) + 0.5) * (camera.height / height)
    )
    flat = np.asarray(camera.cam_from_img(np.stack([u.ravel(), v.ravel()], axis=1)), dtype=np.float64)
    rays = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays.reshape(height, width, 3)


def sees(rays_C: Array, centre_C_m: Array, radius_m: float) -> BoolArray:
    """Which pixels look through a ball, given unit rays, shape (h, w, 3), and its centre in the camera's frame."""
    along = rays_C @ centre_C_m
    gap = float(centre_C_m @ centre_C_m) - along**2
    inside = float(centre_C_m @ centre_C_m) < radius_m**2
    return np.asarray(((gap < radius_m**2) & (along > 0.0)) | (inside & np.isfinite(along)))


def window(wanted: BoolArray) -> tuple[slice, slice]:
    """Rows and columns of the smallest rectangle that holds all wanted pixels; empty where there are none."""
    rows, columns = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
    if len(rows) == 0:
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _read_photo(path: Path, camera: pycolmap.Camera, photo_px: int) -> tuple[Bytes, float]:
    """Colours, red first, averaged down where the photo is longer than desired; and the scale."""
    if not path.is_file():
        raise InputError(f"{path}: does not exist; --photos must name the folder that the model was made from")
    image = decode(path.read_bytes(), str(path))
    if image is None:
        raise InputError(f"{path}: is no image that can be read")
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{path}: has {width} x {height} pixels, the model was made from {camera.width} x {camera.height}"
        )
    scale = min(1.0, photo_px / max(width, height))
    if scale < 1.0:
        size = (max(round(scale * width), 1), max(round(scale * height), 1))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return np.ascontiguousarray(image[:, :, ::-1]), scale

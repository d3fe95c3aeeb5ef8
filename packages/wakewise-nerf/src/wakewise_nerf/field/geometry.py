"""Depth that a field was rendered to, fused into points: only arrays here, so that it works without PyTorch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import StageError
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.dense.fusion import CellMeans, facing_normals, fuse, outlier_mask
from wakewise.vision.reconstruction.dense.stereo import DepthMap
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise_nerf.field.posed import PosedPhoto

# Depth maps of at most this many other views vote on a point.
VOTING_VIEWS = 8
# Fewest points that are worth a cloud.
FEWEST_POINTS = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthCamera:
    """A pinhole camera to render depth from; pixel (i, j) has its centre at (j, i)."""

    focal_px: float
    centre_px: Array
    R_CW: Array
    p_WC_m: Array
    width: int
    height: int

    def __post_init__(self) -> None:
        freeze(self, centre_px=(2,), R_CW=(3, 3), p_WC_m=(3,))

    def directions_C(self) -> Array:
        """Unit rays in the camera's frame, shape (h, w, 3)."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        rays = np.stack(
            [(u - self.centre_px[0]) / self.focal_px, (v - self.centre_px[1]) / self.focal_px, np.ones(u.shape)], axis=2
        )
        return np.asarray(rays / np.linalg.norm(rays, axis=2, keepdims=True))


def depth_camera(photo: PosedPhoto, depth_px: float) -> DepthCamera | None:
    """Look from where a photo was taken at the middle of what it saw of the region, just wide enough; None if in vain.

    `depth_px`: size of a pixel, in the photo's pixels.
    """
    rays = photo.directions_W.reshape(-1, 3).astype(np.float64)
    rays = rays[np.isfinite(rays).all(axis=1)]
    middle = rays.mean(axis=0)
    z = middle / np.linalg.norm(middle)
    x = photo.R_CW[0] - (photo.R_CW[0] @ z) * z
    x = x / np.linalg.norm(x)
    R_CW = np.stack([x, np.cross(z, x), z])
    seen = rays @ R_CW.T
    # Beyond 60 degrees off the middle a pinhole camera is all stretch.
    seen = seen[seen[:, 2] > 0.5]
    if len(seen) == 0:
        return None
    focal = photo.focal_px / depth_px
    flat = focal * seen[:, :2] / seen[:, 2:]
    low, high = np.floor(flat.min(axis=0)), np.ceil(flat.max(axis=0))
    width, height = (int(v) + 1 for v in high - low)
    return DepthCamera(focal_px=focal, centre_px=-low, R_CW=R_CW, p_WC_m=photo.p_WC_m, width=width, height=height)


def depth_map(
    index: int, camera: DepthCamera, distance_m: Array, colours: NDArray[np.uint8], region: RegionOfInterest
) -> DepthMap:
    """A rendered view as fusion wants it.

    `distance_m`, shape (h, w): along the rays; 0 where nothing is. `colours`, shape (h, w, 3): red first.
    """
    rays = camera.directions_C()
    depth = distance_m * rays[:, :, 2]
    points = rays * distance_m[:, :, None]
    middle = camera.R_CW @ (region.centre_W_m - camera.p_WC_m)
    inside = (np.linalg.norm(points - middle, axis=2) <= region.radius_m) & (distance_m > 0.0)
    return DepthMap(
        first=index,
        second=index,
        focal_px=camera.focal_px,
        centre_px=camera.centre_px,
        # There is no second camera: with this baseline one pixel of disparity is one pixel's footprint in depth.
        baseline_m=max(float(np.linalg.norm(middle)), 1e-9),
        R_CW=camera.R_CW,
        p_WC_m=camera.p_WC_m,
        depth_m=depth.astype(np.float32),
        wanted=inside,
        colours=np.ascontiguousarray(colours[:, :, ::-1]),
    )


def fuse_depth(maps: list[DepthMap], agreeing: int, progress: Progress) -> tuple[OrientedPointCloud, float]:
    """Points that `agreeing` other maps confirm within a pixel's footprint, thinned and cleaned; and their spacing.

    Raises StageError if hardly any point is confirmed.
    """
    footprints = [np.median(m.depth_m[m.wanted]) / m.focal_px for m in maps if m.wanted.any()]
    if not footprints:
        raise StageError("neural field: nothing in the region is opaque; it needs more steps or other photos")
    spacing = float(np.median(footprints))
    sight = np.stack([m.R_CW[2] for m in maps])
    gathered = CellMeans(9, spacing)
    confirmed = 0
    for index in range(len(maps)):
        progress(index, len(maps), "fusion")
        near = np.argsort(-(sight @ sight[index]), kind="stable")
        neighbours = [int(k) for k in near if k != index][:VOTING_VIEWS]
        rows = fuse(maps, index, neighbours, min(agreeing, len(neighbours)), 1.0)
        confirmed += len(rows)
        gathered.add(rows)
    if confirmed < FEWEST_POINTS:
        raise StageError(f"neural field: {confirmed} points are confirmed by {agreeing} other views, needs 100")
    cloud, _ = gathered.means()
    cloud = cloud[~outlier_mask(cloud[:, :3])]
    points, colours, towards = cloud[:, :3], cloud[:, 3:6], cloud[:, 6:]
    return OrientedPointCloud(points_m=points, normals=facing_normals(points, towards), colours=colours), spacing

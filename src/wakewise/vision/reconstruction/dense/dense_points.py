"""Dense points: photos and sparse model in, dense.ply out, by semi-global stereo or COLMAP's patch-match (CUDA).

Depth maps beyond a bound of memory lie on disk.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import Progress
from wakewise.core.run_lock import temporary_prefix
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import one_opencv_thread
from wakewise.vision.reconstruction.dense.fusion import CellMeans, facing_normals, fuse, outlier_mask
from wakewise.vision.reconstruction.dense.stereo import DepthMap, masked, pair_depth, rectifiable
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, read_cloud, write_cloud
from wakewise.vision.reconstruction.photos.photo_folder import Image, PhotoStore
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import call, pycolmap
from wakewise.vision.reconstruction.sfm.registered_photos import (
    RegionOfInterest,
    RegisteredPhoto,
    rank_partners,
    read_views,
)
from wakewise.vision.reconstruction.stages import need_room

HELD_BYTES = 250_000_000
"""Of depth maps that stay in memory: about 25 photographs' at 640 px."""


class DepthStore:
    """Depth maps by number, in the order in which they were added; their arrays lie in `folder` beyond `most_bytes`."""

    def __init__(self, folder: Path, most_bytes: int = HELD_BYTES) -> None:
        self._folder = folder
        self._left = most_bytes
        self._maps: list[DepthMap] = []
        self._stored: dict[int, tuple[int, int]] = {}

    def add(self, depth_map: DepthMap) -> None:
        """Keep a map.

        Raises OSError if the disk is full.
        """
        size = depth_map.depth_m.nbytes + depth_map.wanted.nbytes + depth_map.colours.nbytes
        if size <= self._left:
            self._left -= size
        else:
            height, width = depth_map.depth_m.shape
            number = len(self._maps)
            depth_map.depth_m.tofile(self._folder / f"{number}.depth")
            with (self._folder / f"{number}.rest").open("wb") as file:
                file.write(depth_map.wanted.tobytes())
                file.write(depth_map.colours.tobytes())
            self._stored[number] = (height, width)
            depth_map = replace(
                depth_map,
                depth_m=np.zeros((0, 0), dtype=np.float32),
                wanted=np.zeros((0, 0), dtype=np.bool_),
                colours=np.zeros((0, 0, 3), dtype=np.uint8),
            )
        self._maps.append(depth_map)

    def __len__(self) -> int:
        return len(self._maps)

    def photos(self, number: int) -> tuple[int, int]:
        """The two photographs that a map is of: the one that it is seen from, and its partner."""
        one = self._maps[number]
        return one.first, one.second

    def depths(self, number: int) -> DepthMap:
        """A map with its depths; which are wanted, and colours, may be missing.

        Raises OSError if it cannot be read.
        """
        size = self._stored.get(number)
        if size is None:
            return self._maps[number]
        depth = np.fromfile(self._folder / f"{number}.depth", dtype=np.float32).reshape(size)
        return replace(self._maps[number], depth_m=depth)

    def whole(self, number: int) -> DepthMap:
        """A map with all that belongs to it.

        Raises OSError if it cannot be read.
        """
        size = self._stored.get(number)
        if size is None:
            return self._maps[number]
        data = np.fromfile(self._folder / f"{number}.rest", dtype=np.uint8)
        pixels = size[0] * size[1]
        return replace(
            self.depths(number),
            wanted=data[:pixels].view(np.bool_).reshape(size),
            colours=np.ascontiguousarray(data[pixels:]).reshape(*size, 3),
        )


AGREEMENT_PX = 1.0
"""Largest disparity difference of depths that agree."""
VOTING_PHOTOS = 8
"""Depth maps of at most so many other photos vote on a point."""
MOST_POINTS = 8_000_000
"""With more, cells become twice as large, so that four points of a surface are one: fusion and mesh stay below 8 GB."""


def densify(
    folder: Path,
    sparse: Path,
    out: Path,
    settings: ReconstructionSettings,
    *,
    region: RegionOfInterest | None,
    progress: Progress,
    store: PhotoStore | None = None,
) -> dict[str, Any]:
    """Stereo on neighbouring photos, fused by agreement, thinned, cleaned; points with normals and colours.

    Returns dense_points, depth_maps, point_spacing_mm (in units of the model where it has no scale). Raises StageError
    if no depth survives.
    """
    views, points = read_views(sparse, region)
    partners = rank_partners(views, points, region, most=2 * max(VOTING_PHOTOS, settings.stereo_partners))
    scale = _scale(views, region, settings)
    with tempfile.TemporaryDirectory(prefix=temporary_prefix("depths"), dir=out.parent) as scratch:
        maps = DepthStore(Path(scratch))
        with one_opencv_thread():  # the threads are over photos and pairs
            given = store or PhotoStore(folder)
            spacing = _all_depths(maps, given, views, partners, region, settings, scale, progress)
        cloud, spacing = _fuse_all(maps, partners, settings, spacing, progress)
    if len(cloud) < 100:
        where = "" if region is None else f"; is the region right, {region.radius_m:g} m about {region.centre_W_m}?"
        raise StageError(f"dense: {len(cloud)} points survive from {len(maps)} depth maps, at least 100 must{where}")
    normals = facing_normals(cloud[:, :3], cloud[:, 6:9], settings.threads)
    write_cloud(out, OrientedPointCloud(points_m=cloud[:, :3], normals=normals, colours=cloud[:, 3:6]))
    return {"dense_points": len(cloud), "depth_maps": len(maps), "point_spacing_mm": 1e3 * spacing}


def _all_depths(
    maps: DepthStore,
    store: PhotoStore,
    views: tuple[RegisteredPhoto, ...],
    partners: list[list[int]],
    region: RegionOfInterest | None,
    settings: ReconstructionSettings,
    scale: float,
    progress: Progress,
) -> float:
    """A depth map of every photo with each of its best partners, as far as they can be rectified.

    Returns the usual distance between neighbouring rectified pixels at the surface's depth, in m; 0 without any.
    """
    jobs = []
    for i, best in enumerate(partners):
        good = [j for j in best if rectifiable(views[i], views[j])]
        jobs += [(i, j) for j in good[: settings.stereo_partners]]
    # Whole multiples, so that large photos are not kept at a size that stereo does not use.
    shrink = max(1, int(1.0 / scale))
    photos = list(in_order(lambda view: _load(store, view.name, shrink), views, settings.threads))
    small = tuple(_shrunk(view, shrink) for view in views)

    def one(job: tuple[int, int]) -> DepthMap | None:
        found = pair_depth(small, photos, *job, region, scale * shrink, settings.stereo_paths)
        if found is None or store.masks is None:
            return found
        return masked(found, small[found.first], store.masks.of(views[found.first].name))

    spacings = []
    for done, depth_map in enumerate(in_order(one, jobs, settings.threads)):
        progress(done, 2 * len(jobs), "stereo")
        if depth_map is not None:
            maps.add(depth_map)
            depth = depth_map.depth_m
            if depth.any():
                spacings.append(np.median(depth[depth > 0]) / depth_map.focal_px)
    return float(np.median(spacings)) if spacings else 0.0


def _load(store: PhotoStore, name: str, shrink: int) -> Image:
    image = store.image(name)
    if shrink == 1:
        return image
    height, width = (size - size % shrink for size in image.shape[:2])
    small = cv2.resize(image[:height, :width], (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _shrunk(view: RegisteredPhoto, shrink: int) -> RegisteredPhoto:
    """The view with pixels `shrink` times as large; COLMAP's pixel positions scale about the photo's corner."""
    if shrink == 1:
        return view
    return replace(
        view,
        width=view.width // shrink,
        height=view.height // shrink,
        focal_px=view.focal_px / shrink,
        centre_px=view.centre_px / shrink,
    )


def _scale(
    views: tuple[RegisteredPhoto, ...], region: RegionOfInterest | None, settings: ReconstructionSettings
) -> float:
    """Rectified pixels per photo pixel: a region is enlarged, whole frames are not; both are bounded in size."""
    if region is None:
        return min(1.0, settings.dense_px / max(max(view.width, view.height) for view in views))
    wide = [2 * view.focal_px * region.radius_m / max(float(view.depth_of(region.centre_W_m)), 1e-9) for view in views]
    return min(settings.dense_zoom, settings.dense_px / float(np.median(wide)))


def _fuse_all(
    maps: DepthStore,
    partners: list[list[int]],
    settings: ReconstructionSettings,
    spacing: float,
    progress: Progress,
) -> tuple[Array, float]:
    """Points, colours and directions to the camera side by side, shape (n, 9); their spacing, m."""
    photos = [maps.photos(k) for k in range(len(maps))]
    alone = len({photo for both in photos for photo in both}) == 2

    def of_one(index: int) -> Array:
        first, second = photos[index]
        voters = {first, *partners[first][:VOTING_PHOTOS]}
        neighbours = [
            k
            for k, other in enumerate(photos)
            if other[0] in voters
            # The reversed pair is not independent; of two photos it is the only one.
            and (set(other) != {first, second} or (alone and other[0] != first))
        ]
        read = {k: maps.depths(k) for k in neighbours} | {index: maps.whole(index)}
        return fuse(read, index, neighbours, 1 if alone else settings.agreeing_views, AGREEMENT_PX)

    # Cells as they come, in the order of the maps, so that all points need not be in memory at once.
    gathered = CellMeans(9, spacing)
    for index, rows in enumerate(in_order(of_one, range(len(maps)), settings.threads)):
        progress(len(maps) + index, 2 * len(maps), "fusion")
        gathered.add(rows)
        while len(gathered) > MOST_POINTS:
            gathered, spacing = gathered.coarser(), 2.0 * spacing
    cloud, _ = gathered.means()
    del gathered  # as large as the cloud and half as large again
    return cloud[~outlier_mask(cloud[:, :3], threads=settings.threads)], spacing


def require_cuda() -> None:
    """Check that patch-match can run here.

    Raises InputError if pycolmap has no CUDA or there is no device.
    """
    if not pycolmap.has_cuda:
        raise InputError("dense: patch-match needs a pycolmap with CUDA (package pycolmap-cuda12); stereo needs none")
    if pycolmap.get_num_cuda_devices() < 1:
        raise InputError("dense: patch-match needs a CUDA device, none is there; stereo needs none")


def patch_match(
    folder: Path,
    sparse: Path,
    out: Path,
    settings: ReconstructionSettings,
    *,
    region: RegionOfInterest | None,
    progress: Progress,
) -> dict[str, Any]:
    """Patch-match stereo and fusion; what lies outside the region is left out.

    J. L. Schoenberger et al., Pixelwise view selection for unstructured multi-view stereo, ECCV 2016, doi
    10.1007/978-3-319-46487-9_31.

    Returns what `densify` returns. Raises StageError if no points come out.
    """
    with tempfile.TemporaryDirectory(prefix=temporary_prefix("patch-match"), dir=out.parent) as scratch:
        work = Path(scratch) / "work"
        call(partial(pycolmap.undistort_images, work, sparse, folder), "dense", lambda: progress(0, 3, "undistort"))
        options = pycolmap.PatchMatchOptions()
        options.max_image_size = -1 if region is not None else settings.dense_px
        call(partial(pycolmap.patch_match_stereo, work, options=options), "dense", lambda: progress(1, 3, "stereo"))
        fusion = pycolmap.StereoFusionOptions()
        fusion.min_num_pixels = settings.agreeing_views + 1
        raw = Path(scratch) / "fused.ply"
        call(
            partial(pycolmap.stereo_fusion, raw, work, options=fusion, output_type="ply"),
            "dense",
            lambda: progress(2, 3, "fusion"),
        )
        need_room(out.parent, 0.0, "dense")  # on a full disk the points are cut short without an error
        cloud = read_cloud(raw)
    keep = np.ones(len(cloud.points_m), dtype=np.bool_)
    if region is not None:
        keep = np.linalg.norm(cloud.points_m - region.centre_W_m, axis=1) <= region.radius_m
    if keep.sum() < 100:
        raise StageError(f"dense: {keep.sum()} points survive patch-match, at least 100 must")
    cloud = cloud.only(keep)
    points = cloud.points_m
    write_cloud(out, cloud)
    some = np.random.default_rng(RANDOM_SEED).choice(len(points), min(len(points), 2000), replace=False)
    spacing = float(np.median(np.asarray(KDTree(points).query(points[some], k=2)[0])[:, 1]))
    maps = len(pycolmap.Reconstruction(sparse).images)
    return {"dense_points": len(points), "depth_maps": maps, "point_spacing_mm": 1e3 * spacing}

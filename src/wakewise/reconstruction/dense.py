"""Dense points from posed photos: photos and sparse/ in, dense.ply out."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import small_gicp

from wakewise.arrays import Array, IntArray
from wakewise.errors import StageError
from wakewise.interfaces import Progress
from wakewise.reconstruction.clouds import Cloud, write_cloud
from wakewise.reconstruction.fusion import fuse, lonely, thin_mean
from wakewise.reconstruction.photos import Image, decode
from wakewise.reconstruction.settings import ReconstructionSettings
from wakewise.reconstruction.stereo import DepthMap, pair_depth, rectifiable
from wakewise.reconstruction.views import Ball, View, rank_partners, read_views

# Depth maps of at most this many other photos vote on a point.
VOTING_PHOTOS = 8
MERGE_ROWS = 1_000_000


def densify(
    folder: Path,
    sparse: Path,
    out: Path,
    settings: ReconstructionSettings,
    *,
    region: Ball | None,
    progress: Progress,
) -> dict[str, Any]:
    """Stereo on neighbouring photos, fused by agreement, thinned, cleaned; points with normals and colours.

    Returns
    -------
    dict
        dense_points, depth_maps, point_spacing_mm (in units of the model where it has no scale).

    Raises
    ------
    StageError
        If no depth survives.
    """
    views, points = read_views(sparse, region)
    partners = rank_partners(views, points, region, most=2 * max(VOTING_PHOTOS, settings.stereo_partners))
    scale = _scale(views, region, settings)
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)  # the threads are over photos and pairs
    try:
        maps = _all_depths(folder, views, partners, region, settings, scale, progress)
    finally:
        cv2.setNumThreads(before)
    spacing = _spacing(maps) if maps else 0.0
    cloud = _fuse_all(maps, partners, settings, spacing, progress) if maps else np.zeros((0, 9))
    if len(cloud) < 100:
        raise StageError(f"dense: {len(cloud)} points survive from {len(maps)} depth maps, at least 100 must")
    normals = _normals(cloud[:, :3], cloud[:, 6:9])
    write_cloud(out, Cloud(points_m=cloud[:, :3], normals=normals, colours=cloud[:, 3:6]))
    return {"dense_points": len(cloud), "depth_maps": len(maps), "point_spacing_mm": 1e3 * spacing}


def _all_depths(
    folder: Path,
    views: tuple[View, ...],
    partners: list[list[int]],
    region: Ball | None,
    settings: ReconstructionSettings,
    scale: float,
    progress: Progress,
) -> list[DepthMap]:
    """A depth map of every photo with each of its best partners, as far as they can be rectified."""
    jobs = []
    for i, best in enumerate(partners):
        good = [j for j in best if rectifiable(views[i], views[j])]
        jobs += [(i, j) for j in good[: settings.stereo_partners]]
    # Whole multiples, so that large photos need not lie in memory at a size that stereo does not look at.
    shrink = max(1, int(1.0 / scale))
    maps: list[DepthMap] = []
    with ThreadPoolExecutor(settings.threads) as pool:
        try:
            photos = list(pool.map(lambda view: _load(folder / view.name, shrink), views))
            small = tuple(_shrunk(view, shrink) for view in views)
            results: Iterator[DepthMap | None] = pool.map(
                lambda job: pair_depth(small, photos, job[0], job[1], region, scale * shrink, settings.stereo_paths),
                jobs,
            )
            for done, depth_map in enumerate(results):
                progress(done, 2 * len(jobs), "stereo")
                if depth_map is not None:
                    maps.append(depth_map)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return maps


def _load(path: Path, shrink: int) -> Image:
    image = decode(path.read_bytes())
    if image is None:
        raise StageError(f"dense: {path} can no longer be read")
    if shrink == 1:
        return image
    height, width = (size - size % shrink for size in image.shape[:2])
    small = cv2.resize(image[:height, :width], (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _shrunk(view: View, shrink: int) -> View:
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


def _scale(views: tuple[View, ...], region: Ball | None, settings: ReconstructionSettings) -> float:
    """Rectified pixels per photo pixel: a region is enlarged, whole frames are not; both are bounded in size."""
    if region is None:
        return min(1.0, settings.dense_px / max(max(view.width, view.height) for view in views))
    wide = [2 * view.focal_px * region.radius_m / max(float(view.depth_of(region.centre_W_m)), 1e-9) for view in views]
    return min(settings.dense_zoom, settings.dense_px / float(np.median(wide)))


def _spacing(maps: list[DepthMap]) -> float:
    """Usual distance between neighbouring rectified pixels at the surface's depth, in m."""
    return float(np.median([np.median(m.depth_m[m.depth_m > 0]) / m.focal_px for m in maps if m.depth_m.any()]))


def _fuse_all(
    maps: list[DepthMap],
    partners: list[list[int]],
    settings: ReconstructionSettings,
    spacing: float,
    progress: Progress,
) -> Array:
    """Points, colours and directions to the camera side by side, shape (n, 9)."""
    alone = len({own.first for own in maps} | {own.second for own in maps}) == 2

    def of_one(index: int) -> tuple[Array, IntArray]:
        own = maps[index]
        voters = {own.first, *partners[own.first][:VOTING_PHOTOS]}
        neighbours = [
            k
            for k, other in enumerate(maps)
            if other.first in voters
            # The pair the other way round is no independent witness; of two photos it is the only one.
            and ({other.first, other.second} != {own.first, own.second} or (alone and other.first != own.first))
        ]
        agreeing = 1 if alone else settings.agreeing_views
        points, colours, towards = fuse(maps, index, neighbours, agreeing, settings.agreement_px)
        values = np.concatenate([colours, towards], axis=1)
        if not len(points):
            return np.zeros((0, 9)), np.zeros(0, dtype=np.int64)
        points, values, count = thin_mean(points, values, spacing)
        return np.concatenate([points, values], axis=1), count

    gathered: list[Array] = []
    counts: list[IntArray] = []

    def merge() -> None:
        rows = np.concatenate(gathered)
        points, values, count = thin_mean(rows[:, :3], rows[:, 3:], spacing, np.concatenate(counts))
        gathered[:], counts[:] = [np.concatenate([points, values], axis=1)], [count]

    with ThreadPoolExecutor(settings.threads) as pool:
        try:
            for index, (rows, count) in enumerate(pool.map(of_one, range(len(maps)))):
                progress(len(maps) + index, 2 * len(maps), "fusion")
                gathered.append(rows)
                counts.append(count)
                # Merged now and then, so that memory stays bounded.
                if sum(len(part) for part in gathered[1:]) > MERGE_ROWS:
                    merge()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    merge()
    rows = gathered[0]
    return rows[~lonely(rows[:, :3], threads=settings.threads)]


def _normals(points: Array, towards: Array) -> Array:
    """Unit normals from each point's neighbourhood, turned to the side that the cameras were on."""
    cloud = small_gicp.PointCloud(points)
    small_gicp.estimate_normals(cloud, num_neighbors=16, num_threads=1)
    normals = np.array(cloud.normals())[:, :3]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.5, normals / np.maximum(length, 1e-12), towards)
    away = np.einsum("ij,ij->i", normals, towards) < 0
    normals[away] *= -1
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)

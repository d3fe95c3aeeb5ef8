"""The stages as the pipeline calls them: room on the disk is looked for first, and what is fixed is passed on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.colmap import pycolmap
from wakewise.vision.reconstruction.dense import densify
from wakewise.vision.reconstruction.features import database_bytes, match_photos
from wakewise.vision.reconstruction.guided import Poses
from wakewise.vision.reconstruction.known_pose_triangulation import common_region
from wakewise.vision.reconstruction.lens_groups import LensGroup
from wakewise.vision.reconstruction.mapping import map_photos
from wakewise.vision.reconstruction.pairs import Pairs
from wakewise.vision.reconstruction.patchmatch import patch_match
from wakewise.vision.reconstruction.photos import Photo, PhotoStore
from wakewise.vision.reconstruction.registered_photos import RegionOfInterest
from wakewise.vision.reconstruction.request import CropBox, ReconstructionRequest, cut_cloud
from wakewise.vision.reconstruction.scale.stage import place_model, scale_model
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.stages import need_room


def match_step(
    store: PhotoStore,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    focal_px: float | None,
    groups: tuple[LensGroup, ...],
    pairs: Pairs,
    poses: Poses | None,
    fixed: bool,
    look_alikes: int,
    progress: Progress,
) -> dict[str, Any]:
    """Photos to database.db; see `features.match_photos`. `fixed`: the poses are known and stay."""
    need_room(database.parent, database_bytes(len(photos), len(pairs) + look_alikes * len(photos), settings), "match")
    return match_photos(
        store.folder,
        photos,
        database,
        settings,
        focal_px=focal_px,
        pairs=pairs,
        progress=progress,
        store=store,
        groups=groups,
        poses=poses,
        may_be_none=fixed,
        look_alikes=look_alikes,
    )


def map_step(
    store: PhotoStore,
    database: Path,
    sparse: Path,
    settings: ReconstructionSettings,
    photos: int,
    references: dict[str, Array] | None,
    poses: Poses | None,
    fixed: bool,
    progress: Progress,
) -> dict[str, Any]:
    """database.db to sparse/; see `mapping.map_photos`. `fixed`: the poses are known and stay."""
    # Points and tracks are a part of what the database holds; it is copied.
    need_room(sparse.parent, 2.0 * database.stat().st_size, "map")
    return map_photos(
        store.folder,
        database,
        sparse,
        settings,
        photos=photos,
        references=references,
        progress=progress,
        store=store,
        poses=None if fixed else poses,
        fixed=poses if fixed else None,
    )


def scale_step(
    store: PhotoStore, sparse: Path, wishes: ReconstructionRequest, threads: int, referred: bool, progress: Progress
) -> dict[str, Any]:
    """sparse/ in metres; see `scale.stage`. The surest gives the scale: references (`referred`), then bars, then fixes;
    the others check it.
    """
    figures: dict[str, Any] = {}
    if wishes.bars is not None:
        figures |= scale_model(store, sparse, wishes.bars, threads, progress, keep=referred)
    if wishes.fixes is not None:
        figures |= place_model(sparse, wishes.fixes, keep=referred or wishes.bars is not None)
    return figures


def dense_step(
    store: PhotoStore,
    sparse: Path,
    dense: Path,
    settings: ReconstructionSettings,
    region: RegionOfInterest | None,
    fixed: bool,
    crop: CropBox | None,
    progress: Progress,
) -> dict[str, Any]:
    """sparse/ to dense.ply, cut to a box; see `dense.densify`. `fixed`: the poses are known and stay."""
    if fixed and region is None:
        region = common_region(pycolmap.Reconstruction(sparse))
    if settings.dense == "patch-match":
        figures = patch_match(store.folder, sparse, dense, settings, region=region, progress=progress)
    else:
        figures = densify(store.folder, sparse, dense, settings, region=region, progress=progress, store=store)
    return figures if crop is None else figures | {"dense_points": cut_cloud(dense, crop)}

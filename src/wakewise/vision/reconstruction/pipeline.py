"""The whole way from a folder of photos to a model, stage by stage; each can be rerun from its files.

What may be asked of a reconstruction besides its photographs: lengths, masks, a box to cut to, where to stop.

The stages as the pipeline calls them: room on the disk is looked for first, and what is fixed is passed on.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import write_json
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.run_lock import exclusive_run
from wakewise.vision.reconstruction.dense.dense_points import densify, patch_match, require_cuda
from wakewise.vision.reconstruction.outputs.clouds import read_cloud, write_cloud
from wakewise.vision.reconstruction.outputs.meshing import FIGURES as MESH_FIGURES
from wakewise.vision.reconstruction.outputs.meshing import mesh_model
from wakewise.vision.reconstruction.photos.known_cameras import KnownCameras, match_known, match_references
from wakewise.vision.reconstruction.photos.lens_groups import LensGroup, group_photos, known_groups, named_lenses
from wakewise.vision.reconstruction.photos.lenses import Lens
from wakewise.vision.reconstruction.photos.masks import read_masks
from wakewise.vision.reconstruction.photos.photo_folder import (
    Photo,
    PhotoStore,
    read_photos,
    unsupported_files,
    without_duplicates,
)
from wakewise.vision.reconstruction.scale.bars import ScaleBars
from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes
from wakewise.vision.reconstruction.scale.stage import place_model, scale_model
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.features import database_bytes, match_photos
from wakewise.vision.reconstruction.sfm.guided_matching import Poses
from wakewise.vision.reconstruction.sfm.known_pose_triangulation import common_region
from wakewise.vision.reconstruction.sfm.mapping import MAPPINGS, map_photos
from wakewise.vision.reconstruction.sfm.pairs import (
    BAND_NEIGHBOURS,
    LOOK_ALIKES,
    POSE_NEIGHBOURS,
    Pairs,
    choose_pairs,
    uses_retrieval,
)
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise.vision.reconstruction.stages import (
    StageResult,
    invalidate_stage,
    make_folder,
    need_room,
    run_stage,
    stage_key,
)

LEAST_POINTS = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class CropBox:
    """What is kept of a model: from one corner to the other along its axes, in its units (m where it has a scale)."""

    low: Array
    high: Array

    def __post_init__(self) -> None:
        freeze(self, low=(3,), high=(3,))
        if not (np.isfinite(self.low).all() and np.isfinite(self.high).all() and (self.low < self.high).all()):
            raise InputError(
                f"crop: from {np.round(self.low, 6).tolist()} to {np.round(self.high, 6).tolist()}; each of X0 Y0 Z0 "
                "must be below X1 Y1 Z1"
            )

    def holds(self, points: Array) -> BoolArray:
        """Which points, shape (n, 3), lie in it."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))

    def key(self) -> list[float]:
        """Plain values."""
        return [*self.low.tolist(), *self.high.tolist()]


@dataclass(frozen=True, kw_only=True)
class ReconstructionRequest:
    """bars: lengths that give scale; fixes: weak knowledge of places, which gives it without bars; masks: a folder of
    them; crop: what dense points and mesh are kept of; until: the last stage.
    """

    bars: ScaleBars | None = None
    fixes: PositionFixes | None = None
    masks: Path | None = None
    crop: CropBox | None = None
    until: Literal["sparse", "dense", "mesh"] = "mesh"


def cut_cloud(path: Path, box: CropBox) -> int:
    """Keep of a cloud on disk what lies in a box; how many points that is.

    Raises StageError if too little is left; the message says where the points are.
    """
    cloud = read_cloud(path)
    kept = box.holds(cloud.points_m)
    if kept.sum() < LEAST_POINTS:
        low, high = np.quantile(cloud.points_m, (0.01, 0.99), axis=0)
        path.unlink()
        raise StageError(
            f"crop: {kept.sum()} of {len(kept)} points lie in the box, at least {LEAST_POINTS} must; nearly all lie "
            f"from {np.round(low, 4).tolist()} to {np.round(high, 4).tolist()}"
        )
    write_cloud(path, cloud.only(kept))
    return int(kept.sum())


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


LATER = ("scale_bars", "scale_fixes", "dense_points", "depth_maps", "point_spacing_mm", *MESH_FIGURES)
"""Figures of stages that may not be asked for."""


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a reconstruction is; written as `reconstruction.json`.

    pairs, verified_pairs, posed_pairs: of photos that were matched, that show the same, and those of them that were
    matched along epipolar lines of known poses. mapping: how the sparse model came about; poses_refused: why not from
    known poses where that was tried. reprojection_px: mean over all observations that were kept; reprojection_uncut_px:
    before the last cuts, which took cut_pct of them. cameras_rmse_mm: distance of registered cameras from their
    references after the similarity, None without references. reprojection_met: whether the mean is below what the
    settings wish and nothing speaks against the model; doubts: what does, in words. The figures that this rests on:
    `verdict.Evidence`, and second_opinion_pct, how far cameras move, of their spread, when each photo has a lens of its
    own. lenses: name, focal length, size and photos of each; lenses_split: whether photos that seemed to share one
    turned out not to. left_out: each photo without a place, its best partner and their matches. sub_models: photos in
    each model that came about; the first is kept. duplicates: photos left out because another has the same bytes.
    passed_over: films and other files that are not read. suspicion: a word where lengths cannot be metres. stages_s:
    what each stage took when it ran; `skipped` were done before.
    wall_s: this call. scale_bars, scale_fixes: what bars and fixes say of the scale, see `scale.stage`.
    A model without references has no scale, so its lengths are None.
    """

    images: int
    duplicates: int
    registered_images: int
    points: int
    reprojection_px: float
    reprojection_met: bool
    reprojection_uncut_px: float
    cut_pct: float
    doubts: list[str]
    observations_per_photo: float
    coverage_pct: float
    angle_deg: float
    agreeing_pairs_pct: float | None
    held_out_px: float | None
    second_opinion_pct: float | None
    lenses: list[dict[str, Any]]
    lenses_split: bool
    left_out: list[dict[str, Any]]
    sub_models: list[int]
    passed_over: dict[str, int]
    track_length: float
    focal_px: float
    features_per_image: float
    inlier_matches: int
    pairs: int
    verified_pairs: int
    posed_pairs: int
    mapping: str
    poses_refused: str | None
    cameras_rmse_mm: float | None
    cameras_max_mm: float | None
    reference_inliers: int | None
    scale: float | None
    surface_distance_m: float | None
    suspicion: str | None
    scale_bars: dict[str, Any] | None
    scale_fixes: dict[str, Any] | None
    dense_points: int | None
    depth_maps: int | None
    point_spacing_mm: float | None
    mesh_vertices: int | None
    mesh_faces: int | None
    mesh_points_left_out: int | None
    wall_s: float
    stages_s: dict[str, float]
    skipped: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """All figures as plain values for JSON, with a reason (`why`) for each that is null."""
        figures = {**asdict(self), "skipped": list(self.skipped)}
        reason = {
            "dense_points": "no dense points were asked for",
            "depth_maps": "no dense points were asked for",
            "scale_bars": "no bars were given",
            "scale_fixes": "no fixes were given",
            **dict.fromkeys(MESH_FIGURES, "no mesh was asked for, or it is made after the figures"),
            "suspicion": "nothing looks suspicious",
            "agreeing_pairs_pct": "no pair of registered photos has matches enough",
            "held_out_px": "no point is seen by three photos",
            "second_opinion_pct": "lenses were not looked into, or too few photos have a place in both models",
            "poses_refused": "the model came from known poses, or none were given, or hardly a pair fitted them",
        }
        why = {
            key: reason.get(key, "no reference cameras were given, so the model has no scale")
            for key, value in figures.items()
            if value is None
        }
        if self.mapping == MAPPINGS["known"]:
            why |= {
                key: "the cameras are as they were given" for key in why if key.startswith(("cameras_", "reference_"))
            }
            why |= {key: "the cameras that were given were not doubted" for key in why if key == "second_opinion_pct"}
        return figures | {"why": why}


def reconstruct(
    photos: Path,
    out: Path,
    settings: ReconstructionSettings | None = None,
    *,
    focal_px: float | None = None,
    lens: Lens | Mapping[str, Lens] | None = None,
    lens_patterns: Mapping[str, str] | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    reference_positions: dict[str, Array] | None = None,
    reference_rotations: dict[str, Array] | None = None,
    region: tuple[Array, float] | None = None,
    known: KnownCameras | None = None,
    wishes: ReconstructionRequest | None = None,
    progress: Progress = no_progress,
) -> Model:
    """Photos to a model in `out`: database.db, sparse/, dense.ply, mesh.ply, reconstruction.json.

    A stage whose files are there, made from the same photos with the same settings, is skipped.

    `photos`: folder of photographs. `focal_px`: focal length in pixels to start from; it is refined. `lens`: camera
    that took all the photos, such as a trial's in its cameras.txt, or one by name of a group; refined unless the
    settings say no. `lens_patterns`: names of lenses and shell patterns of their photos' names; see
    `lens_groups.group_photos`. `pairs`: which photos to match; else the settings choose. `reference_positions`: camera
    centres in m, shape (3,), by photo name; they fix scale and frame. `reference_rotations`: R_WC, shape (3, 3), by
    photo name, in the frame of the references (optical axis last): with them pairs are chosen, matched and mapped from
    the poses, unless the settings say no or the photos say that they do not fit. `region`, (centre, radius): what the
    dense model is wanted of, in the frame of the references: shape (3,) in m, and m. `known`: poses and lenses of
    photos, in place of references and lenses: kept as they are, or where mapping begins, as the settings say. `wishes`:
    bars or fixes that give scale, masks, a box to cut to, the last stage. `progress`: called with (done, total, note)
    in units of a stage's own work. Raises InputError if the photos, references, pairs or region cannot be used;
    StageError if too little of it fits together; EnvironmentFailure if the disk is full, or a file cannot be read or
    written.
    """
    start = time.perf_counter()
    if out.resolve() == photos.resolve():
        raise InputError(f"{out}: is the folder of the photos, the model must go elsewhere")
    settings = settings or ReconstructionSettings()
    if settings.dense == "patch-match":
        require_cuda()
    wishes, store = wishes or ReconstructionRequest(), PhotoStore(photos)
    found, duplicates = without_duplicates(read_photos(photos, store, settings.threads))
    strangers: tuple[Photo, ...] = ()
    fixed = known is not None and settings.known_cameras == "fixed"
    if known is not None:
        if reference_positions is not None or reference_rotations is not None or focal_px is not None:
            raise InputError("cameras: known cameras are references and lenses; give no others beside them")
        known = match_known(known, found)
        reference_positions, reference_rotations = known.positions, known.rotations
        if fixed:
            strangers = tuple(photo for photo in found if photo.name not in known.positions)
            found = tuple(photo for photo in found if photo.name in known.positions)
    names = [photo.name for photo in found]
    store.masks = read_masks(photos, found, wishes.masks)
    if focal_px is not None and not (np.isfinite(focal_px) and focal_px > 0):
        raise InputError(f"focal length: {focal_px:g} px, must be above 0")
    if lens is not None and focal_px is not None:
        raise InputError("camera: give either a focal length or a calibrated camera, not both")
    groups = group_photos(found, lens_patterns, lens)
    if known is not None and (fixed or known.lenses):
        told = {photo: group.lens for group in groups for photo in group.photos if group.lens is not None}
        groups = known_groups(found, told | known.lenses)
    references = reference_positions
    if references is not None and not fixed:
        references = match_references(references, names)
    if settings.position_priors and references is None:
        raise InputError("position priors: need known camera positions")
    ball = _ball(region, references)
    axes = None if reference_rotations is None else {name: R[:, 2] for name, R in reference_rotations.items()}
    poses = _poses(settings, references, reference_rotations)
    if fixed and known is not None:
        poses = {name: (known.rotations[name], known.positions[name]) for name in names}
    begun = None if poses is None else {n: [*R.ravel().tolist(), *p.tolist()] for n, (R, p) in poses.items()}
    near = POSE_NEIGHBOURS if poses is None else BAND_NEIGHBOURS
    listed = choose_pairs(names, settings, references, axes, near) if pairs is None else [(a, b) for a, b in pairs]
    alike = LOOK_ALIKES if pairs is None and poses is None and uses_retrieval(len(names), settings) else 0
    make_folder(out)
    database, sparse, dense = out / "database.db", out / "sparse", out / "dense.ply"

    results: dict[str, StageResult] = {}
    with exclusive_run(out):
        results["match"] = run_stage(
            out,
            "match",
            stage_key(
                settings,
                "match",
                "",
                [asdict(photo) for photo in found],
                focal_px,
                [[g.name, g.photos, g.lens and g.lens.numbers()] for g in groups],
                listed,
                begun,
                alike,
                *([] if store.masks is None else [store.masks.digests]),
            ),
            (database,),
            lambda: match_step(
                store, found, database, settings, focal_px, groups, listed, poses, fixed, alike, progress
            ),
        )
        fit = 2 * results["match"].figures["posed_pairs"] >= results["match"].figures["pairs"]
        placed = None if references is None else {name: position.tolist() for name, position in references.items()}
        results["map"] = run_stage(
            out,
            "map",
            stage_key(settings, "map", results["match"].key, placed, fixed),
            (sparse / "images.bin",),
            lambda: map_step(
                store,
                database,
                sparse,
                settings,
                len(found),
                references,
                poses if fit or fixed else None,
                fixed,
                progress,
            ),
        )
        bars, fixes = wishes.bars, wishes.fixes
        if bars is None and fixes is None:
            invalidate_stage(out, "scale", "map")
        else:
            results["scale"] = run_stage(
                out,
                "scale",
                stage_key(settings, "scale", results["map"].key, bars and bars.key(), fixes and fixes.key()),
                (sparse / "images.bin",),
                lambda: scale_step(store, sparse, wishes, settings.threads, references is not None, progress),
            )
        place = None if ball is None else [ball.centre_W_m.tolist(), ball.radius_m]
        cut = [] if wishes.crop is None else [wishes.crop.key()]
        if wishes.until != "sparse":
            results["dense"] = run_stage(
                out,
                "dense",
                stage_key(settings, "dense", results.get("scale", results["map"]).key, place, *cut),
                (dense,),
                lambda: dense_step(store, sparse, dense, settings, ball, fixed, wishes.crop, progress),
            )
        if settings.mesh and wishes.until == "mesh":
            results["mesh"] = mesh_model(out, settings, progress)
    figures: dict[str, Any] = dict.fromkeys(LATER)
    for result in results.values():
        figures |= result.figures
    figures["lenses"] = named_lenses(figures["lenses"], groups)
    figures["left_out"] = figures["left_out"] + [
        {"name": photo.name, "partner": None, "matches": 0, "why": "no known camera"} for photo in strangers
    ]
    by_fixes = figures["scale_fixes"] is not None and figures["scale_fixes"]["used"]
    if references is None and bars is None and not by_fixes:
        figures["point_spacing_mm"] = None
    model = Model(
        images=len(found) + len(strangers),
        duplicates=duplicates,
        passed_over=unsupported_files(photos),
        wall_s=time.perf_counter() - start,
        stages_s={name: result.wall_s for name, result in results.items()},
        skipped=tuple(name for name, result in results.items() if result.skipped),
        **figures,
    )
    write_json(out / "reconstruction.json", model.summary())
    return model


def _poses(
    settings: ReconstructionSettings, positions: dict[str, Array] | None, rotations: dict[str, Array] | None
) -> Poses | None:
    """Poses to match and map from: of the photos whose place and turn are both known; None if they are not wanted."""
    if settings.mapper != "poses" or settings.position_priors:
        return None
    if positions is None or rotations is None:
        return None
    return {name: (np.asarray(rotations[name]), p) for name, p in positions.items() if name in rotations}


def _ball(region: tuple[Array, float] | None, references: dict[str, Array] | None) -> RegionOfInterest | None:
    if region is None:
        return None
    if references is None:
        raise InputError("region of interest: needs reference positions, else the model has no frame to place it in")
    centre, radius = region
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"region of interest: radius {radius:g} m, must be above 0")
    return RegionOfInterest(centre_W_m=np.asarray(centre, dtype=np.float64), radius_m=float(radius))

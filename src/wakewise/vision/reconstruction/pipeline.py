"""Photogrammetry pipeline: a folder of photographs to a 3D model in stages that take files and leave files.

match -> map -> scale -> dense -> mesh. Each stage is skipped if its files were made from the same input. The module is
long because the record of a model has all figures of all stages.
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
from wakewise.vision.reconstruction.outputs.meshing import mesh_model, mesh_warnings
from wakewise.vision.reconstruction.photos.known_cameras import KnownCameras, match_known, match_references
from wakewise.vision.reconstruction.photos.lens_groups import LensGroup, group_photos, known_groups, named_lenses
from wakewise.vision.reconstruction.photos.lenses import Lens
from wakewise.vision.reconstruction.photos.masks import read_masks
from wakewise.vision.reconstruction.photos.photo_folder import (
    PHOTOS_FILE,
    Photo,
    PhotoStore,
    digests,
    read_photos,
    refuse_other_photos,
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
from wakewise.vision.reconstruction.sfm.mapping import MAPPINGS, map_photos
from wakewise.vision.reconstruction.sfm.pairs import (
    BAND_NEIGHBOURS,
    POSE_NEIGHBOURS,
    RETRIEVED_NEIGHBOURS,
    Pairs,
    choose_pairs,
    uses_retrieval,
)
from wakewise.vision.reconstruction.sfm.pose_mapping import common_region
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
    """Axis-aligned box of the model that is kept: two corners in its units (m if it has a scale)."""

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
    """Options of a reconstruction. bars, fixes: lengths and camera positions that give the scale; masks: a folder of
    them; crop: box of the dense points and the mesh; until: the last stage.
    """

    bars: ScaleBars | None = None
    fixes: PositionFixes | None = None
    masks: Path | None = None
    crop: CropBox | None = None
    until: Literal["sparse", "dense", "mesh"] = "mesh"


def crop_cloud(path: Path, box: CropBox) -> int:
    """Crop a cloud on disk to a box; the number of points left.

    Raises StageError if too little is left, with the extent of the points.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Inputs:
    """What the stages work on. `fixed`: the poses are known and stay; `retrieved`: neighbours by image retrieval."""

    settings: ReconstructionSettings
    request: ReconstructionRequest
    store: PhotoStore
    photos: tuple[Photo, ...]
    groups: tuple[LensGroup, ...]
    focal_px: float | None
    pairs: Pairs
    retrieved: int
    references: dict[str, Array] | None
    poses: Poses | None
    fixed: bool
    region: RegionOfInterest | None


def _match(job: _Inputs, database: Path, progress: Progress) -> dict[str, Any]:
    """Photos to database.db."""
    count = len(job.photos)
    need_room(database.parent, database_bytes(count, len(job.pairs) + job.retrieved * count, job.settings), "match")
    return match_photos(
        job.store.folder,
        job.photos,
        database,
        job.settings,
        focal_px=job.focal_px,
        pairs=job.pairs,
        progress=progress,
        store=job.store,
        groups=job.groups,
        poses=job.poses,
        may_be_none=job.fixed,
        retrieved=job.retrieved,
    )


def _map(job: _Inputs, database: Path, sparse: Path, poses_fit: bool, progress: Progress) -> dict[str, Any]:
    """database.db to sparse/. `poses_fit`: enough pairs were verified along the epipolar lines of the poses."""
    # Points and tracks are a part of what the database holds; it is copied.
    need_room(sparse.parent, 2.0 * database.stat().st_size, "map")
    return map_photos(
        job.store.folder,
        database,
        sparse,
        job.settings,
        photos=len(job.photos),
        references=job.references,
        progress=progress,
        store=job.store,
        poses=job.poses if poses_fit and not job.fixed else None,
        fixed=job.poses if job.fixed else None,
    )


def _scale(job: _Inputs, sparse: Path, progress: Progress) -> dict[str, Any]:
    """sparse/ in metres. References give the scale, else bars, else fixes; the others check it."""
    figures: dict[str, Any] = {}
    bars, fixes, referred = job.request.bars, job.request.fixes, job.references is not None
    if bars is not None:
        figures |= scale_model(job.store, sparse, bars, job.settings.threads, progress, keep=referred)
    if fixes is not None:
        figures |= place_model(sparse, fixes, keep=referred or bars is not None)
    return figures


def _densify(job: _Inputs, sparse: Path, dense: Path, progress: Progress) -> dict[str, Any]:
    """sparse/ to dense.ply, cut to the requested box."""
    region, folder, crop = job.region, job.store.folder, job.request.crop
    if job.fixed and region is None:
        region = common_region(pycolmap.Reconstruction(sparse))
    if job.settings.dense == "patch-match":
        figures = patch_match(folder, sparse, dense, job.settings, region=region, progress=progress)
    else:
        figures = densify(folder, sparse, dense, job.settings, region=region, progress=progress, store=job.store)
    return figures if crop is None else figures | {"dense_points": crop_cloud(dense, crop)}


LATER = ("scale_bars", "scale_fixes", "dense_points", "depth_maps", "point_spacing_mm", *MESH_FIGURES)
"""Figures of optional stages."""


@dataclass(frozen=True, kw_only=True)
class Model:
    """Figures of a reconstruction, written as `reconstruction.json`.

    pairs, verified_pairs, posed_pairs: image pairs matched, verified, and verified along epipolar lines of known poses.
    mapping: one of `MAPPINGS`; poses_refused: why known poses were not used. reprojection_px: mean over the
    observations kept; reprojection_uncut_px: before the last cuts, which took cut_pct of them. reprojection_met: the
    mean is below the settings' bound and nothing in `ModelEvidence` speaks against the model; warnings: reasons against
    the model by that evidence, and against its surface. second_opinion_pct: displacement of the cameras, of their
    spread, if each photo has intrinsics of its own. lenses: name, focal length, size and photos of each; lenses_split:
    photos that seemed to share one did not. left_out: each unregistered photo, its best partner and their matches.
    sub_models: registered photos of each model; the first is kept. duplicates: photos with the bytes of another.
    passed_over: files that are not read, by kind. cameras_rmse_mm: distance of registered cameras from their references
    after the similarity. suspicion: set if lengths cannot be metres. scale_bars, scale_fixes: see `scale.stage`.
    stages_s: duration of each stage when it ran; `skipped`: finished before. wall_s: this call. Lengths are None for a
    model without scale.
    """

    images: int
    duplicates: int
    registered_images: int
    points: int
    reprojection_px: float
    reprojection_met: bool
    reprojection_uncut_px: float
    cut_pct: float
    warnings: list[str]
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
    mesh_cell_mm: float | None
    mesh_bare_pct: float | None
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
            key: reason.get(key, "no reference cameras were given") for key, value in figures.items() if value is None
        }
        if self.mapping == MAPPINGS["known"]:
            why |= {
                key: "the cameras are as they were given" for key in why if key.startswith(("cameras_", "reference_"))
            }
            why |= {key: "given cameras are not questioned" for key in why if key == "second_opinion_pct"}
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
    request: ReconstructionRequest | None = None,
    replace: bool = False,
    progress: Progress = no_progress,
) -> Model:
    """Photos to a model in `out`: database.db, sparse/, dense.ply, mesh.ply, reconstruction.json.

    A stage whose files were made from the same photos with the same settings is skipped. `focal_px`: initial focal
    length, refined. `lens`: intrinsics of all photos, or by name of a group; refined unless the settings say no.
    `lens_patterns`: names of lenses and shell patterns of their photos' names. `pairs`: names of the photos to match;
    the settings choose if not given. `reference_positions`: camera centres in m, shape (3,), by photo name; they fix
    scale and frame. `reference_rotations`: R_WC, shape (3, 3), by photo name, in the same frame: pairs are then chosen,
    matched and mapped from the poses, if the settings allow it and the poses fit. `region`: centre, shape (3,), and
    radius, in m in the frame of the references, of the dense model. `known`: poses and intrinsics instead of references
    and lenses, fixed or initial as the settings say. `replace`: a model of other photos in `out`. `progress` is called
    with (done, total, note) of each stage.

    Raises InputError if the photos, references, pairs or region cannot be used; StageError if too little of it fits
    together; EnvironmentFailure if the disk is full, or a file cannot be read or written.
    """
    start = time.perf_counter()
    if out.resolve() == photos.resolve():
        raise InputError(f"{out}: is the folder of the photos, the model must go elsewhere (--out)")
    settings = settings or ReconstructionSettings()
    if settings.dense == "patch-match":
        require_cuda()
    found, duplicates = without_duplicates(read_photos(photos, store := PhotoStore(photos), settings.threads))
    without_pose: tuple[Photo, ...] = ()
    fixed = known is not None and settings.known_cameras == "fixed"
    if known is not None:
        if reference_positions is not None or reference_rotations is not None or focal_px is not None:
            raise InputError("cameras: known cameras are references and lenses; give no others beside them")
        known = match_known(known, found)
        reference_positions, reference_rotations = known.positions, known.rotations
        if fixed:
            without_pose = tuple(photo for photo in found if photo.name not in known.positions)
            found = tuple(photo for photo in found if photo.name in known.positions)
    names = [photo.name for photo in found]
    request = request or ReconstructionRequest()
    store.masks = read_masks(photos, found, request.masks)
    if focal_px is not None and not (np.isfinite(focal_px) and focal_px > 0):
        raise InputError(f"focal length: {focal_px:g} px, must be above 0")
    if lens is not None and focal_px is not None:
        raise InputError("camera: give either a focal length or a calibrated camera, not both")
    groups = group_photos(found, lens_patterns, lens)
    if known is not None and (fixed or known.lenses):
        given = {photo: group.lens for group in groups for photo in group.photos if group.lens is not None}
        groups = known_groups(found, given | known.lenses)
    references = reference_positions
    if references is not None and not fixed:
        references = match_references(references, names)
    if settings.position_priors and references is None:
        raise InputError("position priors: need known camera positions")
    axes = None if reference_rotations is None else {name: R[:, 2] for name, R in reference_rotations.items()}
    poses = _poses(settings, references, reference_rotations)
    if fixed and known is not None:
        poses = {name: (known.rotations[name], known.positions[name]) for name in names}
    near = POSE_NEIGHBOURS if poses is None else BAND_NEIGHBOURS
    listed = choose_pairs(names, settings, references, axes, near) if pairs is None else [(a, b) for a, b in pairs]
    retrieval = pairs is None and poses is None and uses_retrieval(len(names), settings)
    job = _Inputs(
        settings=settings,
        request=request,
        store=store,
        photos=found,
        groups=groups,
        focal_px=focal_px,
        pairs=listed,
        retrieved=RETRIEVED_NEIGHBOURS if retrieval else 0,
        references=references,
        poses=poses,
        fixed=fixed,
        region=_region(region, references),
    )
    results = _run_stages(job, out, replace, progress)
    figures: dict[str, Any] = dict.fromkeys(LATER)
    for result in results.values():
        figures |= result.figures
    figures["lenses"] = named_lenses(figures["lenses"], groups)
    figures["left_out"] = figures["left_out"] + [
        {"name": photo.name, "partner": None, "matches": 0, "why": "no known camera"} for photo in without_pose
    ]
    by_fixes = figures["scale_fixes"] is not None and figures["scale_fixes"]["used"]
    if references is None and request.bars is None and not by_fixes:
        figures["point_spacing_mm"] = figures["mesh_cell_mm"] = None
    figures["warnings"] = figures["warnings"] + mesh_warnings(figures)
    model = Model(
        images=len(found) + len(without_pose),
        duplicates=duplicates,
        passed_over=unsupported_files(photos),
        wall_s=time.perf_counter() - start,
        stages_s={name: result.wall_s for name, result in results.items()},
        skipped=tuple(name for name, result in results.items() if result.skipped),
        **figures,
    )
    write_json(out / PHOTOS_FILE, digests(found))
    write_json(out / "reconstruction.json", model.summary())
    return model


def _run_stages(job: _Inputs, out: Path, replace: bool, progress: Progress) -> dict[str, StageResult]:
    """Run the requested stages, each unless it was done with the same input."""
    make_folder(out)
    settings, request, region = job.settings, job.request, job.region
    database, sparse, dense = out / "database.db", out / "sparse", out / "dense.ply"
    begun = None if job.poses is None else {n: [*R.ravel().tolist(), *p.tolist()] for n, (R, p) in job.poses.items()}
    placed = None if job.references is None else {name: place.tolist() for name, place in job.references.items()}
    results: dict[str, StageResult] = {}
    with exclusive_run(out):
        if not replace:
            refuse_other_photos(out, job.photos)
        key = stage_key(
            settings,
            "match",
            "",
            [asdict(photo) for photo in job.photos],
            job.focal_px,
            [[g.name, g.photos, g.lens and g.lens.numbers()] for g in job.groups],
            job.pairs,
            begun,
            job.retrieved,
            *([] if job.store.masks is None else [job.store.masks.digests]),
        )
        results["match"] = run_stage(out, "match", key, (database,), lambda: _match(job, database, progress))
        matched = results["match"].figures
        fit = 2 * matched["posed_pairs"] >= matched["pairs"]
        key = stage_key(settings, "map", key, placed, job.fixed)
        model = (sparse / "images.bin",)
        scaled = request.bars is not None or request.fixes is not None
        if not scaled:
            invalidate_stage(out, "scale", "map")
        results["map"] = run_stage(out, "map", key, model, lambda: _map(job, database, sparse, fit, progress))
        if scaled:
            bars, fixes = request.bars and request.bars.key(), request.fixes and request.fixes.key()
            key = stage_key(settings, "scale", key, bars, fixes)
            results["scale"] = run_stage(out, "scale", key, model, lambda: _scale(job, sparse, progress))
        if request.until != "sparse":
            place = None if region is None else [region.centre_W_m.tolist(), region.radius_m]
            key = stage_key(settings, "dense", key, place, *([] if request.crop is None else [request.crop.key()]))
            results["dense"] = run_stage(out, "dense", key, (dense,), lambda: _densify(job, sparse, dense, progress))
        if settings.mesh and request.until == "mesh":
            results["mesh"] = mesh_model(out, settings, progress)
    return results


def _poses(
    settings: ReconstructionSettings, positions: dict[str, Array] | None, rotations: dict[str, Array] | None
) -> Poses | None:
    """Poses to match and map from: of the photos whose place and turn are both known; None if not to be used."""
    if settings.mapper != "poses" or settings.position_priors:
        return None
    if positions is None or rotations is None:
        return None
    return {name: (np.asarray(rotations[name]), p) for name, p in positions.items() if name in rotations}


def _region(region: tuple[Array, float] | None, references: dict[str, Array] | None) -> RegionOfInterest | None:
    if region is None:
        return None
    if references is None:
        raise InputError("region of interest: needs reference positions, else the model has no frame to place it in")
    centre, radius = region
    if not (np.isfinite(radius) and radius > 0 and np.isfinite(centre).all()):
        raise InputError(f"region of interest: {centre}, radius {radius:g} m, must be finite and the radius above 0")
    return RegionOfInterest(centre_W_m=np.asarray(centre, dtype=np.float64), radius_m=float(radius))

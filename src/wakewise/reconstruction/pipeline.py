"""The whole way from a folder of photos to a model, stage by stage; each can be rerun from its files."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.files import write_json
from wakewise.interfaces import Progress, no_progress
from wakewise.processes import alone
from wakewise.reconstruction.colmap import pycolmap
from wakewise.reconstruction.dense import densify
from wakewise.reconstruction.features import check_sizes, database_bytes, match_photos
from wakewise.reconstruction.guided import Poses
from wakewise.reconstruction.lenses import Lens
from wakewise.reconstruction.mapping import map_photos
from wakewise.reconstruction.meshing import mesh_points
from wakewise.reconstruction.pairs import BAND_NEIGHBOURS, POSE_NEIGHBOURS, Pairs, choose_pairs
from wakewise.reconstruction.patchmatch import patch_match, require_cuda
from wakewise.reconstruction.photos import Photo, PhotoStore, read_photos, without_duplicates
from wakewise.reconstruction.references import match_references
from wakewise.reconstruction.settings import ReconstructionSettings
from wakewise.reconstruction.stages import StageResult, fingerprint, make_folder, need_room, read_stamp, run_stage
from wakewise.reconstruction.views import Ball

# Part of every stage's fingerprint: raise it when a stage's result changes for the same input.
VERSION = 7
_STAGES = {
    "match": ("detector", "max_features", "first_octave"),
    "map": (
        "mapper",
        "refine_camera",
        "reprojection_px",
        "position_priors",
        "prior_sigma_m",
    ),
    "dense": ("dense", "dense_px", "dense_zoom", "stereo_paths", "stereo_partners", "agreeing_views"),
    "mesh": ("mesh_depth",),
}


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a reconstruction is; written as `reconstruction.json`.

    pairs, verified_pairs, posed_pairs: of photos that were matched, that show the same, and those of them that were
    matched along epipolar lines of known poses. mapping: how the sparse model came about; poses_refused: why not from
    known poses where that was tried. reprojection_px: mean over all observations. cameras_rmse_mm: distance of
    registered cameras from their references after the similarity, None without references. reprojection_met: whether
    the mean is below what the settings wish. duplicates: photos left out because another has the same bytes. suspicion:
    a word where lengths cannot be metres. stages_s: what each stage took when it ran; `skipped` were done before.
    wall_s: this call. A model without references has no scale, so its lengths are None.
    """

    images: int
    duplicates: int
    registered_images: int
    points: int
    reprojection_px: float
    reprojection_met: bool
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
    dense_points: int
    depth_maps: int
    point_spacing_mm: float | None
    mesh_vertices: int | None
    mesh_faces: int | None
    wall_s: float
    stages_s: dict[str, float]
    skipped: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """All figures as plain values for JSON, with a reason (`why`) for each that is null."""
        figures = {**asdict(self), "skipped": list(self.skipped)}
        reason = {
            "mesh_vertices": "no mesh was asked for, or it is made after the figures",
            "mesh_faces": "no mesh was asked for, or it is made after the figures",
            "suspicion": "nothing looks suspicious",
            "poses_refused": "the model came from known poses, or none were given, or hardly a pair fitted them",
        }
        why = {
            key: reason.get(key, "no reference cameras were given, so the model has no scale")
            for key, value in figures.items()
            if value is None
        }
        return figures | {"why": why}


def reconstruct(
    photos: Path,
    out: Path,
    settings: ReconstructionSettings | None = None,
    *,
    focal_px: float | None = None,
    lens: Lens | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    reference_positions: dict[str, Array] | None = None,
    reference_rotations: dict[str, Array] | None = None,
    region: tuple[Array, float] | None = None,
    progress: Progress = no_progress,
) -> Model:
    """Photos to a model in `out`: database.db, sparse/, dense.ply, mesh.ply, reconstruction.json.

    A stage whose files are there, made from the same photos with the same settings, is skipped.

    Parameters
    ----------
    photos : Path
        Folder of photographs.
    focal_px : float, optional
        Focal length in pixels to start from; it is refined.
    lens : Lens, optional
        Camera that took all the photos, such as a trial's in its cameras.txt; refined unless the settings say no.
    pairs : sequence of two photo names, optional
        Which photos to match; else the settings choose.
    reference_positions : dict, optional
        Camera centres in m, shape (3,), by photo name; they fix scale and frame.
    reference_rotations : dict, optional
        R_WC, shape (3, 3), by photo name, in the frame of the references (optical axis last): with them pairs are
        chosen, matched and mapped from the poses, unless the settings say no or the photos say that they do not fit.
    region : (centre, radius), optional
        What the dense model is wanted of, in the frame of the references: shape (3,) in m, and m.
    progress : callable
        Called with (done, total, note) in units of a stage's own work.

    Raises
    ------
    InputError
        If the photos, references, pairs or region cannot be used.
    StageError
        If too little of it fits together.
    EnvironmentFailure
        If the disk is full, or a file cannot be read or written.
    """
    start = time.perf_counter()
    if out.resolve() == photos.resolve():
        raise InputError(f"{out}: is the folder of the photos, the model must go elsewhere")
    settings = settings or ReconstructionSettings()
    if settings.dense == "patch-match":
        require_cuda()
    store = PhotoStore(photos)
    found, duplicates = without_duplicates(read_photos(photos, store, settings.threads))
    names = [photo.name for photo in found]
    if focal_px is not None and not (np.isfinite(focal_px) and focal_px > 0):
        raise InputError(f"focal length: {focal_px:g} px, must be above 0")
    if lens is not None:
        if focal_px is not None:
            raise InputError("camera: give either a focal length or a calibrated camera, not both")
        check_sizes(found, lens)
    references = None if reference_positions is None else match_references(reference_positions, names)
    if settings.position_priors and references is None:
        raise InputError("position priors: need known camera positions")
    ball = _ball(region, references)
    axes = None if reference_rotations is None else {name: R[:, 2] for name, R in reference_rotations.items()}
    poses = _poses(settings, references, reference_rotations)
    known = None if poses is None else {n: [*R.ravel().tolist(), *p.tolist()] for n, (R, p) in poses.items()}
    near = POSE_NEIGHBOURS if poses is None else BAND_NEIGHBOURS
    listed = choose_pairs(names, settings, references, axes, near) if pairs is None else [(a, b) for a, b in pairs]
    make_folder(out)
    database, sparse, dense = out / "database.db", out / "sparse", out / "dense.ply"

    results: dict[str, StageResult] = {}
    with alone(out):
        results["match"] = run_stage(
            out,
            "match",
            _key(
                settings,
                "match",
                "",
                [asdict(photo) for photo in found],
                focal_px,
                lens and lens.numbers(),
                listed,
                known,
            ),
            (database,),
            lambda: _match(store, found, database, settings, focal_px, lens, listed, poses, progress),
        )
        fit = 2 * results["match"].figures["posed_pairs"] >= results["match"].figures["pairs"]
        placed = None if references is None else {name: position.tolist() for name, position in references.items()}
        results["map"] = run_stage(
            out,
            "map",
            _key(settings, "map", results["match"].key, placed),
            (sparse / "images.bin",),
            lambda: _map(store, database, sparse, settings, len(found), references, poses if fit else None, progress),
        )
        place = None if ball is None else [ball.centre_W_m.tolist(), ball.radius_m]
        results["dense"] = run_stage(
            out,
            "dense",
            _key(settings, "dense", results["map"].key, place),
            (dense,),
            lambda: _densify(store, sparse, dense, settings, ball, progress),
        )
        if settings.mesh:
            results["mesh"] = mesh_model(out, settings, progress)
    figures: dict[str, Any] = {"mesh_vertices": None, "mesh_faces": None}
    for result in results.values():
        figures |= result.figures
    if references is None:
        figures["point_spacing_mm"] = None
    model = Model(
        images=len(found),
        duplicates=duplicates,
        wall_s=time.perf_counter() - start,
        stages_s={name: result.wall_s for name, result in results.items()},
        skipped=tuple(name for name, result in results.items() if result.skipped),
        **figures,
    )
    write_json(out / "reconstruction.json", model.summary())
    return model


def mesh_model(
    out: Path, settings: ReconstructionSettings, progress: Progress = no_progress, *, held: bool = False
) -> StageResult:
    """Make mesh.ply of a model whose dense points are there, unless it was made of them already.

    No figure of a model needs its surface, so this may come after all that does. `held`: the process that started this
    one keeps others out of the folder.

    Raises
    ------
    InputError
        If there are no dense points of a reconstruction.
    StageError
        If no surface comes out of them.
    EnvironmentFailure
        If the disk is full, or a file cannot be read or written.
    """
    dense, mesh = out / "dense.ply", out / "mesh.ply"
    known = read_stamp(out, "dense")
    if not known or not dense.is_file():
        raise InputError(f"{out}: holds no dense points of a reconstruction (dense.ply, stages/dense.json)")
    spacing = 1e-3 * known["figures"]["point_spacing_mm"]
    with nullcontext() if held else alone(out):
        return run_stage(
            out,
            "mesh",
            _key(settings, "mesh", known["key"]),
            (mesh,),
            lambda: mesh_points(dense, mesh, settings, spacing_m=spacing, progress=progress),
        )


def _key(settings: ReconstructionSettings, stage: str, before: str, *parts: Any) -> str:
    """Fingerprint of all that a stage's result hangs on; `before` is that of the stage before."""
    used = {field: getattr(settings, field) for field in _STAGES[stage]}
    return fingerprint(VERSION, pycolmap.__version__, stage, before, used, parts)


def _match(
    store: PhotoStore,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    focal_px: float | None,
    lens: Lens | None,
    pairs: Pairs,
    poses: Poses | None,
    progress: Progress,
) -> dict[str, Any]:
    need_room(database.parent, database_bytes(len(photos), len(pairs), settings), "match")
    return match_photos(
        store.folder,
        photos,
        database,
        settings,
        focal_px=focal_px,
        pairs=pairs,
        progress=progress,
        store=store,
        lens=lens,
        poses=poses,
    )


def _map(
    store: PhotoStore,
    database: Path,
    sparse: Path,
    settings: ReconstructionSettings,
    photos: int,
    references: dict[str, Array] | None,
    poses: Poses | None,
    progress: Progress,
) -> dict[str, Any]:
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
        poses=poses,
    )


def _densify(
    store: PhotoStore,
    sparse: Path,
    dense: Path,
    settings: ReconstructionSettings,
    region: Ball | None,
    progress: Progress,
) -> dict[str, Any]:
    if settings.dense == "patch-match":
        return patch_match(store.folder, sparse, dense, settings, region=region, progress=progress)
    return densify(store.folder, sparse, dense, settings, region=region, progress=progress, store=store)


def _poses(
    settings: ReconstructionSettings, positions: dict[str, Array] | None, rotations: dict[str, Array] | None
) -> Poses | None:
    """Poses to match and map from: of the photos whose place and turn are both known; None if they are not wanted."""
    if settings.mapper != "poses" or settings.position_priors:
        return None
    if positions is None or rotations is None:
        return None
    return {name: (np.asarray(rotations[name]), p) for name, p in positions.items() if name in rotations}


def _ball(region: tuple[Array, float] | None, references: dict[str, Array] | None) -> Ball | None:
    if region is None:
        return None
    if references is None:
        raise InputError("region of interest: needs reference positions, else the model has no frame to place it in")
    centre, radius = region
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"region of interest: radius {radius:g} m, must be above 0")
    return Ball(centre_W_m=np.asarray(centre, dtype=np.float64), radius_m=float(radius))

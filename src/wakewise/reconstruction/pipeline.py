"""The whole way from a folder of photos to a model, stage by stage; each can be rerun from its files."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.files import write_json
from wakewise.interfaces import Progress, no_progress
from wakewise.reconstruction.dense import densify
from wakewise.reconstruction.features import match_photos
from wakewise.reconstruction.mapping import map_photos
from wakewise.reconstruction.meshing import mesh_points
from wakewise.reconstruction.photos import read_photos
from wakewise.reconstruction.references import match_references
from wakewise.reconstruction.settings import ReconstructionSettings
from wakewise.reconstruction.stages import StageResult, fingerprint, run_stage
from wakewise.reconstruction.views import Ball

# Part of every stage's fingerprint: raise it when a stage's result changes for the same input.
VERSION = 4
_STAGES = {
    "match": ("max_features", "first_octave", "peak_threshold", "exhaustive_up_to", "sequence_overlap", "random_seed"),
    "map": ("min_registered", "random_seed"),
    "dense": ("dense_px", "dense_zoom", "stereo_partners", "agreeing_views", "agreement_px"),
    "mesh": ("mesh_depth",),
}


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a reconstruction is; written as `reconstruction.json`.

    reprojection_px: mean over all observations. cameras_rmse_mm: distance of registered cameras from their references
    after the similarity, None without references. stages_s: what each stage took when it ran; `skipped` were done
    before. wall_s: this call. A model without references has no scale, so its lengths are None.
    """

    images: int
    registered_images: int
    points: int
    reprojection_px: float
    track_length: float
    focal_px: float
    features_per_image: float
    inlier_matches: int
    verified_pairs: int
    cameras_rmse_mm: float | None
    cameras_max_mm: float | None
    reference_inliers: int | None
    scale: float | None
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
        reason = {"mesh_vertices": "no mesh was asked for", "mesh_faces": "no mesh was asked for"}
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
    pairs: Sequence[tuple[str, str]] | None = None,
    reference_positions: dict[str, Array] | None = None,
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
    pairs : sequence of two photo names, optional
        Which photos to match, such as neighbours by the vehicle's own estimate of its pose.
    reference_positions : dict, optional
        Camera centres in m, shape (3,), by photo name; they fix scale and frame.
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
    """
    start = time.perf_counter()
    settings = settings or ReconstructionSettings()
    found = read_photos(photos)
    names = [photo.name for photo in found]
    if focal_px is not None and not (np.isfinite(focal_px) and focal_px > 0):
        raise InputError(f"focal length: {focal_px:g} px, must be above 0")
    references = None if reference_positions is None else match_references(reference_positions, names)
    ball = _ball(region, references)
    out.mkdir(parents=True, exist_ok=True)
    database, sparse, dense, mesh = out / "database.db", out / "sparse", out / "dense.ply", out / "mesh.ply"
    listed = None if pairs is None else [(a, b) for a, b in pairs]

    def key(stage: str, before: str, *parts: Any) -> str:
        used = {field: getattr(settings, field) for field in _STAGES[stage]}
        return fingerprint(VERSION, pycolmap.__version__, stage, before, used, parts)

    results: dict[str, StageResult] = {}
    results["match"] = run_stage(
        out,
        "match",
        key("match", "", [asdict(photo) for photo in found], focal_px, listed),
        (database,),
        lambda: match_photos(photos, found, database, settings, focal_px=focal_px, pairs=listed, progress=progress),
    )
    placed = None if references is None else {name: position.tolist() for name, position in references.items()}
    results["map"] = run_stage(
        out,
        "map",
        key("map", results["match"].key, placed),
        (sparse / "images.bin",),
        lambda: map_photos(
            photos, database, sparse, settings, photos=len(found), references=references, progress=progress
        ),
    )
    place = None if ball is None else [ball.centre_W_m.tolist(), ball.radius_m]
    results["dense"] = run_stage(
        out,
        "dense",
        key("dense", results["map"].key, place),
        (dense,),
        lambda: densify(photos, sparse, dense, settings, region=ball, progress=progress),
    )
    if settings.mesh:
        spacing = 1e-3 * results["dense"].figures["point_spacing_mm"]
        results["mesh"] = run_stage(
            out,
            "mesh",
            key("mesh", results["dense"].key),
            (mesh,),
            lambda: mesh_points(dense, mesh, settings, spacing_m=spacing, progress=progress),
        )
    figures: dict[str, Any] = {"mesh_vertices": None, "mesh_faces": None}
    for result in results.values():
        figures |= result.figures
    if references is None:
        figures["point_spacing_mm"] = None
    model = Model(
        images=len(found),
        wall_s=time.perf_counter() - start,
        stages_s={name: result.wall_s for name, result in results.items()},
        skipped=tuple(name for name, result in results.items() if result.skipped),
        **figures,
    )
    write_json(out / "reconstruction.json", model.summary())
    return model


def _ball(region: tuple[Array, float] | None, references: dict[str, Array] | None) -> Ball | None:
    if region is None:
        return None
    if references is None:
        raise InputError("region of interest: needs reference positions, else the model has no frame to place it in")
    centre, radius = region
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"region of interest: radius {radius:g} m, must be above 0")
    return Ball(centre_W_m=np.asarray(centre, dtype=np.float64), radius_m=float(radius))

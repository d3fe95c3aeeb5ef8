"""A neural field of a trial, judged as its dense cloud is; or of any other model, which has no truth to judge by."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import polars as pl

from wakewise.core.errors import StageError
from wakewise.core.files import write_json
from wakewise.core.interfaces import Progress
from wakewise.experiments.trials.trial import MAIN_SURFACE_FIGURES, REGION_SHARE
from wakewise.operation import read_scenario
from wakewise.vision.evaluation import Crop, evaluate_surface
from wakewise.vision.reconstruction import read_cloud
from wakewise_nerf.field import FieldSettings, build_field

_FIGURES = (*MAIN_SURFACE_FIGURES, "success")


def is_trial(folder: Path) -> bool:
    """Whether a folder is a trial's, so that region and truth are known."""
    return (folder / "scenario.yaml").is_file() and (folder / "images.csv").is_file()


def field_of_model(
    folder: Path,
    photos: Path,
    out: Path,
    settings: FieldSettings,
    *,
    region: tuple[Any, float] | None,
    device: str,
    mesh: bool,
    progress: Progress,
) -> dict[str, Any]:
    """Train a field of a model without a truth; the figures of `build_field`, and a reason for those of the surface."""
    figures = build_field(folder, photos, out, settings, region=region, device=device, mesh=mesh, progress=progress)
    names = [name for key in _FIGURES for name in (key, f"dense_{key}")]
    reason = "the folder is no trial, so there is no truth to measure against"
    why = figures["why"] | dict.fromkeys(names, reason)
    return {**figures, **dict.fromkeys(names), "why": why}


def field_of_trial(
    folder: Path,
    photos: Path,
    out: Path,
    settings: FieldSettings,
    *,
    region: tuple[Any, float] | None,
    device: str,
    mesh: bool,
    progress: Progress,
) -> dict[str, Any]:
    """Train a field of a trial and measure its points against the truth, beside the dense cloud (`dense_...`).

    Nothing true goes into the field: poses are the model's, the region is the plan's. Writes metrics.json in `out`.
    """
    parts = read_scenario(folder / "scenario.yaml").parts()
    planned = (parts.surveyed_target.centre_W_m, REGION_SHARE * parts.surveyed_target.radius_m)
    figures = build_field(
        folder, photos, out, settings, region=region or planned, device=device, mesh=mesh, progress=progress
    )
    centres = pl.read_csv(folder / "images.csv").select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    why = dict(figures["why"])
    for prefix, cloud in (("", out / "points.ply"), ("dense_", folder / "dense.ply")):
        try:
            if not cloud.is_file():
                raise StageError(f"the trial left no {cloud.name}")
            score = evaluate_surface(
                read_cloud(cloud).points_m,
                parts.target.mesh,
                crop=Crop(bed_z_m=parts.target.bed_z_m),
                camera_centres_W_m=centres,
            )
            figures |= {prefix + key: getattr(score, key) for key in _FIGURES}
        except StageError as fault:
            figures |= dict.fromkeys(prefix + key for key in _FIGURES)
            why |= dict.fromkeys((prefix + key for key in _FIGURES), str(fault))
    result = {**figures, "why": why}
    write_json(out / "metrics.json", result)
    return result

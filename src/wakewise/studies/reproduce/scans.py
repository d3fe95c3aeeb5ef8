"""Work of a campaign: one whole scan and its model, of which the pictures that a page shows are kept.

What stays in the trial's folder: `metrics.json`; `model.npz`, points of the model with their errors; three photographs,
0, 5 and 10 s after the first. The rest, some fifty megabytes, goes.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl

from wakewise.errors import StageError
from wakewise.evaluation import Crop, compare_surface
from wakewise.evaluation.extent import area_and_volume
from wakewise.files import whole_file, write_json
from wakewise.interfaces import Progress
from wakewise.operation import Parts, Scenario
from wakewise.reconstruction import read_cloud
from wakewise.targets import read_mesh
from wakewise.trials import run_trial

FIGURES = (
    "rmse_mm",
    "rmse_mean_shape_mm",
    "accuracy_median_mm",
    "completeness_pct",
    "completeness_visible_pct",
    "registered_images",
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "exposure_optical_depth",
    "ray_optical_depth",
    "silt_lifted_g",
    "sway_rms_mm",
    "sway_wash_mm",
    "position_rmse_mm",
    "estimate_rmse_mm",
    "velocity_deviation_pct",
    "roll_pitch_rms_deg",
    "energy_kJ",
    "collisions",
    "fallbacks",
    "duration_s",
)
PICTURES_AT_S = (0.0, 5.0, 10.0)
"""After the first photograph, as the paper shows before and after."""
WIDE_PX, POINTS = 480, 40_000
MODEL = "model.npz"


def scan_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, Any]:
    """Figures of one scan.

    Parameters
    ----------
    settings : mapping
        `fields` of a scenario by dotted names, over the preset `quick`; `extent`, whether area and volume of the model
        are measured, which takes a mesh.

    A model that did not come about is no fault: its figures are missing, `success` is 0 and `failure` says why.
    """
    began = time.process_time()
    extent = bool(settings.get("extent", True))
    fields = dict(settings["fields"]) | {"reconstruction.mesh": extent}
    parts = Scenario.preset("quick", **fields).parts()
    place = folder / "scan"
    told = run_trial(parts, place)
    progress(0.9, 1.0, "figures")
    figures: dict[str, Any] = {key: _plain(told.get(key)) for key in FIGURES}
    figures["success"] = float(bool(told["success"]))
    figures["failure"] = None if told.get("rmse_mm") is not None else str(told["why"].get("rmse_mm", "no model"))
    if extent:
        figures |= _extent(parts, place)
    write_json(folder / "metrics.json", told)
    _keep_model(parts, place, folder)
    _keep_photographs(place, folder)
    shutil.rmtree(place)
    return figures | {"cpu_s": time.process_time() - began}


def photographs_of(folder: Path) -> list[tuple[float, Path]]:
    """Times after the first photograph and files that a scan left."""
    try:
        listed = json.loads((folder / "photographs.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [(float(one["after_s"]), folder / one["file"]) for one in listed]


def _extent(parts: Parts, place: Path) -> dict[str, float | None]:
    """Area and volume of model and truth, and by how much the model is off."""
    crop = Crop(bed_z_m=parts.target.bed_z_m)
    area, volume = area_and_volume(parts.target.mesh, crop)
    found: dict[str, float | None] = {"true_area_cm2": 1e4 * area, "true_volume_cm3": 1e6 * volume}
    path = place / "mesh.ply"
    if not path.is_file():
        return found | {"area_cm2": None, "volume_cm3": None}
    model_area, model_volume = area_and_volume(read_mesh(path), crop)
    return found | {"area_cm2": 1e4 * model_area, "volume_cm3": 1e6 * model_volume}


def _keep_model(parts: Parts, place: Path, folder: Path) -> None:
    """Points of the model with their errors in mm, thinned, for a picture."""
    try:
        compared = compare_surface(
            read_cloud(place / "dense.ply").points_m, parts.target.mesh, crop=Crop(bed_z_m=parts.target.bed_z_m)
        )
    except (StageError, OSError):
        return
    every = max(1, len(compared.points_W_m) // POINTS)
    with whole_file(folder / MODEL) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            points_m=compared.points_W_m[::every].astype(np.float32),
            error_mm=compared.error_mm[::every].astype(np.float32),
        )


def _keep_photographs(place: Path, folder: Path) -> None:
    """The photographs nearest to `PICTURES_AT_S`, small."""
    listed = pl.read_csv(place / "images.csv").sort("time_s")
    times = listed["time_s"].to_numpy() - float(listed["time_s"][0])
    kept = []
    for wished in PICTURES_AT_S:
        row = int(np.argmin(np.abs(times - wished)))
        image = cv2.imread(str(place / "images" / listed["name"][row]), cv2.IMREAD_COLOR)
        if image is None:
            continue
        size = (WIDE_PX, round(WIDE_PX * image.shape[0] / image.shape[1]))
        name = f"photograph-{wished:g}s.jpg"
        coded = cv2.imencode(".jpg", cv2.resize(image, size, interpolation=cv2.INTER_AREA))[1]
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(coded.tobytes())
        kept.append({"after_s": float(times[row]), "file": name})
    write_json(folder / "photographs.json", kept)


def _plain(value: Any) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)

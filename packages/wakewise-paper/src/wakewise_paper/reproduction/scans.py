"""Work of a campaign: one whole scan and its model, of which the pictures that a page shows are kept.

What stays in the trial's folder is `metrics.json` and what a page shows (see
`wakewise.experiments.campaigns.pictures`); the rest, some fifty megabytes, goes.

Work of a campaign that is no flight: wake models against flows. (The planner's is `wakewise_benchmarks.solver`.)
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.files import write_json
from wakewise.core.interfaces import Progress
from wakewise.experiments.campaigns.flights import scenario_of
from wakewise.experiments.campaigns.pictures import keep_pictures
from wakewise.experiments.trials import run_trial
from wakewise.operation import Parts
from wakewise.scene.targets import read_mesh
from wakewise.vision.evaluation import Crop
from wakewise.vision.evaluation.cloud_to_surface import area_and_volume
from wakewise_paper.wake_validation import DEFINITIONS, ValidationOptions, figures, validate

FIGURES = (
    "rmse_mm",
    "rmse_mean_shape_mm",
    "accuracy_median_mm",
    "completeness_pct",
    "completeness_1mm_pct",
    "features_per_image",
    "target_drag_peak_N",
    "bed_over_threshold_s",
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
    "roll_pitch_max_deg",
    "energy_kJ",
    "collisions",
    "fallbacks",
    "duration_s",
)


def scan_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, Any]:
    """Figures of one scan.

    `settings` hold the scenario, and `extent`: whether area and volume of the model are measured, which takes a mesh.

    A model that did not come about is no fault: its figures are missing, `success` is 0 and `failure` says why.
    """
    began = time.process_time()
    extent = bool(settings.get("extent", True))
    parts = scenario_of(settings).replace(**{"reconstruction.mesh": extent}).parts()
    place = folder / "scan"
    told = run_trial(parts, place)
    progress(0.9, 1.0, "figures")
    figures: dict[str, Any] = {key: _plain(told.get(key)) for key in FIGURES}
    figures["success"] = float(bool(told["success"]))
    figures["failure"] = None if told.get("rmse_mm") is not None else str(told["why"].get("rmse_mm", "no model"))
    if extent:
        figures |= _extent(parts, place)
    write_json(folder / "metrics.json", told)
    keep_pictures(parts.target, place, folder)
    shutil.rmtree(place)
    return figures | {"cpu_s": time.process_time() - began}


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


def _plain(value: Any) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def wake_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, float | None]:
    """R2 and bias of every wake model against every flow, as "MODEL/FLOW/FIGURE"; `quick` samples more coarsely.

    All of it is left in wake.json.
    """
    told = figures(validate(ValidationOptions(quick=bool(settings.get("quick", True)), progress=progress)))
    write_json(folder / "wake.json", told)
    return {
        f"{model}/{flow}/{key}": cell[key]
        for model, flows in told["models"].items()
        for flow, cell in flows.items()
        for key in DEFINITIONS
    }

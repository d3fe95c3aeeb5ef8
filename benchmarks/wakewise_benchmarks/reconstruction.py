"""Photographs of three corals in clear water, standard preset: how good the models are, and what they cost.

Each model is made in a process of its own, so that its memory is its own, and then once more from the photographs
alone (`photos_alone`), which is what was done before poses were used. Times are of the wall, as a user waits, from
photographs to figures; the CPU time beside them tells what a loaded machine would hide. The mesh comes after the
figures: `mesh_s` is apart, and its memory is counted.
"""

from __future__ import annotations

import multiprocessing
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import Scenario, load_scenario
from wakewise.scene.targets import stony_kinds
from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise_benchmarks import imaging
from wakewise_benchmarks.peak_memory import peak_memory_MB
from wakewise_paper.photo_sets import judge, planned_views, read_photo_set, write_photos

PRESET, SEED = "standard", 1
_ALONE = ("rmse_mm", "completeness_pct", "completeness_visible_pct", "mapping", "stages_s", "total_s", "total_cpu_s")
_WORST_IS_MOST = ("rmse_mm", "total_s", "total_cpu_s", "memory_MB")


def run(options: BenchOptions) -> dict[str, Any]:
    """Accuracy, completeness, time and memory per coral, and the worst of the three at the top."""
    render_s = float(imaging.run(options)["frame_s"])
    corals: dict[str, dict[str, Any]] = {}
    why: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as scratch:
        for kind in stony_kinds():
            scenario = load_scenario(PRESET, None, {"target.kind": kind, "tank.silt.load_kg_m2": 0.0, "seed": SEED})
            found = model_coral(scenario, Path(scratch) / kind, options)
            if found["failure"] is not None:
                why[kind] = found["failure"]
            corals[kind] = {"rmse_mm": None, "completeness_visible_pct": None, "stages_s": None} | found
            corals[kind] |= {"render_s_per_frame": render_s}

    def worst(key: str, most: bool) -> float | None:
        values = [each[key] for each in corals.values()]
        if any(value is None for value in values):
            why[key] = "a coral has no model"
            return None
        return float(max(values) if most else min(values))

    result: dict[str, Any] = {key: worst(key, True) for key in _WORST_IS_MOST}
    result["completeness_visible_pct"] = worst("completeness_visible_pct", False)
    slowest = max(corals.values(), key=lambda each: float(each["total_s"]))
    result |= {"stages_s": slowest["stages_s"], "render_s_per_frame": render_s, "preset": PRESET, "corals": corals}
    return result | {"why": why}


def model_coral(scenario: Scenario, folder: Path, options: BenchOptions) -> dict[str, Any]:
    """Photograph a scenario's target from its planned orbits, then model and judge it in a process of its own."""
    target = scenario.parts().target
    rng = np.random.default_rng(scenario.seed)
    views = planned_views(target, scenario.mission, scenario.imaging.window_s, rng)
    write_photos(folder, views, None, scenario.imaging, target, seed=scenario.seed, progress=options.progress)
    alone = scenario.reconstruction.model_copy(update={"mapper": "incremental", "mesh": False})
    found, before = (_in_a_process(scenario, folder, settings) for settings in (scenario.reconstruction, alone))
    return found | {
        "photos_alone": {key: before.get(key) for key in _ALONE},
        "cpu_ratio": found["total_cpu_s"] / before["total_cpu_s"],
    }


def _in_a_process(scenario: Scenario, folder: Path, settings: ReconstructionSettings) -> dict[str, Any]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_model, scenario, folder, settings).result()


def _model(scenario: Scenario, folder: Path, settings: ReconstructionSettings) -> dict[str, Any]:
    target = scenario.parts().target
    photos = read_photo_set(folder, scenario.imaging.camera().focal_px)
    out = folder / settings.mapper
    return judge(photos, target, settings, out) | {"memory_MB": peak_memory_MB()}

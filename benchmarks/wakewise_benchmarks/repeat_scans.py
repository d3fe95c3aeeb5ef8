"""Repeat scans of one colony: how far lengths, areas and volumes scatter, and which growth is told.

Written down before the figures were known. Corals of the tank, photographed from planned orbits in clear water
(`wakewise_paper.photo_sets`), each set with camera places, noise and errors of its own and reconstructed by itself; the
same coral again with its surface moved out by 1 and by 3 mm. Sizes are those of `wakewise measure`, changes those of
`wakewise compare-models` from the first scan. CV: standard deviation over mean. Asked: CV of length 0.5 %, of areas and
volume 1 %; 3 mm of growth told, 1 mm not claimed.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import typer

from wakewise.core.errors import StageError
from wakewise.core.interfaces import Progress
from wakewise.operation import Scenario, load_scenario
from wakewise.scene.targets import Mesh, Target
from wakewise.vision.evaluation.measurement import MeasuringRule, measure
from wakewise.vision.evaluation.surface_change import compare_models
from wakewise.vision.reconstruction.quality.finished_models import FinishedModel, read_model
from wakewise_paper.photo_sets import judge, planned_views, write_photos

KINDS = ("brain", "branching")
SCANS, GROWN_MM = 3, (1.0, 3.0)
FIELDS: dict[str, Any] = {
    "tank.silt.load_kg_m2": 0.0,
    "imaging.width": 480,
    "imaging.height": 360,
    "mission.standoff_m": 0.4,
    "mission.elevations_deg": [25.0, 55.0],
    "mission.views": [14, 10],
}
MEASURED = {
    "length": "length_mm",
    "planar_area": "planar_area_cm2",
    "area": "surface_area_cm2",
    "volume": "volume_cm3",
}
ASKED_CV_PCT = {"length": 0.5, "planar_area": 1.0, "area": 1.0, "volume": 1.0}


def repeat_figures(progress: Progress, kinds: tuple[str, ...] = KINDS, scans: int = SCANS) -> dict[str, Any]:
    """CVs in % and verdicts of each kind; at the top the largest CV, whether 3 mm were told and 1 mm claimed."""
    told: dict[str, Any] = {"colonies": {}}
    for number, kind in enumerate(kinds):
        progress(number, len(kinds), f"repeat scans of {kind}")
        told["colonies"][kind] = colony_figures(kind, scans)
    rows = told["colonies"].values()
    for name in MEASURED:
        told[f"{name}_cv_pct"] = max(row[f"{name}_cv_pct"] for row in rows)
    told["growth_3mm_told"] = all(row["grown"]["3"]["told"] for row in rows)
    told["growth_1mm_claimed"] = any(row["grown"]["1"]["told"] for row in rows)
    return told


def colony_figures(kind: str, scans: int) -> dict[str, Any]:
    """Figures of one coral: sizes of each scan, their CVs, and what is told of each growth."""
    scenario = load_scenario("quick", None, {"target.kind": kind, **FIELDS})
    target = scenario.parts().target
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as scratch:
        models = [scan(scenario, target, seed, Path(scratch, f"scan-{seed}")) for seed in range(scans)]
        grown = {
            f"{more:g}": scan(scenario, grown_target(target, 1e-3 * more), 100 + k, Path(scratch, f"grown-{more:g}"))
            for k, more in enumerate(GROWN_MM)
        }
    sizes = [size_of(model) for model in models]
    told: dict[str, Any] = {"scans": sizes, "grown": {}}
    for name, key in MEASURED.items():
        values = np.array([size[key] for size in sizes])
        told[f"{name}_cv_pct"] = float(100.0 * values.std(ddof=1) / values.mean())
    for more, model in grown.items():
        change = compare_models(
            models[0].mesh, model.mesh, np.random.default_rng(0), eyes=(models[0].eyes_m, model.eyes_m)
        )
        told["grown"][more] = {
            "told": change.verdict.startswith("grown"),
            "verdict": change.verdict,
            "low_mm": change.change_low_mm,
            "high_mm": change.change_high_mm,
        }
    return told


def grown_target(target: Target, by_m: float) -> Target:
    """The target with each vertex above the bed moved out along its normal."""
    mesh = trimesh.Trimesh(target.mesh.vertices_m, target.mesh.faces, process=False)
    moved = target.mesh.vertices_m + by_m * np.asarray(mesh.vertex_normals)
    return replace(target, mesh=Mesh(moved, target.mesh.faces), radius_m=target.radius_m + by_m)


def scan(scenario: Scenario, target: Target, seed: int, folder: Path) -> FinishedModel:
    """Photograph a target anew, reconstruct it from the photographs and estimated poses, and mesh it."""
    views = planned_views(target, scenario.mission, scenario.imaging.window_s, np.random.default_rng([7, seed]))
    photos = write_photos(folder, views, None, scenario.imaging, target, seed=seed)
    found = judge(photos, target, scenario.reconstruction.model_copy(update={"mesh": True}), folder / "model")
    if found["failure"] is not None:
        raise StageError(f"repeat scans of {target.name}: {found['failure']}")
    return read_model(folder / "model", 1.0)


def size_of(model: FinishedModel) -> dict[str, float]:
    """Figures of `wakewise measure`."""
    size, _, _ = measure(model.mesh, MeasuringRule(eyes_m=model.eyes_m), np.random.default_rng(0))
    return {key: float(getattr(size, key)) for key in MEASURED.values()}


def show_repeats(told: dict[str, Any]) -> None:
    """A line per figure and colony."""
    for kind, row in told["colonies"].items():
        cvs = ", ".join(f"{name} {row[f'{name}_cv_pct']:.2f} % (asked {ASKED_CV_PCT[name]:g})" for name in MEASURED)
        typer.echo(f"  {kind}: CV of {len(row['scans'])} scans: {cvs}")
        for more, change in row["grown"].items():
            typer.echo(f"    grown by {more} mm: {change['verdict']}")
